//! Writes a scene as binary glTF 2.0, textures embedded as PNG.

mod material;
mod writer;

use std::borrow::Cow;
use std::path::Path;

use glam::{DVec3, Quat, Vec3};
use serde_json::{Map, Value, json};

use self::writer::{Writer, png};

use crate::error::{Error, Result};
use crate::scene::{Camera, Filter, Light, LightKind, Projection, Sampler, Scene, Wrap};

/// The scene as a .glb file: a node for each object, then each camera, then each light.
///
/// [`Scene::origin`] becomes the translation of a node above all others if it is not zero. Not in the file,
/// because glTF has no word for them: the background, the ambient term, notes and the class of an object
/// (`extras` of nodes and materials are written).
///
/// # Errors
/// [`Error::Scene`] if the file would pass the 4 GiB of a GLB or an image cannot be encoded.
pub fn encode(scene: &Scene) -> Result<Vec<u8>> {
    let refuse = |object: &str, problem: String| Error::scene(Path::new(&scene.name), object, problem);
    let mut writer = Writer::default();
    let images = scene
        .images
        .iter()
        .map(|image| {
            let bytes = png(image).map_err(|error| refuse(&format!("image {}", image.name), error.to_string()))?;
            Ok(json!({ "name": image.name, "mimeType": "image/png", "bufferView": writer.view(&bytes, None) }))
        })
        .collect::<Result<Vec<Value>>>()?;
    let meshes: Vec<Value> = scene.objects.iter().map(|object| writer.mesh(scene, object)).collect();
    let materials: Vec<Value> = scene.materials.iter().map(|m| writer.material(m)).collect();
    let mut samplers: Vec<Sampler> = Vec::new();
    let textures: Vec<Value> = scene
        .textures
        .iter()
        .map(|texture| {
            let sampler = samplers.iter().position(|known| *known == texture.sampler).unwrap_or_else(|| {
                samplers.push(texture.sampler);
                samplers.len() - 1
            });
            json!({ "source": texture.image, "sampler": sampler })
        })
        .collect();

    let mut nodes: Vec<Value> = (0..scene.objects.len())
        .map(|i| {
            let object = &scene.objects[i];
            let mut node = json!({ "name": object.name, "mesh": i });
            if let Some(vt) = object.vt_extra {
                node["extras"] = json!({ "vt": vt });
            }
            node
        })
        .collect();
    nodes.extend(scene.cameras.iter().enumerate().map(|(i, camera)| camera_node(i, camera)));
    nodes.extend(scene.lights.iter().enumerate().map(|(i, light)| light_node(i, light)));
    let mut roots: Vec<usize> = (0..nodes.len()).collect();
    if scene.origin != DVec3::ZERO {
        nodes.push(json!({ "name": "origin", "translation": scene.origin.to_array(), "children": roots }));
        roots = vec![nodes.len() - 1];
    }

    let mut root = Map::new();
    root.insert(
        "asset".into(),
        json!({ "version": "2.0", "generator": concat!("vertex-tracing ", env!("CARGO_PKG_VERSION")) }),
    );
    root.insert("scene".into(), json!(0));
    root.insert("scenes".into(), json!([{ "name": scene.name, "nodes": roots }]));
    if !scene.lights.is_empty() {
        writer.extension("KHR_lights_punctual");
        let lights: Vec<Value> = scene.lights.iter().map(light).collect();
        root.insert("extensions".into(), json!({ "KHR_lights_punctual": { "lights": lights } }));
    }
    let arrays = [
        ("nodes", nodes),
        ("meshes", meshes),
        ("materials", materials),
        ("cameras", scene.cameras.iter().map(camera).collect()),
        ("textures", textures),
        ("samplers", samplers.iter().map(sampler).collect()),
        ("images", images),
        ("accessors", writer.accessors),
        ("bufferViews", writer.views),
        ("extensionsUsed", writer.extensions.into_iter().map(Value::from).collect()),
        ("buffers", vec![json!({ "byteLength": writer.bytes.len() })]),
    ];
    // glTF allows no empty array.
    let present = arrays.into_iter().filter(|(_, array)| !array.is_empty());
    root.extend(present.map(|(name, array)| (name.to_owned(), Value::Array(array))));

    let json = Value::Object(root).to_string().into_bytes();
    if json.len() as u64 + writer.bytes.len() as u64 + 64 > u64::from(u32::MAX) {
        return Err(refuse(
            "buffers[0]",
            "a GLB holds 4 GiB at most: use fewer faces or smaller textures".into(),
        ));
    }
    let header = gltf::binary::Header { magic: *b"glTF", version: 2, length: 0 };
    let glb = gltf::Glb { header, json: Cow::Owned(json), bin: Some(Cow::Owned(writer.bytes)) };
    glb.to_vec().map_err(|error| refuse("buffers[0]", error.to_string()))
}

