//! The ID buffer against a plain ray caster, pixel by pixel, on a real device under validation.

mod common;

use std::sync::Arc;

use glam::{DVec3, Vec2, Vec3, Vec4};
use rayon::prelude::*;
use vertex_tracing::{
    constants::{CODE_SHADOW, CODE_VT},
    gpu::{DeviceKind, Fault, Gpu, Options, ReadbackChoice, ReadbackMemory},
    scene::{
        AlphaMode, Background, Camera, Filter, Geometry, Image, Material, Object, Projection, Sampler, Scene,
        Texture, TextureSlot, View, topology::Topology,
    },
    visibility::{Adjacency, Class, Pass, classes, device},
};

use common::TestGpu;

// ---- scenes ----

/// A scene from objects, each a material, whether it is a VT object, and its triangles.
fn scene(objects: &[(Material, bool, Vec<[Vec3; 3]>)]) -> Scene {
    let mut geometry = Geometry::default();
    let mut list = Vec::new();
    for (index, (_, vt, triangles)) in (0..).zip(objects) {
        let (vertex, face) = (geometry.positions.len() as u32, geometry.faces.len() as u32);
        for corners in triangles {
            let first = geometry.positions.len() as u32;
            let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize();
            geometry.positions.extend(corners);
            geometry.normals.extend([normal; 3]);
            geometry.faces.push([first, first + 1, first + 2]);
            geometry.face_objects.push(index);
        }
        list.push(Object {
            name: format!("object {index}"),
            mesh_name: None,
            material: index,
            faces: face..geometry.faces.len() as u32,
            vertices: vertex..geometry.positions.len() as u32,
            vt_extra: None,
            vt: *vt,
        });
    }
    Scene {
        name: "test".into(),
        origin: DVec3::ZERO,
        geometry,
        objects: list,
        materials: objects.iter().map(|object| object.0.clone()).collect(),
        textures: Vec::new(),
        images: Vec::new(),
        lights: Vec::new(),
        cameras: Vec::new(),
        background: Background::default(),
        ambient: 0.0,
        unread: Vec::new(),
        notes: Vec::new(),
    }
}

fn both_sides() -> Material {
    Material { double_sided: true, ..Material::default() }
}

/// Two triangles that face +z, between the corners `low` and `high` of a square at depth `z`.
fn quad(low: Vec2, high: Vec2, z: f32) -> Vec<[Vec3; 3]> {
    let at = |x, y| Vec3::new(x, y, z);
    let (a, b, c, d) = (at(low.x, low.y), at(high.x, low.y), at(high.x, high.y), at(low.x, high.y));
    vec![[a, b, c], [a, c, d]]
}

/// A sphere of `2 · rings · rings` quads, its faces outward.
fn sphere(centre: Vec3, radius: f32, rings: u32) -> Vec<[Vec3; 3]> {
    let at = |i: u32, j: u32| {
        let (theta, phi) = (
            std::f32::consts::PI * i as f32 / rings as f32,
            std::f32::consts::TAU * (j % (2 * rings)) as f32 / (2 * rings) as f32,
        );
        centre + radius * Vec3::new(theta.sin() * phi.cos(), theta.cos(), -theta.sin() * phi.sin())
    };
    let mut triangles = Vec::new();
    for i in 0..rings {
        for j in 0..2 * rings {
            let (a, b, c, d) = (at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
            if i + 1 < rings {
                triangles.push([a, b, c]);
            }
            if i > 0 {
                triangles.push([a, c, d]);
            }
        }
    }
    triangles
}

/// Triangles of random size and place, which cut through each other.
fn soup(count: usize, size: f32) -> Vec<[Vec3; 3]> {
    let mut state = 12345_u64;
    let mut random = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f32 / (1 << 23) as f32 - 1.0
    };
    let mut point = |scale: f32| Vec3::new(random(), random(), random()) * scale;
    (0..count)
        .map(|_| {
            let centre = point(1.5);
            [centre + point(size), centre + point(size), centre + point(size)]
        })
        .collect()
}

