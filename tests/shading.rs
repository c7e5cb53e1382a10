//! Light transport against closed forms, computed in double precision.

use std::f64::consts::PI;
use std::sync::{Arc, atomic::AtomicBool};

use glam::{Affine2, DVec3, Vec2, Vec3, Vec4};
use vertex_tracing::constants::{DEFAULT_AMBIENT, REFLECTION_LIFT};
use vertex_tracing::error::Error;
use vertex_tracing::scene::demo::Demo;
use vertex_tracing::scene::{
    AlphaMode, Background, Camera, Environment, Filter, Geometry, Image, Light, LightKind, Material, Object,
    Projection, Sampler, Scene, Texture, TextureSlot, View, Volume, Wrap,
};
use vertex_tracing::trace::optics::{self, BranchKind};
use vertex_tracing::trace::reference::{self, Following, Samples};
use vertex_tracing::trace::wave::Points;
use vertex_tracing::trace::{Appearance, Rays, Settings, Shadows, Surface, Tracer, shade, texel};

/// Nothing dropped, every path followed until its rest is below single precision.
const EXACT: Settings = Settings { depth: 40, min_throughput: 0.0, shadows: Shadows::All, fresnel: false };

/// Glass that absorbs nothing.
const CLEAR: Volume = Volume { attenuation_color: Vec3::ONE, attenuation_distance: f32::INFINITY };

fn empty() -> Scene {
    Scene {
        name: "test".into(),
        origin: DVec3::ZERO,
        geometry: Geometry::default(),
        objects: Vec::new(),
        materials: Vec::new(),
        textures: Vec::new(),
        images: Vec::new(),
        lights: Vec::new(),
        cameras: Vec::new(),
        background: Background::Color(Vec3::ZERO),
        ambient: 0.0,
        unread: Vec::new(),
        notes: Vec::new(),
    }
}

/// Adds an object; the VT flag follows from the material alone.
fn add(scene: &mut Scene, material: Material, vertices: &[(Vec3, Vec3, Vec2)], faces: &[[u32; 3]]) {
    let geometry = &mut scene.geometry;
    let (first, face) = (geometry.positions.len() as u32, geometry.faces.len() as u32);
    for &(position, normal, uv) in vertices {
        geometry.positions.push(position);
        geometry.normals.push(normal);
        geometry.uvs[0].push(uv);
    }
    let object = scene.objects.len() as u32;
    geometry.faces.extend(faces.iter().map(|corners| corners.map(|corner| corner + first)));
    geometry.face_objects.extend(faces.iter().map(|_| object));
    scene.objects.push(Object {
        name: format!("object {object}"),
        mesh_name: None,
        material: scene.materials.len() as u32,
        faces: face..face + faces.len() as u32,
        vertices: first..first + vertices.len() as u32,
        vt_extra: None,
        vt: (material.metallic >= 0.5 || material.transmission > 0.0) && material.roughness <= 0.1,
    });
    scene.materials.push(material);
}

/// A rectangle around `centre`; its normal is `across` × `up`.
fn add_quad(scene: &mut Scene, material: Material, centre: Vec3, across: Vec3, up: Vec3) {
    let normal = across.cross(up).normalize();
    let corner =
        |s: f32, t: f32| (centre + across * s + up * t, normal, Vec2::new(0.5 + 0.5 * s, 0.5 - 0.5 * t));
    let corners = [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
    add(scene, material, &corners, &[[0, 1, 2], [0, 2, 3]]);
}

/// A closed sphere of `rows` × `columns` quads, poles included.
fn add_sphere(scene: &mut Scene, material: Material, centre: Vec3, radius: f32, rows: u32, columns: u32) {
    let vertex = |n: Vec3| (centre + n * radius, n, Vec2::ZERO);
    let mut vertices = vec![vertex(Vec3::Y)];
    for row in 1..rows {
        let (ring, height) = (PI * f64::from(row) / f64::from(rows)).sin_cos();
        for column in 0..columns {
            let (z, x) = (2.0 * PI * f64::from(column) / f64::from(columns)).sin_cos();
            vertices.push(vertex(DVec3::new(ring * x, height, ring * z).as_vec3()));
        }
    }
    vertices.push(vertex(Vec3::NEG_Y));
    let last = vertices.len() as u32 - 1;
    let at = |row: u32, column: u32| match row {
        0 => 0,
        row if row == rows => last,
        row => 1 + (row - 1) * columns + column % columns,
    };
    let mut faces = Vec::new();
    for (row, column) in (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column))) {
        let (a, b) = (at(row, column), at(row, column + 1));
        let (c, d) = (at(row + 1, column), at(row + 1, column + 1));
        if row > 0 {
            faces.push([a, b, d]);
        }
        if row + 1 < rows {
            faces.push([a, d, c]);
        }
    }
    add(scene, material, &vertices, &faces);
}

fn grey(value: f32) -> Vec4 {
    Vec4::new(value, value, value, 1.0)
}

fn diffuse(albedo: f32) -> Material {
    Material { base_color: grey(albedo), specular: 0.0, ..Material::default() }
}

fn mirror(reflectance: f32) -> Material {
    Material { base_color: grey(reflectance), metallic: 1.0, roughness: 0.0, ..Material::default() }
}

fn glass(volume: Option<Volume>) -> Material {
    Material { transmission: 1.0, roughness: 0.0, volume, ..Material::default() }
}

