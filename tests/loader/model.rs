//! Builds small glTF files in memory.

use std::path::Path;

use serde_json::{Value, json};
use vertex_tracing::error::Result;
use vertex_tracing::scene::Scene;
use vertex_tracing::scene::gltf::{Limits, load_slice};

pub const FLOAT: u32 = 5126;
pub const U8: u32 = 5121;
pub const U16: u32 = 5123;
pub const U32: u32 = 5125;
pub const I16: u32 = 5122;

/// A glTF file whose one buffer is a data URI.
pub struct Model {
    pub json: Value,
    pub bin: Vec<u8>,
}

impl Model {
    /// One node with one mesh of one triangle: (0, 0, 0), (1, 0, 0), (0, 1, 0), material 0.
    pub fn triangle() -> Self {
        let mut model = Self::empty();
        let positions = model.floats("VEC3", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
        model.json["meshes"] =
            json!([{"primitives": [{"attributes": {"POSITION": positions}, "material": 0}]}]);
        model.json["materials"] = json!([{}]);
        model.json["nodes"] = json!([{"mesh": 0}]);
        model
    }

    /// A scene with node 0, and nothing else.
    pub fn empty() -> Self {
        let json = json!({
            "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{}],
            "accessors": [], "bufferViews": [], "buffers": []
        });
        Self { json, bin: Vec::new() }
    }

    /// Appends a buffer view and returns its index.
    pub fn view(&mut self, bytes: &[u8]) -> usize {
        while !self.bin.len().is_multiple_of(4) {
            self.bin.push(0);
        }
        let offset = self.bin.len();
        self.bin.extend_from_slice(bytes);
        push(
            &mut self.json["bufferViews"],
            json!({"buffer": 0, "byteOffset": offset, "byteLength": bytes.len()}),
        )
    }

    /// Appends an accessor over bytes of its own and returns its index.
    pub fn accessor(&mut self, component: u32, kind: &str, count: usize, bytes: &[u8]) -> usize {
        let view = self.view(bytes);
        let accessor = json!({"bufferView": view, "componentType": component, "type": kind, "count": count});
        push(&mut self.json["accessors"], accessor)
    }

    pub fn floats(&mut self, kind: &str, values: &[f32]) -> usize {
        let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        self.accessor(FLOAT, kind, values.len() / lanes(kind), &bytes)
    }

    pub fn indices(&mut self, values: &[u16]) -> usize {
        let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        self.accessor(U16, "SCALAR", values.len(), &bytes)
    }

    /// Adds an attribute to the first primitive.
    pub fn attribute(&mut self, name: &str, accessor: usize) -> &mut Self {
        self.primitive()["attributes"][name] = json!(accessor);
        self
    }

    pub fn primitive(&mut self) -> &mut Value {
        &mut self.json["meshes"][0]["primitives"][0]
    }

    /// Sets the value at a JSON pointer whose parent is there.
    pub fn set(mut self, pointer: &str, value: Value) -> Self {
        let (parent, key) = pointer.rsplit_once('/').unwrap();
        let parent = self.json.pointer_mut(parent).unwrap();
        match key.parse::<usize>() {
            Ok(index) if parent.is_array() => parent[index] = value,
            _ => parent[key] = value,
        }
        self
    }

    pub fn bytes(&self) -> Vec<u8> {
        let mut json = self.json.clone();
        if !self.bin.is_empty() {
            let uri = format!("data:application/octet-stream;base64,{}", base64::encode(&self.bin));
            json["buffers"] = json!([{"byteLength": self.bin.len(), "uri": uri}]);
        }
        serde_json::to_vec(&json).unwrap()
    }

    pub fn load(&self) -> Scene {
        load(&self.bytes()).unwrap_or_else(|error| panic!("{error}"))
    }

    /// The message that the model is refused with.
    pub fn refused(&self) -> String {
        refused(load(&self.bytes()))
    }
}

pub fn load(bytes: &[u8]) -> Result<Scene> {
    load_slice(bytes, None, Path::new("model.gltf"), &Limits::default())
}

/// The message of a refusal, which must be one line and never come from the last net.
pub fn refused(result: Result<Scene>) -> String {
    let message = result.map(|scene| scene.notes).expect_err("must be refused").to_string();
    assert!(!message.contains("internal error"), "{message}");
    assert!(!message.contains('\n'), "{message}");
    message
}

/// A binary glTF of any chunks.
pub fn glb(chunks: &[(&[u8; 4], &[u8])]) -> Vec<u8> {
    let mut body = Vec::new();
    for (kind, data) in chunks {
        body.extend((data.len() as u32).to_le_bytes());
        body.extend_from_slice(*kind);
        body.extend_from_slice(data);
    }
    let mut bytes = b"glTF".to_vec();
    bytes.extend(2_u32.to_le_bytes());
    bytes.extend((12 + body.len() as u32).to_le_bytes());
    bytes.extend(body);
    bytes
}

/// A PNG of one colour.
pub fn png(width: u32, height: u32, color: [u8; 4]) -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    let image = image::RgbaImage::from_pixel(width, height, image::Rgba(color));
    image.write_to(&mut bytes, image::ImageFormat::Png).unwrap();
    bytes.into_inner()
}

pub fn push(array: &mut Value, item: Value) -> usize {
    if array.is_null() {
        *array = json!([]);
    }
    let array = array.as_array_mut().unwrap();
    array.push(item);
    array.len() - 1
}

fn lanes(kind: &str) -> usize {
    match kind {
        "SCALAR" => 1,
        "VEC2" => 2,
        "VEC3" => 3,
        "VEC4" => 4,
        "MAT4" => 16,
        other => panic!("{other}"),
    }
}

/// Whether some note holds `text`.
pub fn noted(scene: &Scene, text: &str) -> bool {
    scene.notes.iter().any(|note| note.contains(text))
}
