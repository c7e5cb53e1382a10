//! Vertices of leaves on the device: words, with those attributes alone that the scene needs.

use glam::{Vec2, Vec3, Vec4};
use half::f16;
use rayon::prelude::*;

use crate::constants::*;

/// All that a vertex can have.
#[derive(Debug, Clone, Copy, Default)]
pub struct Attributes {
    /// Relative to the scene's origin.
    pub position: Vec3,
    /// Interpolated linearly, not of unit length.
    pub normal: Vec3,
    /// Both sets of texture coordinates.
    pub uv: [Vec2; 2],
    /// Linear vertex colour.
    pub color: Vec4,
    /// Tangent and handedness.
    pub tangent: Vec4,
}

/// Where the attributes of a vertex lie, in words from its start: its position first, then those that are needed.
///
/// The shader learns of it by specialization constants (glsl/vertex_fetch.glsl). An attribute at 0, where the
/// position is, is left out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct VertexLayout {
    /// Words of a vertex.
    pub words: u32,
    /// The normal: three floats.
    pub normal: u32,
    /// Each set of texture coordinates: two floats.
    pub uv: [u32; 2],
    /// The colour: four halves.
    pub color: u32,
    /// Tangent and handedness: four halves.
    pub tangent: u32,
}

impl VertexLayout {
    /// The layout that shaders compiled with `features`, bits of `FEATURE_…`, read.
    pub fn of(features: u32) -> Self {
        let mut words = 3;
        let mut attribute = |feature: u32, size: u32| {
            let at = if features & feature == 0 { 0 } else { words };
            words += if at == 0 { 0 } else { size };
            at
        };
        Self {
            normal: attribute(FEATURE_NORMALS, 3),
            uv: [attribute(FEATURE_FIRST_UV, 2), attribute(FEATURE_SECOND_UV, 2)],
            color: attribute(FEATURE_VERTEX_COLORS, 2),
            tangent: attribute(FEATURE_NORMAL_TEXTURE, 2),
            words,
        }
    }

    /// Bytes of a vertex.
    pub fn bytes(self) -> u64 {
        4 * u64::from(self.words)
    }

    /// The shader's specialization constants: number and value.
    pub fn constants(self) -> [(u32, u32); 6] {
        let Self { words, normal, uv: [first, second], color, tangent } = self;
        [
            (VERTEX_WORDS_ID, words),
            (NORMAL_AT_ID, normal),
            (FIRST_UV_AT_ID, first),
            (SECOND_UV_AT_ID, second),
            (COLOR_AT_ID, color),
            (TANGENT_AT_ID, tangent),
        ]
    }

    /// The words of `count` vertices, of which `attributes` tells the attributes.
    pub fn pack(self, count: usize, attributes: impl Fn(usize) -> Attributes + Sync) -> Vec<u32> {
        let mut words = vec![0; count * self.words as usize];
        words
            .par_chunks_exact_mut(self.words as usize)
            .with_min_len(64)
            .enumerate()
            .for_each(|(index, vertex)| self.write(vertex, &attributes(index)));
        words
    }

    fn write(self, vertex: &mut [u32], attributes: &Attributes) {
        let Attributes { position, normal, uv, color, tangent } = attributes;
        let mut put = |at: u32, words: &[u32]| {
            vertex[at as usize..at as usize + words.len()].copy_from_slice(words);
        };
        put(0, &position.to_array().map(f32::to_bits));
        if self.normal != 0 {
            put(self.normal, &normal.to_array().map(f32::to_bits));
        }
        for (at, uv) in self.uv.into_iter().zip(uv).filter(|&(at, _)| at != 0) {
            put(at, &uv.to_array().map(f32::to_bits));
        }
        for (at, value) in
            [(self.color, color), (self.tangent, tangent)].into_iter().filter(|&(at, _)| at != 0)
        {
            put(at, &[pack_halves(value.x, value.y), pack_halves(value.z, value.w)]);
        }
    }
}

/// GLSL's `packHalf2x16`.
fn pack_halves(low: f32, high: f32) -> u32 {
    u32::from(f16::from_f32(low).to_bits()) | u32::from(f16::from_f32(high).to_bits()) << 16
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn attributes_lie_side_by_side_in_any_choice() {
        let bits = [
            FEATURE_NORMALS,
            FEATURE_FIRST_UV,
            FEATURE_SECOND_UV,
            FEATURE_VERTEX_COLORS,
            FEATURE_NORMAL_TEXTURE,
        ];
        for choice in 0..1_u32 << bits.len() {
            let chosen = |i: usize| choice >> i & 1 == 1;
            let layout = VertexLayout::of((0..bits.len()).filter(|&i| chosen(i)).map(|i| bits[i]).sum());
            let places = [layout.normal, layout.uv[0], layout.uv[1], layout.color, layout.tangent];
            let mut end = 3;
            for (i, (at, size)) in places.into_iter().zip([3, 2, 2, 2, 2]).enumerate() {
                assert_eq!(at, if chosen(i) { end } else { 0 }, "{choice:#b}: attribute {i}");
                end += if chosen(i) { size } else { 0 };
            }
            assert_eq!(layout.words, end, "{choice:#b}");
        }
    }

    #[test]
    fn what_is_packed_is_what_was_given() {
        let given = Attributes {
            position: Vec3::new(1.0, 2.0, 3.0),
            normal: Vec3::new(4.0, 5.0, 6.0),
            uv: [Vec2::new(7.0, 8.0), Vec2::new(9.0, 10.0)],
            color: Vec4::new(0.25, 0.5, 0.75, 1.0),
            tangent: Vec4::new(1.0, 0.0, 0.0, -1.0),
        };
        let floats = |words: &[u32]| words.iter().map(|&word| f32::from_bits(word)).collect::<Vec<_>>();
        let all = VertexLayout::of(FEATURE_EVERYTHING).pack(2, |_| given);
        assert_eq!(all.len(), 28);
        assert_eq!(floats(&all[14..24]), (1..=10).map(|n| n as f32).collect::<Vec<_>>());
        assert_eq!(all[24..], [0x3800_3400, 0x3c00_3a00, 0x0000_3c00, 0xbc00_0000]);
        let few = VertexLayout::of(FEATURE_SECOND_UV).pack(1, |_| given);
        assert_eq!(floats(&few), [1.0, 2.0, 3.0, 9.0, 10.0]);
    }
}