fn emitter(radiance: f32) -> Material {
    Material { emissive: Vec3::splat(radiance), ..diffuse(0.0) }
}

fn point_light(position: Vec3, intensity: f32) -> Light {
    let kind = LightKind::Point { position, range: f32::INFINITY };
    Light { name: "point".into(), kind, intensity: Vec3::splat(intensity) }
}

fn trace(scene: &Scene, settings: &Settings, origin: Vec3, direction: Vec3) -> Vec3 {
    reference::radiance(&Tracer::new(scene), settings, origin, direction.normalize()).0
}

/// Unpolarised Fresnel reflectance and the cosine inside, from air into an index of 1.5.
fn fresnel(cos: f64) -> (f64, f64) {
    let inside = (1.0 - (1.0 - cos * cos) / (1.5 * 1.5)).sqrt();
    let s = (cos - 1.5 * inside) / (cos + 1.5 * inside);
    let p = (1.5 * cos - inside) / (1.5 * cos + inside);
    (0.5 * (s * s + p * p), inside)
}

#[track_caller]
fn close(got: f32, wanted: f64, tolerance: f64) {
    let error = (f64::from(got) - wanted).abs();
    assert!(error <= tolerance * wanted.abs().max(1.0), "{got} instead of {wanted}");
}

/// Two parallel planes of half side `wide`, `thickness` apart, that bound glass, in a world of radiance 1.
fn slab(wide: f32, thickness: f32, volume: Volume, tint: f32) -> Scene {
    let mut scene = empty();
    let material = Material { base_color: grey(tint), ..glass(Some(volume)) };
    add_quad(&mut scene, material.clone(), Vec3::ZERO, Vec3::X * wide, Vec3::NEG_Z * wide);
    add_quad(&mut scene, material, Vec3::NEG_Y * thickness, Vec3::X * wide, Vec3::Z * wide);
    scene.background = Background::Color(Vec3::ONE);
    scene
}

#[test]
fn glass_slab_follows_fresnel_snell_and_beer() {
    let (thickness, tint) = (0.5_f32, 0.9_f32);
    let volume = Volume { attenuation_color: Vec3::new(0.2, 0.5, 1.0), attenuation_distance: 0.7 };
    let scene = slab(20.0, thickness, volume, tint);
    for degrees in [0.0_f64, 20.0, 45.0, 60.0, 80.0] {
        let (sin, cos) = degrees.to_radians().sin_cos();
        let (r, inside) = fresnel(cos);
        let direction = DVec3::new(sin, -cos, 0.0).as_vec3();
        let got = trace(&scene, &EXACT, -direction * 2.0, direction);
        for channel in 0..3 {
            let colour = f64::from(volume.attenuation_color[channel]);
            let through = colour.powf(f64::from(thickness) / inside / f64::from(volume.attenuation_distance));
            let crossings = (f64::from(tint) * (1.0 - r)).powi(2);
            // Both ways out see radiance 1: the series over the inner reflections is geometric.
            close(got[channel], r + crossings * through / (1.0 - r * through), 2e-5);
        }
    }
}

#[test]
fn glass_slab_displaces_rays_in_parallel() {
    let thickness = 0.5_f32;
    let scene = slab(2.0, thickness, CLEAR, 1.0);
    let tracer = Tracer::new(&scene);
    for degrees in [5.0_f64, 30.0, 75.0] {
        let (sin, cos) = degrees.to_radians().sin_cos();
        let start = DVec3::new(sin, -cos, 0.0).as_vec3();
        let (mut origin, mut direction, mut exit) = (-start, start, Vec3::ZERO);
        for _ in 0..2 {
            let hit = tracer.closest(origin, direction).expect("the slab is wide");
            let surface = Surface::new(&tracer, hit.face, hit.u, hit.v, direction);
            let appearance = Appearance::new(&scene, &surface);
            let material = &scene.materials[surface.material as usize];
            let [_, refracted] = optics::branches(&EXACT, material, &appearance, &surface, direction);
            let refracted = refracted.expect("no total reflection in a slab");
            assert_eq!(refracted.kind, BranchKind::Refract);
            assert_eq!(refracted.medium.is_some(), surface.outside);
            (origin, direction, exit) = (refracted.origin, refracted.direction, surface.position);
        }
        assert!((direction - start).length() < 1e-6, "leaves along {direction} instead of {start}");
        let inside = sin / 1.5;
        close(exit.x, f64::from(thickness) * inside / (1.0 - inside * inside).sqrt(), 1e-5);
    }
}

