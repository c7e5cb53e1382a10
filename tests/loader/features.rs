//! Geometry, nodes, cameras and lights of valid files, with numbers.

use std::f32::consts::FRAC_1_SQRT_2;
use std::fs;

use glam::{DVec3, Vec2, Vec3, Vec4};
use serde_json::json;
use vertex_tracing::constants::MAX_LIGHTS;
use vertex_tracing::error::Error;
use vertex_tracing::scene::gltf::{Limits, load};
use vertex_tracing::scene::{LightKind, Projection, Scene};

use crate::model::{I16, Model, U8, U16, U32, glb, noted, png, push};

/// Corners of a face in world space.
fn world(scene: &Scene, face: u32) -> [DVec3; 3] {
    scene.geometry.corners(face).map(|corner| corner.as_dvec3() + scene.origin)
}

fn near(a: DVec3, b: [f64; 3]) -> bool {
    (a - DVec3::from_array(b)).length() < 1e-6
}

/// Every object's ranges and every index, as the rest of the program trusts them.
fn assert_valid(scene: &Scene) {
    let geometry = &scene.geometry;
    let vertices = geometry.positions.len();
    assert_eq!(geometry.normals.len(), vertices);
    assert_eq!(geometry.face_objects.len(), geometry.faces.len());
    for (name, length) in [
        ("tangents", geometry.tangents.len()),
        ("uv 0", geometry.uvs[0].len()),
        ("uv 1", geometry.uvs[1].len()),
        ("colors", geometry.colors.len()),
    ] {
        assert!(length == 0 || length == vertices, "{name}: {length} of {vertices}");
    }
    for (index, object) in scene.objects.iter().enumerate() {
        assert!((object.material as usize) < scene.materials.len() && !object.faces.is_empty());
        for face in object.faces.clone() {
            assert_eq!(geometry.face_objects[face as usize] as usize, index);
            assert!(geometry.faces[face as usize].iter().all(|vertex| object.vertices.contains(vertex)));
            assert!(geometry.area_normal(face) != Vec3::ZERO);
        }
    }
    assert!(geometry.normals.iter().all(|normal| (normal.length() - 1.0).abs() < 1e-5));
    let mut used = vec![false; vertices];
    geometry.faces.iter().flatten().for_each(|&vertex| used[vertex as usize] = true);
    assert!(used.iter().all(|used| *used), "no orphan vertices");
}

#[test]
fn plain_triangle_gets_a_flat_normal() {
    let scene = Model::triangle().load();
    assert_valid(&scene);
    assert_eq!(scene.name, "model");
    assert_eq!(scene.origin, DVec3::new(0.5, 0.5, 0.0), "the centre of the box");
    assert_eq!(scene.geometry.normals, [Vec3::Z; 3]);
    assert!(near(world(&scene, 0)[1], [1.0, 0.0, 0.0]));
    assert_eq!(scene.objects[0].name, "node 0");
    assert!(scene.notes.is_empty(), "{:?}", scene.notes);
}

#[test]
fn indexed_faces_without_normals_share_no_vertex() {
    let mut model = Model::triangle();
    let square = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.5];
    let positions = model.floats("VEC3", &square);
    let indices = model.indices(&[0, 1, 2, 0, 2, 3]);
    model.attribute("POSITION", positions).primitive()["indices"] = json!(indices);
    let flat = model.load();
    assert_valid(&flat);
    assert_eq!((flat.geometry.faces.len(), flat.geometry.positions.len()), (2, 6));

    let normals = model.floats("VEC3", &[0.0, 0.0, 2.0].repeat(4));
    model.attribute("NORMAL", normals);
    let smooth = model.load();
    assert_valid(&smooth);
    assert_eq!(smooth.geometry.faces, [[0, 1, 2], [0, 2, 3]]);
    assert_eq!(smooth.geometry.normals, [Vec3::Z; 4], "normalised");
}

