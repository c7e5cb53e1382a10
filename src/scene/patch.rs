//! What rays can hit, seen as textures see it: planar patches and uv charts (design §5).
//!
//! A planar patch is a set of connected coplanar faces with one material and one affine map from position
//! to texture coordinates: a ray's texture coordinates on it follow from its plane alone. All other faces
//! belong to charts, within which texture coordinates are continuous. Both are *targets*: the identity of
//! what a specular path ends on, for matching paths between samples.

use std::ops::Range;

use glam::{DMat2, DVec2, DVec3, Vec2, Vec3, Vec4};

use super::{AlphaMode, Material, Object, Scene, TextureSlot, topology::Topology};

/// Index into [`Targets::targets`].
pub type TargetId = u32;

/// The target of rays that leave the scene.
pub const ENVIRONMENT: TargetId = 0;

/// All targets of a scene; [`ENVIRONMENT`] is the first.
#[derive(Debug, Clone, Default)]
pub struct Targets {
    /// The target of each face.
    pub of_face: Vec<TargetId>,
    /// What each target is.
    pub targets: Vec<Target>,
}

/// A planar patch, a chart, or the environment.
#[derive(Debug, Clone)]
pub struct Target {
    /// Index of its material; `u32::MAX` for the environment.
    pub material: u32,
    /// Its plane and maps if it is planar.
    pub patch: Option<Patch>,
    /// Whether an alpha mask may cut holes into it, through which a ray goes on: only the ray itself knows.
    pub pierced: bool,
}

/// Plane, texture maps and outline of a planar patch.
#[derive(Debug, Clone)]
pub struct Patch {
    /// Unit normal on the front side of its faces.
    pub normal: Vec3,
    /// `normal · x` of its points.
    pub distance: f32,
    /// Affine map from position to base-colour texture coordinates, texture transform included:
    /// `u = base_uv[0].xyz · p + base_uv[0].w`.
    pub base_uv: [Vec4; 2],
    /// The same for the emissive texture.
    pub emissive_uv: [Vec4; 2],
    /// Its outline if that is convex with at most [`MAX_HALF_PLANES`] sides: `h.xyz · p ≤ h.w` inside.
    pub outline: Option<Vec<Vec4>>,
}

/// Largest number of sides of a patch's outline.
pub const MAX_HALF_PLANES: usize = 8;

/// Share of its object's area below which a coplanar group is left to a chart: flat-shaded curved meshes
/// would otherwise shatter into a target a face.
const MIN_PATCH_AREA: f64 = 2e-3;

impl Targets {
    /// Finds the patches and charts of `scene`.
    pub fn new(scene: &Scene, topology: &Topology) -> Self {
        let geometry = &scene.geometry;
        let mut targets = vec![Target { material: u32::MAX, patch: None, pierced: false }];
        let mut of_face = vec![u32::MAX; geometry.faces.len()];
        let least_alphas = least_alphas(scene);
        for object in &scene.objects {
            let faces = object.faces.clone();
            let material = &scene.materials[object.material as usize];
            let mut adjacency = Adjacency::new(scene, topology, faces.clone());
            let pierced = is_pierced(scene, object, &least_alphas);
            if can_be_planar(material) && !pierced {
                let total: f64 = faces.clone().map(|f| f64::from(geometry.area_normal(f).length())).sum();
                // Faces of groups too small: each would flood its whole group again.
                let mut small = vec![false; faces.len()];
                for seed in faces.clone() {
                    if of_face[seed as usize] != u32::MAX || small[(seed - faces.start) as usize] {
                        continue;
                    }
                    let Some(plane) = Plane::of_face(scene, material, seed) else { continue };
                    let group = adjacency.flood(seed, |face| {
                        of_face[face as usize] == u32::MAX && plane.contains(scene, material, face)
                    });
                    let area: f64 = group.iter().map(|&f| f64::from(geometry.area_normal(f).length())).sum();
                    if area < total * MIN_PATCH_AREA {
                        group.iter().for_each(|&face| small[(face - faces.start) as usize] = true);
                        continue;
                    }
                    for &face in &group {
                        of_face[face as usize] = targets.len() as u32;
                    }
                    let outline = plane.outline(scene, &group, area);
                    let patch = Some(plane.patch(outline));
                    targets.push(Target { material: object.material, patch, pierced });
                }
            }
            let textured = material.base_color_texture.is_some() || material.emissive_texture.is_some();
            let mut untextured_chart = None;
            for seed in faces.clone() {
                if of_face[seed as usize] != u32::MAX {
                    continue;
                }
                if let (false, Some(chart)) = (textured, untextured_chart) {
                    of_face[seed as usize] = chart;
                    continue;
                }
                let chart = targets.len() as u32;
                untextured_chart = Some(chart);
                targets.push(Target { material: object.material, patch: None, pierced });
                for face in adjacency.flood(seed, |face| of_face[face as usize] == u32::MAX) {
                    of_face[face as usize] = chart;
                }
            }
        }
        Self { of_face, targets }
    }