#[test]
fn prism_reflects_totally() {
    // In through the leg x = 0, off the hypotenuse at 45° (critical angle 41.8°), out through the leg y = 0
    // towards an emitter.
    let mut scene = empty();
    let deep = Vec3::Z * 10.0;
    add_quad(&mut scene, glass(Some(CLEAR)), Vec3::Y, deep, Vec3::Y);
    add_quad(&mut scene, glass(Some(CLEAR)), Vec3::X, Vec3::X, deep);
    add_quad(&mut scene, glass(Some(CLEAR)), Vec3::new(1.0, 1.0, 0.0), deep, Vec3::new(1.0, -1.0, 0.0));
    for (quad, outward) in [Vec3::NEG_X, Vec3::NEG_Y, Vec3::new(1.0, 1.0, 0.0)].into_iter().enumerate() {
        let normal = scene.geometry.normals[quad * 4];
        assert!(normal.dot(outward) > 0.9, "normal {quad} of the prism is {normal}");
    }
    add_quad(&mut scene, emitter(2.0), Vec3::new(1.0, -1.0, 0.0), Vec3::X * 3.0, Vec3::NEG_Z * 3.0);
    let origin = Vec3::new(-1.0, 1.0, 0.1);
    // Each leg reflects F₀ = 0.04 of what meets it head-on, and sees the other across the hypotenuse.
    let f0 = 0.04;
    close(trace(&scene, &EXACT, origin, Vec3::X).x, 2.0 * (1.0 - f0) / (1.0 + f0), 1e-5);
    let one_way = Settings { depth: 3, ..EXACT };
    close(trace(&scene, &one_way, origin, Vec3::X).x, 2.0 * (1.0 - f0) * (1.0 - f0), 1e-5);
}

#[test]
fn thin_wall_neither_bends_nor_loses() {
    let mut scene = empty();
    let pane = Material { base_color: Vec4::new(0.5, 1.0, 1.0, 1.0), ..glass(None) };
    add_quad(&mut scene, pane, Vec3::ZERO, Vec3::X, Vec3::Y);
    scene.background = Background::Color(Vec3::ONE);
    let tracer = Tracer::new(&scene);
    for degrees in [0.0_f64, 50.0, 85.0] {
        let (sin, cos) = degrees.to_radians().sin_cos();
        let (interface, _) = fresnel(cos);
        let r = 2.0 * interface / (1.0 + interface);
        let front = DVec3::new(sin, 0.0, -cos).as_vec3();
        for direction in [front, -front] {
            let (got, _) = reference::radiance(&tracer, &EXACT, -direction, direction);
            close(got.x, r + 0.5 * (1.0 - r), 1e-5);
            close(got.y, 1.0, 1e-5);
            let hit = tracer.closest(-direction, direction).expect("aimed at its centre");
            let surface = Surface::new(&tracer, hit.face, hit.u, hit.v, direction);
            let appearance = Appearance::new(&scene, &surface);
            let [_, through] =
                optics::branches(&EXACT, &scene.materials[0], &appearance, &surface, direction);
            assert_eq!(through.expect("transmits").direction, direction);
        }
    }
}

#[test]
fn clear_glass_in_a_furnace_vanishes() {
    let mut scene = empty();
    add_sphere(&mut scene, glass(Some(CLEAR)), Vec3::ZERO, 1.0, 32, 64);
    scene.background = Background::Color(Vec3::ONE);
    let tracer = Tracer::new(&scene);
    let origin = Vec3::new(0.3, -0.2, 5.0);
    for i in 0..400 {
        let target = Vec3::new((i % 20) as f32 / 10.0 - 0.95, (i / 20) as f32 / 10.0 - 0.95, 0.0);
        let settings = Settings { min_throughput: 1e-7, ..EXACT };
        let (radiance, _) = reference::radiance(&tracer, &settings, origin, (target - origin).normalize());
        close(radiance.x, 1.0, 1e-4);
    }
}

#[test]
fn a_point_light_falls_off_with_the_square() {
    let mut scene = empty();
    add_quad(&mut scene, diffuse(0.6), Vec3::ZERO, Vec3::X * 50.0, Vec3::NEG_Z * 50.0);
    scene.lights.push(point_light(Vec3::new(0.0, 3.0, 0.0), 40.0));
    for x in [0.0_f64, 1.0, 7.5, 30.0] {
        let squared = x * x + 9.0;
        let wanted = 0.6 / PI * 40.0 * (3.0 / squared.sqrt()) / squared;
        let down = trace(&scene, &EXACT, Vec3::new(x as f32, 1.0, 0.0), Vec3::NEG_Y);
        close(down.x, wanted, 1e-5);
        // From below, the surface turns its other side to the viewer, which no light reaches.
        assert_eq!(trace(&scene, &EXACT, Vec3::new(x as f32, -1.0, 0.0), Vec3::Y), Vec3::ZERO);
    }
}

#[test]
fn spot_and_directional_lights() {
    let mut scene = empty();
    add_quad(&mut scene, diffuse(1.0), Vec3::ZERO, Vec3::X * 50.0, Vec3::NEG_Z * 50.0);
    let (inner, outer) = (20.0_f64.to_radians().cos(), 40.0_f64.to_radians().cos());
    let spot = LightKind::Spot {
        position: Vec3::new(0.0, 2.0, 0.0),
        direction: Vec3::NEG_Y,
        range: 8.0,
        inner_cos: inner as f32,
        outer_cos: outer as f32,
    };
    scene.lights.push(Light { name: "spot".into(), kind: spot, intensity: Vec3::splat(10.0) });
    for x in [0.0_f64, 1.0, 1.5, 3.0] {
        let squared = x * x + 4.0;
        let cos = 2.0 / squared.sqrt();
        let cone = ((cos - outer) / (inner - outer)).clamp(0.0, 1.0).powi(2);
        let window = 1.0 - squared * squared / 8.0_f64.powi(4);
        let wanted = 10.0 * cone * window / squared * cos / PI;
        close(trace(&scene, &EXACT, Vec3::new(x as f32, 1.0, 0.0), Vec3::NEG_Y).x, wanted, 1e-5);
    }
    scene.lights[0].kind = LightKind::Directional { direction: Vec3::new(0.6, -0.8, 0.0) };
    close(trace(&scene, &EXACT, Vec3::Y, Vec3::NEG_Y).x, 10.0 * 0.8 / PI, 1e-6);
}

