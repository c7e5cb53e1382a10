//! The binary tree that the wide one is collapsed of, by a builder that suits the faces.

use std::time::Duration;

use obvhs::{
    BvhBuildParams,
    aabb::Aabb,
    bvh2::{Bvh2, builder::build_bvh2},
};
use rustc_hash::FxHashMap;

use super::split;

/// Faces in heaps from which on they are split from the top. Both the greedy build and its repair take time with the square
/// of a heap: what all overlaps all is merged pair by pair, and looked for everywhere. So many take some hundredths of a second.
const HEAPED: usize = 1024;

/// Layers of boxes from which on faces of about one size, at one place, are a heap. Meshes have a few, foliage a dozen.
const LAYERS: f32 = 32.0;

/// Faces that are looked at to find heaps, at most, and in each of these at least.
const LOOKED_AT: usize = 1 << 16;
const FEWEST: u32 = 16;

/// The tree over `boxes`, a face a leaf, since its collapse makes wider ones.
pub fn build(boxes: &[Aabb]) -> Bvh2 {
    if boxes.is_empty() {
        return Bvh2::default();
    }
    if heaped(boxes) >= HEAPED {
        return split::build(boxes);
    }
    build_bvh2(boxes, params(boxes.len()), &mut Duration::default())
}

/// Reinsertion repairs the greedy build over so many `faces`: all nodes of a small scene, where it pays back within a
/// frame, and as many of a large one as keep the time in proportion.
fn params(faces: usize) -> BvhBuildParams {
    BvhBuildParams {
        reinsertion_batch_ratio: (20_000.0 / faces as f32).clamp(0.05, 1.0),
        max_prims_per_leaf: 1,
        ..BvhBuildParams::medium_build()
    }
}

/// About how many faces lie in heaps: faces are sorted into cells as large as themselves, and the layers in each counted.
fn heaped(boxes: &[Aabb]) -> usize {
    let stride = boxes.len().div_ceil(LOOKED_AT);
    let mut cells: FxHashMap<(u32, [i32; 3]), (u32, f32)> = FxHashMap::default();
    for face in boxes.iter().step_by(stride) {
        let side = power_above(face.diagonal().max_element());
        let place = (face.center() / side).floor().to_array().map(|along| along as i32);
        let [x, y, z] = (face.diagonal() / side).to_array();
        let (count, layers) = cells.entry((side.to_bits(), place)).or_default();
        *count += 1;
        *layers += (x * y + y * z + z * x) / 3.0;
    }
    let is_heap = |&&(count, layers): &&(u32, f32)| count >= FEWEST && layers * stride as f32 >= LAYERS;
    cells.values().filter(is_heap).map(|&(count, _)| count as usize * stride).sum()
}

/// The next power of two above a length, or what is next to it of those that floats hold.
fn power_above(length: f32) -> f32 {
    const EXPONENT: u32 = 0x7f80_0000;
    let exponent = length.to_bits() & EXPONENT;
    f32::from_bits((exponent + 0x0080_0000).min(EXPONENT - 0x0080_0000))
}

#[cfg(test)]
mod tests {
    use glam::{Vec3, Vec3A, vec3};

    use super::*;
    use crate::scene::Scene;
    use crate::scene::demo::{Demo, Mesh, SceneBuilder, matte, shape};

    /// Boxes of the faces of a scene, as [`Tracer`](crate::trace::Tracer) has them.
    fn boxes(scene: &Scene) -> Vec<Aabb> {
        let faces = 0..scene.geometry.faces.len() as u32;
        faces
            .map(|face| {
                let [a, b, c] = scene.geometry.corners(face).map(Vec3A::from);
                Aabb { min: a.min(b).min(c) - 1e-6, max: a.max(b).max(c) + 1e-6 }
            })
            .collect()
    }

    fn boxes_of(meshes: impl IntoIterator<Item = Mesh>) -> Vec<Aabb> {
        let mut builder = SceneBuilder::new("boxes");
        let material = builder.material(matte("any"));
        for mesh in meshes {
            builder.mesh("mesh", mesh, material);
        }
        boxes(&builder.build().unwrap())
    }

