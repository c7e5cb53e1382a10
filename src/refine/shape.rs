//! How a path that samples share is followed between them (design §5).

use crate::scene::patch::{ENVIRONMENT, Targets};
use crate::trace::sample::Node;

/// What is interpolated of a path between its nodes, and where it leads then.
///
/// Where it is `own`, every fragment follows its own ray, bent once at the surface: no sample says where that ends.
/// Elsewhere the last segments of the samples' paths are blended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shape {
    /// The surroundings, by direction.
    Sky {
        /// Whether the direction is the fragment's own.
        own: bool,
    },
    /// One planar patch, by the ray that meets its plane.
    Plane {
        /// Whether the ray is the fragment's own.
        own: bool,
    },
    /// Several planar patches: of those that the ray meets inside their outlines, the nearest.
    Planes {
        /// Whether the ray is the fragment's own.
        own: bool,
    },
    /// One chart, by its texture coordinates.
    Chart,
}

impl Shape {
    /// The shape of a path with these `nodes`, one at least; `None` if they end on different targets that no ray could tell
    /// apart.
    pub fn of(nodes: &[&Node], targets: &Targets) -> Option<Self> {
        let own = nodes.iter().all(|node| node.is_followed());
        let target = nodes.first()?.target;
        if nodes.iter().any(|node| node.target != target) {
            return nodes.iter().all(|node| targets.is_outlined(node.target)).then_some(Self::Planes { own });
        }
        Some(match &targets.targets[target as usize].patch {
            _ if target == ENVIRONMENT => Self::Sky { own },
            Some(_) => Self::Plane { own },
            None => Self::Chart,
        })
    }
}