    /// The target of face `face`.
    pub fn of(&self, face: u32) -> TargetId {
        self.of_face[face as usize]
    }

    /// Whether a target is a patch with an outline: a ray tells by itself whether it meets it.
    pub fn is_outlined(&self, target: TargetId) -> bool {
        self.targets[target as usize].patch.as_ref().is_some_and(|patch| patch.outline.is_some())
    }
}

/// By texture: the least alpha of its image, where a mask of some material reads it.
fn least_alphas(scene: &Scene) -> Vec<Option<u8>> {
    let mut of_image = vec![None; scene.images.len()];
    let mut of_texture = vec![None; scene.textures.len()];
    for material in scene.materials.iter().filter(|it| matches!(it.alpha_mode, AlphaMode::Mask(_))) {
        let Some(slot) = material.base_color_texture else { continue };
        let image = scene.textures[slot.texture as usize].image as usize;
        let alphas = || scene.images[image].rgba.iter().skip(3).step_by(4).copied();
        let least = *of_image[image].get_or_insert_with(|| alphas().min().unwrap_or(u8::MAX));
        of_texture[slot.texture as usize] = Some(least);
    }
    of_texture
}

/// Whether the alpha of an object with a mask is below its cutoff anywhere.
fn is_pierced(scene: &Scene, object: &Object, least_alphas: &[Option<u8>]) -> bool {
    let material = &scene.materials[object.material as usize];
    let AlphaMode::Mask(cutoff) = material.alpha_mode else { return false };
    let texels = material.base_color_texture.and_then(|slot| least_alphas[slot.texture as usize]);
    let vertices = object.vertices.clone().map(|vertex| scene.geometry.color(vertex).w).fold(1.0, f32::min);
    material.base_color.w * vertices * f32::from(texels.unwrap_or(u8::MAX)) / 255.0 < cutoff
}

/// Textures other than base colour and emission vary the shading within a patch.
fn can_be_planar(material: &Material) -> bool {
    material.normal_texture.is_none()
        && material.metallic_roughness_texture.is_none()
        && material.specular_texture.is_none()
        && material.specular_color_texture.is_none()
        && material.transmission_texture.is_none()
}

/// Faces of one object across edges on both sides of which the texture coordinates agree.
struct Adjacency {
    first: u32,
    /// By face: where its neighbours start; one more at the end.
    starts: Vec<u32>,
    neighbours: Vec<u32>,
    /// By face: the last flood that reached it.
    reached: Vec<u32>,
    floods: u32,
}

impl Adjacency {
    fn new(scene: &Scene, topology: &Topology, faces: Range<u32>) -> Self {
        let geometry = &scene.geometry;
        let uvs_at = |face: u32, point: u32| {
            let corner =
                geometry.faces[face as usize].into_iter().find(|&v| topology.point[v as usize] == point);
            corner.map(|v| [geometry.uv(0, v), geometry.uv(1, v)])
        };
        let sides = topology.sides(geometry, faces.clone());
        let pairs = sides.windows(2).filter_map(|pair| {
            let [((a, b), f), (edge, g)] = [pair[0], pair[1]];
            let (f, g) = (f.face, g.face);
            let joined = (a, b) == edge && uvs_at(f, a) == uvs_at(g, a) && uvs_at(f, b) == uvs_at(g, b);
            joined.then(|| [f - faces.start, g - faces.start])
        });
        let pairs: Vec<[u32; 2]> = pairs.collect();
        drop(sides);
        let mut starts = vec![0; faces.len() + 1];
        pairs.as_flattened().iter().for_each(|&face| starts[face as usize + 1] += 1);
        (1..starts.len()).for_each(|face| starts[face] += starts[face - 1]);
        let mut ends = starts.clone();
        let mut neighbours = vec![0; 2 * pairs.len()];
        for [f, g] in pairs.iter().flat_map(|&[f, g]| [[f, g], [g, f]]) {
            let end = &mut ends[f as usize];
            neighbours[*end as usize] = g + faces.start;
            *end += 1;
        }
        Self { first: faces.start, starts, neighbours, reached: vec![0; faces.len()], floods: 0 }
    }

