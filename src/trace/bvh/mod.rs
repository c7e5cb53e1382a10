//! Closest hits and occlusion among the faces of a scene.

mod binary;
mod collapse;
mod lanes;
mod packet;
mod quad;
mod split;
mod wide;

use glam::{Vec2, Vec3, Vec3A};
use obvhs::aabb::Aabb;

use super::finish::{Finish, finishes};
use super::real::{Real, Triple};
use super::surface::{self, Record};
use super::texel;
use super::vector::{Isa, Numbers, Processor, WIDTH, get};
use crate::error::Result;
use crate::memory;
use crate::scene::{AlphaMode, Scene};

pub(super) use packet::{EntryPoints, Packet};
use quad::{Crossing, Probe};
use wide::{BoxProbe, Bvh4, Node};

/// Rays go this part of the distance to a light, so that a light on a surface is seen.
const SHADOW_PART: f32 = 1.0 - 1e-4;

/// Boxes are wider than their triangles by this fraction of the scene's extent: as much as a box test errs
/// for a ray from inside the scene, so that it does not lose what the triangle test would find.
const BOX_PADDING: f32 = 4.0 * f32::EPSILON;

/// Rays below which tests side by side would mostly test nothing.
const FEWEST_TOGETHER: usize = 4;

/// The nearest surface along a ray.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    /// Index into [`Geometry::faces`](crate::scene::Geometry::faces).
    pub face: u32,
    /// Distance from the ray's origin.
    pub t: f32,
    /// Barycentric weight of the face's second corner.
    pub u: f32,
    /// Barycentric weight of the face's third corner.
    pub v: f32,
}

/// Rays that are longest along the same axis, by index.
#[derive(Clone, Copy)]
struct Group {
    rays: [u32; lanes::RAYS],
    count: usize,
}

impl Group {
    const EMPTY: Self = Self { rays: [0; lanes::RAYS], count: 0 };
}

/// A scene made ready for rays.
///
/// Rays hit both sides of every face. Faces with a MASK material count where their alpha reaches the
/// cutoff; BLEND is opaque (coverage on camera rays is [`coverage`](super::surface::coverage)).
pub struct Tracer<'s> {
    scene: &'s Scene,
    bvh: Bvh4,
    masked: bool,
    diagonal: f32,
    /// In the order of the scene's faces.
    records: Vec<Record>,
    finishes: Vec<Finish>,
    /// Where rays are looked at side by side.
    processor: Option<Processor>,
}

/// What a [`Tracer`] builds of faces and materials, without the scene that they are of.
pub struct Hierarchy {
    bvh: Bvh4,
    masked: bool,
    diagonal: f32,
    records: Vec<Record>,
}

impl<'s> Tracer<'s> {
    /// Whether what tracing builds of `scene` can be held.
    ///
    /// # Errors
    /// [`Error::HostMemory`](crate::error::Error::HostMemory).
    pub fn check_memory(scene: &Scene) -> Result<()> {
        let faces = scene.geometry.faces.len() as u64;
        // Mip levels are a third of what they are made of.
        let mips: u64 = scene.images.iter().map(|image| image.rgba.len() as u64 / 3).sum();
        let object = format!("tracing {faces} triangles");
        memory::check(faces * memory::FACE_TRACED + mips, &object, memory::SMALLER_SCENE)
    }

    /// Builds the BVH over all faces of `scene`.
    pub fn new(scene: &'s Scene) -> Self {
        let geometry = &scene.geometry;
        let (low, high) = scene.bounds();
        let padding = low.abs().max(high.abs()).max_element() * BOX_PADDING;
        let boxes: Vec<Aabb> =
            (0..geometry.faces.len() as u32).map(|face| padded(geometry.corners(face), padding)).collect();
        let masked = scene.materials.iter().any(|material| matches!(material.alpha_mode, AlphaMode::Mask(_)));
        Self {
            scene,
            bvh: Bvh4::new(&binary::build(&boxes), |face| geometry.corners(face)),
            masked,
            diagonal: (high - low).length(),
            records: surface::records(scene),
            finishes: finishes(scene),
            processor: Processor::all().first().copied(),
        }
    }