fn view(scene: &Scene, width: u32, height: u32) -> View {
    let camera = Camera::look_at(Vec3::new(0.3, 0.4, 5.0), Vec3::new(0.05, -0.02, 0.0), 0.7);
    View::new(&camera, width, height, scene.bounds())
}

// ---- the ray caster ----

/// The scene's faces in `f64`, with the rows of the image that each can reach.
struct Caster<'a> {
    view: &'a View,
    faces: Vec<([DVec3; 3], bool)>,
    rows: Vec<Vec<u32>>,
}

impl<'a> Caster<'a> {
    fn new(scene: &Scene, view: &'a View) -> Self {
        let mut rows = vec![Vec::new(); view.height as usize];
        let faces = (0..scene.geometry.faces.len() as u32)
            .map(|face| {
                let corners = scene.geometry.corners(face);
                let ys: Option<Vec<f32>> = corners.iter().map(|&c| Some(view.project(c)?.0.y)).collect();
                // A corner behind the eye: anywhere.
                let ys = ys.unwrap_or(vec![0.0, view.height as f32]);
                let low = ys.iter().copied().fold(f32::INFINITY, f32::min) - 2.0;
                let high = ys.iter().copied().fold(f32::NEG_INFINITY, f32::max) + 2.0;
                let first = (low.max(0.0) as usize).min(rows.len());
                let end = (high.max(0.0) as usize).clamp(first, rows.len());
                rows[first..end].iter_mut().for_each(|row| row.push(face));
                (corners.map(Vec3::as_dvec3), !scene.face_material(face).double_sided)
            })
            .collect();
        Self { view, faces, rows }
    }

    /// The nearest face along the ray through image point (`x`, `y`), by Möller and Trumbore.
    fn cast(&self, x: f64, y: f64) -> Option<u32> {
        let view = self.view;
        let h = (2.0 * x / f64::from(view.width) - 1.0) * f64::from(view.half.x);
        let v = (1.0 - 2.0 * y / f64::from(view.height)) * f64::from(view.half.y);
        let offset = view.right.as_dvec3() * h + view.up.as_dvec3() * v;
        let (origin, direction) = match view.orthographic {
            true => (view.eye.as_dvec3() + offset, view.forward.as_dvec3()),
            false => (view.eye.as_dvec3(), view.forward.as_dvec3() + offset),
        };
        let mut best = (f64::INFINITY, None);
        for &face in &self.rows[(y as usize).min(view.height as usize - 1)] {
            let ([a, b, c], cull) = self.faces[face as usize];
            let (e1, e2) = (b - a, c - a);
            let p = direction.cross(e2);
            let determinant = e1.dot(p);
            if determinant == 0.0 || (cull && determinant < 0.0) {
                continue;
            }
            let s = origin - a;
            let u = s.dot(p) / determinant;
            let q = s.cross(e1);
            let (w, t) = (direction.dot(q) / determinant, e2.dot(q) / determinant);
            if u >= 0.0 && w >= 0.0 && u + w <= 1.0 && t > 0.0 && t <= best.0 {
                best = (t, Some(face));
            }
        }
        best.1
    }
}

// ---- the comparison ----

