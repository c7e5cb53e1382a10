//! Traps: each must end in one clear refusal that names the object, without the last net.

use std::fs;
use std::time::{Duration, Instant};

use proptest::prelude::*;
use serde_json::{Value, json};
use vertex_tracing::scene::gltf::{Limits, load, load_slice};

use crate::model::{FLOAT, I16, Model, U8, U16, U32, glb, noted, png, push, refused};

fn assert_refused(model: &Model, words: &[&str]) {
    let message = model.refused();
    for word in words {
        assert!(message.contains(word), "{message:?} does not say {word:?}");
    }
}

fn triangle(pointer: &str, value: Value) -> Model {
    Model::triangle().set(pointer, value)
}

#[test]
fn node_graphs_that_are_no_trees() {
    let nodes = |nodes: Value| triangle("/nodes", nodes);
    assert_refused(&nodes(json!([{"children": [0]}])), &["nodes[0]", "cycle"]);
    assert_refused(&nodes(json!([{}, {"children": [2]}, {"children": [1]}])), &["nodes[1]", "cycle"]);
    assert_refused(
        &nodes(json!([{"children": [2]}, {"children": [2]}, {}])),
        &["nodes[2]", "nodes[0]", "nodes[1]"],
    );
    assert_refused(&nodes(json!([{"children": [1, 1]}, {}])), &["nodes[1]"]);
    assert_refused(&nodes(json!([{"children": [7]}])), &["nodes[0].children[0]"]);
    let mut listed_twice = Model::triangle();
    listed_twice.json["scenes"][0]["nodes"] = json!([0, 0]);
    assert_refused(&listed_twice, &["scenes[0]", "twice"]);
    let mut child_as_root = nodes(json!([{"children": [1]}, {}]));
    child_as_root.json["scenes"][0]["nodes"] = json!([1]);
    assert_refused(&child_as_root, &["scenes[0]", "nodes[1]"]);
}

#[test]
fn shared_children_do_not_multiply() {
    let mut nodes: Vec<Value> = (0..30).map(|node| json!({"children": [node + 1, node + 1]})).collect();
    nodes.push(json!({"mesh": 0}));
    assert_refused(&triangle("/nodes", json!(nodes)), &["child of both"]);
}

#[test]
fn a_chain_of_nodes_may_be_deep() {
    let mut nodes: Vec<Value> = (0..200_000).map(|node| json!({"children": [node + 1]})).collect();
    nodes.push(json!({"mesh": 0}));
    assert_eq!(triangle("/nodes", json!(nodes)).load().objects.len(), 1);
}

#[test]
fn deep_json_is_refused() {
    let mut bytes = br#"{"asset":{"version":"2.0"},"extras":"#.to_vec();
    bytes.extend(std::iter::repeat_n(b'[', 1_000_000));
    assert!(refused(crate::model::load(&bytes)).contains("recursion"));
}

#[test]
fn json_that_swells_is_refused() {
    let mut bytes = br#"{"asset":{"version":"2.0"},"extras":["#.to_vec();
    bytes.extend(b"{},".repeat(3_000_000));
    bytes.extend(b"{}]}");
    assert!(refused(crate::model::load(&bytes)).contains("too many values"));
}

#[test]
fn broken_json_is_named_by_place() {
    assert!(refused(crate::model::load(b"{]")).contains("line 1 column 2"));
    for blank in [&b""[..], b"\xef\xbb\xbf", &[0; 8]] {
        assert!(refused(crate::model::load(blank)).ends_with("is empty"), "{blank:?}");
    }
    assert!(refused(crate::model::load(b"[1, 2]")).contains("asset"));
    let text = triangle("/materials/0/pbrMetallicRoughness", json!({"metallicFactor": "shiny"}));
    assert_refused(&text, &["materials[0].pbrMetallicRoughness.metallicFactor", "shiny"]);
}

