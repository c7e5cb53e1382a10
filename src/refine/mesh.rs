//! The refined mesh: conforming longest-edge bisection of visible faces (paper §3; design §6).
//!
//! Edges are matched by position, so that a texture or normal seam never cracks: one midpoint per
//! geometric edge, one attribute vertex per side of a seam. Faces around an edge form a cycle of sides,
//! which also holds at non-manifold edges. Nothing is ever deleted: a split face keeps its two children,
//! and the tree finds the leaf under a pixel. Where halves are [united](Mesh::unite) again they stay behind, part of no leaf.

use glam::{Vec2, Vec3, Vec4};
use rustc_hash::FxHashMap;

use crate::scene::{Scene, View, topology::Topology};

mod unite;

/// No face, vertex or side.
pub const NONE: u32 = u32::MAX;

/// In place of the halves of a face that is itself part of a whole again.
const UNITED: u32 = u32::MAX - 1;

/// Shortest edge that is bisected, in roundings of its ends' largest coordinate.
const SHORTEST_EDGE: f32 = 8.0;

/// Most faces that are bisected together because they share an edge. Of more, which no surface has, as many at a time share
/// one: bisecting costs the square of their number.
const MOST_AROUND: usize = 32;

/// A side of an edge: `face << 2 | edge`, where edge `i` runs from corner `i` to corner `i + 1`.
type Side = u32;

fn side(face: u32, edge: usize) -> Side {
    face << 2 | edge as u32
}

fn face_of(side: Side) -> usize {
    (side >> 2) as usize
}

fn edge_of(side: Side) -> usize {
    (side & 3) as usize
}

/// An attribute vertex: what one side of a seam knows of a point, seen from one side of the surface.
#[derive(Debug, Clone, Copy)]
pub struct Vertex {
    /// Its geometric point.
    pub point: u32,
    /// Ends of the edge it bisects; [`NONE`] for a vertex of the scene's mesh.
    pub parents: [u32; 2],
    /// A face of the scene that it lies on.
    pub base: u32,
    /// Whether it is seen from behind, against its normals.
    pub back: bool,
    /// Shading normal, interpolated linearly and never renormalised, so that it is the base face's own.
    pub normal: Vec3,
    /// Normal of the visible faces around it on the side of the shading normals, not normalised.
    pub geometric: Vec3,
    /// Both sets of texture coordinates.
    pub uv: [Vec2; 2],
    /// Linear vertex colour.
    pub color: Vec4,
    /// Tangent and handedness.
    pub tangent: Vec4,
}

/// A face of the mesh or of its refinement.
#[derive(Debug, Clone, Copy)]
pub struct Face {
    /// Attribute vertices, wound as the base face.
    pub corners: [u32; 3],
    /// Next side around each of its edges; itself at a border.
    radial: [Side; 3],
    /// The scene's face that it is part of.
    pub base: u32,
    /// Number of bisections that made it.
    pub level: u8,
    /// The two halves, or [`NONE`] for a leaf, or [`UNITED`]. The first holds the corner of this face at which its longest edge begins.
    children: [u32; 2],
    /// Its longest edge as seen from the eye: what is or would be bisected.
    longest: u8,
}

impl Face {
    /// Whether it was not bisected.
    pub fn is_leaf(&self) -> bool {
        self.children[0] == NONE
    }

    /// Its two halves, if it has any.
    pub fn halves(&self) -> Option<[u32; 2]> {
        self.is_bisected().then_some(self.children)
    }

    fn is_bisected(&self) -> bool {
        self.children[0] < UNITED
    }
}

/// A bisected face.
#[derive(Debug, Clone, Copy)]
pub struct Split {
    /// The new vertex, at the middle of its longest edge.
    pub vertex: u32,
    /// The face, which has [`halves`](Face::halves) now.
    pub face: u32,
}

