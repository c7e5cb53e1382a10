//! Writes a scene as binary glTF 2.0, textures embedded as PNG.

use std::borrow::Cow;
use std::io::Cursor;
use std::path::Path;

use glam::{Affine2, Quat, Vec3};
use image::ExtendedColorType::{Rgb8, Rgba8};
use image::ImageEncoder;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use serde_json::{Map, Value, json};

use crate::error::{Error, Result};
use crate::scene::{
    AlphaMode, Camera, Filter, Image, Light, LightKind, Material, Object, Projection, Sampler, Scene,
    TextureSlot, Wrap,
};

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
    if scene.origin != glam::DVec3::ZERO {
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

/// What grows while the scene is walked.
#[derive(Default)]
struct Writer {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
    extensions: Vec<&'static str>,
}

impl Writer {
    fn extension(&mut self, name: &'static str) {
        if !self.extensions.contains(&name) {
            self.extensions.push(name);
        }
    }

    /// Appends `bytes` on a boundary of four, which every component type needs, and returns the view.
    fn view(&mut self, bytes: &[u8], target: Option<u32>) -> usize {
        let mut view = json!({ "buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len() });
        if let Some(target) = target {
            view["target"] = json!(target);
        }
        self.bytes.extend_from_slice(bytes);
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        self.views.push(view);
        self.views.len() - 1
    }

    fn accessor(&mut self, accessor: Value) -> usize {
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }

    fn attribute<T: bytemuck::NoUninit>(&mut self, kind: &str, values: &[T]) -> usize {
        const ARRAY_BUFFER: u32 = 34962;
        let view = self.view(bytemuck::cast_slice(values), Some(ARRAY_BUFFER));
        self.accessor(
            json!({ "bufferView": view, "componentType": 5126, "count": values.len(), "type": kind }),
        )
    }

    fn indices(&mut self, indices: &[u32], vertices: usize) -> usize {
        const ELEMENT_ARRAY_BUFFER: u32 = 34963;
        // The largest index of a type restarts a primitive: glTF forbids its use.
        let (view, component) = if vertices < usize::from(u16::MAX) {
            let short: Vec<u16> = indices.iter().map(|&index| index as u16).collect();
            (self.view(bytemuck::cast_slice(&short), Some(ELEMENT_ARRAY_BUFFER)), 5123)
        } else {
            (self.view(bytemuck::cast_slice(indices), Some(ELEMENT_ARRAY_BUFFER)), 5125)
        };
        self.accessor(json!({ "bufferView": view, "componentType": component, "count": indices.len(), "type": "SCALAR" }))
    }

    fn mesh(&mut self, scene: &Scene, object: &Object) -> Value {
        let geometry = &scene.geometry;
        let vertices = object.vertices.start as usize..object.vertices.end as usize;
        let positions = &geometry.positions[vertices.clone()];
        let position = self.attribute("VEC3", positions);
        let low = positions.iter().fold(Vec3::INFINITY, |low, p| low.min(*p));
        let high = positions.iter().fold(Vec3::NEG_INFINITY, |high, p| high.max(*p));
        self.accessors[position]["min"] = numbers(low.to_array());
        self.accessors[position]["max"] = numbers(high.to_array());
        let mut attributes = json!({ "POSITION": position });
        attributes["NORMAL"] = json!(self.attribute("VEC3", &geometry.normals[vertices.clone()]));
        // An attribute that holds its neutral value throughout is one that the object lacks.
        if let Some(tangents) = geometry.tangents.get(vertices.clone()) {
            attributes["TANGENT"] = json!(self.attribute("VEC4", tangents));
        }
        for (set, uvs) in geometry.uvs.iter().enumerate() {
            if let Some(uvs) =
                uvs.get(vertices.clone()).filter(|uvs| uvs.iter().any(|uv| *uv != glam::Vec2::ZERO))
            {
                attributes[format!("TEXCOORD_{set}")] = json!(self.attribute("VEC2", uvs));
            }
        }
        if let Some(colors) =
            geometry.colors.get(vertices.clone()).filter(|c| c.iter().any(|c| *c != glam::Vec4::ONE))
        {
            attributes["COLOR_0"] = json!(self.attribute("VEC4", colors));
        }
        let faces = &geometry.faces[object.faces.start as usize..object.faces.end as usize];
        let local: Vec<u32> = faces.iter().flatten().map(|v| v - object.vertices.start).collect();
        let indices = self.indices(&local, positions.len());
        let mut mesh = json!({ "primitives": [{ "attributes": attributes, "indices": indices, "material": object.material }] });
        if let Some(name) = &object.mesh_name {
            mesh["name"] = json!(name);
        }
        mesh
    }

    fn material(&mut self, material: &Material) -> Value {
        let mut pbr = json!({
            "baseColorFactor": numbers(material.base_color.to_array()),
            "metallicFactor": number(material.metallic),
            "roughnessFactor": number(material.roughness),
        });
        self.slot(&mut pbr, "baseColorTexture", material.base_color_texture);
        self.slot(&mut pbr, "metallicRoughnessTexture", material.metallic_roughness_texture);
        let mut out = json!({ "name": material.name, "pbrMetallicRoughness": pbr });
        self.slot(&mut out, "normalTexture", material.normal_texture);
        if material.normal_texture.is_some() {
            out["normalTexture"]["scale"] = number(material.normal_scale);
        }
        // Factors above 1 belong into the extension.
        let strength = material.emissive.max_element().max(1.0);
        if material.emissive != Vec3::ZERO {
            out["emissiveFactor"] = numbers((material.emissive / strength).to_array());
        }
        self.slot(&mut out, "emissiveTexture", material.emissive_texture);
        match material.alpha_mode {
            AlphaMode::Opaque => {}
            AlphaMode::Mask(cutoff) => {
                out["alphaMode"] = json!("MASK");
                out["alphaCutoff"] = number(cutoff);
            }
            AlphaMode::Blend => out["alphaMode"] = json!("BLEND"),
        }
        if material.double_sided {
            out["doubleSided"] = json!(true);
        }
        if let Some(vt) = material.vt_extra {
            out["extras"] = json!({ "vt": vt });
        }
        let extensions = self.material_extensions(material, strength);
        if !extensions.is_empty() {
            out["extensions"] = Value::Object(extensions);
        }
        out
    }

    fn material_extensions(&mut self, material: &Material, emissive_strength: f32) -> Map<String, Value> {
        let plain = Material::default();
        let mut all = Vec::new();
        if emissive_strength > 1.0 {
            all.push((
                "KHR_materials_emissive_strength",
                json!({ "emissiveStrength": number(emissive_strength) }),
            ));
        }
        if material.unlit {
            all.push(("KHR_materials_unlit", json!({})));
        }
        if material.ior != plain.ior {
            all.push(("KHR_materials_ior", json!({ "ior": number(material.ior) })));
        }
        let mut specular = json!({ "specularFactor": number(material.specular),
            "specularColorFactor": numbers(material.specular_color.to_array()) });
        let neutral = specular.clone();
        self.slot(&mut specular, "specularTexture", material.specular_texture);
        self.slot(&mut specular, "specularColorTexture", material.specular_color_texture);
        let textured = specular != neutral;
        if textured || material.specular != plain.specular || material.specular_color != plain.specular_color
        {
            all.push(("KHR_materials_specular", specular));
        }
        if material.transmission > 0.0 {
            let mut transmission = json!({ "transmissionFactor": number(material.transmission) });
            self.slot(&mut transmission, "transmissionTexture", material.transmission_texture);
            all.push(("KHR_materials_transmission", transmission));
        }
        if let Some(body) = material.volume {
            // Any thickness above 0 says "solid"; its value is for renderers that do not trace.
            let mut volume = json!({ "thicknessFactor": 1.0, "attenuationColor": numbers(body.attenuation_color.to_array()) });
            if body.attenuation_distance.is_finite() {
                volume["attenuationDistance"] = number(body.attenuation_distance);
            }
            all.push(("KHR_materials_volume", volume));
        }
        all.iter().for_each(|(name, _)| self.extension(name));
        all.into_iter().map(|(name, value)| (name.to_owned(), value)).collect()
    }

    fn slot(&mut self, owner: &mut Value, key: &str, slot: Option<TextureSlot>) {
        let Some(slot) = slot else { return };
        let mut info = json!({ "index": slot.texture, "texCoord": slot.uv_set });
        if slot.transform != Affine2::IDENTITY {
            self.extension("KHR_texture_transform");
            let (scale, angle, offset) = slot.transform.to_scale_angle_translation();
            info["extensions"] = json!({ "KHR_texture_transform": {
                // glTF turns the image counter-clockwise with v down: the coordinates turn the other way.
                "offset": numbers(offset.to_array()), "rotation": number(-angle), "scale": numbers(scale.to_array()),
            }});
        }
        owner[key] = info;
    }
}

fn png(image: &Image) -> image::ImageResult<Vec<u8>> {
    let mut bytes = Cursor::new(Vec::new());
    let encoder = PngEncoder::new_with_quality(&mut bytes, CompressionType::Best, FilterType::Adaptive);
    if image.rgba.chunks_exact(4).all(|texel| texel[3] == u8::MAX) {
        let rgb: Vec<u8> =
            image.rgba.chunks_exact(4).flat_map(|texel| [texel[0], texel[1], texel[2]]).collect();
        encoder.write_image(&rgb, image.width, image.height, Rgb8)?;
    } else {
        encoder.write_image(&image.rgba, image.width, image.height, Rgba8)?;
    }
    Ok(bytes.into_inner())
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