/// Holds the ID buffer of `scene` against the ray caster. Where they differ, the caster must find the
/// device's answer within 1/64 pixel: the rasteriser snaps corners to 1/256 pixel. At most `hairs` pixels may.
fn check(scene: &Scene, classes: &[Class], view: &View, hairs: usize) {
    let gpu = TestGpu::open();
    let mut pass = Pass::new(&gpu, scene, classes).unwrap();
    let visibility = pass.run(view).unwrap();
    let caster = Caster::new(scene, view);
    let class = |face: u32| classes[scene.geometry.face_objects[face as usize] as usize];
    let expected = |x: f64, y: f64| match caster.cast(x, y) {
        Some(face) if class(face) != Class::Occluder => (Some(face), class(face).code()),
        _ => (None, 0),
    };
    let hair_pixels: usize = (0..view.height)
        .into_par_iter()
        .map(|y| {
            let mut differing = 0;
            for x in 0..view.width {
                let found = (visibility.ids.unwrap().face(x, y), visibility.ids.unwrap().code(x, y));
                let (cx, cy) = (f64::from(x) + 0.5, f64::from(y) + 0.5);
                if found != expected(cx, cy) {
                    differing += 1;
                    let near = (0..16).any(|i| {
                        let angle = f64::from(i) * std::f64::consts::TAU / 16.0;
                        let radius = if i % 2 == 0 { 1.0 / 64.0 } else { 1.0 / 256.0 };
                        found == expected(cx + radius * angle.cos(), cy + radius * angle.sin())
                    });
                    assert!(near, "pixel ({x}, {y}): device {found:?}, caster {:?}", expected(cx, cy));
                }
            }
            differing
        })
        .sum();
    assert!(hair_pixels <= hairs, "{hair_pixels} pixels differ by a hair, more than {hairs}");

    // The counts are those of the image.
    let mut counts = vec![0; scene.geometry.faces.len()];
    let mut codes = [0_u64; 256];
    for y in 0..view.height {
        for x in 0..view.width {
            codes[usize::from(visibility.ids.unwrap().code(x, y))] += 1;
            if let Some(face) = visibility.ids.unwrap().face(x, y) {
                counts[face as usize] += 1;
            }
        }
    }
    assert_eq!(visibility.faces.pixels_per_face, counts);
    assert_eq!(visibility.faces.vt_pixels, codes[CODE_VT as usize]);
    assert_eq!(visibility.faces.shadow_pixels, codes[CODE_SHADOW as usize]);
    assert!(visibility.faces.visible.iter().all(|&face| counts[face as usize] > 0));
    assert_eq!(visibility.faces.visible.len(), counts.iter().filter(|&&count| count > 0).count());
    let vt = visibility.faces.visible.iter().filter(|&&face| class(face) == Class::Vt).count();
    assert_eq!(visibility.visible_vt, vt);

    // Counting on the device finds the same.
    let mut device_pass = device::Pass::new(&gpu, scene, classes, ReadbackChoice::Best).unwrap();
    let counted = device_pass.run(view).unwrap();
    assert_eq!((counted.faces, counted.visible_vt), (visibility.faces, visibility.visible_vt));
    assert_eq!(counted.readback_bytes, 4 * scene.geometry.faces.len() as u64);
    drop((pass, device_pass));
    gpu.finish();
}

fn all_vt(scene: &Scene) -> Vec<Class> {
    vec![Class::Vt; scene.objects.len()]
}

// ---- tests ----

#[test]
fn a_quad_behind_a_quad() {
    let near = quad(Vec2::new(-0.5, -0.4), Vec2::new(0.3, 0.6), 0.5);
    let far = quad(Vec2::splat(-1.2), Vec2::splat(1.2), -0.5);
    // The near one is drawn first: only depth can decide.
    let scene = scene(&[(Material::default(), true, near), (Material::default(), true, far)]);
    check(&scene, &all_vt(&scene), &view(&scene, 160, 120), 40);
}

#[test]
fn triangles_that_cut_through_each_other() {
    let scene = scene(&[(both_sides(), true, soup(300, 0.8))]);
    check(&scene, &all_vt(&scene), &view(&scene, 200, 150), 300);
}

#[test]
fn spheres_of_many_sizes() {
    for (rings, hairs) in [(6, 20), (36, 200), (160, 1500)] {
        let scene = scene(&[(Material::default(), true, sphere(Vec3::ZERO, 1.4, rings))]);
        check(&scene, &all_vt(&scene), &view(&scene, 160, 128), hairs);
    }
}

#[test]
fn backs_are_culled_only_where_single_sided() {
    let mut reversed = quad(Vec2::new(-1.0, -1.0), Vec2::new(0.0, 1.0), 0.5);
    reversed.iter_mut().for_each(|corners| corners.swap(1, 2));
    let mut moved = reversed.clone();
    moved.iter_mut().flatten().for_each(|corner| corner.x += 1.0);
    let back = quad(Vec2::splat(-1.5), Vec2::splat(1.5), -0.5);
    let scene = scene(&[
        (Material::default(), true, reversed),
        (both_sides(), true, moved),
        (Material::default(), true, back),
    ]);
    let view = view(&scene, 96, 96);
    check(&scene, &all_vt(&scene), &view, 40);
    let caster = Caster::new(&scene, &view);
    let seen = |x| caster.cast(x, 48.0).map(|face| scene.geometry.face_objects[face as usize]);
    assert_eq!((seen(35.0), seen(62.0)), (Some(2), Some(1)), "the scene shows both cases");
}

