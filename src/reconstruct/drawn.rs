//! What a frame draws of leaves, whichever way they are reconstructed.

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
    /// Vertices, leaf records and node table as the shaders read them, each in parts that follow one another.
    pub fn buffers(&self) -> [Vec<&[u8]>; 3] {
        use bytemuck::cast_slice;
        match self {
            Self::Exact(leaves) => [
                vec![cast_slice(&leaves.vertices)],
                vec![cast_slice(&leaves.leaves)],
                leaves.nodes.iter().map(|part| cast_slice(part)).collect(),
            ],
            Self::Paper(leaves) => {
                [vec![cast_slice(&leaves.vertices)], vec![cast_slice(&leaves.leaves)], Vec::new()]
            }
        }
    }

    /// Frees what [`buffers`](Self::buffers) gives, once the device has it and [`components`](Self::components) were asked for:
    /// groups and numbers stay.
    pub fn free_buffers(&mut self) {
        match self {
            Self::Exact(leaves) => {
                (leaves.vertices, leaves.leaves, leaves.nodes) = Default::default();
            }
            Self::Paper(leaves) => (leaves.vertices, leaves.leaves) = Default::default(),
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

    /// Whether nothing is drawn.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Defined and undefined leaves of specular objects.
    pub fn defined(&self) -> (u32, u32) {
        match self {
            Self::Exact(leaves) => (leaves.defined, leaves.undefined),
            Self::Paper(leaves) => (leaves.defined, leaves.undefined),
        }
    }

    /// Components of Eq. 3 that are not zero everywhere, as bits of `COMPONENT_…`.
    pub fn components(&self) -> u32 {
        match self {
            Self::Exact(leaves) => leaves.components(),
            Self::Paper(leaves) => leaves.components(),
        }
    }
}