/// Visible faces of a scene and their refinement, for one view.
#[derive(Debug, Clone)]
pub struct Mesh {
    /// Positions of the points, relative to the scene's origin.
    pub points: Vec<Vec3>,
    /// Direction from the eye to each point: unit length for a perspective view, on the plane at
    /// distance 1 (in world units) for a parallel one. Lengths of edges are measured between these.
    pub images: Vec<Vec3>,
    /// Attribute vertices.
    pub vertices: Vec<Vertex>,
    /// Faces; leaves and split ones.
    pub faces: Vec<Face>,
    /// Refined face of each base face that was seeded.
    roots: FxHashMap<u32, u32>,
    /// Pixels per unit of `images`.
    pub pixels_per_unit: f32,
    view: View,
    room: Room,
}

/// Lists that bisecting works on, kept for their memory.
#[derive(Debug, Clone, Default)]
struct Room {
    /// Faces that wait for others to be bisected first.
    blocked: Vec<u32>,
    /// Those around the edge that is bisected, and around one half of it.
    sides: Vec<Side>,
    halves: Vec<Side>,
}

impl Mesh {
    /// The unrefined mesh of the base faces `seeds`, in that order.
    pub fn new(scene: &Scene, topology: &Topology, view: &View, seeds: &[u32]) -> Self {
        let geometry = &scene.geometry;
        let mut mesh = Self {
            points: Vec::new(),
            images: Vec::new(),
            vertices: Vec::new(),
            faces: Vec::with_capacity(seeds.len() * 2),
            roots: FxHashMap::default(),
            pixels_per_unit: view.height as f32 / (2.0 * view.half.y),
            view: *view,
            room: Room::default(),
        };
        let mut point_ids = FxHashMap::default();
        let mut vertex_ids = FxHashMap::default();
        for &base in seeds {
            let winding = geometry.area_normal(base);
            let shading: Vec3 =
                geometry.faces[base as usize].map(|v| geometry.normals[v as usize]).iter().sum();
            let normal = if winding.dot(shading) < 0.0 { -winding } else { winding };
            let back = normal.dot(view.direction_to(geometry.corners(base)[0])) > 0.0;
            let corners = geometry.faces[base as usize].map(|v| {
                let id = *vertex_ids.entry((v, back)).or_insert_with(|| {
                    let position = geometry.positions[v as usize];
                    let point = *point_ids
                        .entry(topology.point[v as usize])
                        .or_insert_with(|| mesh.push_point(position));
                    mesh.vertices.push(Vertex {
                        point,
                        parents: [NONE; 2],
                        base,
                        back,
                        normal: geometry.normals[v as usize],
                        geometric: Vec3::ZERO,
                        uv: [geometry.uv(0, v), geometry.uv(1, v)],
                        color: geometry.color(v),
                        tangent: geometry.tangents.get(v as usize).copied().unwrap_or(Vec4::X),
                    });
                    mesh.vertices.len() as u32 - 1
                });
                mesh.vertices[id as usize].geometric += normal;
                id
            });
            mesh.roots.insert(base, mesh.faces.len() as u32);
            let own = mesh.faces.len() as u32;
            mesh.push_face(Face {
                corners,
                radial: [side(own, 0), side(own, 1), side(own, 2)],
                base,
                level: 0,
                children: [NONE; 2],
                longest: 0,
            });
        }
        mesh.link();
        mesh
    }

    /// Links the sides around every edge of the unrefined mesh.
    fn link(&mut self) {
        let mut sides: Vec<((u32, u32), Side)> = (0..self.faces.len() as u32)
            .flat_map(|face| (0..3).map(move |edge| side(face, edge)))
            .map(|s| (self.edge_points(s), s))
            .collect();
        sides.sort_unstable();
        for group in sides.chunk_by(|a, b| a.0 == b.0) {
            for sides in group.chunks(MOST_AROUND) {
                self.link_cycle(sides.iter().map(|&(_, s)| s));
            }
        }
    }

    fn link_cycle(&mut self, sides: impl Iterator<Item = Side> + Clone) {
        let next = sides.clone().cycle().skip(1);
        for (s, next) in sides.zip(next) {
            self.faces[face_of(s)].radial[edge_of(s)] = next;
        }
    }

