//! Any numbers at all as positions, normals, coordinates, factors and a camera: from scene to small frame.
//!
//! The JSON is sound, so that mutations reach the numbers and not the parser. Everything but the device runs:
//! hierarchy, patches, refinement, the sampler and the per-pixel tracer, whose pixels must be numbers.

use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use glam::{Vec2, Vec3};
use serde_json::{Value, json};
use vertex_tracing::{
    options::{EffortOptions, Reconstruction, ViewOptions},
    refine::{Refiner, mesh::Mesh, predict::Predictor, shown::Shown, structure::Structure},
    scene::{
        classify::{VtRules, classify},
        gltf::{Limits, load_slice},
        patch::Targets,
        topology::Topology,
    },
    trace::{Settings, Tracer, reference, sample::Context},
    visibility::IdImage,
};

/// Bytes before those of the mesh: the factors and the camera.
const HEAD: usize = 12;
/// Bytes of a vertex: position, normal, coordinates.
const VERTEX: usize = 32;

/// Does so with one input; returns whether that is a scene.
pub fn frame(bytes: &[u8]) -> bool {
    let Some(glb) = model(bytes) else { return false };
    let limits = Limits { max_triangles: 1000, ..Limits::default() };
    let Ok(mut scene) = load_slice(&glb, None, Path::new("fuzz.glb"), &limits) else { return false };
    let options = ViewOptions { width: 16, height: 12, ..ViewOptions::default() };
    let (Ok(()), Ok(view)) = (classify(&mut scene, &VtRules::default()), options.resolve(&scene)) else {
        return false;
    };
    scene.add_default_lights(&view);

    let tracer = Tracer::new(&scene);
    let settings = Settings::default();
    let image = reference::render(&tracer, &view, &settings, 1, None, &AtomicBool::new(false), &|_| ());
    let image = image.expect("nothing interrupts").image;
    assert!(image.iter().flatten().all(|value| !value.is_nan() && *value >= 0.0), "a pixel is no number");

    let topology = Topology::new(&scene.geometry);
    let targets = Targets::new(&scene, &topology);
    let structures = Structure::all(&scene);
    let context =
        Context { tracer: &tracer, targets: &targets, settings: &settings, view: &view, pyramids: None };
    let predictor = Predictor {
        targets: &targets,
        structures: &structures,
        scene: &scene,
        view: &view,
        reconstruction: Reconstruction::Exact,
        shaft_guard: true,
    };
    let ids: Vec<u32> = (0..view.pixels() as u32)
        .map(|pixel| {
            let centre = Vec2::new((pixel % view.width) as f32, (pixel / view.width) as f32) + 0.5;
            let (origin, direction) = view.ray(centre);
            tracer.closest(origin, direction).map_or(0, |hit| hit.face + 1)
        })
        .collect();
    let mut seeds: Vec<u32> = ids.iter().filter_map(|id| id.checked_sub(1)).collect();
    seeds.sort_unstable();
    seeds.dedup();
    let mesh = Mesh::new(&scene, &topology, &view, &seeds);
    let image = IdImage { width: view.width, height: view.height, pixels: &ids };
    let mut counts = vec![0; scene.geometry.faces.len()];
    let pixels = (0..view.height).flat_map(|y| (0..view.width).map(move |x| (x, y)));
    pixels.filter_map(|(x, y)| image.face(x, y)).for_each(|face| counts[face as usize] += 1);
    let shown = Shown { counts: &counts, ids: Some(image) };
    let mut refiner = Refiner::new(&context, &predictor, mesh, shown, None);
    let effort = EffortOptions { max_samples: Some(200), ..EffortOptions::default() };
    refiner.run(&effort, Instant::now(), |_| Ok::<_, ()>(())).expect("nothing interrupts");
    refiner.mesh.validate();
    for vertex in 0..refiner.samples.len() as u32 {
        for node in refiner.samples.get(vertex).nodes {
            assert!(
                !node.radiance().is_nan() && node.radiance().cmpge(Vec3::ZERO).all(),
                "a node is no number"
            );
        }
    }
    true
}

