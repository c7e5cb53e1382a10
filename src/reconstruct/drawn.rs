//! What a frame draws of leaves, whichever way they are reconstructed.

use std::mem;

use glam::Vec3;

use super::blocks::Sources;
use super::leaves::{Group, Leaves};
use super::paper::PaperLeaves;

/// The assembled leaves of a frame.
#[derive(Debug)]
pub enum Drawn {
    /// Paths intersected per fragment (design §5).
    Exact(Leaves),
    /// Coordinates and colours interpolated (paper §4).
    Paper(PaperLeaves),
}

impl Drawn {
    /// Bytes of the buffers that [`hand_over`](Self::hand_over) fills.
    pub fn bytes(&self) -> [u64; 3] {
        match self {
            Self::Exact(Leaves { vertices, leaves, nodes, .. }) => {
                let nodes: usize = nodes.iter().map(|part| size_of_val(part.as_slice())).sum();
                [size_of_val(vertices.as_slice()), size_of_val(leaves.as_slice()), nodes]
            }
            Self::Paper(PaperLeaves { vertices, leaves, .. }) => {
                [size_of_val(vertices.as_slice()), size_of_val(leaves.as_slice()), 0]
            }
        }
        .map(|bytes| bytes as u64)
    }

    /// Hands on what the shaders read, vertices (buffer 0), leaf records (1) and node table (2), in parts that follow one
    /// another. Each is freed once it is handed on, for there may be as much of them as of all else: groups and numbers stay.
    ///
    /// # Errors
    /// Whatever `take` returns.
    pub fn hand_over<E>(&mut self, mut take: impl FnMut(usize, &[u8]) -> Result<(), E>) -> Result<(), E> {
        use bytemuck::cast_slice;
        match self {
            Self::Exact(Leaves { vertices, leaves, nodes, .. }) => {
                for part in mem::take(nodes) {
                    take(2, cast_slice(&part))?;
                }
                take(0, cast_slice(&mem::take(vertices)))?;
                take(1, cast_slice(&mem::take(leaves)))
            }
            Self::Paper(PaperLeaves { vertices, leaves, .. }) => {
                take(0, cast_slice(&mem::take(vertices)))?;
                take(1, cast_slice(&mem::take(leaves)))
            }
        }
    }

    /// The groups in the order of the records, with the number of leaves of each.
    pub fn groups(&self) -> &[(Group, u32)] {
        match self {
            Self::Exact(leaves) => &leaves.groups,
            Self::Paper(leaves) => &leaves.groups,
        }
    }

    /// Number of leaves.
    pub fn len(&self) -> u64 {
        self.groups().iter().map(|&(_, count)| u64::from(count)).sum()
    }

    /// Whether all that is blended is among them.
    pub fn veiled(&self) -> bool {
        matches!(self, Self::Exact(Leaves { veiled: true, .. }))
    }

    /// Takes what of them gets colours of the plain picture: see [`Leaves::rest`].
    pub fn take_rest(&mut self) -> Vec<([Vec3; 3], Sources)> {
        match self {
            Self::Exact(leaves) => mem::take(&mut leaves.rest),
            Self::Paper(_) => Vec::new(),
        }
    }

    /// Whether nothing is drawn.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Leaves of specular objects that are defined, undefined, and whose pixels were traced.
    pub fn kinds(&self) -> [u32; 3] {
        match self {
            Self::Exact(leaves) => [leaves.defined, leaves.undefined, leaves.traced],
            Self::Paper(leaves) => [leaves.defined, leaves.undefined, 0],
        }
    }

    /// Components of Eq. 3 that are not zero everywhere, as bits of `COMPONENT_…`.
    pub fn components(&self) -> u32 {
        match self {
            Self::Exact(leaves) => leaves.components(),
            Self::Paper(leaves) => leaves.components,
        }
    }
}
