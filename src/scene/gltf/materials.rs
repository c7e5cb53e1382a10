//! Materials in use, defaults filled in and values brought into range.

use std::collections::BTreeMap;
use std::path::Path;

use glam::{Vec3, Vec4};
use gltf::json::material::AlphaMode as Alpha;
use gltf::json::validation::Checked;

use super::document::Document;
use super::mesh::Parts;
use super::nodes::vt_extra;
use super::notes::Notes;
use super::textures::Textures;
use crate::error::{Error, Result};
use crate::scene::{AlphaMode, Material, Volume};

/// Index in the file, or `None` for glTF's default material, to index in the scene.
pub type MaterialMap = BTreeMap<Option<usize>, u32>;

/// Index of refraction that stands for an infinite one, which the file writes as 0.
const INFINITE_IOR: f32 = 1e6;

/// The materials that drawn primitives use, in the order of the file, the default one first.
pub fn in_use(
    document: &Document,
    parts: &Parts,
    textures: &mut Textures,
    file: &Path,
    notes: &Notes,
) -> Result<(Vec<Material>, MaterialMap)> {
    let mut map: MaterialMap = parts.materials(document).into_iter().map(|material| (material, 0)).collect();
    let mut materials = Vec::with_capacity(map.len());
    for (index, slot) in &mut map {
        *slot = materials.len() as u32;
        materials.push(match index {
            Some(index) => convert(document, *index, textures, file, notes)?,
            None => Material { metallic: 1.0, ..Material::default() },
        });
    }
    Ok((materials, map))
}

fn convert(
    document: &Document,
    index: usize,
    textures: &mut Textures,
    file: &Path,
    notes: &Notes,
) -> Result<Material> {
    let source = &document.root.materials[index];
    let name = source.name.clone().unwrap_or_else(|| format!("material {index}"));
    let owner = source.name.as_ref().map_or_else(|| name.clone(), |name| format!("material {name}"));
    let range = Range { file, index, owner: &owner, notes };
    let mut slot = |reference: Option<super::textures::Reference>, srgb: bool| {
        reference.and_then(|reference| textures.slot(&document.root, reference, srgb, &owner, notes))
    };
    let pbr = &source.pbr_metallic_roughness;
    let extensions = source.extensions.as_ref();
    let specular = extensions.and_then(|all| all.specular.as_ref());
    let transmission = extensions.and_then(|all| all.transmission.as_ref());
    let strength = extensions.and_then(|all| all.emissive_strength.as_ref());
    let strength = strength.map_or(1.0, |strength| strength.emissive_strength.0);
    let emissive = Vec3::from_array(source.emissive_factor.0)
        * range.within("emissiveStrength", strength, 0.0, f32::MAX)?;

    Ok(Material {
        base_color: Vec4::from_array(range.all("baseColorFactor", pbr.base_color_factor.0, 0.0, 1.0)?),
        base_color_texture: slot(pbr.base_color_texture.as_ref().map(Into::into), true),
        metallic: range.within("metallicFactor", pbr.metallic_factor.0, 0.0, 1.0)?,
        roughness: range.within("roughnessFactor", pbr.roughness_factor.0, 0.0, 1.0)?,
        metallic_roughness_texture: slot(pbr.metallic_roughness_texture.as_ref().map(Into::into), false),
        normal_texture: slot(source.normal_texture.as_ref().map(Into::into), false),
        normal_scale: range.within(
            "normalTexture.scale",
            source.normal_texture.as_ref().map_or(1.0, |normal| normal.scale),
            -f32::MAX,
            f32::MAX,
        )?,
        emissive: Vec3::from_array(range.all("emissiveFactor", emissive.to_array(), 0.0, f32::MAX)?),
        emissive_texture: slot(source.emissive_texture.as_ref().map(Into::into), true),
        specular: range.within(
            "specularFactor",
            specular.map_or(1.0, |it| it.specular_factor.0),
            0.0,
            1.0,
        )?,
        specular_texture: slot(specular.and_then(|it| it.specular_texture.as_ref()).map(Into::into), false),
        specular_color: Vec3::from_array(range.all(
            "specularColorFactor",
            specular.map_or([1.0; 3], |it| it.specular_color_factor.0),
            0.0,
            f32::MAX,
        )?),
        specular_color_texture: slot(
            specular.and_then(|it| it.specular_color_texture.as_ref()).map(Into::into),
            true,
        ),
        ior: match extensions.and_then(|all| all.ior.as_ref()).map_or(1.5, |it| it.ior.0) {
            0.0 => INFINITE_IOR,
            ior => range.within("ior", ior, 1.0, INFINITE_IOR)?,
        },
        transmission: range.within(
            "transmissionFactor",
            transmission.map_or(0.0, |it| it.transmission_factor.0),
            0.0,
            1.0,
        )?,
        transmission_texture: slot(
            transmission.and_then(|it| it.transmission_texture.as_ref()).map(Into::into),
            false,
        ),
        volume: match extensions.and_then(|all| all.volume.as_ref()) {
            Some(volume) if volume.thickness_factor.0 > 0.0 => Some(Volume {
                attenuation_color: Vec3::from_array(range.all(
                    "attenuationColor",
                    volume.attenuation_color.0,
                    0.0,
                    1.0,
                )?),
                attenuation_distance: range.distance(volume.attenuation_distance.0),
            }),
            _ => None,
        },
        alpha_mode: match source.alpha_mode {
            Checked::Valid(Alpha::Mask) => {
                let cutoff = source.alpha_cutoff.unwrap_or_default().0;
                AlphaMode::Mask(range.within("alphaCutoff", cutoff, 0.0, f32::MAX)?)
            }
            Checked::Valid(Alpha::Blend) => AlphaMode::Blend,
            Checked::Valid(Alpha::Opaque) | Checked::Invalid => AlphaMode::Opaque,
        },
        double_sided: source.double_sided,
        unlit: extensions.is_some_and(|all| all.unlit.is_some()),
        vt_extra: vt_extra(&source.extras),
        name,
    })
}

/// One number, or several as the file writes them.
fn shown(values: &[f32]) -> String {
    let words: Vec<String> = values.iter().map(f32::to_string).collect();
    if let [word] = &words[..] { word.clone() } else { format!("[{}]", words.join(", ")) }
}

/// Brings the numbers of one material into range, with a note, and refuses those that are not numbers.
struct Range<'a> {
    file: &'a Path,
    index: usize,
    owner: &'a str,
    notes: &'a Notes,
}

impl Range<'_> {
    fn within(&self, property: &str, value: f32, low: f32, high: f32) -> Result<f32> {
        Ok(self.all(property, [value], low, high)?[0])
    }

    fn all<const N: usize>(&self, property: &str, values: [f32; N], low: f32, high: f32) -> Result<[f32; N]> {
        if values.iter().any(|value| !value.is_finite()) {
            let object = format!("materials[{}].{property}", self.index);
            return Err(Error::scene(self.file, object, "too large for a 32-bit number"));
        }
        let clamped = values.map(|value| value.clamp(low, high));
        if clamped != values {
            self.notes.add("materials", || {
                let (given, used) = (shown(&values), shown(&clamped));
                format!("{}: {property} {given} is out of range: {used} is used", self.owner)
            });
        }
        Ok(clamped)
    }

    /// The attenuation distance, for which infinity is the neutral value.
    fn distance(&self, distance: f32) -> f32 {
        if distance > 0.0 {
            return distance;
        }
        let owner = self.owner;
        self.notes.add("materials", || format!("{owner}: attenuationDistance {distance}: taken as infinite"));
        f32::INFINITY
    }
}