/// A binary glTF file of one mesh, from the input's numbers.
fn model(bytes: &[u8]) -> Option<Vec<u8>> {
    let (head, rest) = bytes.split_at_checked(HEAD)?;
    let share = |i: usize| f64::from(head[i]) / 255.0;
    let corners = rest.len() / VERTEX / 3 * 3;
    if corners == 0 || corners > 300 {
        return None;
    }
    let mut bin = rest[..corners * VERTEX].to_vec();
    // Indices share vertices as the head says: fans, strips or single triangles.
    let indices: Vec<u16> = (0..corners as u16)
        .map(|i| match head[0] % 3 {
            0 => i,
            1 => i / 3 + i % 3,
            _ => (i * u16::from(head[1])) % corners as u16,
        })
        .map(|i| i % corners as u16)
        .collect();
    let index_bytes: Vec<u8> = indices.iter().flat_map(|i| i.to_le_bytes()).collect();
    let index_offset = bin.len();
    bin.extend_from_slice(&index_bytes);
    bin.resize(bin.len().next_multiple_of(4), 0);
    let mut bounds = [[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]];
    for vertex in bin[..index_offset].chunks_exact(VERTEX) {
        for (axis, number) in vertex[..12].chunks_exact(4).enumerate() {
            let number = f32::from_le_bytes(number.try_into().ok()?);
            if !number.is_finite() {
                return None;
            }
            bounds[0][axis] = bounds[0][axis].min(number);
            bounds[1][axis] = bounds[1][axis].max(number);
        }
    }
    let solid = if head[2] & 1 == 1 {
        json!({ "thicknessFactor": 1.0, "attenuationDistance": 0.01 + share(3) })
    } else {
        json!({})
    };
    let accessor = |view: usize, kind: &str| json!({ "bufferView": view, "componentType": 5126, "type": kind, "count": corners });
    let view = |offset: usize| json!({ "buffer": 0, "byteOffset": offset, "byteLength": index_offset - offset, "byteStride": VERTEX });
    let mut position = accessor(0, "VEC3");
    position["min"] = json!(bounds[0]);
    position["max"] = json!(bounds[1]);
    let scale = 10_f64.powf(12.0 * share(10) - 6.0);
    let root: Value = json!({
        "asset": { "version": "2.0" },
        "scenes": [{ "nodes": [0] }],
        "scene": 0,
        "nodes": [{ "mesh": 0, "scale": [scale, scale, scale], "translation": [1e6 * share(11), 0.0, 0.0] }],
        "extensionsUsed": ["KHR_materials_transmission", "KHR_materials_volume", "KHR_materials_ior"],
        "materials": [{
            "pbrMetallicRoughness": { "metallicFactor": share(4), "roughnessFactor": 0.1 * share(5),
                "baseColorFactor": [share(6), share(7), 1.0, 1.0] },
            "extensions": {
                "KHR_materials_transmission": { "transmissionFactor": share(8) },
                "KHR_materials_ior": { "ior": 1.0 + 2.0 * share(9) },
                "KHR_materials_volume": solid,
            },
        }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2 },
            "indices": 3, "material": 0 }] }],
        "accessors": [position, accessor(1, "VEC3"), accessor(2, "VEC2"),
            { "bufferView": 3, "componentType": 5123, "type": "SCALAR", "count": corners }],
        "bufferViews": [view(0), view(12), view(24),
            { "buffer": 0, "byteOffset": index_offset, "byteLength": index_bytes.len() }],
        "buffers": [{ "byteLength": bin.len() }],
    });
    let mut json = root.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut glb = b"glTF".to_vec();
    let length = 12 + 8 + json.len() + 8 + bin.len();
    for word in [2, length as u32, json.len() as u32] {
        glb.extend(word.to_le_bytes());
    }
    glb.extend(b"JSON");
    glb.extend(json);
    glb.extend((bin.len() as u32).to_le_bytes());
    glb.extend(b"BIN\0");
    glb.extend(bin);
    Some(glb)
}