    /// The tracer of `scene`, whose faces, objects and materials are those that `hierarchy` was built of; its lights
    /// may be others.
    pub fn with(scene: &'s Scene, hierarchy: Hierarchy) -> Self {
        let Hierarchy { bvh, masked, diagonal, records } = hierarchy;
        let processor = Processor::all().first().copied();
        Self { scene, bvh, masked, diagonal, records, finishes: finishes(scene), processor }
    }

    /// What was built, for another tracer.
    pub fn into_hierarchy(self) -> Hierarchy {
        let Self { bvh, masked, diagonal, records, .. } = self;
        Hierarchy { bvh, masked, diagonal, records }
    }

    /// The scene that is traced.
    pub fn scene(&self) -> &'s Scene {
        self.scene
    }

    /// The diagonal of the box around all faces: nothing that a ray from a face hits is farther away.
    pub fn diagonal(&self) -> f32 {
        self.diagonal
    }

    /// Lets rays start `distance` off every face instead of what its position and size ask for: made to
    /// compare images with renderers that have one global epsilon.
    pub fn set_offset(&mut self, distance: f32) {
        for record in &mut self.records {
            record.offset = distance;
        }
    }

    /// Looks at rays side by side as this processor would, or one by one.
    #[cfg(test)]
    pub(super) fn set_processor(&mut self, processor: Option<Processor>) {
        self.processor = processor;
    }

    #[inline]
    pub(super) fn record(&self, face: u32) -> &Record {
        &self.records[face as usize]
    }

    /// Second texture coordinates of the corners of `face`.
    pub(super) fn second_uvs(&self, face: u32) -> [Vec2; 3] {
        let geometry = &self.scene.geometry;
        geometry.faces[face as usize].map(|corner| geometry.uv(1, corner))
    }

    /// Where rays are looked at side by side.
    pub(super) fn processor(&self) -> Option<Processor> {
        self.processor
    }

    /// Those that [`finish_of`](super::finish::finish_of) tells.
    pub(super) fn finishes(&self) -> &[Finish] {
        &self.finishes
    }

    /// Makes `entries` the places where the rays of `packet` have to look.
    pub(super) fn find_entries(&self, packet: &Packet, entries: &mut EntryPoints) {
        entries.find(&self.bvh, packet);
    }

    /// The nearest hit from `origin` along the unit vector `direction`.
    #[inline]
    pub fn closest(&self, origin: Vec3, direction: Vec3) -> Option<Hit> {
        self.closest_below(self.bvh.root(), origin, direction)
    }

    /// [`closest`](Self::closest) for a ray of the packet that `entries` are of.
    #[inline]
    pub(super) fn closest_among(&self, entries: &EntryPoints, origin: Vec3, direction: Vec3) -> Option<Hit> {
        self.closest_below(entries.nodes(), origin, direction)
    }

    /// [`closest`](Self::closest) for all `rays`, origins and unit directions, of the packet that `entries` are of; `hits` are
    /// made theirs.
    pub(super) fn closest_of_each(
        &self,
        entries: &EntryPoints,
        rays: &[(Vec3, Vec3)],
        hits: &mut Vec<Option<Hit>>,
    ) {
        hits.clear();
        hits.resize(rays.len(), None);
        if entries.is_empty() {
            return;
        }
        if !self.masked
            && rays.len() >= FEWEST_TOGETHER
            && let Some(processor) = self.processor
        {
            return self.closest_together(processor, entries, rays, hits);
        }
        for (&(origin, direction), hit) in rays.iter().zip(hits) {
            *hit = self.closest_among(entries, origin, direction);
        }
    }

    fn closest_together(
        &self,
        processor: Processor,
        entries: &EntryPoints,
        rays: &[(Vec3, Vec3)],
        hits: &mut [Option<Hit>],
    ) {
        let mut groups = [Group::EMPTY; 3];
        for (index, &(_, direction)) in rays.iter().enumerate() {
            let group = &mut groups[quad::axes(direction)[2]];
            group.rays[group.count] = index as u32;
            group.count += 1;
            if group.count == lanes::RAYS {
                self.closest_of_group(processor, entries, rays, std::mem::replace(group, Group::EMPTY), hits);
            }
        }
        for group in groups {
            self.closest_of_group(processor, entries, rays, group, hits);
        }
    }

    fn closest_of_group(
        &self,
        processor: Processor,
        entries: &EntryPoints,
        rays: &[(Vec3, Vec3)],
        group: Group,
        hits: &mut [Option<Hit>],
    ) {
        let indices = &group.rays[..group.count];
        if indices.len() < FEWEST_TOGETHER {
            for &index in indices {
                let (origin, direction) = rays[index as usize];
                hits[index as usize] = self.closest_among(entries, origin, direction);
            }
            return;
        }
        let some = group.rays.map(|index| rays[index as usize]);
        lanes::closest(processor, &self.bvh, entries.nodes(), &some[..indices.len()], |ray, hit| {
            hits[indices[ray] as usize] = hit;
        });
    }

    /// Which of the rays in `lanes`, a bit each, of the packet that `entries` are of, are [`occluded`](Self::occluded).
    #[inline(always)]
    pub(super) fn occluded_of_each<S: Isa>(
        &self,
        entries: &EntryPoints,
        origin: Triple<Numbers<S>>,
        direction: Triple<Numbers<S>>,
        distance: Numbers<S>,
        lanes: u16,
    ) -> u16 {
        if entries.is_empty() {
            return 0;
        }
        if !self.masked && lanes.count_ones() as usize >= FEWEST_TOGETHER {
            let end = distance * distance.all(SHADOW_PART);
            return lanes::occluded(&self.bvh, entries.nodes(), origin, direction, end, lanes);
        }
        let (origins, directions, distances) = (origin.store(), direction.store(), distance.store());
        let mut occluded = 0;
        for lane in (0..WIDTH).filter(|lane| lanes >> lane & 1 == 1) {
            let (origin, direction) = (get(&origins, lane), get(&directions, lane));
            let is = self.occluded_below(entries.nodes(), origin, direction, distances[lane]);
            occluded |= u16::from(is) << lane;
        }
        occluded
    }

    /// Whether anything lies between `origin` and the point `distance` (may be infinite) away along the
    /// unit vector `direction`.
    #[inline]
    pub fn occluded(&self, origin: Vec3, direction: Vec3, distance: f32) -> bool {
        self.occluded_below(self.bvh.root(), origin, direction, distance)
    }

    /// [`occluded`](Self::occluded) for a ray of the packet that `entries` are of.
    #[inline]
    pub(super) fn occluded_among(
        &self,
        entries: &EntryPoints,
        origin: Vec3,
        direction: Vec3,
        distance: f32,
    ) -> bool {
        !entries.is_empty() && self.occluded_below(entries.nodes(), origin, direction, distance)
    }

    /// Whether `accepts` any of the faces in boxes that `meets` says are worth opening; `meets` is given the lower and
    /// the upper corner of a box.
    pub fn any_face(&self, meets: impl Fn(Vec3, Vec3) -> bool, accepts: impl FnMut(u32) -> bool) -> bool {
        self.bvh.any_face(meets, accepts)
    }

    fn closest_below(&self, entries: &[Node], origin: Vec3, direction: Vec3) -> Option<Hit> {
        if self.masked {
            self.closest_of::<true>(entries, origin, direction)
        } else {
            self.closest_of::<false>(entries, origin, direction)
        }
    }

    fn occluded_below(&self, entries: &[Node], origin: Vec3, direction: Vec3, distance: f32) -> bool {
        if self.masked {
            self.occluded_of::<true>(entries, origin, direction, distance)
        } else {
            self.occluded_of::<false>(entries, origin, direction, distance)
        }
    }

    #[inline(always)]
    fn closest_of<const MASKED: bool>(&self, entries: &[Node], origin: Vec3, direction: Vec3) -> Option<Hit> {
        let probe = Probe::new(origin, direction);
        let mut nearest: Option<Hit> = None;
        self.bvh.traverse(entries, &BoxProbe::new(origin, direction), f32::INFINITY, |quad, mut end| {
            let Some(crossing) = quad.intersect(&probe, end.next_up()) else { return Some(end) };
            for lane in crossing.each() {
                let hit = crossing.hit(lane, quad);
                // Of equally near faces the first, in whatever order they come.
                let nearer =
                    hit.t < end || hit.t == end && nearest.is_some_and(|other| hit.face < other.face);
                if nearer && (!MASKED || self.covers(&hit)) {
                    nearest = Some(hit);
                    end = hit.t;
                }
            }
            Some(end)
        });
        nearest
    }

    #[inline(always)]
    fn occluded_of<const MASKED: bool>(
        &self,
        entries: &[Node],
        origin: Vec3,
        direction: Vec3,
        distance: f32,
    ) -> bool {
        let probe = Probe::new(origin, direction);
        let end = distance * SHADOW_PART;
        self.bvh.traverse(entries, &BoxProbe::new(origin, direction), end, |quad, end| {
            let crossing = quad.intersect(&probe, end);
            let stops = |crossing: Crossing| {
                !MASKED || crossing.each().any(|lane| self.covers(&crossing.hit(lane, quad)))
            };
            (!crossing.is_some_and(stops)).then_some(end)
        })
    }

    /// Whether a MASK material lets a hit count.
    fn covers(&self, hit: &Hit) -> bool {
        let material = self.scene.face_material(hit.face);
        let AlphaMode::Mask(cutoff) = material.alpha_mode else { return true };
        let geometry = &self.scene.geometry;
        let corners = geometry.faces[hit.face as usize];
        let w = [1.0 - hit.u - hit.v, hit.u, hit.v];
        let mut alpha = material.base_color.w;
        if !geometry.colors.is_empty() {
            alpha *= corners.iter().zip(w).map(|(&corner, w)| geometry.color(corner).w * w).sum::<f32>();
        }
        if let Some(slot) = &material.base_color_texture {
            let uv = corners.iter().zip(w).map(|(&corner, w)| geometry.uv(slot.uv_set, corner) * w).sum();
            alpha *= texel::lookup(self.scene, slot, uv).w;
        }
        alpha >= cutoff
    }
}