#[test]
fn parallel_projection() {
    let scene = scene(&[
        (Material::default(), true, sphere(Vec3::ZERO, 1.0, 20)),
        (both_sides(), true, soup(60, 0.5)),
    ]);
    let camera = Camera {
        projection: Projection::Orthographic { xmag: 2.0, ymag: 1.5 },
        ..Camera::look_at(Vec3::new(1.0, 0.5, 4.0), Vec3::ZERO, 1.0)
    };
    check(&scene, &all_vt(&scene), &View::new(&camera, 160, 120, scene.bounds()), 200);
}

#[test]
fn one_pixel() {
    let scene = scene(&[(Material::default(), true, quad(Vec2::splat(-9.0), Vec2::splat(9.0), 0.0))]);
    check(&scene, &all_vt(&scene), &view(&scene, 1, 1), 0);
}

#[test]
fn an_empty_scene() {
    let scene = scene(&[]);
    check(&scene, &[], &view(&scene, 16, 16), 0);
}

#[test]
fn the_eye_inside_and_faces_behind_it() {
    // A floor that runs from far ahead to far behind the eye.
    let floor = vec![
        [Vec3::new(-50.0, -1.0, 60.0), Vec3::new(50.0, -1.0, 60.0), Vec3::new(50.0, -1.0, -60.0)],
        [Vec3::new(-50.0, -1.0, 60.0), Vec3::new(50.0, -1.0, -60.0), Vec3::new(-50.0, -1.0, -60.0)],
    ];
    let scene =
        scene(&[(Material::default(), true, floor), (both_sides(), true, sphere(Vec3::ZERO, 20.0, 12))]);
    check(&scene, &all_vt(&scene), &view(&scene, 128, 96), 300);
}

#[test]
fn far_from_the_origin() {
    let offset = Vec3::new(40_000.0, -30_000.0, 20_000.0);
    let scene = scene(&[(Material::default(), true, sphere(offset, 1.0, 20))]);
    let camera = Camera::look_at(offset + Vec3::new(0.0, 0.5, 4.0), offset, 0.7);
    check(&scene, &all_vt(&scene), &View::new(&camera, 120, 90, scene.bounds()), 150);
}

#[test]
fn codes_of_every_class() {
    let at = |x: f32| quad(Vec2::new(x, -1.0), Vec2::new(x + 0.6, 1.0), 0.5);
    let mut scene = scene(&[
        (Material::default(), false, quad(Vec2::splat(-2.0), Vec2::splat(2.0), -0.5)),
        (Material::default(), true, at(-0.9)),
        (Material { unlit: true, ..Material::default() }, false, at(0.3)),
    ]);
    let with_shadows = classes(&scene, true);
    assert_eq!(with_shadows, [Class::Shadow, Class::Vt, Class::Occluder]);
    assert_eq!(classes(&scene, false), [Class::Occluder, Class::Vt, Class::Occluder]);
    let view = view(&scene, 128, 128);
    check(&scene, &with_shadows, &view, 40);
    check(&scene, &classes(&scene, false), &view, 40);

    // What one sees through is not drawn, unless it is a VT object.
    scene.materials[1].alpha_mode = AlphaMode::Blend;
    scene.materials[2].alpha_mode = AlphaMode::Blend;
    let gpu = TestGpu::open();
    let mut pass = Pass::new(&gpu, &scene, &with_shadows).unwrap();
    // So near that the quad behind fills the image.
    let camera = Camera::look_at(Vec3::new(0.0, 0.0, 5.0), Vec3::ZERO, 0.6);
    let ids = pass.run(&View::new(&camera, 128, 128, scene.bounds())).unwrap().ids.unwrap();
    let codes = [(35, 64), (64, 64), (85, 64), (0, 127)].map(|(x, y)| u32::from(ids.code(x, y)));
    assert_eq!(codes, [CODE_VT, CODE_SHADOW, CODE_SHADOW, CODE_SHADOW]);
    let corner = ids.face(0, 127).map(|face| scene.geometry.face_objects[face as usize]);
    assert_eq!(corner, Some(0));
    drop(pass);
    gpu.finish();
}