#[test]
fn the_phong_lobe_carries_its_reflectance() {
    // Roughness 0.5 is exponent 30; the light falls in along the normal.
    let metal = Material { roughness: 0.5, ..mirror(0.7) };
    let dielectric = Material { roughness: 0.5, ior: 1.5, ..Material::default() };
    for (material, reflectance, is_metal) in [(metal, 0.7, true), (dielectric, 0.04, false)] {
        let mut scene = empty();
        add_quad(&mut scene, material, Vec3::ZERO, Vec3::X, Vec3::NEG_Z);
        let kind = LightKind::Directional { direction: Vec3::NEG_Y };
        scene.lights.push(Light { name: "sun".into(), kind, intensity: Vec3::ONE });
        let tracer = Tracer::new(&scene);
        let rings = 4000;
        let width = PI / 2.0 / f64::from(rings);
        let mut energy = 0.0;
        for ring in 0..rings {
            let (sin, cos) = ((f64::from(ring) + 0.5) * width).sin_cos();
            let direction = DVec3::new(sin, -cos, 0.0).as_vec3();
            let surface = Surface::new(&tracer, 0, 0.3, 0.3, direction);
            let appearance = Appearance::new(&scene, &surface);
            let local = shade::local(&scene, &surface, &appearance, direction, shade::ALL_LIT);
            let lobe = if is_metal { local.textured.x } else { local.added.x };
            energy += f64::from(lobe) * cos * 2.0 * PI * sin * width;
        }
        assert!((energy - reflectance).abs() < 1e-4 * reflectance, "{energy} instead of {reflectance}");
    }
}

#[test]
fn perfect_mirrors_show_no_highlight_and_ask_no_light() {
    let mut scene = empty();
    add_quad(&mut scene, mirror(1.0), Vec3::ZERO, Vec3::X, Vec3::NEG_Z);
    scene.lights.push(point_light(Vec3::Y, 1.0));
    let (radiance, rays) = reference::radiance(&Tracer::new(&scene), &EXACT, Vec3::Y * 0.5, Vec3::NEG_Y);
    assert_eq!(radiance, Vec3::ZERO);
    assert_eq!(rays, Rays { primary: 1, reflected: 1, transmitted: 0, shadow: 0 });
}

#[test]
fn a_mirror_shows_the_mirror_image() {
    let mut scene = empty();
    add_quad(&mut scene, mirror(0.8), Vec3::ZERO, Vec3::X * 5.0, Vec3::NEG_Z * 5.0);
    add_quad(&mut scene, emitter(3.0), Vec3::new(2.0, 2.0, 0.0), Vec3::Z, Vec3::X);
    scene.background = Background::Color(Vec3::splat(0.25));
    // Towards the emitter's image, x in 1..3 at y = −2.
    let eye = Vec3::new(-1.0, 1.0, 0.0);
    for (x, wanted) in [(0.999, 0.2), (1.001, 2.4), (2.999, 2.4), (3.001, 0.2)] {
        close(trace(&scene, &EXACT, eye, Vec3::new(x, -2.0, 0.0) - eye).x, wanted, 1e-6);
    }
    // Schlick at 60° and F₀ = 0.8.
    let direction = DVec3::new(-(60.0_f64.to_radians().sin()), -0.5, 0.0).as_vec3();
    let schlick = Settings { fresnel: true, ..EXACT };
    let got = trace(&scene, &schlick, Vec3::X * -3.0 - direction * 0.5, direction);
    close(got.x, 0.25 * (0.8 + 0.2 * 0.5_f64.powi(5)), 1e-6);
}

#[test]
fn depth_counts_specular_bounces() {
    let mut scene = empty();
    let glowing = Material { emissive: Vec3::ONE, ..mirror(1.0) };
    add_quad(&mut scene, glowing, Vec3::ZERO, Vec3::X * 5.0, Vec3::NEG_Z * 5.0);
    add_quad(&mut scene, mirror(1.0), Vec3::Y, Vec3::X * 5.0, Vec3::Z * 5.0);
    for depth in 0..6 {
        let settings = Settings { depth, ..EXACT };
        let (radiance, rays) =
            reference::radiance(&Tracer::new(&scene), &settings, Vec3::Y * 0.5, Vec3::NEG_Y);
        assert_eq!(rays.reflected, u64::from(depth));
        // A hit at the limit still shows its local component.
        assert_eq!(radiance.x, 1.0 + (depth / 2) as f32);
    }
}

#[test]
fn weak_branches_are_dropped() {
    let mut scene = empty();
    add_quad(&mut scene, mirror(0.1), Vec3::ZERO, Vec3::X * 5.0, Vec3::NEG_Z * 5.0);
    add_quad(&mut scene, mirror(0.1), Vec3::Y, Vec3::X * 5.0, Vec3::Z * 5.0);
    let settings = Settings::default();
    let (_, rays) = reference::radiance(&Tracer::new(&scene), &settings, Vec3::Y * 0.5, Vec3::NEG_Y);
    // 0.1² lies above 1/255, 0.1³ below.
    assert_eq!(rays.reflected, 2);
}