#[test]
fn strips_fans_and_what_is_not_drawn() {
    for (mode, faces) in [(4, 1), (5, 3), (6, 3)] {
        let mut model = Model::triangle();
        let zigzag = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.4, 1.0, 0.0, 1.6, 1.1, 0.0, 0.8, 2.0, 0.0];
        let fan = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0, -1.0, 0.5, 0.0];
        let positions = model.floats("VEC3", if mode == 6 { &fan } else { &zigzag });
        model.attribute("POSITION", positions).primitive()["mode"] = json!(mode);
        let scene = model.load();
        assert_eq!(scene.geometry.faces.len(), faces, "mode {mode}");
        assert!(scene.geometry.normals.iter().all(|normal| normal.z > 0.99), "mode {mode} keeps its winding");
        assert_eq!(noted(&scene, "make no triangle"), mode == 4);
    }
    let mut model = Model::triangle();
    let points = json!({"attributes": {"POSITION": 0}, "mode": 0});
    push(&mut model.json["meshes"][0]["primitives"], points);
    let scene = model.load();
    assert_eq!(scene.geometry.faces.len(), 1);
    assert!(noted(&scene, "points and lines"));
}

#[test]
fn interleaved_and_sparse_accessors() {
    let mut model = Model::triangle();
    let mut bytes = Vec::new();
    for (position, normal) in [([0.0_f32, 0.0, 5.0], [0.0_f32, 0.0, 1.0]); 3] {
        bytes.extend(position.iter().chain(&normal).flat_map(|value| value.to_le_bytes()));
    }
    let view = model.view(&bytes);
    model.json["bufferViews"][view]["byteStride"] = json!(24);
    let interleaved = |offset: usize| json!({"bufferView": view, "byteOffset": offset, "componentType": 5126, "type": "VEC3", "count": 3});
    let positions = push(&mut model.json["accessors"], interleaved(0));
    let normals = push(&mut model.json["accessors"], interleaved(12));
    let indices = model.view(&[1, 2]);
    let values: Vec<u8> =
        [3.0_f32, 0.0, 5.0, 0.0, 4.0, 5.0].iter().flat_map(|value| value.to_le_bytes()).collect();
    let values = model.view(&values);
    model.json["accessors"][positions]["sparse"] = json!({
        "count": 2,
        "indices": {"bufferView": indices, "componentType": U8},
        "values": {"bufferView": values}
    });
    model.attribute("POSITION", positions).attribute("NORMAL", normals);
    let scene = model.load();
    let corners = world(&scene, 0);
    assert!(
        near(corners[0], [0.0, 0.0, 5.0])
            && near(corners[1], [3.0, 0.0, 5.0])
            && near(corners[2], [0.0, 4.0, 5.0])
    );
    assert_eq!(scene.geometry.normals, [Vec3::Z; 3]);

    // Without a buffer view an accessor is zeros, sparse values replaced.
    model.json["accessors"][positions].as_object_mut().unwrap().remove("bufferView");
    assert!(near(world(&model.load(), 0)[0], [0.0, 0.0, 0.0]));
}

#[test]
fn transforms_are_composed_in_double_precision() {
    let far = 6_378_137.25;
    let mut model = Model::triangle();
    model.json["nodes"] = json!([
        {"translation": [far, 0, 0], "children": [1]},
        {"translation": [0, 0, 0.125], "rotation": [0, 0, FRAC_1_SQRT_2, FRAC_1_SQRT_2], "children": [2]},
        {"mesh": 0, "name": "leaf", "scale": [2, 1, 1]}
    ]);
    let scene = model.load();
    assert_eq!(scene.objects[0].name, "leaf");
    // x is doubled, then turned to y.
    let [a, b, c] = world(&scene, 0);
    assert!(
        near(a, [far, 0.0, 0.125]) && near(b, [far, 2.0, 0.125]) && near(c, [far - 1.0, 0.0, 0.125]),
        "{a} {b} {c}"
    );
    assert!((scene.origin.x - (far - 0.5)).abs() < 1e-6);
}

