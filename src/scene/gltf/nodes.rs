//! Node transforms: local in `f64` from the text, then world, over a tree of any depth.

use std::path::Path;

use glam::{DAffine3, DMat3, DQuat, DVec3};
use gltf::json::extras::RawValue;
use serde_json::Value;

use super::document::Document;
use super::notes::Notes;
use crate::error::{Error, Result};

/// World transforms of all nodes, and which of them the chosen scene holds.
pub struct Nodes {
    /// Node space to world space.
    pub world: Vec<DAffine3>,
    /// Indices of the nodes of the scene, ascending.
    pub in_scene: Vec<usize>,
}

impl Nodes {
    /// Resolves the tree, which [`validate`](super::validate) has found to be one, for scene `wanted`.
    pub fn resolve(document: &Document, wanted: Option<usize>, file: &Path, notes: &Notes) -> Result<Self> {
        let root = &document.root;
        let children = |node: usize| root.nodes[node].children.iter().flatten().map(|child| child.value());
        let mut has_parent = vec![false; root.nodes.len()];
        (0..root.nodes.len()).flat_map(children).for_each(|child| has_parent[child] = true);
        let parentless: Vec<usize> = (0..root.nodes.len()).filter(|&node| !has_parent[node]).collect();

        // Joints may lie outside of the scene, so every node gets its transform.
        let mut world = document.locals.clone();
        let mut stack = parentless.clone();
        while let Some(node) = stack.pop() {
            for child in children(node) {
                world[child] = world[node] * document.locals[child];
                stack.push(child);
            }
        }

        let mut stack = match chosen_scene(document, wanted, file, notes)? {
            Some(scene) => root.scenes[scene].nodes.iter().map(|node| node.value()).collect(),
            None => parentless,
        };
        let mut in_scene = Vec::new();
        while let Some(node) = stack.pop() {
            in_scene.push(node);
            stack.extend(children(node));
        }
        in_scene.sort_unstable();
        Ok(Self { world, in_scene })
    }
}

fn chosen_scene(
    document: &Document,
    wanted: Option<usize>,
    file: &Path,
    notes: &Notes,
) -> Result<Option<usize>> {
    let scenes = &document.root.scenes;
    if let Some(scene) = wanted
        && scene >= scenes.len()
    {
        let problem = format!("scene {scene} was asked for, but there are {}", scenes.len());
        return Err(Error::scene(file, "scenes", problem));
    }
    if scenes.is_empty() {
        notes.add("scenes", || "the file has no scene: all of its nodes are drawn".into());
        return Ok(None);
    }
    let scene = wanted.or(document.root.scene.map(|scene| scene.value())).unwrap_or(0);
    if scenes.len() > 1 {
        notes.add("scenes", || format!("scene {scene} of {} is drawn", scenes.len()));
    }
    Ok(Some(scene))
}

/// A node's own transform. Whatever has the wrong shape is left for the typed parse to refuse.
pub fn local_transform(node: &Value, index: usize, notes: &Notes) -> DAffine3 {
    if let Some(m) = numbers::<16>(node, "matrix") {
        if [m[3], m[7], m[11], m[15]] != [0.0, 0.0, 0.0, 1.0] {
            notes.add("matrices", || format!("nodes[{index}]: the last row of its matrix is ignored"));
        }
        let columns = DMat3::from_cols(
            DVec3::new(m[0], m[1], m[2]),
            DVec3::new(m[4], m[5], m[6]),
            DVec3::new(m[8], m[9], m[10]),
        );
        return DAffine3::from_mat3_translation(columns, DVec3::new(m[12], m[13], m[14]));
    }
    let vector = |key: &str| numbers::<3>(node, key).map(DVec3::from_array);
    let mut rotation = numbers::<4>(node, "rotation").map_or(DQuat::IDENTITY, DQuat::from_array);
    let squared = rotation.length_squared();
    if (squared - 1.0).abs() > 1e-3 {
        notes.add("rotations", || {
            format!("nodes[{index}]: its rotation is not a unit quaternion: normalised")
        });
    }
    let length = rotation.length();
    rotation = if length > 0.0 && length.is_finite() { rotation / length } else { DQuat::IDENTITY };
    DAffine3::from_scale_rotation_translation(
        vector("scale").unwrap_or(DVec3::ONE),
        rotation,
        vector("translation").unwrap_or(DVec3::ZERO),
    )
}

fn numbers<const N: usize>(node: &Value, key: &str) -> Option<[f64; N]> {
    let list = node.get(key)?.as_array().filter(|list| list.len() == N)?;
    let mut numbers = [0.0; N];
    for (number, value) in numbers.iter_mut().zip(list) {
        *number = value.as_f64()?;
    }
    Some(numbers)
}

/// `extras: {"vt": true|false}`.
pub fn vt_extra(extras: &Option<Box<RawValue>>) -> Option<bool> {
    let extras: Value = serde_json::from_str(extras.as_ref()?.get()).ok()?;
    extras.get("vt")?.as_bool()
}
