//! Paths that a leaf's corners do not share as a whole: part of the leaf ends on one target, part on another, or on none.
//!
//! The light of each part fades towards the corners that lack it, where its texture keeps its place: only the border
//! between the parts is unsharp.

use glam::{Vec3, Vec4};

use super::nodes::{Corner, LeafNodes, Matcher, Place, before, texture_parts};
use super::table::floats;
use crate::constants::*;
use crate::trace::sample::Node;

/// Least cosine between a corner's ray and a plane that it did not meet at which it may stand for a ray that meets it: a
/// flatter one would draw the texture's coordinates towards infinity.
const STEEP: f32 = 0.02;

/// A path as far as it ends on one target: at all corners of a leaf, or at some.
pub(super) struct Part<'n> {
    /// By corner: the node of the path, whatever its target.
    found: [Option<&'n Node>; 3],
    /// Whether this part draws the corner's node.
    drawn: [bool; 3],
    /// Largest radiance of a drawn node.
    pub weight: f32,
}

impl<'n> Part<'n> {
    /// The part that draws those nodes of `found`, one at least, that `drawn` marks.
    pub fn new(found: [Option<&'n Node>; 3], drawn: [bool; 3]) -> Self {
        let mut part = Self { found, drawn, weight: 0.0 };
        let weights = part.nodes().into_iter().flatten().map(|node| node.radiance().max_element());
        part.weight = weights.fold(0.0, f32::max);
        part
    }

    /// The parts of a path by the targets that it ends on.
    pub fn by_target(found: [Option<&'n Node>; 3]) -> impl Iterator<Item = Self> {
        (0..3).filter_map(move |i| {
            let target = found[i]?.target;
            let drawn = found.map(|node| node.is_some_and(|node| node.target == target));
            (!drawn[..i].contains(&true)).then(|| Self::new(found, drawn))
        })
    }

    /// The drawn nodes.
    pub fn nodes(&self) -> [Option<&'n Node>; 3] {
        std::array::from_fn(|i| self.found[i].filter(|_| self.drawn[i]))
    }

    /// The drawn nodes if all corners have one.
    pub fn whole(&self) -> Option<[&'n Node; 3]> {
        let [Some(a), Some(b), Some(c)] = self.nodes() else { return None };
        Some([a, b, c])
    }

    /// What orders parts of equal weight: path and target.
    pub fn order(&self) -> Option<(u32, u32)> {
        self.nodes().into_iter().flatten().map(|node| (node.path, node.target)).min()
    }
}

impl Matcher<'_> {
    /// Encodes a part that some corners lack.
    pub(super) fn encode_part(&self, leaf: &mut LeafNodes, corners: &[Corner; 3], part: &Part) {
        let drawn = part.nodes();
        let Some(first) = drawn.into_iter().flatten().next() else { return };
        let target = &self.targets.targets[first.target as usize];
        let reference = self.base_textures.get(target.material as usize).copied().unwrap_or(NO_TEXTURE);
        let emissive =
            self.scene.materials.get(target.material as usize).is_some_and(|m| m.emissive_texture.is_some());
        let places: [Option<Place>; 3] = match &target.patch {
            Some(patch) => {
                let side = patch.normal.dot(first.direction).signum();
                std::array::from_fn(|i| {
                    let node = part.found[i]?;
                    let meets = patch.normal.dot(node.direction) * side > STEEP
                        && (patch.distance - patch.normal.dot(node.origin)) * side > 0.0;
                    (part.drawn[i] || meets).then(|| corners[i].on_plane(patch, node))
                })
            }
            None => std::array::from_fn(|i| drawn[i].map(|node| corners[i].on_chart(node))),
        };
        // With one place alone there is nothing between which the texture could be told.
        if reference == NO_TEXTURE || emissive || places.iter().flatten().count() < 2 {
            return self.combine(leaf, corners, drawn, Node::radiance);
        }
        let branch = first.first.index();
        let shades: [Vec3; 3] = std::array::from_fn(|i| {
            let shade = |node: &Node| node.throughput * node.local.textured;
            drawn[i].map_or(Vec3::ZERO, |n| before(shade(n), corners[i].sample.primary.attenuation[branch]))
        });
        let elsewhere = mean(&places);
        let places = places.map(|place| place.unwrap_or(elsewhere));
        self.combine(leaf, corners, drawn, |node| node.throughput * node.local.added);
        leaf.note_texture(reference);
        leaf.texels.push([NODE_TEXTURE | (branch as u32) << 3 | 3 << 4, reference, 0, 0]);
        leaf.texels.extend(texture_parts(shades, places).into_iter().flatten().map(floats));
        leaf.count += 1;
    }
}

/// Mean of the places that are known, one at least: the texture does not move towards the corners that lack it.
fn mean(places: &[Option<Place>; 3]) -> Place {
    let known = || places.iter().flatten();
    let share = 1.0 / known().count() as f32;
    Place {
        scale: known().map(|place| place.scale).sum::<f32>() * share,
        bundle: known().map(|place| place.bundle).sum::<Vec4>() * share,
        rest: known().map(|place| place.rest).sum::<Vec4>() * share,
    }
}