#[test]
fn non_uniform_scale_takes_normals_by_the_inverse_transpose() {
    let mut model = Model::triangle();
    let normals = model.floats("VEC3", &[FRAC_1_SQRT_2, 0.0, FRAC_1_SQRT_2].repeat(3));
    model.attribute("NORMAL", normals);
    let scene = model.set("/nodes/0/scale", json!([2, 1, 1])).load();
    let expected = Vec3::new(0.5, 0.0, 1.0).normalize();
    assert!(scene.geometry.normals.iter().all(|normal| (*normal - expected).length() < 1e-6));
}

#[test]
fn mirrored_nodes_keep_their_front() {
    let mut model = Model::triangle();
    let normals = model.floats("VEC3", &[0.0, 0.0, 1.0].repeat(3));
    model.attribute("NORMAL", normals);
    let scene = model.set("/nodes/0/scale", json!([-1, 1, 1])).load();
    assert_valid(&scene);
    assert!(scene.geometry.area_normal(0).z > 0.0, "the winding is turned with the mirror");
    assert_eq!(scene.geometry.normals, [Vec3::Z; 3]);
    assert_eq!(
        Model::triangle().set("/nodes/0/scale", json!([-1, 1, 1])).load().geometry.normals,
        [Vec3::Z; 3]
    );
}

#[test]
fn matrices_and_bad_rotations() {
    let matrix = json!([0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1, 0, 7, 8, 9, 1]);
    let scene = Model::triangle().set("/nodes/0/matrix", matrix).load();
    assert!(near(world(&scene, 0)[1], [7.0, 9.0, 9.0]));
    let scene = Model::triangle().set("/nodes/0/rotation", json!([0, 0, 2, 2])).load();
    assert!(near(world(&scene, 0)[1], [0.0, 1.0, 0.0]) && noted(&scene, "unit quaternion"));
    let scene = Model::triangle().set("/nodes/0/rotation", json!([0, 0, 0, 0])).load();
    assert!(near(world(&scene, 0)[1], [1.0, 0.0, 0.0]) && noted(&scene, "unit quaternion"));
}

#[test]
fn instances_are_objects_of_their_own() {
    let mut model = Model::triangle();
    model.json["scenes"][0]["nodes"] = json!([0, 1]);
    model.json["nodes"] = json!([{"mesh": 0}, {"mesh": 0, "translation": [5, 0, 0], "extras": {"vt": true}}]);
    model.json["meshes"][0]["name"] = json!("tri");
    model.json["materials"][0]["extras"] = json!({"vt": false});
    let scene = model.load();
    assert_valid(&scene);
    assert_eq!(scene.objects.len(), 2);
    assert_eq!(scene.objects[1].vertices, 3..6);
    assert_eq!((scene.objects[0].name.as_str(), scene.objects[0].mesh_name.as_deref()), ("tri", Some("tri")));
    assert_eq!(scene.materials[0].vt_extra, Some(false));
    assert_eq!([scene.objects[0].vt_extra, scene.objects[1].vt_extra], [Some(false), Some(true)]);
}

