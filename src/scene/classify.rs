//! Which objects are specular VT objects (paper §4; design §2).

use super::{Scene, TextureSlot};
use crate::error::{Error, Result};

/// What decides over an object's class, beside its material.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct VtRules {
    /// Largest roughness of a specular object (0.1).
    pub roughness_threshold: f32,
    /// Node, mesh or material names that are VT objects whatever their material says.
    pub force: Vec<String>,
    /// Node, mesh or material names that are not.
    pub forbid: Vec<String>,
}

impl Default for VtRules {
    fn default() -> Self {
        Self { roughness_threshold: 0.1, force: Vec::new(), forbid: Vec::new() }
    }
}

/// Sets [`Object::vt`](super::Object::vt) of every object.
///
/// Names given by the user win over `extras`, which win over the material. A texture on roughness,
/// metallic or transmission classifies by its mean, which is noted.
///
/// # Errors
/// [`Error::Option`] for a name that no object, mesh or material has.
pub fn classify(scene: &mut Scene, rules: &VtRules) -> Result<()> {
    for (option, names) in [("--vt", &rules.force), ("--no-vt", &rules.forbid)] {
        for name in names {
            if !(0..scene.objects.len()).any(|object| bears(scene, object, name)) {
                return Err(Error::Option(format!(
                    "{option} {name}: no node, mesh or material has this name; there are {}",
                    known_names(scene)
                )));
            }
        }
    }
    let mut notes = Vec::new();
    let by_material: Vec<bool> = (0..scene.materials.len())
        .map(|material| specular_by_material(scene, material, rules.roughness_threshold, &mut notes))
        .collect();
    scene.notes.append(&mut notes);
    for index in 0..scene.objects.len() {
        let object = &scene.objects[index];
        let forced = rules.force.iter().any(|name| bears(scene, index, name));
        let forbidden = rules.forbid.iter().any(|name| bears(scene, index, name));
        let extra = object.vt_extra.or(scene.materials[object.material as usize].vt_extra);
        let vt = match (forbidden, forced) {
            (true, _) => false,
            (_, true) => true,
            _ => extra.unwrap_or(by_material[object.material as usize]),
        };
        scene.objects[index].vt = vt && !scene.materials[scene.objects[index].material as usize].unlit;
    }
    for (material, specular) in scene.materials.iter().zip(scene.specular_materials()) {
        if specular && material.normal_texture.is_some() {
            scene.notes.push(format!(
                "material {}: its normal map bends what it reflects, so that its pixels are traced one by one",
                material.name
            ));
        }
    }
    Ok(())
}

fn bears(scene: &Scene, object: usize, name: &str) -> bool {
    let object = &scene.objects[object];
    object.name == name
        || object.mesh_name.as_deref() == Some(name)
        || scene.materials[object.material as usize].name == name
}

fn known_names(scene: &Scene) -> String {
    let mut names: Vec<&str> = scene
        .objects
        .iter()
        .flat_map(|object| [object.name.as_str(), scene.materials[object.material as usize].name.as_str()])
        .collect();
    names.sort_unstable();
    names.dedup();
    let more = names.len().saturating_sub(12);
    names.truncate(12);
    let list = names.join(", ");
    if more > 0 { format!("{list} and {more} more") } else { list }
}

fn specular_by_material(scene: &Scene, index: usize, threshold: f32, notes: &mut Vec<String>) -> bool {
    let material = &scene.materials[index];
    let mut mean = |slot: Option<TextureSlot>, channel: usize, what: &str| match slot {
        None => 1.0,
        Some(slot) => {
            let image = &scene.images[scene.textures[slot.texture as usize].image as usize];
            let sum: u64 = image.rgba.iter().skip(channel).step_by(4).map(|&value| u64::from(value)).sum();
            let mean = sum as f32 / 255.0 / (image.width as f32 * image.height as f32);
            notes.push(format!(
                "material {}: {what} texture classifies by its mean, {mean:.2}",
                material.name
            ));
            mean
        }
    };
    let textured = material.metallic_roughness_texture;
    let specular_candidate = material.metallic >= 0.5 || material.transmission > 0.0;
    if !specular_candidate {
        return false;
    }
    let roughness = material.roughness * mean(textured, 1, "roughness");
    let metallic = material.metallic * mean(textured, 2, "metallic");
    let transmission = material.transmission * mean(material.transmission_texture, 0, "transmission");
    roughness <= threshold && (metallic >= 0.5 || transmission > 0.0)
}
