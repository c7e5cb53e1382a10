//! Materials that are BLEND although nothing can be seen through them: exporters mark whole models so.

use super::notes::Notes;
use crate::scene::{AlphaMode, Material, Scene};

/// Makes materials opaque that are BLEND with an alpha of 1 wherever they show. The picture is the same, and nothing has to be
/// sorted or traced layer by layer.
pub fn settle(scene: &mut Scene, notes: &Notes) {
    let blends = |material: &Material| material.alpha_mode == AlphaMode::Blend;
    if !scene.materials.iter().any(blends) {
        return;
    }
    let mut covers: Vec<bool> = vec![true; scene.materials.len()];
    for object in &scene.objects {
        let covers = &mut covers[object.material as usize];
        let mut vertices = object.vertices.clone();
        *covers = *covers && vertices.all(|vertex| scene.geometry.color(vertex).w >= 1.0);
    }
    let mut has_holes: Vec<Option<bool>> = vec![None; scene.images.len()];
    for (material, covers) in scene.materials.iter_mut().zip(covers) {
        if !covers || !blends(material) || material.base_color.w < 1.0 {
            continue;
        }
        let is_clear = material.base_color_texture.is_some_and(|slot| {
            let image = scene.textures[slot.texture as usize].image as usize;
            let mut alphas = scene.images[image].rgba.iter().skip(3).step_by(4);
            *has_holes[image].get_or_insert_with(|| alphas.any(|&alpha| alpha < u8::MAX))
        });
        if !is_clear {
            material.alpha_mode = AlphaMode::Opaque;
            notes.add("opaque materials", || {
                format!("material {}: BLEND, but its alpha is 1 everywhere: it is opaque", material.name)
            });
        }
    }
}
