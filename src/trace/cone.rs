//! Ray cones: how much of a face a pixel covers where its ray arrives, so that textures are filtered there as the rasteriser
//! filters them (Akenine-Möller et al., "Texture Level of Detail Strategies for Real-Time Ray Tracing", 2019, and "Improved
//! Shader and Texture Level of Detail Using Ray Cones", 2021).

use glam::Vec3;

use super::Tracer;
use super::optics::BranchKind;
use super::pyramid::Pyramid;
use super::surface::Record;
use crate::scene::{Material, TextureSlot, View};

/// A cone around a ray, at some place along it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Cone {
    /// Its width, in world units; negative behind a focus.
    pub width: f32,
    /// What that grows by in a unit of distance.
    pub spread: f32,
}

impl Cone {
    /// At the eye, of the view ray along the unit vector `direction`: as wide as a pixel, seen straight on.
    pub fn of_pixel(view: &View, direction: Vec3) -> Self {
        let side = 2.0 * view.half.y / view.height as f32;
        if view.orthographic {
            Self { width: side, spread: 0.0 }
        } else {
            // Off the axis the image plane is farther away.
            Self { width: 0.0, spread: side * direction.dot(view.forward) }
        }
    }

    /// At the next place, `distance` on.
    pub fn after(self, distance: f32) -> Self {
        Self { width: self.width + self.spread * distance, ..self }
    }

    /// After reflection by a surface of `curvature`, positive where it bulges towards the ray.
    pub fn reflected(self, curvature: f32) -> Self {
        Self { spread: self.spread + 2.0 * curvature * self.width, ..self }
    }

    /// After refraction there; `eta` is the index of the side that the ray comes from over that of the other.
    pub fn refracted(self, curvature: f32, eta: f32) -> Self {
        Self { spread: eta * self.spread + (eta - 1.0) * curvature * self.width, ..self }
    }

    /// Of the ray that leaves a face of `material` where this one arrives, from outside or from inside.
    pub(super) fn leaving(
        self,
        kind: BranchKind,
        record: &Record,
        material: &Material,
        outside: bool,
    ) -> Self {
        let curvature = if outside { record.curvature() } else { -record.curvature() };
        match (kind, material.volume) {
            (BranchKind::Reflect, _) => self.reflected(curvature),
            // A thin wall is passed straight.
            (BranchKind::Refract, None) => self,
            (BranchKind::Refract, Some(_)) if outside => self.refracted(curvature, material.ior.recip()),
            (BranchKind::Refract, Some(_)) => self.refracted(curvature, material.ior),
        }
    }
}

/// How textures are filtered along the view rays of pixels.
#[derive(Clone, Copy)]
pub struct Filtering<'a> {
    /// By texture: its mip levels, where they are used.
    pub pyramids: &'a [Option<Pyramid>],
    /// Greatest ratio of the axes of what a lookup covers: 1 where it is a square.
    pub anisotropy: f32,
    /// Whose pixels they are.
    pub view: &'a View,
}

impl<'a> Filtering<'a> {
    /// The cone of the view ray along the unit vector `direction` at a point of it.
    #[inline(never)]
    pub(super) fn at_first(&self, point: Vec3, direction: Vec3) -> Cone {
        Cone::of_pixel(self.view, direction).after(self.view.distance_to(point))
    }

    /// What `cone` covers of `face`, where its ray arrives along the unit vector `direction`.
    #[inline]
    pub(super) fn footprint(&self, tracer: &Tracer, face: u32, cone: Cone, direction: Vec3) -> Footprint<'a> {
        let record = tracer.record(face);
        // Anisotropic filtering takes means of as many lookups along the longer axis. Here is one, of the shorter one's level.
        let long = 1.0 / record.ng.dot(direction).abs();
        let side = cone.width.abs() * (long / self.anisotropy).max(1.0);
        let second = if record.extras { record.density(tracer.second_uvs(face)) } else { 0.0 };
        Footprint { pyramids: self.pyramids, sides: [side * record.density(record.uvs), side * second] }
    }
}

/// What a cone covers of a face.
pub struct Footprint<'a> {
    pyramids: &'a [Option<Pyramid>],
    /// Its side, in each set of texture coordinates.
    sides: [f32; 2],
}

impl<'a> Footprint<'a> {
    /// Mip levels of the texture in `slot`, and the one that is as coarse as the footprint: below 0 where texels are larger.
    #[inline]
    pub(super) fn level(&self, slot: &TextureSlot, texels: u32) -> Option<(&'a Pyramid, f32)> {
        let pyramid = self.pyramids[slot.texture as usize].as_ref()?;
        let scale = (slot.transform.matrix2.determinant().abs() * texels as f32).sqrt();
        Some((pyramid, (self.sides[usize::from(slot.uv_set)] * scale).log2()))
    }
}

#[cfg(test)]
mod tests {
    use glam::vec3;

    use super::super::pyramid::Pyramids;
    use super::*;
    use crate::options::FilterMode;
    use crate::scene::demo::{SceneBuilder, chrome, glass, matte, shape, texture};
    use crate::scene::{Camera, Projection, Sampler, Scene, Volume};

