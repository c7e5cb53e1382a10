//! The binary buffer of a GLB and what points into it: images and meshes.

use std::io::Cursor;

use glam::{Vec2, Vec3, Vec4};
use image::ExtendedColorType::{Rgb8, Rgba8};
use image::ImageEncoder;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use serde_json::{Value, json};

use super::numbers;
use crate::scene::{Image, Object, Scene};

/// What grows while the scene is walked.
#[derive(Default)]
pub(super) struct Writer {
    pub(super) bytes: Vec<u8>,
    pub(super) views: Vec<Value>,
    pub(super) accessors: Vec<Value>,
    pub(super) extensions: Vec<&'static str>,
}

impl Writer {
    pub(super) fn extension(&mut self, name: &'static str) {
        if !self.extensions.contains(&name) {
            self.extensions.push(name);
        }
    }

    /// Appends `bytes` on a boundary of four, which every component type needs, and returns the view.
    pub(super) fn view(&mut self, bytes: &[u8], target: Option<u32>) -> usize {
        let mut view = json!({ "buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len() });
        if let Some(target) = target {
            view["target"] = json!(target);
        }
        self.bytes.extend_from_slice(bytes);
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        self.views.push(view);
        self.views.len() - 1
    }

    pub(super) fn accessor(&mut self, accessor: Value) -> usize {
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }

    pub(super) fn attribute<T: bytemuck::NoUninit>(&mut self, kind: &str, values: &[T]) -> usize {
        const ARRAY_BUFFER: u32 = 34962;
        let view = self.view(bytemuck::cast_slice(values), Some(ARRAY_BUFFER));
        self.accessor(
            json!({ "bufferView": view, "componentType": 5126, "count": values.len(), "type": kind }),
        )
    }

    pub(super) fn indices(&mut self, indices: &[u32], vertices: usize) -> usize {
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

    pub(super) fn mesh(&mut self, scene: &Scene, object: &Object) -> Value {
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
            if let Some(uvs) = uvs.get(vertices.clone()).filter(|uvs| uvs.iter().any(|uv| *uv != Vec2::ZERO))
            {
                attributes[format!("TEXCOORD_{set}")] = json!(self.attribute("VEC2", uvs));
            }
        }
        if let Some(colors) =
            geometry.colors.get(vertices.clone()).filter(|c| c.iter().any(|c| *c != Vec4::ONE))
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
}

pub(super) fn png(image: &Image) -> image::ImageResult<Vec<u8>> {
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