fn camera(camera: &Camera) -> Value {
    let mut out = match camera.projection {
        Projection::Perspective { yfov } => {
            json!({ "type": "perspective", "perspective": { "yfov": number(yfov), "znear": 0.01 } })
        }
        Projection::Orthographic { xmag, ymag } => json!({ "type": "orthographic", "orthographic":
            { "xmag": number(xmag), "ymag": number(ymag), "znear": 0.0, "zfar": 1000.0 } }),
    };
    out["name"] = json!(camera.name);
    out
}

fn camera_node(index: usize, camera: &Camera) -> Value {
    let columns = [
        camera.right.extend(0.0),
        camera.up.extend(0.0),
        (-camera.forward).extend(0.0),
        camera.position.extend(1.0),
    ];
    json!({ "name": camera.name, "camera": index, "matrix": numbers(columns.map(|c| c.to_array()).concat()) })
}

fn light(light: &Light) -> Value {
    let intensity = light.intensity.max_element();
    let color = if intensity > 0.0 { light.intensity / intensity } else { Vec3::ONE };
    let mut out =
        json!({ "name": light.name, "color": numbers(color.to_array()), "intensity": number(intensity) });
    let (kind, reach) = match light.kind {
        LightKind::Point { range, .. } => ("point", range),
        LightKind::Directional { .. } => ("directional", f32::INFINITY),
        LightKind::Spot { range, inner_cos, outer_cos, .. } => {
            out["spot"] = json!({ "innerConeAngle": number(inner_cos.acos()), "outerConeAngle": number(outer_cos.acos()) });
            ("spot", range)
        }
    };
    out["type"] = json!(kind);
    if reach.is_finite() {
        out["range"] = number(reach);
    }
    out
}

fn light_node(index: usize, light: &Light) -> Value {
    let (position, direction) = match light.kind {
        LightKind::Point { position, .. } => (position, Vec3::NEG_Z),
        LightKind::Directional { direction } => (Vec3::ZERO, direction),
        LightKind::Spot { position, direction, .. } => (position, direction),
    };
    let mut node = json!({ "name": light.name, "translation": numbers(position.to_array()),
        "extensions": { "KHR_lights_punctual": { "light": index } } });
    if direction != Vec3::NEG_Z {
        node["rotation"] = numbers(Quat::from_rotation_arc(Vec3::NEG_Z, direction).to_array());
    }
    node
}

fn sampler(sampler: &Sampler) -> Value {
    let wrap = |wrap| match wrap {
        Wrap::Repeat => 10497,
        Wrap::Mirror => 33648,
        Wrap::Clamp => 33071,
    };
    let min = match (sampler.min, sampler.mip) {
        (Filter::Nearest, None) => 9728,
        (Filter::Linear, None) => 9729,
        (Filter::Nearest, Some(Filter::Nearest)) => 9984,
        (Filter::Linear, Some(Filter::Nearest)) => 9985,
        (Filter::Nearest, Some(Filter::Linear)) => 9986,
        (Filter::Linear, Some(Filter::Linear)) => 9987,
    };
    let mag = if sampler.mag == Filter::Nearest { 9728 } else { 9729 };
    json!({ "magFilter": mag, "minFilter": min, "wrapS": wrap(sampler.wrap_u), "wrapT": wrap(sampler.wrap_v) })
}

/// The shortest decimal that reads back as the same `f32`.
fn number(value: f32) -> Value {
    json!(value.to_string().parse::<f64>().unwrap_or(0.0))
}

fn numbers(values: impl AsRef<[f32]>) -> Value {
    values.as_ref().iter().map(|&value| number(value)).collect()
}