#[test]
fn objects_that_repeat_another_are_dropped_by_name() {
    let nodes = json!([
        {"mesh": 0, "name": "first"}, {"mesh": 0, "name": "moved", "translation": [5, 0, 0]},
        {"mesh": 0, "name": "again"}, {"mesh": 0, "name": "forced", "extras": {"vt": true}},
        {"mesh": 1, "name": "other material"}, {"mesh": 2, "name": "copied mesh"}, {"mesh": 3, "name": "turned over"}
    ]);
    let mut model = Model::triangle();
    model.json["scenes"][0]["nodes"] = json!([0, 1, 2, 3, 4, 5, 6]);
    model.json["nodes"] = nodes;
    model.json["materials"] = json!([{}, {"doubleSided": true}]);
    let mesh = model.json["meshes"][0].clone();
    let turned = model.indices(&[0, 2, 1]);
    model.json["meshes"] = json!([mesh, mesh, mesh, mesh]);
    model.json["meshes"][1]["primitives"][0]["material"] = json!(1);
    model.json["meshes"][3]["primitives"][0]["indices"] = json!(turned);
    let scene = model.load();
    assert_valid(&scene);
    let names: Vec<&str> = scene.objects.iter().map(|object| object.name.as_str()).collect();
    assert_eq!(names, ["first", "moved", "forced", "other material", "turned over"]);
    assert_eq!(scene.geometry.faces.len(), 5);
    assert_eq!(scene.objects[2].vt_extra, Some(true));
    assert!(near(world(&scene, 1)[0], [5.0, 0.0, 0.0]) && near(world(&scene, 2)[0], [0.0, 0.0, 0.0]));
    assert!(noted(&scene, "again: it repeats first"), "{:?}", scene.notes);
    assert!(noted(&scene, "copied mesh: it repeats first"), "{:?}", scene.notes);

    // Each layer of it covers more.
    model.json["materials"][0]["alphaMode"] = json!("BLEND");
    model.json["materials"][0]["pbrMetallicRoughness"] = json!({"baseColorFactor": [1, 1, 1, 0.5]});
    assert_eq!(model.load().objects.len(), 7);
}

#[test]
fn degenerate_faces_are_dropped_by_name() {
    let mut model = Model::triangle();
    let corners = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 2.0, 0.0, 0.0, f32::NAN, 0.0, 0.0];
    let positions = model.floats("VEC3", &corners);
    let indices = model.indices(&[0, 1, 2, 0, 1, 3, 0, 0, 1, 0, 2, 4]);
    model.attribute("POSITION", positions).primitive()["indices"] = json!(indices);
    model.json["nodes"][0]["name"] = json!("sliver");
    let scene = model.load();
    assert_valid(&scene);
    assert_eq!(scene.geometry.faces.len(), 1);
    assert!(noted(&scene, "sliver: 2 faces without area are dropped"), "{:?}", scene.notes);
    let elsewhere = "sliver: 1 faces with a position that is NaN or infinite are dropped";
    assert!(noted(&scene, elsewhere), "{:?}", scene.notes);
    assert!(scene.origin.is_finite() && scene.geometry.positions.iter().all(|position| position.is_finite()));
}

#[test]
fn normals_without_direction_become_the_faces() {
    let mut model = Model::triangle();
    let normals = model.floats("VEC3", &[0.0, 0.0, 0.0, f32::NAN, 0.0, 1.0, 0.0, 1.0, 0.0]);
    model.attribute("NORMAL", normals);
    let scene = model.load();
    assert_eq!(scene.geometry.normals, [Vec3::Z, Vec3::Z, Vec3::Y]);
    assert!(noted(&scene, "2 normals"));
}