#[test]
fn versions_and_extensions() {
    assert_refused(&triangle("/asset", json!({"version": "1.0"})), &["glTF 1.0"]);
    assert_refused(&triangle("/asset", json!({"version": "2.0", "minVersion": "2.1"})), &["2.1"]);
    assert_refused(&triangle("/asset", json!({})), &["asset"]);
    // Named before any other complaint: what is broken may be so for want of the extension.
    let mut model = triangle("/nodes", json!([{"children": [0], "mesh": 9}]));
    model.json["extensionsRequired"] = json!(["KHR_draco_mesh_compression", "EXT_meshopt_compression"]);
    assert_refused(&model, &["KHR_draco_mesh_compression", "EXT_meshopt_compression"]);
}

#[test]
fn binary_headers_that_lie() {
    let good = glb(&[(b"JSON", b"{\"asset\":{\"version\":\"2.0\"}}  ")]);
    assert!(crate::model::load(&good).is_ok());
    for length in [0_u32, 4, 11, 12, 19, good.len() as u32 + 1, u32::MAX] {
        let mut bytes = good.clone();
        bytes[8..12].copy_from_slice(&length.to_le_bytes());
        assert!(refused(crate::model::load(&bytes)).contains("GLB"), "length {length}");
    }
    for length in [good.len() as u32 - 19, u32::MAX] {
        let mut bytes = good.clone();
        bytes[12..16].copy_from_slice(&length.to_le_bytes());
        let expected = format!("GLB chunk 0: {length} bytes long, but {} are left", good.len() - 20);
        assert!(refused(crate::model::load(&bytes)).contains(&expected), "chunk length {length}");
    }
    // What is left behind it is no chunk: either length may be the wrong one.
    let mut bytes = good.clone();
    bytes[12..16].copy_from_slice(&(good.len() as u32 - 24).to_le_bytes());
    let refusal = refused(crate::model::load(&bytes));
    assert!(refusal.contains("GLB chunk 1: 4 bytes are left, too few for its header"), "{refusal}");
    for end in 0..good.len() {
        refused(crate::model::load(&good[..end]));
    }
    let mut version = good.clone();
    version[4] = 1;
    assert!(refused(crate::model::load(&version)).contains("version 1"));
    assert!(refused(crate::model::load(&glb(&[(b"BIN\0", b"data")]))).contains("JSON"));

    let mut model = Model::triangle();
    model.json["buffers"] = json!([{"byteLength": model.bin.len()}]);
    let json = serde_json::to_vec(&model.json).unwrap();
    for chunks in
        [vec![(b"JSON", &json[..])], vec![(b"JSON", &json[..]), (b"UNK\0", b"none"), (b"BIN\0", &model.bin)]]
    {
        assert!(refused(crate::model::load(&glb(&chunks))).contains("buffers[0]"));
    }
    let short = glb(&[(b"JSON", &json), (b"BIN\0", &model.bin[..8])]);
    assert!(refused(crate::model::load(&short)).contains("buffers[0]"));
}

#[test]
fn uris_stay_in_the_folder() {
    let outer = tempfile::tempdir().unwrap();
    let folder = outer.path().join("model");
    fs::create_dir(&folder).unwrap();
    fs::write(outer.path().join("secret.bin"), [0; 64]).unwrap();
    fs::write(outer.path().join("secret.png"), png(1, 1, [0; 4])).unwrap();
    let absolute = outer.path().join("secret.bin").display().to_string();
    let uris = [
        "../secret.bin",
        "%2e%2e/secret.bin",
        "a/../../secret.bin",
        &absolute,
        &format!("file://{absolute}"),
        "/dev/zero",
        "file:///dev/zero",
        "http://localhost/a.bin",
        "%ff.bin",
        "a%00.bin",
        ":",
        "",
        "absent.bin",
        ".",
    ];
    for uri in uris {
        let mut model = Model::triangle();
        model.json["buffers"] = json!([{"byteLength": 36, "uri": uri}]);
        let file = folder.join("model.gltf");
        fs::write(&file, serde_json::to_vec(&model.json).unwrap()).unwrap();
        let message = refused(load(&file, &Limits::default()));
        assert!(message.contains("buffers[0]"), "{uri}: {message}");

        let mut model = Model::triangle();
        model.json["images"] = json!([{"uri": uri.replace(".bin", ".png")}]);
        fs::write(&file, model.bytes()).unwrap();
        let message = refused(load(&file, &Limits::default()));
        assert!(message.contains("images[0]"), "{uri}: {message}");
    }
    let mut model = Model::triangle();
    model.json["buffers"] = json!([{"byteLength": 36, "uri": "a.bin"}]);
    let memory = serde_json::to_vec(&model.json).unwrap();
    assert!(refused(crate::model::load(&memory)).contains("no folder"));
}

