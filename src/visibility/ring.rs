//! The one-ring rule: faces that touch a visible face may be visible too, though smaller than a pixel.

use std::collections::HashMap;

use glam::Vec3;

use super::Class;
use crate::scene::{Scene, View};

/// Which faces meet at each position.
///
/// Vertices meet where their positions are equal bit for bit, so that seams in normals or texture
/// coordinates do not separate faces.
#[derive(Debug, Clone)]
pub struct Adjacency {
    /// Number of the position of each vertex.
    places: Vec<u32>,
    /// Where each position's faces start in `faces`; one more at the end.
    starts: Vec<u32>,
    /// Faces at each position, ascending.
    faces: Vec<u32>,
}

impl Adjacency {
    /// The adjacency of all faces of `scene`.
    pub fn new(scene: &Scene) -> Self {
        let geometry = &scene.geometry;
        let mut numbers: HashMap<[u32; 3], u32> = HashMap::with_capacity(geometry.positions.len());
        let places: Vec<u32> = geometry
            .positions
            .iter()
            .map(|position| {
                let next = numbers.len() as u32;
                // Adding zero makes −0 and 0 the same bits.
                *numbers.entry(position.to_array().map(|x| (x + 0.0).to_bits())).or_insert(next)
            })
            .collect();
        let mut starts = vec![0_u32; numbers.len() + 1];
        for &vertex in geometry.faces.iter().flatten() {
            starts[places[vertex as usize] as usize + 1] += 1;
        }
        for place in 1..starts.len() {
            starts[place] += starts[place - 1];
        }
        let mut ends = starts.clone();
        let mut faces = vec![0; 3 * geometry.faces.len()];
        for (face, vertices) in (0..).zip(&geometry.faces) {
            for &vertex in vertices {
                let end = &mut ends[places[vertex as usize] as usize];
                faces[*end as usize] = face;
                *end += 1;
            }
        }
        Self { places, starts, faces }
    }

    /// Faces that share a position with `face`, itself included; a face may come more than once.
    pub fn around<'a>(&'a self, scene: &'a Scene, face: u32) -> impl Iterator<Item = u32> + 'a {
        scene.geometry.faces[face as usize].into_iter().flat_map(|vertex| {
            let place = self.places[vertex as usize] as usize;
            self.faces[self.starts[place] as usize..self.starts[place + 1] as usize].iter().copied()
        })
    }

    /// `visible` and the faces around them that could be seen, ascending (design §3).
    ///
    /// A face is added if it needs samples at all, reaches into the view, and faces the eye or is
    /// double-sided.
    pub fn one_ring(&self, scene: &Scene, classes: &[Class], view: &View, visible: &[u32]) -> Vec<u32> {
        let mut marked = vec![false; scene.geometry.faces.len()];
        let mut ring = visible.to_vec();
        for &face in visible {
            marked[face as usize] = true;
        }
        for &face in visible {
            for neighbour in self.around(scene, face) {
                if !marked[neighbour as usize] {
                    // Marked even if refused, to ask only once.
                    marked[neighbour as usize] = true;
                    if could_be_seen(scene, classes, view, neighbour) {
                        ring.push(neighbour);
                    }
                }
            }
        }
        ring.sort_unstable();
        ring
    }
}

fn could_be_seen(scene: &Scene, classes: &[Class], view: &View, face: u32) -> bool {
    if classes[scene.geometry.face_objects[face as usize] as usize] == Class::Occluder {
        return false;
    }
    let corners = scene.geometry.corners(face);
    let towards = scene.geometry.area_normal(face).dot(view.direction_to(corners[0]));
    (towards < 0.0 || scene.face_material(face).double_sided) && reaches_into(view, corners)
}

/// Whether a triangle may reach into the view: false only if all corners are beyond one side of it.
fn reaches_into(view: &View, corners: [Vec3; 3]) -> bool {
    let clip = corners.map(|corner| view.clip_from_eye_relative() * (corner - view.eye).extend(1.0));
    let outside = |beyond: fn(glam::Vec4) -> bool| clip.into_iter().all(beyond);
    !(outside(|p| p.x < -p.w)
        || outside(|p| p.x > p.w)
        || outside(|p| p.y < -p.w)
        || outside(|p| p.y > p.w)
        || outside(|p| p.w <= 0.0 || p.z > p.w))
}
