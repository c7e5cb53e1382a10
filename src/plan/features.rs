//! What shaders are compiled with.

use super::needs::{Needs, SLOTS, Used};
use crate::constants::*;
use crate::scene::{Background, LightKind, Scene, patch::Targets};

/// Bits of `FEATURE_…` that the scene needs.
pub fn wanted(scene: &Scene, used: &Used, targets: &Targets, specular: bool, needs: &mut Needs) -> u32 {
    let lit = !scene.lights.is_empty();
    let mut features = 0;
    let mut feature = |needed: bool, bit: u32, what: &str, why: &str| {
        if needs.part(needed, what, why) {
            features |= bit;
        }
    };
    for (slot, what) in SLOTS.iter().enumerate() {
        feature(used.slots >> slot & 1 == 1, 1 << slot, what, "no material in use has one that shows");
    }
    feature(used.shaded, FEATURE_NORMALS, "vertex normals", "all objects are unlit, and none is specular");
    for (set, bit, what) in [
        (0, FEATURE_FIRST_UV, "first texture coordinates"),
        (1, FEATURE_SECOND_UV, "second texture coordinates"),
    ] {
        feature(used.uv_sets >> set & 1 == 1, bit, what, "no texture that shows takes its place from them");
    }
    feature(used.emission, FEATURE_EMISSION, "emission", "no material in use emits");
    feature(
        lit && used.glossy,
        FEATURE_HIGHLIGHTS,
        "highlights",
        "no material in use shows a highlight of a light",
    );
    feature(!scene.geometry.colors.is_empty(), FEATURE_VERTEX_COLORS, "vertex colours", "no mesh has any");
    feature(used.masked, FEATURE_ALPHA_TEST, "alpha test", "no material in use has alpha mode MASK");
    feature(
        used.blended,
        FEATURE_BLENDING,
        "blending and sorting",
        "no material in use has alpha mode BLEND",
    );
    let has = |is: fn(&LightKind) -> bool| scene.lights.iter().any(|light| is(&light.kind));
    for (needed, bit, what, why) in [
        (
            has(|kind| matches!(kind, LightKind::Directional { .. })),
            FEATURE_DIRECTIONAL_LIGHTS,
            "directional lights",
            "the scene has none",
        ),
        (
            has(|kind| matches!(kind, LightKind::Spot { .. })),
            FEATURE_SPOT_LIGHTS,
            "spot lights",
            "the scene has none",
        ),
        (
            has(|kind| match kind {
                LightKind::Point { range, .. } | LightKind::Spot { range, .. } => range.is_finite(),
                LightKind::Directional { .. } => false,
            }),
            FEATURE_LIGHT_RANGES,
            "ranges of lights",
            "no light ends anywhere",
        ),
    ] {
        feature(needed, bit, what, why);
    }
    if specular {
        feature(
            used.transmits,
            FEATURE_TRANSMISSION,
            "refraction in shaders",
            "no specular object transmits",
        );
        feature(
            targets.targets.iter().any(|target| target.patch.is_some()),
            FEATURE_PATCHES,
            "candidate patches",
            "nothing that can be reflected is planar",
        );
    }
    feature(
        matches!(scene.background, Background::Environment(_)),
        FEATURE_PANORAMA,
        "panorama",
        "no --environment surrounds the scene",
    );
    features
}