#[test]
fn reflections_stay_above_the_facet() {
    for tilt in [0.0_f32, 0.2, 0.6] {
        for grazing in [1e-4_f32, 0.05, 0.5] {
            let n = Vec3::new(tilt, 1.0, 0.0).normalize();
            let r = optics::reflect(Vec3::new(1.0, -grazing, 0.0).normalize(), n, Vec3::Y);
            assert!((r.length() - 1.0).abs() < 1e-6 && r.y >= REFLECTION_LIFT * 0.99, "{r}");
        }
    }
    let clear = optics::reflect(Vec3::new(0.6, -0.8, 0.0), Vec3::Y, Vec3::Y);
    assert!((clear - Vec3::new(0.6, 0.8, 0.0)).length() < 1e-6, "{clear}");
}

#[test]
fn shadows_are_hard_and_opaque() {
    let mut scene = empty();
    add_quad(&mut scene, diffuse(1.0), Vec3::ZERO, Vec3::X * 5.0, Vec3::NEG_Z * 5.0);
    add_quad(&mut scene, glass(None), Vec3::Y, Vec3::X, Vec3::NEG_Z);
    scene.lights.push(point_light(Vec3::new(0.0, 2.0, 0.0), 1.0));
    let radiance = |shadows, origin| trace(&scene, &Settings { shadows, ..EXACT }, origin, Vec3::NEG_Y).x;
    // The pane's shadow on the floor ends at |x| = 2.
    for (x, lit) in [(0.0, false), (1.999, false), (2.001, true)] {
        assert_eq!(radiance(Shadows::All, Vec3::new(x, 0.5, 0.1)) > 0.0, lit, "at x = {x}");
    }
    // `Vt` spares what the eye sees directly, not what it sees through the pane.
    assert!(radiance(Shadows::Vt, Vec3::Y * 0.5) > 0.0);
    assert_eq!(radiance(Shadows::Vt, Vec3::Y * 1.5), 0.0);
    assert!(radiance(Shadows::None, Vec3::Y * 1.5) > 0.0);
}

#[test]
fn masked_faces_let_all_rays_through_their_holes() {
    let mut scene = empty();
    // Opaque at the top left and the bottom right.
    let texels = [255, 0, 0, 255].map(|alpha: u8| [255, 255, 255, alpha]).concat();
    scene.images.push(Image { name: "holes".into(), width: 2, height: 2, rgba: texels.into() });
    let sampler = Sampler { mag: Filter::Nearest, ..Sampler::default() };
    scene.textures.push(Texture { image: 0, sampler, srgb: true });
    let slot = TextureSlot { texture: 0, uv_set: 0, transform: Affine2::IDENTITY };
    let material =
        Material { base_color_texture: Some(slot), alpha_mode: AlphaMode::Mask(0.5), ..emitter(1.0) };
    add_quad(&mut scene, material, Vec3::ZERO, Vec3::X, Vec3::Y);
    let tracer = Tracer::new(&scene);
    for (x, y, covered) in [(-0.5, 0.4, true), (0.5, 0.4, false), (-0.5, -0.4, false), (0.5, -0.4, true)] {
        for z in [1.0_f32, -1.0] {
            let (origin, direction) = (Vec3::new(x, y, z), Vec3::new(0.0, 0.0, -z));
            assert_eq!(tracer.closest(origin, direction).is_some(), covered, "at {x}, {y}");
            assert_eq!(tracer.occluded(origin, direction, 2.0), covered, "at {x}, {y}");
            assert!(!tracer.occluded(origin, direction, 0.99), "ends before the face");
        }
    }
}

#[test]
fn blended_faces_cover_camera_rays_in_part() {
    let mut scene = empty();
    let base_color = Vec4::new(0.0, 0.0, 0.0, 0.25);
    let pane = Material { base_color, alpha_mode: AlphaMode::Blend, ..emitter(1.0) };
    add_quad(&mut scene, pane.clone(), Vec3::ZERO, Vec3::X, Vec3::Y);
    add_quad(&mut scene, pane, Vec3::NEG_Z, Vec3::X, Vec3::Y);
    add_quad(&mut scene, mirror(1.0), Vec3::Z * 2.0, Vec3::X, Vec3::NEG_Y);
    scene.background = Background::Color(Vec3::splat(4.0));
    let origin = Vec3::new(0.1, 0.2, 1.0);
    close(trace(&scene, &EXACT, origin, Vec3::NEG_Z).x, 0.25 + 0.75 * (0.25 + 0.75 * 4.0), 1e-6);
    // In the mirror the first pane is opaque.
    close(trace(&scene, &EXACT, origin, Vec3::Z).x, 1.0, 1e-6);
}

#[test]
fn the_environment_has_its_centre_at_minus_z() {
    // 4 × 2 texels; red counts columns, green rows.
    let radiance: Arc<[Vec3]> = (0..8).map(|i| Vec3::new((i % 4) as f32, (i / 4) as f32, 0.0)).collect();
    let panorama = Environment { name: "test".into(), width: 4, height: 2, radiance };
    let at = |x: f32, y: f32, z: f32| texel::environment(&panorama, Vec3::new(x, y, z).normalize());
    // The centre lies between columns 1 and 2 and between the rows.
    close(at(0.0, 0.0, -1.0).x, 1.5, 1e-6);
    close(at(0.0, 0.0, -1.0).y, 0.5, 1e-6);
    close(at(1.0, 0.0, -1.0).x, 2.0, 1e-5);
    close(at(-1.0, 0.0, -1.0).x, 1.0, 1e-5);
    close(at(1.0, 0.0, 0.0).x, 2.5, 1e-5);
    // Behind the viewer the seam joins columns 3 and 0.
    close(at(0.0, 0.0, 1.0).x, 1.5, 1e-5);
    close(at(1.0, 0.0, 1.0).x, 3.0, 1e-5);
    close(at(-1.0, 0.0, 1.0).x, 0.0, 1e-5);
    assert_eq!((at(0.0, 1.0, 0.0).y, at(0.0, -1.0, 0.0).y), (0.0, 1.0));
}