#[test]
fn texture_coordinates_and_colours_of_all_types() {
    let mut model = Model::triangle();
    let bytes: Vec<u8> =
        [0_u16, 65535, 32768, 0, 65535, 65535].iter().flat_map(|v| v.to_le_bytes()).collect();
    let shorts = model.accessor(U16, "VEC2", 3, &bytes);
    model.json["accessors"][shorts]["normalized"] = json!(true);
    let floats = model.floats("VEC2", &[0.5, -3.0, 1e4, f32::NAN, 2.0, 2.0]);
    let colors = model.accessor(U8, "VEC4", 3, &[255, 0, 51, 102, 0, 0, 0, 0, 255, 255, 255, 255]);
    model.json["accessors"][colors]["normalized"] = json!(true);
    model.attribute("TEXCOORD_0", shorts).attribute("TEXCOORD_1", floats).attribute("COLOR_0", colors);
    let scene = model.load();
    assert_valid(&scene);
    assert_eq!(scene.geometry.uvs[0][0], Vec2::new(0.0, 1.0));
    assert!((scene.geometry.uvs[0][1].x - 0.5).abs() < 1e-4);
    assert_eq!(scene.geometry.uvs[1], [Vec2::new(0.5, -3.0), Vec2::ZERO, Vec2::splat(2.0)]);
    assert!((scene.geometry.colors[0] - Vec4::new(1.0, 0.0, 0.2, 0.4)).length() < 1e-6);
    assert!(noted(&scene, "out of range"));

    let mut model = Model::triangle();
    let colors = model.floats("VEC3", &[0.25, 0.5, 1.0, 0.0, 0.0, 0.0, 2.0, -1.0, 0.5]);
    model.attribute("COLOR_0", colors);
    let scene = model.load();
    assert_eq!(scene.geometry.colors[0], Vec4::new(0.25, 0.5, 1.0, 1.0), "RGB is opaque");
    assert_eq!(scene.geometry.colors[2], Vec4::new(1.0, 0.0, 0.5, 1.0), "clamped");
}

#[test]
fn missing_attributes_are_neutral_beside_objects_that_have_them() {
    let mut model = Model::triangle();
    let uvs = model.floats("VEC2", &[0.5; 6]);
    let colors = model.floats("VEC3", &[0.5; 9]);
    let plain = json!({"attributes": {"POSITION": 0}});
    let turned = json!({"attributes": {"POSITION": 0}, "indices": model.indices(&[0, 2, 1])});
    let full = json!({"attributes": {"POSITION": 0, "TEXCOORD_0": uvs, "COLOR_0": colors}});
    model.json["meshes"][0]["primitives"] = json!([plain, full, turned]);
    let scene = model.load();
    assert_valid(&scene);
    assert_eq!([0, 3, 6].map(|v| scene.geometry.uvs[0][v].x), [0.0, 0.5, 0.0]);
    assert_eq!([0, 3, 6].map(|v| scene.geometry.colors[v].x), [1.0, 0.5, 1.0]);
}

#[test]
fn morph_targets_at_their_default_weights() {
    let mut model = Model::triangle();
    let deltas = model.floats("VEC3", &[0.0, 0.0, 2.0].repeat(3));
    let unused = model.floats("VEC3", &[9.0; 9]);
    model.primitive()["targets"] = json!([{"POSITION": deltas}, {"POSITION": unused}]);
    model.json["meshes"][0]["weights"] = json!([0.5, 0.0]);
    assert!(near(world(&model.load(), 0)[0], [0.0, 0.0, 1.0]));
    model.json["nodes"][0]["weights"] = json!([0.25, 0.0]);
    assert!(near(world(&model.load(), 0)[0], [0.0, 0.0, 0.5]), "the node's weights win");
}

#[test]
fn skins_stand_as_their_joints_do() {
    let mut model = Model::triangle();
    let joints = model.accessor(U8, "VEC4", 3, &[0, 1, 0, 0].repeat(3));
    let weights = model.floats("VEC4", &[1.0, 0.0, 0.0, 0.0, 0.5, 0.5, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0]);
    let mut bind = vec![0.0; 32];
    for diagonal in [0, 5, 10, 15, 16, 21, 26, 31] {
        bind[diagonal] = 1.0;
    }
    bind[28] = -10.0; // joint 1 was bound at x = 10
    let bind = model.floats("MAT4", &bind);
    model.attribute("JOINTS_0", joints).attribute("WEIGHTS_0", weights);
    model.json["skins"] = json!([{"joints": [1, 2], "inverseBindMatrices": bind}]);
    model.json["scenes"][0]["nodes"] = json!([0, 1]);
    model.json["nodes"] = json!([
        {"mesh": 0, "skin": 0, "translation": [100, 0, 0]},
        {"children": [2]},
        {"translation": [10, 4, 0]}
    ]);
    let scene = model.load();
    let [a, b, c] = world(&scene, 0);
    assert!(near(a, [0.0, 0.0, 0.0]), "the node's own transform is ignored: {a}");
    assert!(near(b, [1.0, 2.0, 0.0]), "half of joint 1's lift: {b}");
    assert!(near(c, [0.0, 5.0, 0.0]), "weights are normalised: {c}");
    assert!(noted(&scene, "skinned"));
}