#[cfg(unix)]
#[test]
fn links_and_devices() {
    let outer = tempfile::tempdir().unwrap();
    let folder = outer.path().join("model");
    fs::create_dir(&folder).unwrap();
    let mut model = Model::triangle();
    fs::write(outer.path().join("outside.bin"), &model.bin).unwrap();
    fs::write(folder.join("inside.bin"), &model.bin).unwrap();
    std::os::unix::fs::symlink(outer.path().join("outside.bin"), folder.join("out.bin")).unwrap();
    std::os::unix::fs::symlink("inside.bin", folder.join("in.bin")).unwrap();
    std::os::unix::fs::symlink("/dev/zero", folder.join("zero.bin")).unwrap();
    std::os::unix::net::UnixListener::bind(folder.join("socket.bin")).unwrap();
    let file = folder.join("model.gltf");
    let mut result = |uri: &str| {
        model.json["buffers"] = json!([{"byteLength": 36, "uri": uri}]);
        fs::write(&file, serde_json::to_vec(&model.json).unwrap()).unwrap();
        load(&file, &Limits::default())
    };
    assert!(result("in.bin").is_ok(), "links inside of the folder are followed");
    assert!(refused(result("out.bin")).contains("outside"));
    assert!(refused(result("zero.bin")).contains("outside"));
    assert!(refused(result("socket.bin")).contains("regular"));
    for path in ["/dev/zero", "/dev", "/proc/self/mem"] {
        refused(load(path.as_ref(), &Limits::default()));
    }
}

#[test]
fn bytes_read_are_bounded_over_all_files() {
    let folder = tempfile::tempdir().unwrap();
    let mut model = Model::triangle();
    fs::write(folder.path().join("a.bin"), vec![0; 10_000]).unwrap();
    let buffer = json!({"byteLength": 36, "uri": "a.bin"});
    model.json["buffers"] = json!(vec![buffer; 5]);
    let file = folder.path().join("model.gltf");
    fs::write(&file, serde_json::to_vec(&model.json).unwrap()).unwrap();
    let limits = Limits { max_file_bytes: 45_000, ..Limits::default() };
    assert!(refused(load(&file, &limits)).contains("buffers[3]"), "a small file counts for 16 KiB");
    let limits = Limits { max_file_bytes: 10, ..Limits::default() };
    assert!(refused(load(&file, &limits)).contains("limit"));
}

