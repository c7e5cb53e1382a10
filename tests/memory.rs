//! Memory that is not there: one line says what it was for and what needs less, and nothing is left behind.

#![cfg(target_os = "linux")] // other systems have no `ulimit -v`

#[path = "common/program.rs"]
mod program;

use std::fs::{self, File};
use std::io::Write;
use std::process::Command;

use program::{text, vtrace};
use vertex_tracing::scene::demo::Demo;

/// Runs `vtrace` with so many MiB of address space; its exit code and last line.
fn run_within(mebibytes: u64, folder: &tempfile::TempDir, arguments: &str) -> (Option<i32>, String) {
    let vtrace = vtrace().get_program().to_owned();
    let line = format!("ulimit -c 0; ulimit -v {}; exec \"$0\" {arguments}", mebibytes << 10);
    let mut command = Command::new("sh");
    // The validation layer takes memory that no user's program does.
    for variable in ["VTRACE_VALIDATION", "RUST_BACKTRACE"] {
        command.env_remove(variable);
    }
    let output = command.current_dir(folder).arg("-c").arg(line).arg(vtrace).output().unwrap();
    let last = text(&output.stderr).lines().last().unwrap_or_default().to_owned();
    (output.status.code(), last)
}

fn scene() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("scene.glb"), Demo::Mirror.glb()).unwrap();
    folder
}

fn names(folder: &tempfile::TempDir) -> Vec<String> {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name());
    let mut names: Vec<String> = entries.map(|name| name.into_string().unwrap()).collect();
    names.sort();
    names
}

/// A PNG whose header tells of `side` × `side` texels, and which has none.
fn hollow_png(side: u32) -> Vec<u8> {
    let image = image::DynamicImage::new_luma8(8, 8);
    let mut bytes = std::io::Cursor::new(Vec::new());
    image.write_to(&mut bytes, image::ImageFormat::Png).unwrap();
    let mut bytes = bytes.into_inner();
    bytes[16..20].copy_from_slice(&side.to_be_bytes());
    bytes[20..24].copy_from_slice(&side.to_be_bytes());
    let crc = !bytes[12..29].iter().fold(!0_u32, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |crc, _| (crc >> 1) ^ (0xedb8_8320 & (crc & 1).wrapping_neg()))
    });
    bytes[29..33].copy_from_slice(&crc.to_be_bytes());
    bytes
}

/// One triangle, shown by so many nodes; a material with `texture`.
fn many_triangles(nodes: u32, texture: &str) -> String {
    let list: Vec<String> = (0..nodes).map(|node| node.to_string()).collect();
    let node = |node| format!(r#"{{"mesh": 0, "translation": [{node}, 0, 0]}}"#);
    let mut each: Vec<String> = Vec::new();
    each.extend((0..nodes).map(node));
    format!(
        r#"{{"asset": {{"version": "2.0"}}, "scenes": [{{"nodes": [{}]}}], "nodes": [{}],
        "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0, "TEXCOORD_0": 1}}, "indices": 2, "material": 0}}]}}],
        "materials": [{{"pbrMetallicRoughness": {{"baseColorTexture": {{"index": 0}}}}}}],
        "textures": [{{"source": 0}}], "images": [{{"uri": "{texture}"}}],
        "accessors": [{{"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 3}},
            {{"bufferView": 1, "componentType": 5126, "type": "VEC2", "count": 3}},
            {{"bufferView": 2, "componentType": 5121, "type": "SCALAR", "count": 60000}}],
        "bufferViews": [{{"buffer": 0, "byteLength": 36}}, {{"buffer": 0, "byteOffset": 36, "byteLength": 24}},
            {{"buffer": 0, "byteOffset": 60, "byteLength": 60000}}],
        "buffers": [{{"byteLength": 60060, "uri": "triangles.bin"}}]}}"#,
        list.join(","),
        each.join(",")
    )
}

#[test]
fn what_cannot_be_held_is_told_before_the_work() {
    let folder = scene();
    let path = |name: &str| folder.path().join(name);
    let corners: [f32; 15] = [0., 0., 0., 1., 0., 0., 0., 1., 0., 0., 0., 1., 0., 0., 1.];
    let mut triangles: Vec<u8> = corners.iter().flat_map(|value| value.to_le_bytes()).collect();
    triangles.extend([0, 1, 2].iter().cycle().take(60_000));
    fs::write(path("triangles.bin"), triangles).unwrap();
    fs::write(path("hollow.png"), hollow_png(16384)).unwrap();
    fs::write(path("texture.gltf"), many_triangles(1, "hollow.png")).unwrap();
    fs::write(path("triangles.gltf"), many_triangles(500, "hollow.png")).unwrap();
    // It has a length, but next to no bytes on the disk.
    File::create(path("long.glb")).unwrap().set_len(1500 << 20).unwrap();
    File::create(path("wide.pfm")).unwrap().write_all(b"PF\n5120 5120\n-1\n").unwrap();
    File::options().append(true).open(path("wide.pfm")).unwrap().set_len(16 + (300 << 20)).unwrap();
    let before = names(&folder);
    let picture = "memory for a picture of 16384x16384: ";
    for (mebibytes, arguments, object, remedy) in [
        (2000, "reference scene.glb --size 16384x16384 -o a.png", picture, "a smaller --size needs less"),
        (2500, "render scene.glb --size 16384x16384 -o a.png", picture, "a smaller --size needs less"),
        (1000, "plan texture.gltf", "memory for textures: 3072.0 MiB", "smaller textures need less"),
        (1000, "plan triangles.gltf", "memory for 10000000 triangles: ", "fewer triangles needs less"),
        (1000, "plan long.glb", "long.glb: memory for its bytes: 1500.0 MiB", "split the model"),
        (600, "compare wide.pfm wide.pfm", "memory for wide.pfm: 300.0 MiB", "a smaller picture needs less"),
    ] {
        let (code, line) = run_within(mebibytes, &folder, arguments);
        assert_eq!(code, Some(1), "{arguments}: {line}");
        assert!(line.starts_with("error: ") && line.contains(object), "{arguments}: {line}");
        assert!(line.ends_with(remedy), "{arguments}: {line}");
        assert_eq!(names(&folder), before, "{arguments}");
    }
}

/// Whatever the limit, so that each allocation on the way is the one that fails.
#[test]
fn no_limit_ends_in_an_abort() {
    let folder = scene();
    let mut codes = Vec::new();
    for format in ["png", "exr", "pfm"] {
        for mebibytes in (40..480).step_by(55) {
            let arguments = format!("reference scene.glb --size 1200x800 --threads 2 -o a.{format}");
            let (code, line) = run_within(mebibytes, &folder, &arguments);
            assert!(
                code == Some(0) || line.starts_with("error: ") && code == Some(1),
                "{mebibytes} {format}: {line}"
            );
            codes.extend(code);
            let expected: &[&str] = if code == Some(0) { &["a", "scene.glb"] } else { &["scene.glb"] };
            let found: Vec<String> =
                names(&folder).iter().map(|name| name.replace(&format!(".{format}"), "")).collect();
            assert_eq!(found, expected, "{mebibytes} {format}");
            let _ = fs::remove_file(folder.path().join(format!("a.{format}")));
        }
    }
    assert!(codes.contains(&0) && codes.contains(&1), "{codes:?}");
}
