//! Compiles every GLSL entry point under `glsl/` to SPIR-V in `OUT_DIR`.
//!
//! Entry points end in `.vert`, `.frag` or `.comp`; `.glsl` files are included by them.

use std::{env, fs, path::Path};

#[path = "src/constants.rs"]
#[allow(dead_code, missing_docs)]
mod constants;

fn main() {
    shaderc_link::link();
    println!("cargo:rerun-if-changed=glsl");
    println!("cargo:rerun-if-changed=src/constants.rs");

    let compiler = shaderc::Compiler::new().expect("shaderc initialises");
    let out_dir = env::var("OUT_DIR").expect("cargo sets OUT_DIR");

    let mut entries: Vec<_> = fs::read_dir("glsl")
        .expect("glsl/ exists")
        .map(|entry| entry.expect("glsl/ is readable").path())
        .collect();
    entries.sort();
    for path in entries {
        let kind = match path.extension().and_then(|extension| extension.to_str()) {
            Some("vert") => shaderc::ShaderKind::Vertex,
            Some("frag") => shaderc::ShaderKind::Fragment,
            Some("comp") => shaderc::ShaderKind::Compute,
            _ => continue,
        };
        let name = path.file_name().expect("a file").to_str().expect("UTF-8 shader names");
        let source = fs::read_to_string(&path).expect("shader is readable");
        let artifact = compiler
            .compile_into_spirv(&source, kind, name, "main", Some(&options()))
            .unwrap_or_else(|error| panic!("{error}"));
        if artifact.get_num_warnings() > 0 {
            println!("cargo:warning={}", artifact.get_warning_messages());
        }
        fs::write(Path::new(&out_dir).join(format!("{name}.spv")), artifact.as_binary_u8())
            .expect("OUT_DIR is writable");
    }
}

fn options() -> shaderc::CompileOptions<'static> {
    let mut options = shaderc::CompileOptions::new().expect("shaderc options");
    options.set_target_env(shaderc::TargetEnv::Vulkan, shaderc::EnvVersion::Vulkan1_3 as u32);
    options.set_target_spirv(shaderc::SpirvVersion::V1_6);
    options.set_source_language(shaderc::SourceLanguage::GLSL);
    options.set_forced_version_profile(460, shaderc::GlslProfile::None);
    options.set_optimization_level(shaderc::OptimizationLevel::Performance);
    options.set_generate_debug_info();
    options.set_warnings_as_errors();
    for (name, value) in constants::shader_defines() {
        options.add_macro_definition(name, Some(&value));
    }
    options.set_include_callback(|name, _, _, _| {
        let path = Path::new("glsl").join(name);
        fs::read_to_string(&path)
            .map(|content| shaderc::ResolvedInclude { resolved_name: name.to_owned(), content })
            .map_err(|error| format!("{}: {error}", path.display()))
    });
    options
}