#[test]
fn references_to_nothing() {
    for (pointer, value, object) in [
        (
            "/meshes/0/primitives/0/attributes/POSITION",
            json!(9),
            "meshes[0].primitives[0].attributes.POSITION",
        ),
        ("/meshes/0/primitives/0/attributes/NORMAL", json!(9), "meshes[0].primitives[0].attributes"),
        ("/meshes/0/primitives/0/indices", json!(9), "meshes[0].primitives[0].indices"),
        ("/meshes/0/primitives/0/material", json!(9), "meshes[0].primitives[0].material"),
        ("/meshes/0/primitives/0/targets", json!([{"POSITION": 9}]), "meshes[0].primitives[0].targets[0]"),
        ("/meshes/0/primitives/0/mode", json!(9), "meshes[0].primitives[0].mode"),
        ("/accessors/0/bufferView", json!(9), "accessors[0].bufferView"),
        ("/bufferViews/0/buffer", json!(9), "bufferViews[0].buffer"),
        ("/scene", json!(9), "scene"),
        ("/nodes/0/mesh", json!(9), "nodes[0].mesh"),
        ("/nodes/0/camera", json!(9), "nodes[0].camera"),
        ("/nodes/0/skin", json!(9), "nodes[0].skin"),
        ("/nodes/0/extensions", json!({"KHR_lights_punctual": {"light": 9}}), "nodes[0]"),
        ("/textures", json!([{"source": 9}]), "textures[0].source"),
        ("/textures", json!([{"sampler": 9}]), "textures[0].sampler"),
        ("/materials/0/emissiveTexture", json!({"index": 9}), "materials[0].emissiveTexture"),
        ("/materials/0/alphaMode", json!("GLOW"), "materials[0].alphaMode"),
        ("/samplers", json!([{"wrapS": 1}]), "samplers[0].wrapS"),
        ("/skins", json!([{"joints": [9]}]), "skins[0].joints[0]"),
        ("/skins", json!([{"joints": []}]), "skins[0]"),
        ("/images", json!([{}]), "images[0]"),
        ("/images", json!([{"bufferView": 9}]), "images[0].bufferView"),
        ("/images", json!([{"bufferView": 0}]), "images[0]"),
        ("/nodes/0/mesh", json!(-1), "nodes[0].mesh"),
        ("/nodes/0/mesh", json!(0.5), "nodes[0].mesh"),
    ] {
        assert_refused(&triangle(pointer, value), &[object]);
    }
}

#[test]
fn ranges_outside_of_buffers() {
    for (pointer, value, object) in [
        ("/accessors/0/count", json!(4), "accessors[0]"),
        ("/accessors/0/count", json!(1_u64 << 31), "accessors[0]"),
        ("/accessors/0/count", json!(1_u64 << 63), "accessors[0]"),
        ("/accessors/0/count", json!(u64::MAX), "accessors[0]"),
        ("/accessors/0/byteOffset", json!(4), "accessors[0]"),
        ("/accessors/0/byteOffset", json!(u64::MAX - 4), "accessors[0]"),
        ("/accessors/0/byteOffset", json!(-4), "accessors[0].byteOffset"),
        ("/bufferViews/0/byteLength", json!(37), "bufferViews[0]"),
        ("/bufferViews/0/byteOffset", json!(u64::MAX), "bufferViews[0]"),
        ("/bufferViews/0/byteStride", json!(4), "accessors[0]"),
        ("/bufferViews/0/byteStride", json!(8), "accessors[0]"),
        ("/bufferViews/0/byteStride", json!(0), "bufferViews[0].byteStride"),
        ("/bufferViews/0/byteStride", json!(16), "accessors[0]"),
    ] {
        assert_refused(&triangle(pointer, value), &[object]);
    }
    let mut model = Model::triangle();
    let positions = json!({"componentType": FLOAT, "type": "VEC3", "count": u32::MAX});
    let positions = push(&mut model.json["accessors"], positions);
    model.attribute("POSITION", positions);
    assert_refused(&model, &["--max-triangles"]);
    assert_refused(&triangle("/accessors/0/count", json!(0)), &["nothing to draw"]);
}