#[test]
fn masked_faces_have_holes() {
    let mut scene = scene(&[
        (Material::default(), true, quad(Vec2::splat(-1.0), Vec2::splat(1.0), 0.5)),
        (Material::default(), true, quad(Vec2::splat(-3.0), Vec2::splat(3.0), -0.5)),
    ]);
    // Two texels side by side: the left one is a hole.
    let rgba = Arc::from([255, 255, 255, 0, 255, 255, 255, 255]);
    scene.images.push(Image { name: "holes".into(), width: 2, height: 1, rgba });
    let sampler = Sampler { mag: Filter::Nearest, min: Filter::Nearest, mip: None, ..Sampler::default() };
    scene.textures.push(Texture { image: 0, sampler, srgb: true });
    scene.materials[0].alpha_mode = AlphaMode::Mask(0.5);
    scene.materials[0].base_color_texture =
        Some(TextureSlot { texture: 0, uv_set: 0, transform: glam::Affine2::IDENTITY });
    scene.geometry.uvs[0] =
        scene.geometry.positions.iter().map(|p| Vec2::new(p.x, 1.0 - p.y) * 0.5 + 0.5).collect();
    let camera = Camera::look_at(Vec3::new(0.0, 0.0, 5.0), Vec3::ZERO, 0.7);
    let view = View::new(&camera, 64, 64, scene.bounds());

    let gpu = TestGpu::open();
    let seen = |scene: &Scene| {
        let mut pass = Pass::new(&gpu, scene, &all_vt(scene)).unwrap();
        let visibility = pass.run(&view).unwrap();
        [24, 40].map(|x| {
            visibility.ids.unwrap().face(x, 30).map(|face| scene.geometry.face_objects[face as usize])
        })
    };
    assert_eq!(seen(&scene), [Some(1), Some(0)]);
    // The factor and the vertex colour count as well.
    scene.materials[0].base_color = Vec4::new(1.0, 1.0, 1.0, 0.6);
    assert_eq!(seen(&scene), [Some(1), Some(0)]);
    scene.geometry.colors = vec![Vec4::new(1.0, 1.0, 1.0, 0.8); scene.geometry.positions.len()];
    assert_eq!(seen(&scene), [Some(1), Some(1)]);
    scene.materials[0].alpha_mode = AlphaMode::Mask(0.0);
    assert_eq!(seen(&scene), [Some(0), Some(0)]);
    gpu.finish();
}

#[test]
fn every_kind_of_memory_gives_the_same() {
    let scene = scene(&[(both_sides(), true, soup(500, 0.5))]);
    let gpu = TestGpu::open();
    let mut pass = Pass::new(&gpu, &scene, &all_vt(&scene)).unwrap();
    // A width that makes neither rows nor the whole a multiple of any atom size.
    let view = view(&scene, 127, 63);
    let expected = pass.run(&view).unwrap().ids.unwrap().pixels.to_vec();
    assert!(expected.iter().any(|&pixel| pixel != 0));
    for memory in ReadbackMemory::ALL {
        pass.set_readback(ReadbackChoice::Treat(memory));
        for _ in 0..2 {
            let visibility = pass.run(&view).unwrap();
            assert_eq!(visibility.readback_memory, memory);
            assert_eq!(visibility.readback_bytes, 127 * 63 * 4);
            assert!(visibility.ids.unwrap().pixels == expected, "{}", memory.name());
        }
        pass.set_readback(ReadbackChoice::Only(memory));
        match pass.run(&view) {
            Ok(visibility) => assert!(visibility.ids.unwrap().pixels == expected, "{}", memory.name()),
            Err(error) => assert!(error.to_string().contains(memory.name()), "{error}"),
        }
    }
    drop(pass);
    gpu.finish();
}

