//! Prints link directives for the archives that Debian splits off `libshaderc_combined.a`.
//!
//! A build script cannot add libraries to its own linking; a build-dependency of it can.
//! Where the archives are absent (other distributions, the Vulkan SDK, a source build) nothing is printed.

use std::path::Path;

/// In link order: each library's undefined symbols are defined further down.
const LIBRARIES: [&str; 8] = [
    "glslang",
    "SPIRV",
    "MachineIndependent",
    "GenericCodeGen",
    "OGLCompiler",
    "OSDependent",
    "HLSL",
    "SPIRV-Tools-opt",
];

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    let arch = std::env::var("CARGO_CFG_TARGET_ARCH").unwrap_or_default();
    let dir = format!("/usr/lib/{arch}-linux-gnu");
    let has = |name: &str| Path::new(&dir).join(format!("lib{name}.a")).exists();
    if !has("shaderc_combined") || !has("MachineIndependent") {
        return;
    }
    println!("cargo:rustc-link-search=native={dir}");
    for name in LIBRARIES.into_iter().chain(["SPIRV-Tools"]).filter(|name| has(name)) {
        println!("cargo:rustc-link-lib=static={name}");
    }
}