    /// Faces connected with `seed` through faces that `accept`, `seed` first.
    fn flood(&mut self, seed: u32, accept: impl Fn(u32) -> bool) -> Vec<u32> {
        self.floods += 1;
        let Self { first, starts, neighbours, reached, floods } = self;
        reached[(seed - *first) as usize] = *floods;
        let mut group = vec![seed];
        let mut next = 0;
        while next < group.len() {
            let face = (group[next] - *first) as usize;
            for &face in &neighbours[starts[face] as usize..starts[face + 1] as usize] {
                let reached = &mut reached[(face - *first) as usize];
                if *reached != *floods && accept(face) {
                    *reached = *floods;
                    group.push(face);
                }
            }
            next += 1;
        }
        group
    }
}

/// A plane and its affine texture maps, in double precision.
struct Plane {
    origin: DVec3,
    normal: DVec3,
    extent: f64,
    uv: [[(DVec3, f64); 2]; 2],
    color: Vec4,
}

impl Plane {
    /// The plane of `face`, unless its shading normals or colours vary.
    fn of_face(scene: &Scene, material: &Material, face: u32) -> Option<Self> {
        let geometry = &scene.geometry;
        let vertices = geometry.faces[face as usize];
        let [a, b, c] = geometry.corners(face).map(|p| p.as_dvec3());
        let (e1, e2) = (b - a, c - a);
        let normal = e1.cross(e2).try_normalize()?;
        // Dual basis of the edges: gradients of the barycentric weights of b and c.
        let gram = DMat2::from_cols(DVec2::new(e1.dot(e1), e1.dot(e2)), DVec2::new(e1.dot(e2), e2.dot(e2)));
        if gram.determinant() <= 0.0 {
            return None;
        }
        let inverse = gram.inverse();
        let g1 = e1 * inverse.x_axis.x + e2 * inverse.x_axis.y;
        let g2 = e1 * inverse.y_axis.x + e2 * inverse.y_axis.y;
        let map = |slot: Option<TextureSlot>| {
            let uv = |v: u32| slot.map_or(Vec2::ZERO, |s| s.transform(geometry.uv(s.uv_set, v))).as_dvec2();
            let [ua, ub, uc] = vertices.map(uv);
            std::array::from_fn(|k| {
                let gradient = g1 * (ub[k] - ua[k]) + g2 * (uc[k] - ua[k]);
                (gradient, ua[k] - gradient.dot(a))
            })
        };
        let plane = Self {
            origin: a,
            normal,
            extent: e1.length().max(e2.length()),
            uv: [map(material.base_color_texture), map(material.emissive_texture)],
            color: geometry.color(vertices[0]),
        };
        plane.contains(scene, material, face).then_some(plane)
    }

    /// Whether `face` lies in this plane with the same texture maps, colours and flat normals.
    fn contains(&self, scene: &Scene, material: &Material, face: u32) -> bool {
        let geometry = &scene.geometry;
        let corners = geometry.faces[face as usize];
        let facing = geometry.area_normal(face).as_dvec3().normalize_or_zero();
        facing.dot(self.normal) > 1.0 - 1e-6
            && corners.into_iter().all(|v| {
                let position = geometry.positions[v as usize].as_dvec3();
                let slots = [material.base_color_texture, material.emissive_texture];
                let maps_agree = slots.into_iter().zip(&self.uv).all(|(slot, map)| {
                    let Some(slot) = slot else { return true };
                    let uv = slot.transform(geometry.uv(slot.uv_set, v)).as_dvec2();
                    let predicted =
                        DVec2::new(map[0].0.dot(position) + map[0].1, map[1].0.dot(position) + map[1].1);
                    (uv - predicted).length() <= 1e-4 * uv.length().max(1.0)
                });
                (position - self.origin).dot(self.normal).abs()
                    <= 1e-5 * self.extent.max(position.length() * 0.05)
                    && geometry.normals[v as usize].as_dvec3().dot(self.normal) > 1.0 - 1e-5
                    && geometry.color(v) == self.color
                    && maps_agree
            })
    }