#[test]
fn formats_that_no_attribute_has() {
    for (name, component, kind) in [
        ("POSITION", U16, "VEC3"),
        ("POSITION", FLOAT, "VEC2"),
        ("NORMAL", FLOAT, "VEC4"),
        ("NORMAL", I16, "VEC3"),
        ("TANGENT", FLOAT, "VEC3"),
        ("TEXCOORD_0", I16, "VEC2"),
        ("COLOR_0", U32, "VEC3"),
        ("COLOR_0", FLOAT, "SCALAR"),
        ("JOINTS_0", FLOAT, "VEC4"),
        ("WEIGHTS_0", U8, "VEC4"),
    ] {
        let mut model = Model::triangle();
        let accessor = model.accessor(component, kind, 3, &[0; 48]);
        model.attribute(name, accessor);
        let given = format!("{kind} of ");
        assert_refused(&model, &["meshes[0].primitives[0].attributes", name, &given]);
    }
    for (component, kind) in [(FLOAT, "SCALAR"), (I16, "SCALAR"), (U16, "VEC2")] {
        let mut model = Model::triangle();
        let accessor = model.accessor(component, kind, 3, &[0; 12]);
        model.primitive()["indices"] = json!(accessor);
        assert_refused(&model, &["meshes[0].primitives[0].indices"]);
    }
    for (pointer, value) in [("componentType", json!(5124)), ("type", json!("VEC5"))] {
        assert_refused(&triangle(&format!("/accessors/0/{pointer}"), value), &["accessors[0]"]);
    }
    let mut model = Model::triangle();
    let short = model.floats("VEC3", &[0.0; 6]);
    model.attribute("NORMAL", short);
    assert_refused(&model, &["NORMAL", "2 elements for 3 positions"]);
}

#[test]
fn indices_beyond_the_vertices() {
    for bad in [3, 255, 65535] {
        let mut model = Model::triangle();
        let indices = model.indices(&[0, 1, bad]);
        model.primitive()["indices"] = json!(indices);
        assert_refused(&model, &["meshes[0].primitives[0].indices", &bad.to_string()]);
        // Unused meshes are held to it, too, as far as the budget goes.
        model.json["meshes"] =
            json!([{"primitives": [{"attributes": {"POSITION": 0}}]}, model.json["meshes"][0].clone()]);
        assert_refused(&model, &["meshes[1].primitives[0].indices"]);
    }
}

#[test]
fn sparse_accessors() {
    let sparse = |count: u64, indices: &[u8], values: usize| {
        let mut model = Model::triangle();
        let indices = model.view(indices);
        let values = model.view(&vec![0; values]);
        model.json["accessors"][0]["sparse"] = json!({
            "count": count,
            "indices": {"bufferView": indices, "componentType": U8}, "values": {"bufferView": values}
        });
        model
    };
    assert!(sparse(0, &[0], 12).load().notes.is_empty());
    assert_refused(&sparse(4, &[0, 1, 2, 3], 48), &["accessors[0]", "4 sparse"]);
    assert_refused(&sparse(2, &[0], 24), &["accessors[0]"]);
    assert_refused(&sparse(2, &[0, 1], 12), &["accessors[0]"]);
    assert_refused(&sparse(u64::MAX, &[0], 12), &["accessors[0]"]);
    assert_refused(&sparse(2, &[1, 0], 24), &["accessors[0].sparse", "ascend"]);
    assert_refused(&sparse(2, &[1, 1], 24), &["accessors[0].sparse"]);
    assert_refused(&sparse(1, &[3], 12), &["accessors[0].sparse"]);
    let mut float_indices = sparse(1, &[0; 4], 12);
    float_indices.json["accessors"][0]["sparse"]["indices"]["componentType"] = json!(FLOAT);
    assert_refused(&float_indices, &["accessors[0].sparse"]);
}

