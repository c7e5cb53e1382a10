//! Alpha of faces with glTF's alpha mode MASK, for the ID buffer.

use bytemuck::{Pod, Zeroable};
use glam::Vec2;

use super::sampler::level_0;
use crate::{
    error::Result,
    gpu::{DescriptorSet, Format, Resource, SetLayout, Uploads},
    scene::{AlphaMode, Sampler, Scene},
};

/// Alpha at a vertex of a masked object; the shader's `MaskVertex`.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
pub struct MaskVertex {
    /// Transformed coordinates of the base-colour texture.
    pub uv: Vec2,
    /// Base-colour factor times vertex colour.
    pub alpha: f32,
}

/// The mask data of all vertices; of those whose material has no mask it is never read.
pub fn vertices(scene: &Scene) -> Vec<MaskVertex> {
    let mut vertices = vec![MaskVertex::zeroed(); scene.geometry.positions.len()];
    for object in &scene.objects {
        let material = &scene.materials[object.material as usize];
        if !matches!(material.alpha_mode, AlphaMode::Mask(_)) {
            continue;
        }
        for vertex in object.vertices.clone() {
            let slot = material.base_color_texture;
            let uv = slot.map_or(Vec2::ZERO, |slot| slot.transform(scene.geometry.uv(slot.uv_set, vertex)));
            let alpha = material.base_color.w * scene.geometry.color(vertex).w;
            vertices[vertex as usize] = MaskVertex { uv, alpha };
        }
    }
    vertices
}

/// A set with the alpha channel of the base-colour texture of `material`; opaque if it has none.
///
/// # Errors
/// No memory left, or a texture larger than the device allows.
pub fn set(uploads: &mut Uploads, scene: &Scene, layout: &SetLayout, material: u32) -> Result<DescriptorSet> {
    let material = &scene.materials[material as usize];
    let name = format!("alpha of {}", material.name);
    let (alpha, size, sampler) = match material.base_color_texture {
        None => (vec![255], (1, 1), Sampler::default()),
        Some(slot) => {
            let texture = scene.textures[slot.texture as usize];
            let image = &scene.images[texture.image as usize];
            let alpha = image.rgba.iter().skip(3).step_by(4).copied().collect();
            (alpha, (image.width, image.height), texture.sampler)
        }
    };
    let image = uploads.texture(&name, Format::R8, size, &[&alpha], false)?;
    layout.set(&name, &[("alpha_map", Resource::Textures(&[(&image, level_0(&sampler))]))])
}