#[test]
fn reading_in_place_gives_the_same() {
    let scene = scene(&[(both_sides(), true, soup(500, 0.5))]);
    let gpu = TestGpu::open();
    let mut pass = Pass::new(&gpu, &scene, &all_vt(&scene)).unwrap();
    // Rows without gaps, whatever the device's alignment; then rows that may have some.
    for width in [256, 255] {
        let view = view(&scene, width, 64);
        pass.set_readback(ReadbackChoice::Best);
        pass.run(&view).unwrap();
        let in_place = pass.run(&view).unwrap().ids.unwrap().pixels.to_vec();
        let software = gpu.info().kind == DeviceKind::Cpu;
        assert!(pass.reads_in_place() == software || width == 255, "software devices need no copy");
        pass.set_readback(ReadbackChoice::Treat(ReadbackMemory::CachedCoherent));
        assert!(
            pass.run(&view).unwrap().ids.unwrap().pixels == in_place && in_place.iter().any(|&id| id != 0)
        );
        assert!(!pass.reads_in_place());
    }
    drop(pass);
    gpu.finish();
}

#[test]
fn runs_repeat_for_any_size_order_and_thread_count() {
    let scene = scene(&[(both_sides(), true, soup(2000, 0.3))]);
    let gpu = TestGpu::open();
    let mut pass = Pass::new(&gpu, &scene, &all_vt(&scene)).unwrap();
    let (small, large) = (view(&scene, 64, 48), view(&scene, 320, 200));
    pass.warm_up(&small).unwrap();
    let mut run = |view: &View, threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let visibility = pass.run(view).unwrap();
            assert!(visibility.times.visibility > 0.0 && visibility.times.readback > 0.0);
            (visibility.faces.clone(), visibility.ids.unwrap().pixels.to_vec())
        })
    };
    let (first_small, first_large) = (run(&small, 1), run(&large, 1));
    for threads in [1, 2, 5] {
        assert!(run(&large, threads) == first_large);
        assert!(run(&small, threads) == first_small);
    }
    drop(pass);
    gpu.finish();
}

#[test]
fn small_faces_are_found_by_the_ring() {
    let scene = scene(&[(Material::default(), true, sphere(Vec3::ZERO, 1.0, 40))]);
    let classes = all_vt(&scene);
    let gpu = TestGpu::open();
    let mut pass = Pass::new(&gpu, &scene, &classes).unwrap();
    let topology = Topology::new(&scene.geometry);
    let adjacency = Adjacency::new(&scene, &topology);
    let coarse = view(&scene, 64, 48);
    let visible = pass.run(&coarse).unwrap().faces.visible.clone();
    let ring = adjacency.one_ring(&scene, &topology, &classes, &coarse, &visible);
    assert!(ring.is_sorted() && visible.iter().all(|face| ring.binary_search(face).is_ok()));
    // Everything that a hundred times the pixels show is marked, though the small image missed some.
    let fine = pass.run(&view(&scene, 640, 480)).unwrap().faces.visible.clone();
    assert!(fine.len() > visible.len());
    let missed: Vec<_> = fine.iter().filter(|face| ring.binary_search(face).is_err()).collect();
    assert!(missed.is_empty(), "{} of {} faces are missed", missed.len(), fine.len());
    // Faces on the far side are not.
    assert!(ring.len() < scene.geometry.faces.len() * 3 / 5, "{} faces", ring.len());
    drop(pass);
    gpu.finish();
}

