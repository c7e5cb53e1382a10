//! The one-ring rule: faces that touch a visible face may be visible too, though they own no pixel.

use glam::{Mat4, Vec2, Vec3};

use super::Class;
use crate::scene::{Scene, View, topology::Topology};

/// Which faces meet at each point of a [`Topology`].
#[derive(Debug, Clone)]
pub struct Adjacency {
    /// Where each point's faces start in `faces`; one more at the end.
    starts: Vec<u32>,
    /// Faces at each point, ascending.
    faces: Vec<u32>,
}

impl Adjacency {
    /// The adjacency of all faces of `scene`, which `topology` is of.
    pub fn new(scene: &Scene, topology: &Topology) -> Self {
        let geometry = &scene.geometry;
        let mut starts = vec![0_u32; topology.points as usize + 1];
        for &vertex in geometry.faces.iter().flatten() {
            starts[topology.point[vertex as usize] as usize + 1] += 1;
        }
        for point in 1..starts.len() {
            starts[point] += starts[point - 1];
        }
        let mut ends = starts.clone();
        let mut faces = vec![0; 3 * geometry.faces.len()];
        for (face, vertices) in (0..).zip(&geometry.faces) {
            for &vertex in vertices {
                let end = &mut ends[topology.point[vertex as usize] as usize];
                faces[*end as usize] = face;
                *end += 1;
            }
        }
        Self { starts, faces }
    }

    /// Faces that share a point with `face`, itself included; a face may come more than once.
    pub fn around<'a>(
        &'a self,
        scene: &'a Scene,
        topology: &'a Topology,
        face: u32,
    ) -> impl Iterator<Item = u32> + 'a {
        scene.geometry.faces[face as usize].into_iter().flat_map(|vertex| {
            let point = topology.point[vertex as usize] as usize;
            self.faces[self.starts[point] as usize..self.starts[point + 1] as usize].iter().copied()
        })
    }

    /// `visible` and the faces around them that could be seen, ascending (design §3).
    ///
    /// A face is added if it needs samples at all, reaches into the view, and faces the eye or is
    /// double-sided. An added face that lies between all pixel centres could not have owned a pixel even in
    /// plain sight, so its own neighbours are asked in turn: one ring alone would leave gaps where many
    /// faces share a pixel. The result errs towards too many: small faces that are hidden may be among it.
    pub fn one_ring(
        &self,
        scene: &Scene,
        topology: &Topology,
        classes: &[Class],
        view: &View,
        visible: &[u32],
    ) -> Vec<u32> {
        let mut asked = vec![false; scene.geometry.faces.len()];
        for &face in visible {
            asked[face as usize] = true;
        }
        let mut ring = visible.to_vec();
        let mut open = visible.to_vec();
        let clip_from_eye_relative = view.clip_from_eye_relative();
        while let Some(face) = open.pop() {
            for neighbour in self.around(scene, topology, face) {
                if !std::mem::replace(&mut asked[neighbour as usize], true)
                    && could_be_seen(scene, classes, view, &clip_from_eye_relative, neighbour)
                {
                    ring.push(neighbour);
                    if misses_all_centres(view, scene.geometry.corners(neighbour)) {
                        open.push(neighbour);
                    }
                }
            }
        }
        ring.sort_unstable();
        ring
    }
}

fn could_be_seen(
    scene: &Scene,
    classes: &[Class],
    view: &View,
    clip_from_eye_relative: &Mat4,
    face: u32,
) -> bool {
    if classes[scene.geometry.face_objects[face as usize] as usize] == Class::Occluder {
        return false;
    }
    let corners = scene.geometry.corners(face);
    !scene.face_material(face).culls(scene.geometry.area_normal(face), view.direction_to(corners[0]))
        && reaches_into(clip_from_eye_relative, corners.map(|corner| corner - view.eye))
}

/// Whether a triangle, given relative to the eye, may reach into the view: false only if all corners are beyond one side of it.
fn reaches_into(clip_from_eye_relative: &Mat4, corners: [Vec3; 3]) -> bool {
    let clip = corners.map(|corner| *clip_from_eye_relative * corner.extend(1.0));
    let outside = |beyond: fn(glam::Vec4) -> bool| clip.into_iter().all(beyond);
    !(outside(|p| p.x < -p.w)
        || outside(|p| p.x > p.w)
        || outside(|p| p.y < -p.w)
        || outside(|p| p.y > p.w)
        || outside(|p| p.w <= 0.0 || p.z > p.w))
}

/// Whether the image of a triangle surely contains no pixel centre, or only just.
fn misses_all_centres(view: &View, corners: [Vec3; 3]) -> bool {
    /// Triangles with more pixel centres in the box around them are not asked about one by one.
    const MOST_CENTRES: f32 = 64.0;
    /// How far inside a centre must lie to count, in pixels: the rasteriser rounds corners to 1/256.
    const MARGIN: f32 = 1.0 / 64.0;
    let [Some((a, _)), Some((b, _)), Some((c, _))] = corners.map(|corner| view.project(corner)) else {
        return false;
    };
    let first = (a.min(b).min(c) - 0.5).ceil();
    let last = (a.max(b).max(c) - 0.5).floor();
    let count = (last - first + 1.0).max(Vec2::ZERO);
    if count.x * count.y > MOST_CENTRES {
        return false;
    }
    let winding = (b - a).perp_dot(c - a).signum();
    let inside = |centre: Vec2| {
        [(a, b), (b, c), (c, a)].into_iter().all(|(from, to)| {
            let edge = to - from;
            winding * edge.perp_dot(centre - from) > MARGIN * edge.length()
        })
    };
    let mut centres = (0..count.y as u32)
        .flat_map(|y| (0..count.x as u32).map(move |x| first + Vec2::new(x as f32, y as f32) + 0.5));
    !centres.any(inside)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Camera, Projection};

    /// One world unit is one pixel; (0, 0) is the top left corner of the image, y runs down.
    fn misses(corners: [(f32, f32); 3]) -> bool {
        let camera = Camera {
            projection: Projection::Orthographic { xmag: 8.0, ymag: 8.0 },
            ..Camera::look_at(Vec3::new(8.0, -8.0, 5.0), Vec3::new(8.0, -8.0, 0.0), 1.0)
        };
        let view = View::new(&camera, 16, 16, (Vec3::splat(-20.0), Vec3::splat(20.0)));
        misses_all_centres(&view, corners.map(|(x, y)| Vec3::new(x, -y, 0.0)))
    }

    #[test]
    fn centres_of_pixels() {
        assert!(misses([(3.6, 3.6), (4.4, 3.6), (3.6, 4.4)]), "between four centres");
        assert!(!misses([(3.2, 3.2), (4.4, 3.2), (3.2, 4.4)]), "around one");
        assert!(misses([(1.0, 1.6), (9.0, 1.6), (9.0, 2.4)]), "a sliver between two rows");
        assert!(misses([(2.4, 2.6), (3.4, 2.6), (3.4, 3.6)]), "a centre in its box alone");
        assert!(!misses([(1.0, 1.0), (15.0, 1.0), (1.0, 15.0)]), "large");
    }
}
