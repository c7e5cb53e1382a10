//! Finishes: what is the same at all points of the faces of a material.

use super::shade::Scattering;
use super::{Appearance, Record};
use crate::scene::{Material, Scene, TextureSlot};

/// A material on objects that are VT, or that are not.
pub(super) struct Finish {
    /// Whether nothing but the base colour's texture varies over a face: then points are shaded side by side.
    pub plain: bool,
    /// Index into [`Scene::materials`].
    pub material: u32,
    /// Whether it is on VT objects.
    pub vt: bool,
    /// Its values, no texture looked up.
    pub appearance: Appearance,
    /// How it scatters light, where it is plain.
    pub scattering: Scattering,
    /// Texture of the base colour.
    pub texture: Option<TextureSlot>,
}

/// The finishes of `scene`: each material's, then the same on VT objects.
pub(super) fn finishes(scene: &Scene) -> Vec<Finish> {
    let varied = !scene.geometry.colors.is_empty() || !scene.geometry.uvs[1].is_empty();
    let finish = |(index, material): (usize, &Material), vt| {
        let appearance = Appearance::untextured(material);
        Finish {
            plain: !varied && is_plain(material),
            material: index as u32,
            vt,
            scattering: Scattering::new(scene, &appearance, vt, material.unlit),
            appearance,
            texture: material.base_color_texture,
        }
    };
    scene
        .materials
        .iter()
        .enumerate()
        .flat_map(|material| [finish(material, false), finish(material, true)])
        .collect()
}

/// Where the finish of a face is among them.
#[inline]
pub(super) fn finish_of(record: &Record) -> usize {
    2 * record.material as usize + usize::from(record.vt)
}

fn is_plain(material: &Material) -> bool {
    let Material { base_color_texture, metallic_roughness_texture, normal_texture, emissive_texture, .. } =
        material;
    let Material { specular_texture, specular_color_texture, transmission_texture, .. } = material;
    let others = [
        metallic_roughness_texture,
        normal_texture,
        emissive_texture,
        specular_texture,
        specular_color_texture,
        transmission_texture,
    ];
    others.into_iter().all(Option::is_none) && base_color_texture.is_none_or(|slot| slot.uv_set == 0)
}
