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

/// Most heights of corners above planes that are looked at beside those of the first normal, before the answer is that
/// objects may meet: some tens of milliseconds, and more than a thousand flat mirrors that are all turned differently.
const MOST_HEIGHTS: usize = 1 << 24;

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
    let corners_of = |object: &Object| object.faces.clone().flat_map(|face| scene.geometry.corners(face));
    let corners = || objects().flat_map(corners_of);
    let (low, high) = corners().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), corner| {
        (low.min(corner), high.max(corner))
    });
    let tolerance = f64::from(FLAT * (high - low).length());
    let Some(facets) = objects().map(|object| facet(scene, object)).collect::<Option<Vec<_>>>() else {
        return true;
    };

    // By normal: how high all corners reach along it.
    let mut spans: HashMap<[u32; 3], Span> = HashMap::new();
    let corner_count = corners().count();
    let mut one_plane = true;
    for facet in &facets {
        let normal = (facet.normal + 0.0).to_array().map(f32::to_bits); // -0.0 is 0.0
        let all = *spans.entry(normal).or_insert_with(|| Span::along(facet.normal, corners()));
        if (spans.len() - 1) * corner_count > MOST_HEIGHTS {
            return true;
        }
        let own = Span::along(facet.normal, corners_of(facet.object));
        let height = facet.normal.as_dvec3().dot(facet.origin.as_dvec3());
        // An object that is not flat may see itself.
        let lowest_seen = if facet.both_sides { all.low } else { own.low };
        if all.high - height > tolerance || lowest_seen - height < -tolerance {
            return true;
        }
        one_plane &= all.low - height >= -tolerance;
    }
    !one_plane && share_a_point(scene, topology, &facets)
}

/// Lowest and highest of some points along a direction.
#[derive(Clone, Copy)]
struct Span {
    low: f64,
    high: f64,
}

impl Span {
    fn along(direction: Vec3, points: impl Iterator<Item = Vec3>) -> Self {
        let direction = direction.as_dvec3();
        points.map(|point| direction.dot(point.as_dvec3())).fold(
            Self { low: f64::INFINITY, high: f64::NEG_INFINITY },
            |Self { low, high }, height| Self { low: low.min(height), high: high.max(height) },
        )
    }
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