#[test]
fn numbers_that_are_none() {
    for value in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let mut model = Model::triangle();
        let positions = model.floats("VEC3", &[value; 9]);
        model.attribute("POSITION", positions);
        assert_refused(&model, &["nothing to draw: ", "1 primitives has a position that is NaN or infinite"]);
    }
    // Beyond f32 once placed: dropped, not drawn at infinity.
    assert_refused(&triangle("/nodes/0/scale", json!([1e300, 1e300, 1e300])), &["NaN or infinite"]);
    assert_refused(&triangle("/nodes/0/scale", json!([0, 0, 0])), &["degenerate"]);
    let mut model = Model::triangle();
    let positions = model.floats("VEC3", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 2.0, 0.0, 0.0, f32::NAN, 0.0, 0.0]);
    let indices = model.indices(&[0, 1, 2, 0, 1, 3]);
    model.attribute("POSITION", positions).primitive()["indices"] = json!(indices);
    assert_refused(&model, &["degenerate or has a position that is NaN or infinite"]);
    let bytes = String::from_utf8(Model::triangle().bytes()).unwrap();
    let huge = bytes.replace(r#"{"mesh":0}"#, r#"{"mesh":0,"translation":[1e309,0,0]}"#);
    assert!(refused(crate::model::load(huge.as_bytes())).contains("number out of range"));
    assert_refused(
        &triangle("/materials/0/emissiveFactor", json!([1e300, 0, 0])),
        &["materials[0].emissiveFactor"],
    );
}

#[test]
fn lenses_that_see_nothing() {
    let perspective = |yfov: f64, znear: f64, zfar: f64| json!([{"type": "perspective", "perspective": {"yfov": yfov, "znear": znear, "zfar": zfar}}]);
    let orthographic = |xmag: f64, ymag: f64, znear: f64, zfar: f64| json!([{"type": "orthographic", "orthographic": {"xmag": xmag, "ymag": ymag, "znear": znear, "zfar": zfar}}]);
    for cameras in [
        perspective(0.0, 0.1, 1.0),
        perspective(-1.0, 0.1, 1.0),
        perspective(3.2, 0.1, 1.0),
        perspective(1.0, 0.0, 1.0),
        perspective(1.0, 2.0, 1.0),
        orthographic(0.0, 1.0, 0.0, 1.0),
        orthographic(1.0, 0.0, 0.0, 1.0),
        orthographic(1e300, 1.0, 0.0, 1.0),
        orthographic(1.0, 1.0, 1.0, 1.0),
        json!([{"type": "perspective"}]),
        json!([{"type": "perspective", "orthographic": {"xmag": 1, "ymag": 1, "znear": 0, "zfar": 1}}]),
        json!([{"type": "fisheye", "perspective": {"yfov": 1, "znear": 0.1}}]),
    ] {
        assert_refused(&triangle("/cameras", cameras), &["cameras[0]"]);
    }
    let near = "znear is 10 and zfar 1: the one must be above 0, the other beyond it";
    assert_refused(&triangle("/cameras", perspective(1.0, 10.0, 1.0)), &[near]);
    let endless = json!([{"type": "perspective", "perspective": {"yfov": 1, "znear": -1}}]);
    assert_refused(&triangle("/cameras", endless), &["znear is -1 and must be above 0"]);
}

#[test]
fn skins_and_morphs() {
    let mut model = Model::triangle();
    let joints = model.accessor(U8, "VEC4", 3, &[9; 12]);
    let weights = model.floats("VEC4", &[0.25; 12]);
    model.attribute("JOINTS_0", joints).attribute("WEIGHTS_0", weights);
    model.json["skins"] = json!([{"joints": [0]}]);
    model.json["nodes"][0]["skin"] = json!(0);
    assert_refused(&model, &["meshes[0].primitives[0].attributes.JOINTS_0", "joint 9"]);
    model.json["skins"][0]["inverseBindMatrices"] = json!(0);
    assert_refused(&model, &["skins[0]", "MAT4"]);
    let none = model.floats("MAT4", &[]);
    model.json["skins"][0]["inverseBindMatrices"] = json!(none);
    assert_refused(&model, &["skins[0]", "0 inverse bind matrices"]);

    let mut model = Model::triangle();
    let short = model.floats("VEC3", &[0.0; 3]);
    model.primitive()["targets"] = json!([{"POSITION": short}]);
    assert_refused(&model, &["targets[0].POSITION"]);
}