#[test]
fn textures_are_decoded_before_they_are_filtered() {
    let mut scene = empty();
    let texels = [[0, 0, 0, 255], [255, 255, 255, 255]].concat();
    scene.images.push(Image { name: "edge".into(), width: 2, height: 1, rgba: texels.into() });
    let sampler = Sampler { wrap_u: Wrap::Clamp, wrap_v: Wrap::Clamp, ..Sampler::default() };
    scene.textures.push(Texture { image: 0, sampler, srgb: true });
    let slot = TextureSlot { texture: 0, uv_set: 0, transform: Affine2::IDENTITY };
    let at = |scene: &Scene, u: f32| texel::lookup(scene, &slot, Vec2::new(u, 0.5)).x;
    close(at(&scene, 0.5), 0.5, 1e-6);
    close(at(&scene, 0.25), 0.0, 1e-6);
    close(at(&scene, 2.0), 1.0, 1e-6);
    // Repeated, the image's border blends its ends.
    scene.textures[0].sampler.wrap_u = Wrap::Repeat;
    close(at(&scene, 1.0), 0.5, 1e-6);
    scene.images[0].rgba = vec![127; 8].into();
    close(at(&scene, 0.3), ((127.0 / 255.0 + 0.055) / 1.055_f64).powf(2.4), 1e-6);
}

#[test]
fn normal_maps_tilt_the_normal_on_both_sides() {
    let mut scene = empty();
    // The texel (1, ½, 1) leans by 45° along the tangent.
    scene.images.push(Image {
        name: "lean".into(),
        width: 1,
        height: 1,
        rgba: vec![255, 128, 255, 255].into(),
    });
    scene.textures.push(Texture { image: 0, sampler: Sampler::default(), srgb: false });
    let slot = TextureSlot { texture: 0, uv_set: 0, transform: Affine2::IDENTITY };
    let material = Material { normal_texture: Some(slot), ..mirror(1.0) };
    add_quad(&mut scene, material, Vec3::ZERO, Vec3::X, Vec3::NEG_Z);
    scene.geometry.tangents = vec![Vec4::new(1.0, 0.0, 0.0, 1.0); 4];
    let tracer = Tracer::new(&scene);
    let above = Surface::new(&tracer, 0, 0.2, 0.2, Vec3::NEG_Y);
    assert!((above.n - Vec3::new(1.0, 1.0, 0.0).normalize()).length() < 0.01, "{}", above.n);
    assert!(above.outside && above.ng == Vec3::Y);
    let below = Surface::new(&tracer, 0, 0.2, 0.2, Vec3::Y);
    assert!((below.n + above.n).length() < 1e-6 && below.ng == Vec3::NEG_Y && !below.outside);
}

/// The `index`th number of Halton's sequence.
fn halton(mut index: u32, base: u32) -> f32 {
    let (mut result, mut digit) = (0.0, 1.0);
    while index > 0 {
        digit /= base as f32;
        result += digit * (index % base) as f32;
        index /= base;
    }
    result
}

#[test]
fn no_ray_leaves_a_closed_sphere() {
    // In the manner of Embree's watertightness tests; half of the rays are aimed at vertices and edges.
    for offset in [Vec3::ZERO, Vec3::new(1e3, -2e3, 5e2), Vec3::new(-3e4, 1e5, 7e4)] {
        let mut scene = empty();
        add_sphere(&mut scene, diffuse(1.0), offset, 1.0, 40, 80);
        let tracer = Tracer::new(&scene);
        let rays = 200_000;
        let mut leaks = 0;
        for i in 0..rays {
            let [a, b, c, d] = [2, 3, 5, 7].map(|base| halton(i + 1, base));
            let origin = offset + (Vec3::new(a, b, c) - 0.5) * 0.8;
            let face = (d * scene.geometry.faces.len() as f32) as u32;
            let corners = scene.geometry.corners(face);
            let target = match i % 4 {
                0 => corners[0],
                1 => corners[0].lerp(corners[1], a),
                _ => origin + (Vec3::new(b, c, a) - 0.5),
            };
            if let Some(direction) = (target - origin).try_normalize() {
                leaks += u32::from(tracer.closest(origin, direction).is_none());
            }
        }
        assert!(leaks <= rays / 50_000, "{leaks} of {rays} rays escape from the sphere at {offset}");
    }
}