#[test]
fn quantized_meshes() {
    let mut model = Model::triangle();
    let bytes: Vec<u8> =
        [0_i16, 0, 0, 0, 32767, 0, 0, 0, 0, 32767, 0, 0].iter().flat_map(|v| v.to_le_bytes()).collect();
    let positions = model.accessor(I16, "VEC3", 3, &bytes);
    let view = model.json["accessors"][positions]["bufferView"].as_u64().unwrap() as usize;
    model.json["bufferViews"][view]["byteStride"] = json!(8);
    model.json["accessors"][positions]["normalized"] = json!(true);
    model.attribute("POSITION", positions);
    assert!(model.refused().contains("POSITION"), "only with the extension");
    model.json["extensionsUsed"] = json!(["KHR_mesh_quantization"]);
    model.json["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
    assert!(near(world(&model.load(), 0)[1], [1.0, 0.0, 0.0]));
}

#[test]
fn wide_indices() {
    let mut model = Model::triangle();
    let bytes: Vec<u8> = [2_u32, 0, 1].iter().flat_map(|v| v.to_le_bytes()).collect();
    let indices = model.accessor(U32, "SCALAR", 3, &bytes);
    model.primitive()["indices"] = json!(indices);
    assert!(near(world(&model.load(), 0)[0], [0.0, 1.0, 0.0]));
}

#[test]
fn tangents_are_made_or_transformed_where_a_normal_map_needs_them() {
    let mut model = Model::triangle();
    let uvs = model.floats("VEC2", &[0.0, 1.0, 1.0, 1.0, 0.0, 0.0]);
    let normals = model.floats("VEC3", &[0.0, 0.0, 1.0].repeat(3));
    model.attribute("TEXCOORD_0", uvs).attribute("NORMAL", normals);
    assert!(model.load().geometry.tangents.is_empty(), "no normal map, no tangents");
    let image = model.view(&png(1, 1, [128, 128, 255, 255]));
    model.json["images"] = json!([{"bufferView": image, "mimeType": "image/png"}]);
    model.json["textures"] = json!([{"source": 0}]);
    model.json["materials"] = json!([{"normalTexture": {"index": 0}}]);
    let made = model.load();
    assert_valid(&made);
    assert!((made.geometry.tangents[0] - Vec4::new(1.0, 0.0, 0.0, 1.0)).length() < 1e-5);

    let tangents = model.floats("VEC4", &[0.0, 1.0, 0.0, 1.0].repeat(3));
    model.attribute("TANGENT", tangents);
    let given = model.set("/nodes/0/scale", json!([-1, 1, 1])).load();
    assert!((given.geometry.tangents[0] - Vec4::new(0.0, 1.0, 0.0, -1.0)).length() < 1e-6, "mirrored");
}

#[test]
fn cameras_in_node_order_without_scale() {
    let mut model = Model::triangle();
    model.json["cameras"] = json!([
        {"type": "orthographic", "orthographic": {"xmag": 2, "ymag": 3, "znear": 0, "zfar": 10}},
        {"type": "perspective", "perspective": {"yfov": 0.5, "znear": 0.1}, "name": "lens"}
    ]);
    model.json["scenes"][0]["nodes"] = json!([2, 0, 1]);
    model.json["nodes"] = json!([
        {"mesh": 0},
        {"camera": 1, "translation": [1, 2, 3], "scale": [5, 5, -5]},
        {"camera": 0, "rotation": [0, FRAC_1_SQRT_2, 0, FRAC_1_SQRT_2], "name": "side"}
    ]);
    let scene = model.load();
    let [lens, side] = &scene.cameras[..] else { panic!("{:?}", scene.cameras) };
    assert_eq!((lens.name.as_str(), side.name.as_str()), ("lens", "side"));
    assert_eq!(lens.projection, Projection::Perspective { yfov: 0.5 });
    assert_eq!(lens.position, Vec3::new(0.5, 1.5, 3.0), "relative to the origin");
    assert_eq!(side.projection, Projection::Orthographic { xmag: 2.0, ymag: 3.0 });
    assert!((side.forward - Vec3::NEG_X).length() < 1e-6 && (side.right - Vec3::NEG_Z).length() < 1e-6);
    for camera in &scene.cameras {
        assert!((camera.right.cross(camera.up) + camera.forward).length() < 1e-6, "right-handed");
    }
}

#[test]
fn lights_in_world_space() {
    let mut model = Model::triangle();
    model.json["extensionsUsed"] = json!(["KHR_lights_punctual"]);
    model.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [
        {"type": "directional", "color": [1, 0.5, 0], "intensity": 4},
        {"type": "spot", "range": 7, "spot": {"innerConeAngle": 0.1, "outerConeAngle": 0.2}},
        {"type": "point", "name": "bulb"},
        {"type": "tube"}
    ]}});
    let node = |light: usize| json!({"translation": [0.5, 0.5, 9], "extensions": {"KHR_lights_punctual": {"light": light}}});
    model.json["nodes"] = json!([{"mesh": 0}, node(0), node(1), node(2), node(3)]);
    model.json["scenes"][0]["nodes"] = json!([0, 1, 2, 3, 4]);
    model.json["nodes"][1]["rotation"] = json!([0, FRAC_1_SQRT_2, 0, FRAC_1_SQRT_2]);
    let scene = model.load();
    assert_eq!(scene.lights.len(), 3);
    assert!(noted(&scene, "type that is not known"));
    assert_eq!(scene.ambient, 0.0);
    assert_eq!(scene.lights[0].intensity, Vec3::new(4.0, 2.0, 0.0));
    let LightKind::Directional { direction } = scene.lights[0].kind else { panic!() };
    assert!((direction - Vec3::NEG_X).length() < 1e-6);
    let LightKind::Spot { position, direction, range, inner_cos, outer_cos } = scene.lights[1].kind else {
        panic!()
    };
    assert_eq!((position, direction, range), (Vec3::new(0.0, 0.0, 9.0), Vec3::NEG_Z, 7.0));
    assert_eq!((inner_cos, outer_cos), (0.1_f32.cos(), 0.2_f32.cos()));
    let LightKind::Point { range, .. } = scene.lights[2].kind else { panic!() };
    assert!(range.is_infinite() && scene.lights[2].name == "bulb");
    assert!(Model::triangle().load().ambient > 0.0, "a file without lights is not black");
}