#[test]
fn images_that_are_none() {
    let with = |uri: &str| {
        let mut model = Model::triangle();
        model.json["images"] = json!([{"uri": uri}]);
        model
    };
    let data = |bytes: &[u8]| format!("data:image/png;base64,{}", base64::encode(bytes));
    assert_refused(&with(&data(b"no image at all")), &["images[0]", "PNG"]);
    assert_refused(&with(&data(&[0xff, 0xd8, 0xff, 0, 0, 0, 0, 0])), &["images[0]"]);
    assert_refused(&with("data:image/png;base64,%%%"), &["images[0]", "data URI"]);
    assert_refused(&with("data:image/png;base64"), &["images[0]", "comma"]);
    let whole = png(16, 16, [7; 4]);
    let mut model = with(&data(&whole[..whole.len() / 2]));
    model.json["textures"] = json!([{"source": 0}]);
    model.json["materials"][0] = json!({"emissiveTexture": {"index": 0}});
    assert_refused(&model, &["images[0]"]);
}

#[test]
fn texture_bytes_are_bounded_over_all_images() {
    let mut model = Model::triangle();
    let view = model.view(&png(64, 64, [7; 4]));
    for index in 0..4 {
        push(&mut model.json["images"], json!({"bufferView": view, "mimeType": "image/png"}));
        push(&mut model.json["textures"], json!({"source": index}));
    }
    model.json["materials"][0] = json!({
        "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "metallicRoughnessTexture": {"index": 1}},
        "normalTexture": {"index": 2}, "emissiveTexture": {"index": 3}
    });
    let load = |max_texture_bytes| {
        let limits = Limits { max_texture_bytes, ..Limits::default() };
        load_slice(&model.bytes(), None, "a.gltf".as_ref(), &limits)
    };
    assert_eq!(load(5 * 64 * 64 * 4).unwrap().images.len(), 4);
    let message = refused(load(3 * 64 * 64 * 4));
    assert!(message.contains("images[2]") && message.contains("--max-texture-bytes"), "{message}");
}

#[test]
fn instances_are_counted_before_they_are_made() {
    let mut model = Model::triangle();
    let positions = model.floats("VEC3", &[0.5; 9 * 1000]);
    model.attribute("POSITION", positions);
    model.json["nodes"] = json!(vec![json!({"mesh": 0}); 30_000]);
    model.json["scenes"][0]["nodes"] = (0..30_000).collect();
    let start = Instant::now();
    assert_refused(&model, &["--max-triangles"]);
    assert!(start.elapsed() < Duration::from_secs(10));
    let limits = Limits { max_nodes: 1000, ..Limits::default() };
    assert!(refused(load_slice(&model.bytes(), None, "a.gltf".as_ref(), &limits)).contains("30000 nodes"));
}

#[test]
fn many_primitives_over_one_large_accessor_cost_what_they_draw() {
    let mut model = Model::triangle();
    let positions: Vec<f32> = (0..300_000).map(|value| (value % 7) as f32).collect();
    let positions = model.floats("VEC3", &positions);
    let indices = model.indices(&[0, 1, 2]);
    let primitive = json!({"attributes": {"POSITION": positions}, "indices": indices});
    model.json["meshes"] = json!([{"primitives": vec![primitive; 20_000]}]);
    let start = Instant::now();
    let _ = crate::model::load(&model.bytes());
    assert!(start.elapsed() < Duration::from_secs(10));
}