#[test]
fn offsets_clear_the_surface_wherever_it_lies() {
    let places =
        [(Vec3::ZERO, 1.0), (Vec3::ZERO, 1e-4), (Vec3::splat(1e6), 1e3), (Vec3::new(-1e6, 3e5, 0.0), 1e5)];
    for (centre, size) in places {
        let mut scene = empty();
        add_sphere(&mut scene, diffuse(1.0), centre, size, 20, 40);
        let light = centre + Vec3::new(0.2, 0.3, 0.9) * (size * 100.0);
        scene.lights.push(point_light(light, 1.0));
        let tracer = Tracer::new(&scene);
        let mut rays = Rays::default();
        for face in 0..scene.geometry.faces.len() as u32 {
            let inward = -scene.geometry.area_normal(face).normalize();
            // Corners, an edge and the inside, with the facet's own normal: nothing shades a convex body.
            for (u, v) in [(0.0, 0.0), (1.0, 0.0), (0.5, 0.5), (0.3, 0.3)] {
                let mut surface = Surface::new(&tracer, face, u, v, inward);
                surface.n = surface.ng;
                if (light - surface.position).normalize().dot(surface.ng) < 0.05 {
                    continue;
                }
                let appearance = Appearance::new(&scene, &surface);
                let lit = shade::visible_lights(&tracer, &surface, &appearance, &mut rays);
                assert_eq!(lit, shade::ALL_LIT, "face {face} at {centre} of size {size} shades itself");
                assert!(surface.offset <= 1e-5 * (centre.length() + size), "{}", surface.offset);
            }
        }
        assert!(rays.shadow > 500, "only {} rays tried", rays.shadow);
    }
}

fn room() -> (Scene, View) {
    let mut scene = empty();
    add_quad(&mut scene, diffuse(0.7), Vec3::ZERO, Vec3::X * 5.0, Vec3::NEG_Z * 5.0);
    add_sphere(&mut scene, glass(Some(CLEAR)), Vec3::Y, 0.9, 16, 32);
    add_sphere(&mut scene, mirror(0.8), Vec3::new(2.0, 1.0, -1.0), 0.9, 16, 32);
    scene.lights.push(point_light(Vec3::new(1.0, 5.0, 3.0), 60.0));
    let camera = Camera::look_at(Vec3::new(0.5, 2.0, 5.0), Vec3::new(0.5, 0.8, 0.0), 0.8);
    let view = View::new(&camera, 70, 50, scene.bounds());
    (scene, view)
}

fn render(scene: &Scene, view: &View, spp: u32, only: Option<&[bool]>) -> reference::Reference {
    let (tracer, going) = (Tracer::new(scene), AtomicBool::new(false));
    reference::render(&tracer, view, &Settings::default(), spp, only, &going, &|_| {})
        .expect("nobody interrupts")
}

#[test]
fn the_reference_does_not_depend_on_threads() {
    let (scene, view) = room();
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| render(&scene, &view, 3, None))
    };
    let (one, three) = (with(1), with(3));
    assert_eq!((one.image, one.rays, one.vt_mask), (three.image, three.rays, three.vt_mask));
    assert_eq!(one.rays.primary, 3 * view.pixels() as u64);
}

#[test]
fn the_reference_shows_the_same_in_packets() {
    let (scene, view) = room();
    let mask = render(&scene, &view, 1, None).vt_mask;
    let tracer = Tracer::new(&scene);
    for (count, only) in [(1, None), (3, Some(mask.as_slice())), (16, None)] {
        let alone = render(&scene, &view, count, only);
        let samples = Samples { following: Following::Together, ..Samples::from(count) };
        let together = reference::render(
            &tracer,
            &view,
            &Settings::default(),
            samples,
            only,
            &AtomicBool::new(false),
            &|_| {},
        )
        .unwrap();
        assert_eq!((together.rays, &together.vt_mask), (alone.rays, &alone.vt_mask));
        for (a, b) in together.image.iter().zip(&alone.image) {
            let (a, b) = (Vec3::from(*a), Vec3::from(*b));
            assert!(a.abs_diff_eq(b, 1e-4 * (0.1 + b.max_element())), "{a} {b}");
        }
    }
}

/// Tiles share the search for hits and shadows; each pixel must not notice, under any light and projection.
#[test]
fn the_reference_traces_tiles_as_it_traces_single_rays() {
    let (mut scene, _) = room();
    let pane =
        Material { alpha_mode: AlphaMode::Blend, base_color: Vec4::new(0.4, 0.9, 0.5, 0.5), ..diffuse(0.0) };
    let corners = [[-1.5, 0.2, 2.0], [1.0, 0.2, 2.2], [1.0, 1.4, 2.0], [-1.5, 1.4, 1.8]];
    let pane_corners = corners.map(|corner| (Vec3::from(corner), Vec3::Z, Vec2::ZERO));
    add(&mut scene, pane, &pane_corners, &[[0, 1, 2], [0, 2, 3]]);
    let kinds = [
        LightKind::Directional { direction: Vec3::new(-0.3, -1.0, 0.0).normalize() },
        LightKind::Directional { direction: Vec3::NEG_Y },
        LightKind::Point { position: Vec3::new(-1.0, 0.6, 1.0), range: 4.0 },
        LightKind::Spot {
            position: Vec3::new(0.0, 3.0, 2.0),
            direction: Vec3::new(0.1, -1.0, -0.6).normalize(),
            range: f32::INFINITY,
            inner_cos: 0.95,
            outer_cos: 0.8,
        },
    ];
    for kind in kinds {
        scene.lights.push(Light { name: "light".into(), kind, intensity: Vec3::ONE });
    }
    let tracer = Tracer::new(&scene);
    let eye = Camera::look_at(Vec3::new(0.4, 1.7, 4.0), Vec3::new(0.3, 0.8, 0.0), 0.9);
    let level = Camera::look_at(Vec3::new(0.5, 1.0, 5.0), Vec3::new(0.5, 1.0, 0.0), 0.9);
    let parallel = Camera { projection: Projection::Orthographic { xmag: 2.0, ymag: 2.0 }, ..level };
    for (camera, settings) in [(&eye, Settings::default()), (&parallel, EXACT)] {
        let view = View::new(camera, 61, 43, scene.bounds());
        let traced =
            reference::render(&tracer, &view, &settings, 1, None, &AtomicBool::new(false), &|_| {}).unwrap();
        let mut rays = Rays::default();
        for (pixel, &radiance) in traced.image.iter().enumerate() {
            let at = Vec2::new((pixel % 61) as f32 + 0.5, (pixel / 61) as f32 + 0.5);
            let (origin, direction) = view.ray(at);
            let (alone, its_rays) = reference::radiance(&tracer, &settings, origin, direction);
            assert_eq!(radiance, alone.to_array(), "at {at}");
            rays += its_rays;
        }
        assert_eq!(rays, traced.rays);
        assert!(rays.shadow > 5000 && rays.reflected > 100, "{rays:?}");
    }
}

