//! From JSON text to the crate's typed tree, with what is valid but unknown to the crate smoothed out first.

use std::path::Path;

use glam::DAffine3;
use gltf::json::Root;
use serde::Deserialize;
use serde_json::Value;

use super::Limits;
use super::nodes::local_transform;
use super::notes::Notes;
use crate::error::{Error, Result};
use crate::memory;

/// Extensions that are read; any other is refused where it is required and noted where it is used.
const SUPPORTED: &[&str] = &[
    "EXT_texture_webp",
    "KHR_lights_punctual",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_volume",
    "KHR_mesh_quantization",
    "KHR_texture_transform",
];

/// Bound on the memory that the JSON takes once parsed: a byte of text can become a hundred.
const MAX_JSON_MEMORY: u64 = 3 << 29;

/// A parsed file.
pub struct Document {
    /// The crate's tree. Its indices are good once [`validate::structure`](super::validate::structure) says so.
    pub root: Root,
    /// Local transform of every node, in the precision of the text (the tree holds `f32`).
    pub locals: Vec<DAffine3>,
    /// Whether the file uses KHR_mesh_quantization, which admits small integers as vertex attributes.
    pub quantized: bool,
}

impl Document {
    /// Parses `json`.
    pub fn parse(json: &[u8], file: &Path, limits: &Limits, notes: &Notes) -> Result<Self> {
        let refuse = |object: &str, problem: String| Error::scene(file, object, problem);
        let parsed = estimated_memory(json);
        if parsed > MAX_JSON_MEMORY {
            return Err(refuse("JSON", "too many values; move data into binary buffers".into()));
        }
        // Data URIs are decoded from it.
        memory::check(parsed + json.len() as u64, "JSON", "move data into binary buffers")?;
        let json = without_padding(json);
        if json.is_empty() {
            return Err(refuse("JSON", "is empty".into()));
        }
        let mut tree: Value =
            serde_json::from_slice(json).map_err(|error| refuse("JSON", error.to_string()))?;

        let required = names(&tree, "extensionsRequired");
        let unsupported: Vec<_> = required.iter().filter(|name| !supported(name)).cloned().collect();
        if !unsupported.is_empty() {
            let problem = format!("needs {}, which is not supported; export without", unsupported.join(", "));
            return Err(refuse("extensionsRequired", problem));
        }
        check_version(&tree).map_err(|problem| refuse("asset", problem))?;
        let used = names(&tree, "extensionsUsed");
        for name in used.iter().filter(|name| !supported(name)) {
            notes.add("extensions", || format!("extension {name} is ignored"));
        }
        let count = tree.get("nodes").and_then(Value::as_array).map_or(0, Vec::len) as u64;
        if count > limits.max_nodes {
            let problem =
                format!("{count} nodes, but the limit is {} (--max-nodes); merge nodes", limits.max_nodes);
            return Err(refuse("nodes", problem));
        }

        smooth(&mut tree, notes);
        let locals = tree.get("nodes").and_then(Value::as_array).map_or_else(Vec::new, |nodes| {
            nodes.iter().enumerate().map(|(index, node)| local_transform(node, index, notes)).collect()
        });
        let root: Root = serde_path_to_error::deserialize(tree).map_err(|error| {
            let path = error.path().to_string();
            refuse(if path == "." { "JSON" } else { &path }, error.into_inner().to_string())
        })?;
        let quantized = required.iter().chain(&used).any(|name| name == "KHR_mesh_quantization");
        Ok(Self { root, locals, quantized })
    }
}

/// URIs of buffers and images, with nothing else of `json` kept; none where it cannot be read.
pub fn uris(json: &[u8]) -> Vec<String> {
    #[derive(Default, Deserialize)]
    #[serde(default)]
    struct Listed {
        buffers: Vec<Named>,
        images: Vec<Named>,
    }
    #[derive(Deserialize)]
    struct Named {
        uri: Option<String>,
    }
    let Listed { buffers, images } = serde_json::from_slice(without_padding(json)).unwrap_or_default();
    buffers.into_iter().chain(images).filter_map(|named| named.uri).collect()
}

/// Some writers pad the JSON chunk with zeros instead of spaces.
fn without_padding(json: &[u8]) -> &[u8] {
    let end = json.iter().rposition(|&byte| byte != 0).map_or(0, |last| last + 1);
    &json[..end]
}

fn supported(name: &str) -> bool {
    SUPPORTED.contains(&name)
}