/// MikkTSpace takes time with the square of the faces at one vertex.
#[test]
fn normal_maps_on_a_million_faces_round_one_vertex() {
    let mut model = Model::triangle();
    let mut corners = vec![0.0_f32, 0.0, 0.0];
    for step in 0..100_000 {
        let angle = step as f32 * 0.1;
        corners.extend([angle.cos(), angle.sin(), 0.0]);
    }
    let positions = model.floats("VEC3", &corners);
    let image = model.view(&png(1, 1, [128, 128, 255, 255]));
    model.attribute("POSITION", positions).primitive()["mode"] = json!(6);
    model.json["images"] = json!([{"bufferView": image, "mimeType": "image/png"}]);
    model.json["textures"] = json!([{"source": 0}]);
    model.json["materials"] = json!([{"normalTexture": {"index": 0}}]);
    let start = Instant::now();
    let scene = model.load();
    assert!(start.elapsed() < Duration::from_secs(10));
    assert!(noted(&scene, "tangents"), "{:?}", scene.notes);
    assert_eq!(scene.geometry.tangents.len(), scene.geometry.positions.len());
}

#[test]
fn a_flood_of_faults_is_noted_in_few_lines() {
    let mut model = Model::triangle();
    model.json["nodes"] = json!(vec![json!({"mesh": 0, "rotation": [1, 1, 1, 1]}); 500]);
    let scene = model.load();
    assert!(scene.notes.len() < 12 && scene.notes.last().unwrap().contains("492 more"), "{:?}", scene.notes);
}

#[test]
fn nothing_to_draw() {
    assert_refused(&Model::empty(), &["nothing to draw"]);
    assert_refused(&triangle("/meshes/0/primitives/0/mode", json!(0)), &["nothing to draw", "points"]);
}

/// A file that uses a bit of everything, as ground for mutations.
fn rich() -> Vec<u8> {
    let mut model = Model::triangle();
    let normals = model.floats("VEC3", &[0.0, 0.0, 1.0].repeat(3));
    let uvs = model.floats("VEC2", &[0.0, 1.0, 1.0, 1.0, 0.0, 0.0]);
    let indices = model.indices(&[0, 1, 2]);
    let image = model.view(&png(2, 2, [128, 128, 255, 255]));
    model.attribute("NORMAL", normals).attribute("TEXCOORD_0", uvs).primitive()["indices"] = json!(indices);
    model.json["images"] = json!([{"bufferView": image, "mimeType": "image/png"}]);
    model.json["textures"] = json!([{"source": 0}]);
    model.json["materials"] = json!([{"normalTexture": {"index": 0}}]);
    model.json["cameras"] = json!([{"type": "perspective", "perspective": {"yfov": 1, "znear": 0.1}}]);
    model.json["nodes"] = json!([{"mesh": 0, "children": [1]}, {"camera": 0}]);
    model.json["buffers"] = json!([{"byteLength": model.bin.len()}]);
    glb(&[(b"JSON", &serde_json::to_vec(&model.json).unwrap()), (b"BIN\0", &model.bin)])
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    /// Bytes overwritten anywhere: a scene or a refusal, and never the last net.
    #[test]
    fn mutated_files_never_reach_the_last_net(
        edits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
    ) {
        let mut bytes = rich();
        for (at, value) in edits {
            let at = at.index(bytes.len());
            bytes[at] = value;
        }
        if let Err(error) = crate::model::load(&bytes) {
            prop_assert!(!error.to_string().contains("internal error"), "{error}");
        }
    }

    /// Digits replaced by digits keep the JSON whole, so that indices, counts and offsets go astray.
    #[test]
    fn numbers_gone_astray_never_reach_the_last_net(
        edits in prop::collection::vec((any::<prop::sample::Index>(), b'0'..=b'9'), 1..6),
    ) {
        let mut bytes = rich();
        let digits: Vec<usize> = (20..bytes.len()).filter(|&at| bytes[at].is_ascii_digit()).collect();
        for (at, value) in edits {
            bytes[digits[at.index(digits.len())]] = value;
        }
        if let Err(error) = crate::model::load(&bytes) {
            prop_assert!(!error.to_string().contains("internal error"), "{error}");
        }
    }
}
