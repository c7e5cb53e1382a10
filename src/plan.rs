//! What a frame needs, decided once from scene and options, and what it leaves out.

use crate::constants::{
    COMPONENT_REFLECTED, COMPONENT_REFLECTED_COMB, COMPONENT_TRANSMITTED, COMPONENT_TRANSMITTED_COMB,
};
use crate::options::{Mode, Options, Shadows};
use crate::reconstruct::passes::{ColorPass, color_passes};
use crate::reconstruct::table::slots;
use crate::report::stats::LeftOut;
use crate::scene::{Material, Scene};

/// The stages, passes and buffers of a frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// Whether specular objects are traced.
    pub specular: bool,
    /// Whether diffuse objects are traced for their shadows.
    pub receivers: bool,
    /// Whether any specular object reflects.
    pub reflection: bool,
    /// Whether any specular object transmits.
    pub transmission: bool,
    /// The colour passes.
    pub passes: Vec<ColorPass>,
    /// Which textures are uploaded.
    pub textures: Vec<bool>,
    /// Whether any material has textures beyond base colour and emission.
    pub detail_textures: bool,
    /// Whether any material has a texture on its emission.
    pub emission_textures: bool,
    /// Whether any material has a texture on its base colour.
    pub base_textures: bool,
    /// Whether any material shows highlights of lights.
    pub highlights: bool,
    /// What is left out, and why.
    pub left_out: Vec<LeftOut>,
    /// Whether passes are drawn although they add nothing.
    pub everything: bool,
}

impl Plan {
    /// The plan of `scene` under `options`.
    pub fn new(scene: &Scene, options: &Options) -> Self {
        let everything = options.everything;
        let mut left_out = Vec::new();
        let mut need = |needed: bool, what: &str, why: &str| {
            if !needed && !everything {
                left_out.push(LeftOut { what: what.into(), why: why.into() });
            }
            needed || everything
        };
        let vt = || scene.objects.iter().filter(|object| object.vt);
        let material = |object: &crate::scene::Object| &scene.materials[object.material as usize];
        let transmits = |m: &Material| m.transmission > 0.0;
        let reflects = |m: &Material| m.metallic > 0.0 || transmits(m) || options.scene.fresnel;

        let any_vt = scene.objects.iter().any(|object| object.vt);
        let lit = !scene.lights.is_empty();
        let specular = any_vt && !scene.geometry.faces.is_empty();
        let receivers = options.scene.shadows == Shadows::All
            && lit
            && scene.objects.iter().any(|object| !object.vt && !material(object).unlit);
        if !specular {
            need(false, "specular tracing", "no object is specular");
        }
        if !receivers {
            need(
                false,
                "shadows on diffuse objects",
                match (options.scene.shadows, lit) {
                    (Shadows::All, true) => "no diffuse object is lit",
                    (Shadows::All, false) => "the scene has no light",
                    _ => "--shadows leaves them out",
                },
            );
        }
        if !specular && !receivers {
            need(
                false,
                "bounding volume hierarchy, ID buffer, readback and refinement",
                "nothing is traced: all objects are rasterised in the ordinary way",
            );
        }
        let reflection = need(
            vt().any(|o| reflects(material(o))),
            "reflected texture and its pass",
            "no specular object reflects",
        );
        let transmission = need(
            vt().any(|o| transmits(material(o))),
            "transmitted texture and its pass, refraction",
            "no specular object transmits",
        );
        let mut passes = color_passes(options.method.mode, options.method.equation).to_vec();
        if options.method.mode == Mode::MultiPass {
            let absent = |needed: bool, bits: u32| if needed { 0 } else { bits };
            let unneeded = absent(reflection, COMPONENT_REFLECTED | COMPONENT_REFLECTED_COMB)
                | absent(transmission, COMPONENT_TRANSMITTED | COMPONENT_TRANSMITTED_COMB);
            passes.retain(|pass| pass.components & !unneeded != 0);
        }

        let mut textures = vec![false; scene.textures.len()];
        let mut used_materials = vec![false; scene.materials.len()];
        for object in &scene.objects {
            used_materials[object.material as usize] = true;
        }
        let used = || scene.materials.iter().zip(&used_materials).filter(|(_, used)| **used).map(|(m, _)| m);
        for slot in used().flat_map(slots).flatten() {
            textures[slot.texture as usize] = true;
        }
        let detail_textures = need(
            used().any(|material| slots(material)[2..].iter().any(Option::is_some)),
            "normal, roughness, specular and transmission textures",
            "no material has one",
        );
        let emission_textures =
            need(used().any(|m| m.emissive_texture.is_some()), "emission texture", "no material has one");
        let base_textures = need(
            used().any(|m| m.base_color_texture.is_some()),
            "base colour texture",
            "no material has one",
        );
        let highlights = need(
            lit && used().any(|m| m.roughness > 0.0 && !m.unlit && (m.metallic > 0.0 || m.specular > 0.0)),
            "highlights",
            "no material shows a highlight of a light",
        );
        Self {
            emission_textures,
            base_textures,
            highlights,
            specular,
            receivers,
            reflection,
            transmission,
            passes,
            textures,
            detail_textures,
            left_out,
            everything,
        }
    }

    /// The colour passes of a frame in which only `present` components of Eq. 3 are not zero everywhere, and
    /// the others as left out.
    pub fn passes_for(&self, present: u32) -> (Vec<ColorPass>, Vec<LeftOut>) {
        let adds = |pass: &&ColorPass| self.everything || pass.components & present != 0;
        let (drawn, dropped): (Vec<&ColorPass>, _) = self.passes.iter().partition(adds);
        let left_out = |pass: &ColorPass| LeftOut {
            what: format!("{} pass", pass.name),
            why: "its colours are zero at every vertex".into(),
        };
        (drawn.into_iter().copied().collect(), dropped.into_iter().map(left_out).collect())
    }

    /// Whether anything is traced: hierarchy, visibility, samples.
    pub fn traces(&self) -> bool {
        self.specular || self.receivers
    }
}