#[test]
fn a_hundred_thousand_faces_in_a_thousand_pixels() {
    let scene = scene(&[(Material::default(), true, sphere(Vec3::ZERO, 1.0, 160))]);
    assert!(scene.geometry.faces.len() > 100_000);
    let classes = all_vt(&scene);
    let gpu = TestGpu::open();
    let mut pass = Pass::new(&gpu, &scene, &classes).unwrap();
    let topology = Topology::new(&scene.geometry);
    let adjacency = Adjacency::new(&scene, &topology);
    let coarse = view(&scene, 64, 64);
    let found = pass.run(&coarse).unwrap();
    assert!(found.faces.vt_pixels < 1300, "{} pixels", found.faces.vt_pixels);
    let visible = found.faces.visible.clone();
    let ring = adjacency.one_ring(&scene, &topology, &classes, &coarse, &visible);
    // What a reference of 40 x 40 samples a pixel shows.
    let fine = pass.run(&view(&scene, 2560, 2560)).unwrap().faces.visible.clone();
    assert!(fine.len() > 30 * visible.len(), "{} faces for {}", fine.len(), visible.len());
    let missed = fine.iter().filter(|face| ring.binary_search(face).is_err()).count();
    assert_eq!(missed, 0, "of {} faces", fine.len());
    drop(pass);
    gpu.finish();
}

#[test]
fn failures_leave_nothing_behind() {
    let scene = scene(&[(Material::default(), true, quad(Vec2::splat(-1.0), Vec2::splat(1.0), 0.0))]);
    let view = view(&scene, 32, 32);
    for (call, fault) in [
        ("vkCreateBuffer", Fault::OutOfDeviceMemory),
        ("vkAllocateMemory", Fault::OutOfDeviceMemory),
        ("vkBindBufferMemory", Fault::OutOfDeviceMemory),
        ("vkMapMemory", Fault::OutOfDeviceMemory),
        ("vkCreateImage", Fault::OutOfDeviceMemory),
        ("vkCreateImageView", Fault::OutOfDeviceMemory),
        ("vkCreateShaderModule", Fault::OutOfDeviceMemory),
        ("vkCreateGraphicsPipelines", Fault::OutOfDeviceMemory),
        ("vkCreateDescriptorPool", Fault::OutOfDeviceMemory),
        ("vkAllocateDescriptorSets", Fault::OutOfDeviceMemory),
        ("vkCreateCommandPool", Fault::OutOfDeviceMemory),
        ("vkCreateQueryPool", Fault::OutOfDeviceMemory),
        ("vkBeginCommandBuffer", Fault::DeviceLost),
        ("vkQueueSubmit2", Fault::DeviceLost),
    ] {
        let gpu = TestGpu::open();
        gpu.fail_next(call, fault);
        let failed = Pass::new(&gpu, &scene, &all_vt(&scene)).and_then(|mut pass| {
            pass.set_readback(ReadbackChoice::Treat(ReadbackMemory::CachedCoherent));
            pass.run(&view).map(drop)
        });
        let message = failed.expect_err(call).to_string();
        assert!(message.contains("ID buffer"), "{call}: {message}");
        assert!(message.contains(call) || message.contains("memory"), "{call}: {message}");
        // And the device goes on serving.
        Pass::new(&gpu, &scene, &all_vt(&scene)).unwrap().run(&view).unwrap();
        gpu.finish();
    }
}

#[test]
fn sizes_beyond_the_device_are_refused() {
    let scene = scene(&[]);
    let gpu = TestGpu::open();
    let mut pass = Pass::new(&gpu, &scene, &[]).unwrap();
    let too_wide = view(&scene, gpu.max_image_size() + 1, 1);
    let message = pass.run(&too_wide).unwrap_err().to_string();
    assert!(
        message.contains("ID buffer") && message.contains(&gpu.max_image_size().to_string()),
        "{message}"
    );
    assert!(pass.run(&view(&scene, 8, 8)).is_ok());
    drop(pass);
    gpu.finish();
}

#[test]
fn unknown_devices_are_refused_by_name() {
    let options = Options { device: Some("no such card".into()), ..Options::default() };
    let message = Gpu::new(&options).unwrap_err().to_string();
    assert!(message.contains("no such card") && message.contains("there are"), "{message}");
    let listed = vertex_tracing::gpu::devices().unwrap();
    assert!(
        listed.iter().any(|device| device.usable.is_ok() && device.api_version >= [1, 3, 0]),
        "{listed:?}"
    );
}