#[test]
fn lights_beyond_the_most_are_dropped_with_a_note() {
    let mut model = Model::triangle();
    model.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [{"type": "point"}]}});
    for _ in 0..40 {
        let node =
            push(&mut model.json["nodes"], json!({"extensions": {"KHR_lights_punctual": {"light": 0}}}));
        push(&mut model.json["scenes"][0]["nodes"], json!(node));
    }
    let scene = model.load();
    assert_eq!(scene.lights.len(), MAX_LIGHTS as usize);
    assert!(noted(&scene, "32 lights beyond the first 8 are dropped"));
}

#[test]
fn scenes_are_chosen_and_noted() {
    let mut model = Model::triangle();
    model.json["scene"] = json!(1);
    model.json["scenes"] = json!([{"nodes": [0]}, {"nodes": [1]}]);
    model.json["nodes"] = json!([{"mesh": 0, "name": "first"}, {"mesh": 0, "name": "second"}]);
    let scene = model.load();
    assert_eq!(scene.objects[0].name, "second");
    assert!(noted(&scene, "scene 1 of 2"));
    let with = |scene| Limits { scene: Some(scene), ..Limits::default() };
    let load =
        |limits| vertex_tracing::scene::gltf::load_slice(&model.bytes(), None, "a.gltf".as_ref(), &limits);
    assert_eq!(load(with(0)).unwrap().objects[0].name, "first");
    assert!(crate::model::refused(load(with(2))).contains("there are 2"));
    model.json.as_object_mut().unwrap().remove("scene");
    assert_eq!(model.load().objects[0].name, "first");
}