/// Waves of rays show what each ray alone does, by as many rays: also through glass, where histories part.
#[test]
fn points_are_seen_together_as_alone() {
    for demo in [Demo::GlassBowl, Demo::CupAndGlass, Demo::MirrorAndWall] {
        let scene = demo.scene();
        let tracer = Tracer::new(&scene);
        let view = View::new(&scene.cameras[0], 61, 43, scene.bounds());
        for settings in
            [Settings::default(), Settings { depth: 2, shadows: Shadows::Vt, ..Settings::default() }]
        {
            let mut points = Points::new(&tracer, &settings);
            let mut rays = Rays::default();
            for band in (0..view.height).collect::<Vec<_>>().chunks(8) {
                let centres =
                    band.iter().flat_map(|&y| (0..view.width).map(move |x| Vec2::new(x as f32, y as f32)));
                let seen = centres.filter_map(|corner| {
                    let (origin, direction) = view.ray(corner + 0.5);
                    Some((origin, direction, tracer.closest(origin, direction)?))
                });
                let seen: Vec<_> = seen.collect();
                seen.iter().for_each(|&(_, direction, hit)| points.add(direction, hit));
                let together: Vec<Vec3> = points.radiances().collect();
                assert_eq!(together.len(), seen.len());
                for (&(origin, direction, _), together) in seen.iter().zip(together) {
                    let (alone, its_rays) = reference::radiance(&tracer, &settings, origin, direction);
                    assert!(
                        together.abs_diff_eq(alone, 1e-5 * (1.0 + alone.max_element())),
                        "{together} {alone}"
                    );
                    rays += Rays { primary: 0, ..its_rays };
                }
            }
            assert_eq!(points.rays(), rays);
            assert!(rays.reflected > 100, "{rays:?}");
        }
    }
}

#[test]
fn the_reference_traces_the_wanted_pixels_alone() {
    let (scene, view) = room();
    let all = render(&scene, &view, 1, None);
    assert_eq!(all.vt_mask, reference::vt_mask(&Tracer::new(&scene), &view));
    let specular = all.vt_mask.iter().filter(|&&vt| vt).count();
    assert!((300..view.pixels() / 2).contains(&specular), "{specular}");
    let some = render(&scene, &view, 1, Some(&all.vt_mask));
    assert_eq!((some.rays.primary, some.rays.reflected), (specular as u64, all.rays.reflected));
    for pixel in 0..view.pixels() {
        let wanted = if all.vt_mask[pixel] { all.image[pixel] } else { [0.0; 3] };
        assert_eq!(some.image[pixel], wanted);
    }
}

#[test]
fn the_reference_stops_when_interrupted() {
    let (scene, view) = room();
    let (tracer, stop) = (Tracer::new(&scene), AtomicBool::new(true));
    let result = reference::render(&tracer, &view, &Settings::default(), 1, None, &stop, &|_| {});
    assert!(matches!(result, Err(Error::Interrupted)));
}

#[test]
fn an_empty_scene_is_its_background() {
    let mut scene = empty();
    scene.background = Background::Color(Vec3::new(0.1, 0.2, 0.3));
    let camera = Camera::look_at(Vec3::Z, Vec3::ZERO, 0.8);
    let view = View::new(&camera, 4, 4, scene.bounds());
    assert!(render(&scene, &view, 4, None).image.iter().all(|pixel| *pixel == [0.1, 0.2, 0.3]));
}

#[test]
fn a_scene_without_lights_is_lit_from_the_camera() {
    let mut scene = empty();
    add_quad(&mut scene, diffuse(1.0), Vec3::ZERO, Vec3::X, Vec3::Y);
    let eye = Vec3::Z * 7.0;
    let view = View::new(&Camera::look_at(eye, Vec3::ZERO, 0.8), 4, 4, scene.bounds());
    scene.add_default_lights(&view);
    close(trace(&scene, &EXACT, eye, Vec3::NEG_Z).x, 0.7 + f64::from(DEFAULT_AMBIENT), 1e-5);
    scene.add_default_lights(&view);
    assert_eq!((scene.lights.len(), scene.notes.len()), (1, 1), "a scene with lights is left alone");
}
