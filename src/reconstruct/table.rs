//! The scene table: materials and targets as the shaders read them, a fixed number of texels each.

use glam::{Vec3, Vec4};

use super::bank::Bank;
use crate::constants::*;
use crate::scene::patch::{MAX_HALF_PLANES, Target, TargetId, Targets};
use crate::scene::{AlphaMode, Material, Scene, TextureSlot};

/// Four words: a texel of a table.
pub type Texel = [u32; 4];

/// Materials, then targets.
#[derive(Debug)]
pub struct SceneTable {
    /// Its texels.
    pub texels: Vec<Texel>,
    materials: u32,
}

/// Slots of a material in the order of the table: see glsl/material.glsl.
pub fn slots(material: &Material) -> [Option<TextureSlot>; 7] {
    [
        material.base_color_texture,
        material.emissive_texture,
        material.metallic_roughness_texture,
        material.normal_texture,
        material.specular_texture,
        material.specular_color_texture,
        material.transmission_texture,
    ]
}

impl SceneTable {
    /// The table of `scene`; `fresnel` gives metals Schlick's approximation.
    pub fn new(scene: &Scene, targets: &Targets, bank: &Bank, fresnel: bool) -> Self {
        let mut texels = Vec::with_capacity(
            scene.materials.len() * MATERIAL_TEXELS as usize + targets.targets.len() * TARGET_TEXELS as usize,
        );
        for (material, specular) in scene.materials.iter().zip(scene.specular_materials()) {
            texels.extend(pack_material(material, bank, fresnel, specular));
        }
        let table = Self { materials: scene.materials.len() as u32, texels };
        let packed: Vec<_> = targets.targets.iter().map(|target| table.pack_target(target)).collect();
        Self { texels: table.texels.into_iter().chain(packed.into_iter().flatten()).collect(), ..table }
    }

    /// First texel of a material.
    pub fn material(&self, index: u32) -> u32 {
        index * MATERIAL_TEXELS
    }

    /// First texel of a target.
    pub fn target(&self, target: TargetId) -> u32 {
        self.materials * MATERIAL_TEXELS + target * TARGET_TEXELS
    }

    fn pack_target(&self, target: &Target) -> Vec<Texel> {
        let mut texels = vec![[0; 4]; TARGET_TEXELS as usize];
        let Some(patch) = &target.patch else { return texels };
        let outline = patch.outline.as_deref().unwrap_or_default();
        texels[0] = floats(patch.normal.extend(patch.distance));
        texels[1] = [self.material(target.material), outline.len() as u32, u32::MAX, 0];
        for row in 0..2 {
            texels[2 + row] = floats(patch.base_uv[row]);
            texels[4 + row] = floats(patch.emissive_uv[row]);
        }
        for (texel, &side) in
            texels[TARGET_OUTLINE as usize..].iter_mut().zip(outline.iter().take(MAX_HALF_PLANES))
        {
            *texel = floats(side);
        }
        texels
    }
}

fn pack_material(material: &Material, bank: &Bank, fresnel: bool, specular: bool) -> Vec<Texel> {
    let mut flags = 0;
    for (set, flag) in [
        (material.unlit, MATERIAL_UNLIT),
        (matches!(material.alpha_mode, AlphaMode::Mask(_)), MATERIAL_MASK),
        (material.alpha_mode == AlphaMode::Blend, MATERIAL_BLEND),
        (material.volume.is_some(), MATERIAL_SOLID),
        (fresnel, MATERIAL_SCHLICK),
        (specular, MATERIAL_SPECULAR),
    ] {
        if set {
            flags |= flag;
        }
    }
    let cutoff = if let AlphaMode::Mask(cutoff) = material.alpha_mode { cutoff } else { 0.0 };
    let slots = slots(material);
    let [base, emissive, metallic_roughness, normal, specular, specular_color, transmission] =
        slots.map(|slot| bank.reference(slot));
    let mut texels = vec![
        floats(material.base_color),
        floats(material.emissive.extend(material.ior)),
        floats(Vec4::new(material.metallic, material.roughness, material.specular, material.transmission)),
        floats(material.specular_color.extend(material.normal_scale)),
        [base, emissive, metallic_roughness, normal],
        [specular, specular_color, transmission, flags],
        floats(Vec3::ZERO.extend(0.0).with_x(cutoff)),
    ];
    for slot in slots {
        let (matrix, translation, set) = slot.map_or((glam::Mat2::IDENTITY, glam::Vec2::ZERO, 0), |slot| {
            (slot.transform.matrix2, slot.transform.translation, u32::from(slot.uv_set))
        });
        let (u, v) = (matrix.row(0), matrix.row(1));
        texels.push([u.x.to_bits(), u.y.to_bits(), translation.x.to_bits(), set]);
        texels.push([v.x.to_bits(), v.y.to_bits(), translation.y.to_bits(), 0]);
    }
    debug_assert_eq!(texels.len(), MATERIAL_TEXELS as usize);
    texels
}

/// The bits of four floats.
pub fn floats(value: Vec4) -> Texel {
    value.to_array().map(f32::to_bits)
}
