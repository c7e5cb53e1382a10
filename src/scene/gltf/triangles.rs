//! Triangles of a primitive: index lists, strips and fans.

use gltf::json::mesh::{Mode, Primitive, Semantic};
use gltf::json::validation::Checked;
use gltf::json::{Accessor, Index, Root};

use super::accessor::Reader;

/// The accessor of one attribute.
pub fn attribute(primitive: &Primitive, semantic: Semantic) -> Option<Index<Accessor>> {
    primitive.attributes.get(&Checked::Valid(semantic)).copied()
}

/// Whether the primitive is of triangles at all, and not of points or lines.
pub fn are_faces(primitive: &Primitive) -> bool {
    matches!(primitive.mode, Checked::Valid(Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan))
}

/// Number of triangles, and of indices that are left over; zeros for a primitive without positions.
pub fn count(root: &Root, primitive: &Primitive) -> (u64, u64) {
    let Some(positions) = attribute(primitive, Semantic::Positions) else { return (0, 0) };
    let corners = root.accessors[primitive.indices.unwrap_or(positions).value()].count.0;
    match primitive.mode {
        Checked::Valid(Mode::Triangles) => (corners / 3, corners % 3),
        Checked::Valid(Mode::TriangleStrip | Mode::TriangleFan) => (corners.saturating_sub(2), 0),
        _ => (0, 0),
    }
}

/// Vertex numbers of all triangles, counter-clockwise.
///
/// `indices` is `None` for a primitive that takes its vertices in order. Fails with the first index that is
/// not below `vertices`; the primitive restart value is one of those.
pub fn list(
    mode: Mode,
    indices: Option<&Reader>,
    vertices: usize,
    triangles: usize,
) -> Result<Vec<[u32; 3]>, u32> {
    let corner = |position: usize| -> Result<u32, u32> {
        let index = indices.map_or(position as u32, |indices| indices.integers::<1>(position)[0]);
        if (index as usize) < vertices { Ok(index) } else { Err(index) }
    };
    (0..triangles)
        .map(|i| {
            let positions = match mode {
                Mode::TriangleStrip => [i, i + 1 + i % 2, i + 2 - i % 2],
                Mode::TriangleFan => [i + 1, i + 2, 0],
                _ => [3 * i, 3 * i + 1, 3 * i + 2],
            };
            Ok([corner(positions[0])?, corner(positions[1])?, corner(positions[2])?])
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strips_and_fans_keep_their_winding() {
        assert_eq!(list(Mode::TriangleStrip, None, 5, 3).unwrap(), [[0, 1, 2], [1, 3, 2], [2, 3, 4]]);
        assert_eq!(list(Mode::TriangleFan, None, 5, 3).unwrap(), [[1, 2, 0], [2, 3, 0], [3, 4, 0]]);
        assert_eq!(list(Mode::Triangles, None, 6, 2).unwrap(), [[0, 1, 2], [3, 4, 5]]);
        assert_eq!(list(Mode::Triangles, None, 5, 2), Err(5));
    }
}
