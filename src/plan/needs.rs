//! What a scene uses, and the list of what it does not.

use crate::reconstruct::table::slots;
use crate::report::stats::LeftOut;
use crate::scene::{AlphaMode, Material, Scene, TextureSlot};

/// Collects what is left out.
pub struct Needs {
    everything: bool,
    /// What is in the plan.
    pub used: Vec<String>,
    /// What is left out, and why.
    pub left_out: Vec<LeftOut>,
}

impl Needs {
    /// With `everything`, no part is left out.
    pub fn new(everything: bool) -> Self {
        Self { everything, used: Vec::new(), left_out: Vec::new() }
    }

    /// Whether a part is in the plan: if the scene needs it, or if everything is asked for.
    pub fn part(&mut self, needed: bool, what: &str, why: &str) -> bool {
        let included = needed || self.everything;
        if included {
            self.used.push(what.into());
        } else {
            self.leave_out(what, why);
        }
        included
    }

    /// Notes a part that an option switches off, whatever else is asked for.
    pub fn option(&mut self, off: bool, what: &str, why: &str) {
        if off {
            self.leave_out(what, why);
        } else {
            self.used.push(what.into());
        }
    }

    /// Notes a part that is left out whatever is asked for.
    pub fn leave_out(&mut self, what: &str, why: &str) {
        self.left_out.push(LeftOut { what: what.into(), why: why.into() });
    }
}

/// Texture slots of a material in words, in the order of [`slots`].
pub const SLOTS: [&str; 7] = [
    "base colour texture",
    "emission texture",
    "metalness and roughness texture",
    "normal map, tangents",
    "highlight strength texture",
    "highlight colour texture",
    "transmission texture",
];

/// What the objects of a scene make use of.
#[derive(Debug, Default)]
pub struct Used {
    /// Whether any object is a specular VT object.
    pub specular: bool,
    /// Whether any diffuse object shows the light of lights.
    pub lit: bool,
    /// Whether any specular object reflects.
    pub reflects: bool,
    /// Whether any specular object transmits.
    pub transmits: bool,
    /// Whether any object has a normal that shows.
    pub shaded: bool,
    /// Slots with a texture that shows, a bit each, in the order of [`slots`].
    pub slots: u32,
    /// Sets of texture coordinates that they read, a bit each.
    pub uv_sets: u32,
    /// Which textures show.
    pub textures: Vec<bool>,
    /// Whether any material emits.
    pub emission: bool,
    /// Whether any material shows highlights.
    pub glossy: bool,
    /// Whether any material is cut out by alpha.
    pub masked: bool,
    /// Whether any material covers by alpha.
    pub blended: bool,
}

impl Used {
    /// What `scene` makes use of; `fresnel` lets every specular object reflect.
    pub fn of(scene: &Scene, fresnel: bool) -> Self {
        let mut used = Self { textures: vec![false; scene.textures.len()], ..Self::default() };
        for object in scene.objects.iter().filter(|object| !object.faces.is_empty()) {
            let material = &scene.materials[object.material as usize];
            // A texture can make a metal a dielectric in places.
            let all_metal = material.metallic >= 1.0 && material.metallic_roughness_texture.is_none();
            let transmits = material.transmission > 0.0 && !all_metal;
            used.specular |= object.vt;
            used.lit |= !object.vt && !material.unlit;
            used.shaded |= object.vt || !material.unlit;
            used.reflects |= object.vt && (material.metallic > 0.0 || transmits || fresnel);
            used.transmits |= object.vt && transmits;
            used.emission |= emits(material);
            used.glossy |= glossy(material);
            used.masked |= matches!(material.alpha_mode, AlphaMode::Mask(_));
            used.blended |= material.alpha_mode == AlphaMode::Blend;
            for (index, slot) in showing(material).into_iter().enumerate() {
                let Some(slot) = slot else { continue };
                used.slots |= 1 << index;
                used.uv_sets |= 1 << slot.uv_set;
                used.textures[slot.texture as usize] = true;
            }
        }
        used
    }
}

fn emits(material: &Material) -> bool {
    !material.unlit && material.emissive.max_element() > 0.0
}

fn glossy(material: &Material) -> bool {
    material.roughness > 0.0 && !material.unlit && (material.metallic > 0.0 || material.specular > 0.0)
}

/// The slots of a material without those that multiply zero.
fn showing(material: &Material) -> [Option<TextureSlot>; 7] {
    let shaded = !material.unlit;
    let dielectric = shaded && material.specular > 0.0 && material.specular_color.max_element() > 0.0;
    let shows = [
        true,
        emits(material),
        shaded && (material.metallic > 0.0 || material.roughness > 0.0),
        shaded,
        dielectric,
        dielectric,
        shaded && material.transmission > 0.0,
    ];
    let mut slots = slots(material);
    slots.iter_mut().zip(shows).filter(|(_, shows)| !shows).for_each(|(slot, _)| *slot = None);
    slots
}