/// The box around a face's corners, `padding` wider on all sides.
fn padded([a, b, c]: [Vec3; 3], padding: f32) -> Aabb {
    Aabb { min: Vec3A::from(a.min(b).min(c) - padding), max: Vec3A::from(a.max(b).max(c) + padding) }
}

#[cfg(test)]
mod tests {
    use glam::vec3;
    use proptest::prelude::*;

    use super::*;
    use crate::scene::Camera;
    use crate::scene::demo::{SceneBuilder, matte, shape};

    fn point() -> impl Strategy<Value = Vec3> {
        prop::array::uniform3(-1.0..1.0_f32).prop_map(Vec3::from)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        /// Rays find together what each finds by itself, to the bit: also where faces coincide, along the axes, and where
        /// there is nothing.
        #[test]
        fn together_rays_find_what_they_find_alone(
            planes in prop::collection::vec((point(), point(), point()), 1..12),
            turned in 0.0..1.5_f32,
            rays in prop::collection::vec((point(), point()), 1..70),
            towards in prop_oneof![point(), Just(Vec3::X), Just(Vec3::NEG_Y)],
        ) {
            let mut builder = SceneBuilder::new("planes");
            let material = builder.material(matte("plane"));
            for (corner, a, b) in planes {
                builder.mesh("plane", shape::plane(corner, a, b, 1.0), material);
                builder.mesh("again", shape::plane(corner, a, b, 1.0), material);
            }
            builder.mesh("ball", shape::sphere(vec3(0.3, 0.2, -0.4), 0.5, 2), material);
            builder.camera(Camera::look_at(Vec3::Z, Vec3::ZERO, 0.8));
            let scene = builder.build().unwrap();
            let mut tracer = Tracer::new(&scene);
            let ray = |(origin, by): (Vec3, Vec3)| Some((origin * 0.5, (towards + by * turned).try_normalize()?));
            let rays: Vec<(Vec3, Vec3)> = rays.into_iter().filter_map(ray).collect();
            let mut packet = Packet::EMPTY;
            rays.iter().for_each(|&(origin, direction)| packet.add(origin, direction));
            let mut entries = EntryPoints::default();
            tracer.find_entries(&packet, &mut entries);
            let alone: Vec<Option<Hit>> =
                rays.iter().map(|&(origin, direction)| tracer.closest(origin, direction)).collect();
            for processor in Processor::all() {
                tracer.set_processor(Some(processor));
                let mut together = Vec::new();
                tracer.closest_of_each(&entries, &rays, &mut together);
                prop_assert_eq!(&together, &alone, "{:?}", processor);
            }
        }
    }
}