    /// A wall of 64 texels to a unit of length, at z = 0.
    fn wall(camera: Camera) -> Scene {
        let mut scene = SceneBuilder::new("wall");
        let boards = scene.sampled_texture(texture::chessboard(64), Sampler::default(), true);
        let wall = scene.material(matte("wall").textured(boards));
        scene.mesh(
            "wall",
            shape::plane(vec3(-50.0, -50.0, 0.0), Vec3::X * 100.0, Vec3::Y * 100.0, 1.0),
            wall,
        );
        scene.camera(camera);
        scene.build().unwrap()
    }

    /// The level that the pixel in the middle of an image of `height` rows reads of the wall.
    fn level(scene: &Scene, height: u32, filter: FilterMode) -> f32 {
        let view = View::new(&scene.cameras[0], height, height, scene.bounds());
        let tracer = Tracer::new(scene);
        let pyramids = Pyramids::new(scene, &[true], filter).unwrap();
        let filtering = pyramids.filtering(scene, &view);
        let (origin, direction) = view.ray(glam::Vec2::splat(height as f32 / 2.0));
        let hit = tracer.closest(origin, direction).unwrap();
        let cone = filtering.at_first(tracer.record(hit.face).position(hit.u, hit.v), direction);
        let slot = scene.materials[0].base_color_texture.unwrap();
        filtering.footprint(&tracer, hit.face, cone, direction).level(&slot, 64 * 64).unwrap().1
    }

    fn close(a: f32, b: f32) {
        assert!((a - b).abs() < 1e-3 * (1.0 + b.abs()), "{a} {b}");
    }

    #[test]
    fn a_pixel_seen_straight_on_covers_its_square() {
        // Ten units high at a distance of 5: ten texels a pixel of 64 rows.
        let mut camera = Camera::look_at(vec3(0.0, 0.0, 5.0), Vec3::ZERO, 90_f32.to_radians());
        for filter in [FilterMode::File, FilterMode::Aniso8] {
            close(level(&wall(camera.clone()), 64, filter), 10_f32.log2());
        }
        close(level(&wall(camera.clone()), 640, FilterMode::File), 0.0);
        camera.projection = Projection::Orthographic { ymag: 5.0, xmag: 5.0 };
        close(level(&wall(camera.clone()), 64, FilterMode::File), 10_f32.log2());
    }

    #[test]
    fn a_slanted_view_reads_the_longer_axis_up_to_the_ratio() {
        for [cos, aniso8] in [[0.25_f32, 1.0], [0.05, 2.5]] {
            let from = vec3((1.0 - cos * cos).sqrt(), 0.0, cos) * 5.0;
            let scene = wall(Camera::look_at(from, Vec3::ZERO, 90_f32.to_radians()));
            close(level(&scene, 64, FilterMode::Trilinear), (10.0 / cos).log2());
            close(level(&scene, 64, FilterMode::Aniso8), (10.0 * aniso8).log2());
        }
    }

    /// The first face of an object whose material is `material`.
    fn face_of(material: Material, mesh: crate::scene::demo::Mesh) -> Scene {
        let mut scene = SceneBuilder::new("face");
        let material = scene.material(material);
        scene.mesh("mesh", mesh, material);
        scene.build().unwrap()
    }

    #[test]
    fn a_flat_mirror_goes_on_as_if_it_were_not_there() {
        let scene = face_of(chrome("mirror", Vec3::ONE), shape::plane(Vec3::ZERO, Vec3::X, Vec3::Y, 1.0));
        let tracer = Tracer::new(&scene);
        let cone = Cone { width: 0.1, spread: 0.02 };
        let leaves =
            |outside| cone.leaving(BranchKind::Reflect, tracer.record(0), &scene.materials[0], outside);
        assert_eq!(leaves(true), cone);
        assert_eq!(leaves(false).after(3.0).after(3.0), cone.after(6.0));
    }

    #[test]
    fn balls_focus_as_optics_has_it() {
        const RADIUS: f32 = 2.0;
        let beam = Cone { width: 0.1, spread: 0.0 };
        let leaves = |material, kind, outside| {
            let scene = face_of(material, shape::sphere(Vec3::ZERO, RADIUS, 4));
            let tracer = Tracer::new(&scene);
            beam.leaving(kind, tracer.record(0), &scene.materials[0], outside)
        };
        let focus = |cone: Cone| -cone.width / cone.spread;
        let mirror = chrome("mirror", Vec3::ONE);
        close(focus(leaves(mirror.clone(), BranchKind::Reflect, true)), -RADIUS / 2.0);
        close(focus(leaves(mirror, BranchKind::Reflect, false)), RADIUS / 2.0);
        // f = n r / (n − 1) into the glass; r / (n − 1) out of it.
        let clear = Volume { attenuation_color: Vec3::ONE, attenuation_distance: f32::INFINITY };
        let body = Material { volume: Some(clear), ..glass("ball", 1.5) };
        close(focus(leaves(body.clone(), BranchKind::Refract, true)), 3.0 * RADIUS);
        close(focus(leaves(body, BranchKind::Refract, false)), 2.0 * RADIUS);
        assert_eq!(leaves(glass("pane", 1.5), BranchKind::Refract, true), beam);
    }
}
