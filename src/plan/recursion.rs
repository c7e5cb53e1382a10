//! Whether a path that has met a specular face can ever meet another.
//!
//! Told of flat objects alone. Convex bodies do not see themselves either; but a sample at a vertex of one starts
//! from a normal between those of its faces, and can graze the next of them.

use std::collections::HashMap;

use glam::Vec3;

use crate::scene::topology::Topology;
use crate::scene::{Object, Scene};

/// Distance from a plane, as a share of the extent of all specular faces, that a face in it may have.
const FLAT: f32 = 1e-6;

/// A flat specular object.
struct Facet<'s> {
    object: &'s Object,
    origin: Vec3,
    normal: Vec3,
    /// Whether rays can leave it on the side against its normal too.
    both_sides: bool,
}

/// Whether any ray that a specular object reflects or transmits may meet a specular object, itself included.
///
/// A ray that leaves a flat object, lifted above its facet, stays on one side of its plane. On that side nothing
/// specular may lie: in front of a mirror that is seen from its front alone, on both sides of any other. Where
/// objects in different planes share a point, the normal there is none of theirs: no promise is made.
pub fn can_meet(scene: &Scene, topology: &Topology) -> bool {
    let objects = || scene.objects.iter().filter(|object| object.vt && !object.faces.is_empty());
    let corners = |object: &Object| {
        object.faces.clone().flat_map(|face| scene.geometry.corners(face)).collect::<Vec<Vec3>>()
    };
    let (low, high) =
        objects().flat_map(corners).fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), corner| {
            (low.min(corner), high.max(corner))
        });
    let tolerance = FLAT * (high - low).length();
    let Some(facets) = objects().map(|object| facet(scene, object)).collect::<Option<Vec<_>>>() else {
        return true;
    };

    // Quadratic in the number of objects at worst; the first pair that sees each other ends it.
    let height = |facet: &Facet, corner: Vec3| (corner - facet.origin).dot(facet.normal);
    let mut one_plane = true;
    for from in &facets {
        for to in &facets {
            // An object that is not flat may see itself.
            let both_sides = from.both_sides || std::ptr::eq(from, to);
            for height in corners(to.object).into_iter().map(|corner| height(from, corner)) {
                if height > tolerance || (both_sides && height < -tolerance) {
                    return true;
                }
                one_plane &= height >= -tolerance;
            }
        }
    }
    !one_plane && share_a_point(scene, topology, &facets)
}

/// The plane of an object, as its area is turned; `None` if it has no direction.
fn facet<'s>(scene: &'s Scene, object: &'s Object) -> Option<Facet<'s>> {
    let geometry = &scene.geometry;
    let normals = || object.faces.clone().map(|face| geometry.area_normal(face));
    let largest = normals().max_by(|a, b| a.length_squared().total_cmp(&b.length_squared()))?;
    let normal = crate::scene::mesh::unit(largest)?;
    let material = &scene.materials[object.material as usize];
    let turned = normals().any(|other| other.dot(normal) < 0.0);
    Some(Facet {
        object,
        origin: geometry.corners(object.faces.start)[0],
        normal,
        both_sides: material.double_sided || material.transmission > 0.0 || turned,
    })
}

/// Whether any two of the objects do.
fn share_a_point(scene: &Scene, topology: &Topology, facets: &[Facet]) -> bool {
    let mut owners: HashMap<u32, usize> = HashMap::new();
    facets.iter().enumerate().any(|(index, facet)| {
        let vertices = facet.object.faces.clone().flat_map(|face| scene.geometry.faces[face as usize]);
        vertices
            .map(|vertex| topology.point[vertex as usize])
            .any(|point| *owners.entry(point).or_insert(index) != index)
    })
}