    fn push_point(&mut self, position: Vec3) -> u32 {
        let image = self.image_of(position);
        self.points.push(position);
        self.images.push(image);
        self.points.len() as u32 - 1
    }

    /// Image vector of a position: see [`Mesh::images`].
    pub fn image_of(&self, position: Vec3) -> Vec3 {
        let to = position - self.view.eye;
        if self.view.orthographic {
            Vec3::new(to.dot(self.view.right), to.dot(self.view.up), 1.0)
        } else {
            // Nearer than the near plane directions turn without bound, and nothing is seen.
            to / to.length().max(self.view.near)
        }
    }

    /// Position of an attribute vertex.
    pub fn position(&self, vertex: u32) -> Vec3 {
        self.points[self.vertices[vertex as usize].point as usize]
    }

    /// Image vector of an attribute vertex: see [`Mesh::images`].
    pub fn image(&self, vertex: u32) -> Vec3 {
        self.images[self.vertices[vertex as usize].point as usize]
    }

    /// The other faces along edge `edge` of a leaf, from corner `edge` to the next.
    pub fn beyond(&self, face: u32, edge: usize) -> impl Iterator<Item = u32> + use<'_> {
        self.around(side(face, edge)).skip(1).map(|s| s >> 2)
    }

    /// The two points of an edge, smaller id first.
    fn edge_points(&self, s: Side) -> (u32, u32) {
        let corners = self.faces[face_of(s)].corners;
        let a = self.vertices[corners[edge_of(s)] as usize].point;
        let b = self.vertices[corners[(edge_of(s) + 1) % 3] as usize].point;
        (a.min(b), a.max(b))
    }

    /// Length in pixels of edge `edge` of a face, from corner `edge` to the next.
    pub fn length_of(&self, face: u32, edge: usize) -> f32 {
        self.edge_length(side(face, edge))
    }

    /// Length of an edge in pixels, as seen from the eye.
    fn edge_length(&self, s: Side) -> f32 {
        let (a, b) = self.edge_points(s);
        self.image_length_squared(a, b).sqrt() * self.pixels_per_unit
    }

    /// Squared length of an edge in units of `images`: 0 where its ends are so few roundings apart that its middle may
    /// fall on one of them. Halves as long as the whole would be bisected for ever.
    fn image_length_squared(&self, a: u32, b: u32) -> f32 {
        let [p, q] = [a, b].map(|point| self.points[point as usize]);
        let rounding = p.abs().max(q.abs()).max_element() * f32::EPSILON;
        if (p - q).abs().max_element() <= SHORTEST_EDGE * rounding {
            return 0.0;
        }
        (self.images[a as usize] - self.images[b as usize]).length_squared()
    }

    /// Adds a face, whose longest edge is found. Ties are broken by point ids, so that edges have one strict order and
    /// propagation ends.
    fn push_face(&mut self, face: Face) {
        let points = face.corners.map(|v| self.vertices[v as usize].point);
        let key = |edge: usize| {
            let (a, b) = (points[edge], points[(edge + 1) % 3]);
            let (a, b) = (a.min(b), a.max(b));
            (self.image_length_squared(a, b).to_bits(), b, a) // non-negative floats order as their bits
        };
        let longest = (0..3).max_by_key(|&edge| key(edge)).expect("a face has three edges");
        self.faces.push(Face { longest: longest as u8, ..face });
    }

    /// The longest edge of a face.
    fn longest(&self, face: u32) -> Side {
        side(face, usize::from(self.faces[face as usize].longest))
    }

    /// Longest edge of a face in pixels.
    pub fn size(&self, face: u32) -> f32 {
        self.edge_length(self.longest(face))
    }

    /// Projected area of a face in pixels.
    pub fn area(&self, face: u32) -> f32 {
        let [a, b, c] = self.faces[face as usize].corners.map(|v| self.image(v));
        (b - a).cross(c - a).length() * 0.5 * self.pixels_per_unit * self.pixels_per_unit
    }

    /// Bisects `face` at its longest edge, and first whatever neighbours must be bisected to keep the mesh
    /// conforming. Appends what was split, parents before children.
    ///
    /// Does nothing if `face` is no longer a leaf.
    pub fn bisect(&mut self, face: u32, splits: &mut Vec<Split>) {
        let mut room = std::mem::take(&mut self.room);
        room.blocked.push(face);
        while let Some(&top) = room.blocked.last() {
            if !self.faces[top as usize].is_leaf() {
                room.blocked.pop();
                continue;
            }
            let longest = self.longest(top);
            let points = self.edge_points(longest);
            let blocking = self.around(longest).find(|&s| self.edge_points(self.longest(s >> 2)) != points);
            match blocking {
                Some(neighbour) => room.blocked.push(neighbour >> 2),
                None => {
                    self.bisect_edge(longest, &mut room, splits);
                    room.blocked.pop();
                }
            }
        }
        self.room = room;
    }

    /// All sides of an edge, starting with the given one.
    fn around(&self, start: Side) -> impl Iterator<Item = Side> + use<'_> {
        let mut next = Some(start);
        std::iter::from_fn(move || {
            let current = next?;
            let following = self.faces[face_of(current)].radial[edge_of(current)];
            next = (following != start).then_some(following);
            Some(current)
        })
    }

    fn bisect_edge(&mut self, edge: Side, Room { sides, halves, .. }: &mut Room, splits: &mut Vec<Split>) {
        sides.clear();
        sides.extend(self.around(edge));
        let (first, second) = self.edge_points(edge);
        let middle = (self.points[first as usize] + self.points[second as usize]) * 0.5;
        let point = self.push_point(middle);
        let vertices = self.vertices.len();
        for &s in sides.iter() {
            let (index, e) = (face_of(s), edge_of(s));
            let face = self.faces[index];
            let [a, b, c] = [face.corners[e], face.corners[(e + 1) % 3], face.corners[(e + 2) % 3]];
            let ends = [a.min(b), a.max(b)];
            let known = self.vertices[vertices..].iter().position(|vertex| vertex.parents == ends);
            let vertex = match known {
                Some(known) => (vertices + known) as u32,
                None => self.push_midpoint(ends, point),
            };
            let facet = self.facet(index as u32);
            self.vertices[vertex as usize].geometric += facet;
            let left = self.faces.len() as u32;
            let right = left + 1;
            let child = |corners, radial| Face {
                corners,
                radial,
                base: face.base,
                level: face.level.saturating_add(1),
                children: [NONE; 2],
                longest: 0,
            };
            // Edges of the halves: left = (c a, a m, m c), right = (b c, c m, m b).
            self.push_face(child([c, a, vertex], [side(left, 0), side(left, 1), side(right, 1)]));
            self.push_face(child([b, c, vertex], [side(right, 0), side(left, 2), side(right, 2)]));
            self.faces[index].children = [left, right];
            self.replace(side(index as u32, (e + 2) % 3), side(left, 0));
            self.replace(side(index as u32, (e + 1) % 3), side(right, 0));
            splits.push(Split { vertex, face: index as u32 });
        }
        for end in [first, second] {
            halves.clear();
            halves.extend(sides.iter().map(|&s| {
                let Face { corners, children: [left, right], .. } = self.faces[face_of(s)];
                let starts = self.vertices[corners[edge_of(s)] as usize].point == end;
                if starts { side(left, 1) } else { side(right, 2) }
            }));
            self.link_cycle(halves.iter().copied());
        }
    }

    /// Puts side `new` in the place of side `old` in the cycle around their edge.
    fn replace(&mut self, old: Side, new: Side) {
        let next = self.faces[face_of(old)].radial[edge_of(old)];
        if next == old {
            self.faces[face_of(new)].radial[edge_of(new)] = new;
            return;
        }
        self.faces[face_of(new)].radial[edge_of(new)] = next;
        let mut before = next;
        while self.faces[face_of(before)].radial[edge_of(before)] != old {
            before = self.faces[face_of(before)].radial[edge_of(before)];
        }
        self.faces[face_of(before)].radial[edge_of(before)] = new;
    }

    fn push_midpoint(&mut self, parents: [u32; 2], point: u32) -> u32 {
        let [a, b] = parents.map(|v| self.vertices[v as usize]);
        self.vertices.push(Vertex {
            point,
            parents,
            base: a.base,
            back: a.back,
            normal: (a.normal + b.normal) * 0.5,
            geometric: Vec3::ZERO,
            uv: [(a.uv[0] + b.uv[0]) * 0.5, (a.uv[1] + b.uv[1]) * 0.5],
            color: (a.color + b.color) * 0.5,
            tangent: (a.tangent.truncate() + b.tangent.truncate()).extend(a.tangent.w * 2.0) * 0.5,
        });
        self.vertices.len() as u32 - 1
    }

    /// Unit normal of a face, on the side of its shading normals.
    fn facet(&self, face: u32) -> Vec3 {
        let corners = self.faces[face as usize].corners;
        let [a, b, c] = corners.map(|v| self.position(v));
        let normal = (b - a).cross(c - a).normalize_or_zero();
        let shading: Vec3 = corners.iter().map(|&v| self.vertices[v as usize].normal).sum();
        if normal.dot(shading) < 0.0 { -normal } else { normal }
    }

    /// Indices of the faces that were not bisected.
    pub fn leaves(&self) -> impl Iterator<Item = u32> + use<'_> {
        (0..self.faces.len() as u32).filter(|&face| self.faces[face as usize].is_leaf())
    }

    /// The refined face that base face `base` became, if it was seeded.
    pub fn root(&self, base: u32) -> Option<u32> {
        self.roots.get(&base).copied()
    }

    /// The leaf of base face `base` that covers image vector `image`; `None` if `base` was not seeded.
    pub fn leaf_at(&self, base: u32, image: Vec3) -> Option<u32> {
        let mut face = self.root(base)?;
        loop {
            let Face { corners, children, longest, .. } = self.faces[face as usize];
            if children[0] == NONE {
                return Some(face);
            }
            let e = usize::from(longest);
            let middle = self.faces[children[0] as usize].corners[2];
            let (a, c, m) = (self.image(corners[e]), self.image(corners[(e + 2) % 3]), self.image(middle));
            let line = c.cross(m);
            let same_side = (line.dot(a) >= 0.0) == (line.dot(image) >= 0.0);
            face = children[usize::from(!same_side)];
        }
    }

    /// Checks what every consumer relies on: sides around an edge agree on its points, leaves meet leaves
    /// along whole edges (no hanging node), every vertex is or was used, halves fill their face.
    ///
    /// # Panics
    /// If the mesh is broken.
    pub fn validate(&self) {
        let mut used = vec![false; self.vertices.len()];
        let united = self.faces.iter().filter(|face| face.children[0] == UNITED);
        united.flat_map(|face| face.corners).for_each(|corner| used[corner as usize] = true);
        for face in self.leaves() {
            for edge in 0..3 {
                let own = side(face, edge);
                let mut steps = 0;
                for s in self.around(own) {
                    assert_eq!(self.edge_points(s), self.edge_points(own), "sides of one edge disagree");
                    assert!(self.faces[face_of(s)].is_leaf(), "a leaf's edge is split on its other side");
                    steps += 1;
                    assert!(steps <= self.faces.len(), "the cycle around an edge does not close");
                }
            }
            for corner in self.faces[face as usize].corners {
                used[corner as usize] = true;
            }
        }
        assert!(used.iter().all(|&used| used), "a vertex belongs to no face");
        for face in self.faces.iter().filter(|face| face.is_bisected()) {
            let area = |corners: [u32; 3]| {
                let [a, b, c] = corners.map(|v| self.position(v).as_dvec3());
                (b - a).cross(c - a).length()
            };
            let halves: f64 = face.children.iter().map(|&c| area(self.faces[c as usize].corners)).sum();
            let [a, b, _] = face.corners.map(|v| self.position(v));
            let slack = f64::from((a - b).length() * (a.length() + b.length())) * 1e-5;
            let whole = area(face.corners);
            assert!((whole - halves).abs() <= whole * 1e-4 + slack, "halves do not fill their face");
        }
    }
}