/// The strings of a top-level array; anything else is left for the typed parse to name.
fn names(tree: &Value, key: &str) -> Vec<String> {
    let list = tree.get(key).and_then(Value::as_array).into_iter().flatten();
    list.filter_map(Value::as_str).map(String::from).collect()
}

fn check_version(tree: &Value) -> Result<(), String> {
    let asset = tree.get("asset").ok_or("missing; this is not glTF 2.0")?;
    let parse = |key: &str| -> Result<Option<(u32, u32)>, String> {
        let Some(value) = asset.get(key) else { return Ok(None) };
        value
            .as_str()
            .and_then(|text| text.split_once('.'))
            .and_then(|(major, minor)| Some((major.parse().ok()?, minor.parse().ok()?)))
            .map(Some)
            .ok_or_else(|| format!("{key} is {value}, not a version"))
    };
    match (parse("version")?, parse("minVersion")?) {
        (Some((2, _)), None) => Ok(()),
        (Some((2, _)), Some(least)) if least <= (2, 0) => Ok(()),
        (Some((2, _)), Some((major, minor))) => Err(format!("needs a reader of glTF {major}.{minor}")),
        (Some((major, minor)), _) => {
            Err(format!("glTF {major}.{minor}, but only 2.0 is supported; convert it"))
        }
        (None, _) => Err("has no version".into()),
    }
}

/// An upper bound on the bytes that `json` takes as a tree and as typed values together.
fn estimated_memory(json: &[u8]) -> u64 {
    /// A map node and the largest typed struct that `{}` can become.
    const OBJECT: u64 = 1000;
    /// A key on the heap.
    const KEY: u64 = 64;
    /// A value in a vector that has grown by doubling.
    const VALUE: u64 = 48;
    let (mut total, mut in_string, mut escaped) = (json.len() as u64, false, false);
    for &byte in json {
        if in_string {
            match byte {
                _ if escaped => escaped = false,
                b'\\' => escaped = true,
                b'"' => in_string = false,
                _ => {}
            }
            continue;
        }
        total += match byte {
            b'"' => {
                in_string = true;
                0
            }
            b'{' => OBJECT,
            b'[' | b',' => VALUE,
            b':' => KEY,
            _ => 0,
        };
    }
    total
}

/// Rewrites what is valid glTF but fails in the crate: scenes without nodes, integers written as `1.0`, and
/// animations, which nobody plays here but whose channels may be of a kind that the crate refuses.
fn smooth(tree: &mut Value, notes: &Notes) {
    let Value::Object(root) = tree else { return };
    if let Some(animations) = root.remove("animations") {
        let count = animations.as_array().map_or(0, Vec::len);
        if count > 0 {
            notes.add("animations", || {
                format!("{count} animations are ignored: nodes are as the file places them")
            });
        }
    }
    // Checked by name above; the crate's own list is shorter.
    root.remove("extensionsRequired");
    for scene in root.get_mut("scenes").and_then(Value::as_array_mut).into_iter().flatten() {
        if let Value::Object(scene) = scene {
            scene.entry("nodes").or_insert_with(|| Value::Array(Vec::new()));
        }
    }
    let mut stack = vec![tree];
    while let Some(value) = stack.pop() {
        match value {
            Value::Number(number) if number.is_f64() => {
                let number = number.as_f64().unwrap_or(f64::NAN);
                if number.fract() == 0.0 && (0.0..9.0e15).contains(&number) {
                    *value = Value::from(number as u64);
                }
            }
            Value::Array(items) => stack.extend(items),
            Value::Object(members) => stack.extend(members.values_mut()),
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_is_bounded_from_the_text() {
        assert!(estimated_memory(br#"{"a":[1,2,3]}"#) >= 1000 + 64 + 3 * 48);
        assert_eq!(estimated_memory(br#""{[,:\"{{{""#), 11, "strings count as their bytes");
    }

    #[test]
    fn versions() {
        let check = |asset: &str| check_version(&serde_json::from_str(asset).unwrap());
        assert!(check(r#"{"asset":{"version":"2.0"}}"#).is_ok());
        assert!(check(r#"{"asset":{"version":"2.1","minVersion":"2.0"}}"#).is_ok());
        assert!(check(r#"{"asset":{"version":"1.0"}}"#).unwrap_err().contains("1.0"));
        assert!(check(r#"{"asset":{"version":"2.0","minVersion":"2.1"}}"#).unwrap_err().contains("2.1"));
        assert!(check(r#"{"asset":{"version":2}}"#).is_err());
        assert!(check(r#"{"asset":{}}"#).is_err() && check("{}").is_err());
    }
}
