//! Lights of the scene's nodes (KHR_lights_punctual), in world space.

use std::f32::consts::FRAC_PI_2;

use glam::{DVec3, Vec3};
use gltf::json::Index;
use gltf::json::extensions::scene::khr_lights_punctual::{Light as Source, Type};
use gltf::json::validation::Checked;

use super::document::Document;
use super::nodes::Nodes;
use super::notes::Notes;
use crate::scene::camera::relative;
use crate::scene::{Light, LightKind};

/// Lights beyond this number are dropped: each costs a shadow ray at every hit.
const MAX_LIGHTS: usize = crate::constants::MAX_LIGHTS as usize;

/// One light for each node of the scene that has one, in node order.
///
/// A light shines along −z of its node; the node's scale does not reach it.
pub fn placed(document: &Document, nodes: &Nodes, origin: DVec3, notes: &Notes) -> Vec<Light> {
    let mut lights = Vec::new();
    let mut dropped = 0;
    for &node in &nodes.in_scene {
        let owner = &document.root.nodes[node];
        let Some(index) = owner.extensions.as_ref().and_then(|all| all.khr_lights_punctual.as_ref()) else {
            continue;
        };
        let Some(source) = source(document, index.light) else { continue };
        let name = owner.name.clone().or_else(|| source.name.clone());
        let name = name.unwrap_or_else(|| format!("light {}", index.light.value()));
        if lights.len() == MAX_LIGHTS {
            dropped += 1;
            continue;
        }
        let world = nodes.world[node];
        let direction = (-world.matrix3.z_axis).try_normalize().unwrap_or(DVec3::NEG_Z).as_vec3().normalize();
        let intensity = (Vec3::from_array(source.color) * source.intensity).max(Vec3::ZERO);
        let position = relative(world.translation, origin);
        if !intensity.is_finite() || !position.is_finite() {
            notes.add("lights", || format!("light {name}: its intensity or place is not finite: dropped"));
            continue;
        }
        match kind(source, position, direction, &name, notes) {
            Some(kind) => lights.push(Light { name, kind, intensity }),
            None => notes.add("lights", || format!("light {name}: of a type that is not known: dropped")),
        }
    }
    if dropped > 0 {
        notes.add("lights", || format!("{dropped} lights beyond the first {MAX_LIGHTS} are dropped"));
    }
    lights
}

fn source(document: &Document, light: Index<Source>) -> Option<&Source> {
    document.root.extensions.as_ref()?.khr_lights_punctual.as_ref()?.lights.get(light.value())
}

fn kind(source: &Source, position: Vec3, direction: Vec3, name: &str, notes: &Notes) -> Option<LightKind> {
    let range = match source.range {
        Some(range) if range > 0.0 => range,
        Some(range) => {
            notes.add("lights", || format!("light {name}: its range is {range}: taken as infinite"));
            f32::INFINITY
        }
        None => f32::INFINITY,
    };
    match source.type_ {
        Checked::Valid(Type::Directional) => Some(LightKind::Directional { direction }),
        Checked::Valid(Type::Point) => Some(LightKind::Point { position, range }),
        Checked::Valid(Type::Spot) => {
            let cone = source.spot.as_ref()?;
            let outer = cone.outer_cone_angle.clamp(1e-4, FRAC_PI_2);
            let inner = cone.inner_cone_angle.clamp(0.0, outer);
            if outer != cone.outer_cone_angle || inner != cone.inner_cone_angle {
                notes.add("lights", || format!("light {name}: its cone angles are clamped"));
            }
            Some(LightKind::Spot {
                position,
                direction,
                range,
                inner_cos: inner.cos(),
                outer_cos: outer.cos(),
            })
        }
        Checked::Invalid => None,
    }
}