#[test]
fn a_file_without_scenes_shows_all_roots() {
    let mut model = Model::triangle();
    model.json.as_object_mut().unwrap().remove("scenes");
    model.json.as_object_mut().unwrap().remove("scene");
    let scene = model.load();
    assert_eq!(scene.objects.len(), 1);
    assert!(noted(&scene, "no scene"));
}

#[test]
fn valid_oddities_are_not_refused() {
    let mut model = Model::triangle();
    model.json["scenes"] = json!([{"nodes": [0]}, {}]);
    model.json["nodes"][0]["mesh"] = json!(0.0);
    model.json["animations"] =
        json!([{"channels": [{"sampler": 0, "target": {"path": "pointer"}}], "samplers": []}]);
    model.json["extensionsUsed"] = json!(["VENDOR_fancy"]);
    model.json["textures"] = json!([{}]);
    model.json["materials"] = json!([{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]);
    let colors = model.floats("VEC3", &[1.0; 9]);
    model.attribute("SHININESS", colors).attribute("_MINE", colors);
    let scene = model.load();
    for text in ["animations", "VENDOR_fancy", "unknown attribute", "no PNG, JPEG or WebP"] {
        assert!(noted(&scene, text), "{text}: {:?}", scene.notes);
    }
    assert!(scene.materials[0].base_color_texture.is_none());
    let mut marked = b"\xef\xbb\xbf".to_vec();
    marked.extend(Model::triangle().bytes());
    assert!(noted(&crate::model::load(&marked).unwrap(), "byte order mark"));
}

#[test]
fn binary_files() {
    let mut model = Model::triangle();
    model.json["buffers"] = json!([{"byteLength": model.bin.len()}]);
    let json = serde_json::to_vec(&model.json).unwrap();
    let bytes = glb(&[(b"JSON", &json), (b"BIN\0", &model.bin), (b"MORE", b"ignored")]);
    let scene = crate::model::load(&bytes).unwrap();
    assert_eq!(scene.geometry.faces.len(), 1);
    assert!(noted(&scene, "chunks"));
}

#[test]
fn files_beside_the_model_by_escaped_and_foreign_names() {
    let folder = tempfile::tempdir().unwrap();
    let mut model = Model::triangle();
    fs::create_dir(folder.path().join("dätä")).unwrap();
    fs::write(folder.path().join("dätä/b c%.bin"), &model.bin).unwrap();
    fs::write(folder.path().join("ü.jpg"), png(2, 3, [1, 2, 3, 4])).unwrap();
    model.json["buffers"] = json!([{"byteLength": model.bin.len(), "uri": "d%C3%A4tä/b%20c%25.bin"}]);
    model.json["images"] = json!([{"uri": "ü.jpg"}]);
    model.json["textures"] = json!([{"source": 0}]);
    model.json["materials"] = json!([{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]);
    let path = folder.path().join("模型.gltf");
    fs::write(&path, serde_json::to_vec(&model.json).unwrap()).unwrap();
    let scene = load(&path, &Limits::default()).unwrap();
    assert_eq!(scene.name, "模型");
    assert_eq!((scene.images[0].width, scene.images[0].height), (2, 3), "a PNG, whatever its name");
    let absent = load(&folder.path().join("absent.gltf"), &Limits::default());
    assert!(matches!(absent, Err(Error::Io { .. })));
}