    /// Squares around one place, none a copy of another: each larger than the one before; each turned on; each beside it.
    fn heap(kind: usize, count: u32) -> Vec<Aabb> {
        boxes_of((0..count).map(|index| {
            let share = index as f32 / count as f32;
            let (sin, cos) = (share * std::f32::consts::TAU).sin_cos();
            let [corner, u, v] = match kind {
                0 => [vec3(-1.0, -1.0, 0.0) * (1.0 + share), Vec3::X * 2.0, Vec3::Y * 2.0]
                    .map(|v| v * (1.0 + share)),
                1 => [vec3(-cos, -1.0, -sin), vec3(cos, 0.0, sin) * 2.0, Vec3::Y * 2.0],
                _ => [vec3(-1.0, -1.0, share * 1e-3), Vec3::X * 2.0, Vec3::Y * 2.0],
            };
            shape::plane(corner, u, v, 1.0)
        }))
    }

    /// All that a tree over `boxes` must be; its depth.
    fn checked(tree: &Bvh2, boxes: &[Aabb]) -> usize {
        let (mut seen, mut deepest) = (vec![false; boxes.len()], 0);
        let mut waiting = vec![(0, 1)];
        while let Some((node, depth)) = waiting.pop() {
            deepest = deepest.max(depth);
            let node = &tree.nodes[node as usize];
            let holds = |other: &Aabb| node.aabb().union(other) == *node.aabb();
            if node.is_leaf() {
                assert_eq!(node.prim_count, 1);
                let face = tree.primitive_indices[node.first_index as usize] as usize;
                assert!(holds(&boxes[face]) && !std::mem::replace(&mut seen[face], true));
            } else {
                for child in [node.first_index, node.first_index + 1] {
                    assert!(holds(tree.nodes[child as usize].aabb()));
                    waiting.push((child, depth + 1));
                }
            }
        }
        assert!(seen.iter().all(|&seen| seen));
        deepest
    }

    /// Every level of a tree that is split from the top costs a look at each face, so a low tree is made in time.
    #[test]
    fn heaps_are_split_from_the_top() {
        for kind in 0..3 {
            let boxes = heap(kind, 1000);
            assert!(heaped(&boxes) >= HEAPED, "{kind}: {}", heaped(&boxes));
            let depth = checked(&build(&boxes), &boxes);
            assert!(depth <= 16, "{kind}: a tree of depth {depth} over {} faces", boxes.len());
        }
        // Also where they are but a part of what is there.
        let ball = boxes_of([shape::sphere(Vec3::X * 30.0, 20.0, 5)]);
        let both = [heap(0, 1000), ball].concat();
        assert!(heaped(&both) >= HEAPED && heaped(&both) <= 2200, "{}", heaped(&both));
        checked(&build(&both), &both);
    }

    #[test]
    fn meshes_are_no_heaps() {
        for demo in [Demo::Cup, Demo::CupAndGlass, Demo::Mirror] {
            assert!(heaped(&boxes(&demo.scene())) < 100, "{}", heaped(&boxes(&demo.scene())));
        }
        let planes = (0..400).map(|i| shape::plane(Vec3::Z * (i as f32), Vec3::X * 9.0, Vec3::Y * 9.0, 1.0));
        for boxes in [
            boxes_of([shape::sphere(Vec3::ZERO, 1.0, 6)]),
            boxes_of([shape::sphere(Vec3::ONE * 1e3, 1.0, 5)]),
            boxes_of(planes),
        ] {
            assert_eq!(heaped(&boxes), 0);
        }
    }

    /// Boxes for which the heuristic cuts off one face at a time: each is as large as all before it and lies beyond them.
    #[test]
    fn no_boxes_make_a_deep_tree() {
        let mut boxes = Vec::new();
        let mut at = Vec3A::ZERO;
        for power in 0..120 {
            for _ in 0..10 {
                let side = Vec3A::splat(2.0_f32.powi(power - 60));
                boxes.push(Aabb { min: at, max: at + side });
                at += side;
            }
        }
        let depth = checked(&split::build(&boxes), &boxes);
        assert!(depth <= 16 + 3 * 11, "{depth}");
        let same = vec![boxes[0]; 5000];
        assert_eq!(checked(&split::build(&same), &same), 14);
    }
}