    /// The convex outline of `group` if the group fills its convex hull (`area` is twice the area).
    fn outline(&self, scene: &Scene, group: &[u32], area: f64) -> Option<Vec<Vec4>> {
        let x = self.normal.any_orthonormal_vector();
        let y = self.normal.cross(x);
        let mut points: Vec<DVec2> = group
            .iter()
            .flat_map(|&face| scene.geometry.corners(face))
            .map(|p| p.as_dvec3() - self.origin)
            .map(|p| DVec2::new(p.dot(x), p.dot(y)))
            .collect();
        let hull = convex_hull(&mut points);
        let hull_area: f64 =
            (0..hull.len()).map(|i| hull[i].perp_dot(hull[(i + 1) % hull.len()])).sum::<f64>();
        if hull.len() < 3 || hull.len() > MAX_HALF_PLANES || (hull_area - area).abs() > 1e-4 * area {
            return None;
        }
        let sides = (0..hull.len()).map(|i| {
            let along = hull[(i + 1) % hull.len()] - hull[i];
            let outward = (x * along.y - y * along.x).normalize();
            let point = self.origin + x * hull[i].x + y * hull[i].y;
            outward.as_vec3().extend(outward.dot(point) as f32)
        });
        Some(sides.collect())
    }

    fn patch(&self, outline: Option<Vec<Vec4>>) -> Patch {
        let rows =
            |map: &[(DVec3, f64); 2]| map.map(|(gradient, offset)| gradient.as_vec3().extend(offset as f32));
        Patch {
            normal: self.normal.as_vec3(),
            distance: self.normal.dot(self.origin) as f32,
            base_uv: rows(&self.uv[0]),
            emissive_uv: rows(&self.uv[1]),
            outline,
        }
    }
}

/// Counter-clockwise convex hull without collinear points (Andrew's monotone chain).
fn convex_hull(points: &mut Vec<DVec2>) -> Vec<DVec2> {
    points.sort_unstable_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    points.dedup();
    let size = points.iter().fold(0.0_f64, |size, p| size.max(p.abs().max_element()));
    let left_turn = |hull: &[DVec2], p: DVec2| {
        let (a, b) = (hull[hull.len() - 2], hull[hull.len() - 1]);
        (b - a).perp_dot(p - b) > 1e-7 * size * (b - a).length()
    };
    let chain = |points: &mut dyn Iterator<Item = &DVec2>| {
        let mut hull: Vec<DVec2> = Vec::new();
        for &p in points {
            while hull.len() >= 2 && !left_turn(&hull, p) {
                hull.pop();
            }
            hull.push(p);
        }
        hull.pop();
        hull
    };
    let mut hull = chain(&mut points.iter());
    hull.extend(chain(&mut points.iter().rev()));
    hull
}

/// Distance from a plane of what is in it, as a share of its coordinates.
const IN_PLANE: f32 = 16.0 * f32::EPSILON;

impl Patch {
    /// Whether a point of the plane lies inside the outline; true where there is none.
    pub fn contains(&self, point: Vec3) -> bool {
        self.outline.as_ref().is_none_or(|sides| sides.iter().all(|h| h.truncate().dot(point) <= h.w))
    }

    /// Whether a point lies in the plane, as far as single precision tells.
    pub fn has(&self, point: Vec3) -> bool {
        let rounding = IN_PLANE * (self.distance.abs() + point.abs().max_element());
        (self.normal.dot(point) - self.distance).abs() <= rounding
    }

    /// Base-colour texture coordinates at a point of the plane.
    pub fn uv(&self, point: Vec3) -> Vec2 {
        Vec2::new(
            self.base_uv[0].truncate().dot(point) + self.base_uv[0].w,
            self.base_uv[1].truncate().dot(point) + self.base_uv[1].w,
        )
    }

    /// Distance along a ray to the plane, in units of `direction`'s length; infinite or negative if it misses.
    pub fn intersect(&self, origin: Vec3, direction: Vec3) -> f32 {
        (self.distance - self.normal.dot(origin)) / self.normal.dot(direction)
    }
}
