//! Light in reconstructed pictures, held against the reference tracer: shadows, absorption, panes, highlights.

mod common;

use glam::{Vec3, Vec4, vec3};
use vertex_tracing::{
    options::{Mode, Msaa, Shadows, VisibilityWay},
    report::metrics::{Encoding, compare},
    scene::{
        AlphaMode, Background, Camera, Filter, Image, Material, Sampler, Scene, Volume,
        demo::{SceneBuilder, chrome, glass, matte, shape, texture},
        light::{Light, LightKind},
    },
};

use common::floor::glowing_floor;
use common::{TestGpu, image, options, over_vt, psnr, traced, wrong};

/// A pane hides what is behind it in part, be that a mesh whose pixels are all traced, and is hidden where it is under that: be
/// it traced, too, or drawn where effort is limited. The mesh stays out of the refined one either way.
#[test]
fn panes_are_seen_among_dense_meshes() {
    let gpu = TestGpu::open();
    let mut builder = SceneBuilder::new("pane over waves");
    let metal = builder.material(chrome("silver", Vec3::splat(0.9)));
    builder.mesh("waves", shape::waves(2.0, 250, 0.02, 5.0), metal);
    let veil = Material { base_color: vec3(0.8, 0.1, 0.1).extend(0.6), unlit: true, ..matte("veil") };
    let veil = Material { alpha_mode: AlphaMode::Blend, double_sided: true, ..veil };
    let veil = builder.material(veil);
    builder.mesh("pane", shape::plane(vec3(-0.4, 0.3, 0.4), Vec3::X * 0.8, vec3(0.0, -0.4, -0.8), 1.0), veil);
    builder.background(Background::Color(vec3(0.2, 0.5, 0.8)));
    builder.camera(Camera::look_at(vec3(0.0, 3.0, 0.5), Vec3::ZERO, 0.8));
    let scene = builder.build().unwrap();
    let truth = image(&options(320, 256), &traced(&scene, &options(320, 256), 1, None));
    for (preview, max_samples, mode, visibility) in [
        (false, None, Mode::MultiTexture, VisibilityWay::IdBuffer),
        (true, None, Mode::MultiTexture, VisibilityWay::IdBuffer),
        (true, None, Mode::MultiPass, VisibilityWay::IdBuffer),
        (true, None, Mode::MultiTexture, VisibilityWay::SinglePass),
        (false, Some(100_000), Mode::MultiTexture, VisibilityWay::IdBuffer),
    ] {
        let mut options = options(320, 256);
        (options.effort.preview, options.effort.max_samples) = (preview, max_samples);
        (options.method.mode, options.method.visibility) = (mode, visibility);
        let what = format!("preview {preview}, {max_samples:?} samples, {mode:?}, {visibility:?}");
        let frame = gpu.render(&scene, &options);
        let faces = &frame.stats.faces;
        assert!(faces.visible > 20_000, "{what}: {} faces are visible", faces.visible);
        let psnr = compare(&truth, &frame.image, None, Encoding::Srgb).unwrap().psnr.unwrap_or(99.0);
        println!("{what}: {} leaves, {psnr:.1} dB", faces.leaves);
        assert!(faces.leaves < 10_000, "{what}: {} leaves", faces.leaves);
        assert!(psnr > 45.0, "{what}: {psnr:.1} dB");
    }
    gpu.finish();
}

/// Panes that no order of drawing is right for, with a shadow on them, before and behind a mirror ball.
#[test]
fn panes_are_blended_in_order_and_shadowed() {
    let gpu = TestGpu::open();
    let mut builder = SceneBuilder::new("panes through one another");
    let boards = builder.texture(texture::chessboard(64));
    let floor = builder.material(matte("floor").textured(boards));
    builder.mesh("floor", shape::plane(vec3(-2.0, 0.0, 2.0), Vec3::X * 4.0, Vec3::NEG_Z * 4.0, 1.0), floor);
    let metal = builder.material(chrome("silver", Vec3::splat(0.9)));
    builder.mesh("ball", shape::sphere(vec3(0.0, 0.6, 0.0), 0.5, 2), metal);
    for (name, color, corner, right) in [
        ("red", vec3(0.8, 0.1, 0.1), vec3(-1.2, 0.0, 0.9), vec3(2.4, 0.0, -0.5)),
        ("green", vec3(0.1, 0.8, 0.1), vec3(-1.2, 0.0, 0.4), vec3(2.4, 0.0, 0.5)),
        ("blue", vec3(0.1, 0.1, 0.8), vec3(-1.5, 0.0, -1.0), vec3(3.0, 0.0, 0.0)),
    ] {
        let blended = AlphaMode::Blend;
        let base_color = color.extend(0.5);
        let pane = Material { base_color, alpha_mode: blended, double_sided: true, ..matte(name) };
        let pane = builder.material(pane);
        builder.mesh(name, shape::plane(corner, right, Vec3::Y * 1.1, 1.0), pane);
    }
    builder.point_light(vec3(0.3, 4.0, 2.5), Vec3::splat(60.0));
    builder.camera(Camera::look_at(vec3(0.2, 1.4, 3.6), vec3(0.0, 0.5, 0.0), 0.8));
    let scene = builder.build().unwrap();
    for (mode, visibility, msaa, max_samples) in [
        (Mode::MultiTexture, VisibilityWay::IdBuffer, Msaa::One, None),
        (Mode::MultiPass, VisibilityWay::IdBuffer, Msaa::One, None),
        (Mode::MultiTexture, VisibilityWay::SinglePass, Msaa::One, None),
        (Mode::MultiTexture, VisibilityWay::Device, Msaa::Four, None),
        (Mode::MultiTexture, VisibilityWay::IdBuffer, Msaa::One, Some(1_000_000)),
    ] {
        let mut options = options(320, 256);
        (options.method.mode, options.method.visibility, options.method.msaa) = (mode, visibility, msaa);
        (options.effort.max_samples, options.effort.sparing) = (max_samples, max_samples.is_some());
        let frame = gpu.render(&scene, &options);
        let truth = image(&options, &traced(&scene, &options, 1, None));
        let far =
            |(a, b): &(&[f32; 3], &[f32; 3])| (Vec3::from(**a) - Vec3::from(**b)).abs().max_element() > 0.1;
        let wrong = frame.image.pixels.iter().zip(&truth.pixels).filter(far).count();
        println!("{mode:?}, {visibility:?}, {msaa:?}: {wrong} pixels are wrong");
        assert!(wrong < 320, "{mode:?}, {visibility:?}, {msaa:?}: {wrong} pixels are wrong");
    }
    gpu.finish();
}

/// Metal and glass that is BLEND, too, covers by its alpha; what lies behind is seen through it, another such object among it.
#[test]
fn blended_metal_and_glass_cover_in_part() {
    let gpu = TestGpu::open();
    let mut builder = SceneBuilder::new("fading");
    let boards = builder.texture(texture::chessboard(64));
    let floor = builder.material(matte("floor").textured(boards));
    builder.mesh("floor", shape::plane(vec3(-2.0, 0.0, 2.0), Vec3::X * 4.0, Vec3::NEG_Z * 4.0, 1.0), floor);
    let alpha_mode = AlphaMode::Blend;
    let metal = Material { alpha_mode, ..chrome("fading silver", Vec3::splat(0.9)) };
    let metal = builder.material(Material { base_color: metal.base_color.truncate().extend(0.4), ..metal });
    builder.mesh("ball", shape::sphere(vec3(-0.4, 0.6, 0.0), 0.5, 3), metal);
    let bottle = Material { alpha_mode, ..glass("fading glass", 1.5) };
    let bottle = builder.material(Material { base_color: Vec4::new(1.0, 1.0, 1.0, 0.6), ..bottle });
    builder.mesh("drop", shape::sphere(vec3(0.4, 0.6, -0.5), 0.5, 3), bottle);
    builder.point_light(vec3(0.3, 4.0, 2.5), Vec3::splat(60.0));
    builder.camera(Camera::look_at(vec3(0.2, 1.4, 3.6), vec3(0.0, 0.5, 0.0), 0.8));
    let scene = builder.build().unwrap();
    for mode in [Mode::MultiTexture, Mode::MultiPass] {
        for visibility in [VisibilityWay::IdBuffer, VisibilityWay::SinglePass] {
            let mut options = options(320, 256);
            (options.method.mode, options.method.visibility) = (mode, visibility);
            let frame = gpu.render(&scene, &options);
            let truth = image(&options, &traced(&scene, &options, 1, None));
            let psnr = compare(&truth, &frame.image, None, Encoding::Srgb).unwrap().psnr.unwrap_or(99.0);
            println!("{mode:?}, {visibility:?}: {psnr:.1} dB, {} leaves", frame.stats.faces.leaves);
            assert!(psnr > 40.0, "{mode:?}, {visibility:?}: {psnr:.1} dB");
        }
    }
    gpu.finish();
}

/// What a body absorbs is lost on the way to the first thing that its inside shows, too: a floor under water, and without
/// one all that comes from far away.
#[test]
fn bodies_absorb_before_the_first_bounce_is_over() {
    let gpu = TestGpu::open();
    for depth in [Some(0.4), None] {
        let mut builder = SceneBuilder::new("pool");
        if let Some(depth) = depth {
            let boards = builder.texture(texture::chessboard(64));
            let floor = builder.material(Material { unlit: true, ..matte("floor").textured(boards) });
            let corner = vec3(-2.0, -depth, 2.0);
            builder.mesh("floor", shape::plane(corner, Vec3::X * 4.0, Vec3::NEG_Z * 4.0, 1.0), floor);
        }
        let green = Volume { attenuation_color: vec3(0.1, 0.6, 0.4), attenuation_distance: 1.0 };
        let water = builder.material(Material { volume: Some(green), ..glass("water", 1.33) });
        builder.mesh(
            "water",
            shape::plane(vec3(-1.5, 0.0, 1.5), Vec3::X * 3.0, Vec3::NEG_Z * 3.0, 1.0),
            water,
        );
        builder.background(Background::Color(vec3(0.5, 0.6, 0.7)));
        builder.camera(Camera::look_at(vec3(0.0, 1.5, 3.0), Vec3::ZERO, 0.8));
        let scene = builder.build().unwrap();
        for mode in [Mode::MultiTexture, Mode::MultiPass] {
            let mut options = options(320, 256);
            options.method.mode = mode;
            let error = over_vt(&gpu.render(&scene, &options), &options, &traced(&scene, &options, 1, None));
            let psnr = error.psnr.unwrap_or(99.0);
            println!("{depth:?} deep, {mode:?}: {psnr:.1} dB");
            assert!(psnr > 45.0, "{depth:?} deep, {mode:?}: {psnr:.1} dB");
        }
    }
    gpu.finish();
}

/// Between a shadow and where a light does not reach any more nothing is lit: beyond its range, out of its cone.
#[test]
fn shadows_stay_dark_up_to_the_end_of_the_light() {
    let gpu = TestGpu::open();
    let position = vec3(1.2, 1.6, 0.3);
    for kind in [
        LightKind::Point { position, range: 3.0 },
        LightKind::Spot {
            position,
            direction: vec3(-0.6, -0.75, -0.1).normalize(),
            range: f32::INFINITY,
            inner_cos: 0.86,
            outer_cos: 0.85,
        },
    ] {
        let mut builder = SceneBuilder::new("box at the end of the light");
        let white = builder.material(matte("white"));
        builder.mesh(
            "floor",
            shape::plane(vec3(-4.0, 0.0, 4.0), Vec3::X * 8.0, Vec3::NEG_Z * 8.0, 1.0),
            white,
        );
        let corner = vec3(-0.4, 0.0, -0.3);
        builder.mesh("box", shape::cuboid(corner, vec3(0.1, 0.7, 0.6), 1.0), white);
        builder.light(Light { name: "lamp".into(), kind, intensity: Vec3::splat(30.0) });
        builder.camera(Camera::look_at(vec3(-1.5, 4.0, 2.5), vec3(-0.8, 0.0, 0.0), 0.8));
        let scene = builder.build().unwrap();
        let options = options(400, 320);
        let frame = gpu.render(&scene, &options);
        let truth = image(&options, &traced(&scene, &options, 1, None));
        let pixels = frame.image.pixels.iter().zip(&truth.pixels);
        let wrong = pixels.filter(|(seen, truth)| truth[0] == 0.0 && seen[0] > 0.01).count();
        println!("{kind:?}: {wrong} dark pixels shine");
        assert!(wrong < 10, "{kind:?}: {wrong} dark pixels shine");
    }
    gpu.finish();
}

/// Where the border of a shadow is known, it is followed: shadows as thin as three pixels do not break into pieces.
#[test]
fn thin_shadows_do_not_break() {
    let gpu = TestGpu::open();
    let mut builder = SceneBuilder::new("strips over a floor");
    let white = builder.material(matte("white"));
    let strip = builder.material(Material { double_sided: true, ..matte("strip") });
    builder.mesh("floor", shape::plane(vec3(-4.0, 0.0, 4.0), Vec3::X * 8.0, Vec3::NEG_Z * 8.0, 1.0), white);
    for (at, angle) in [(-1.5_f32, 0.3_f32), (-0.5, 1.1), (0.4, -0.5), (1.5, 0.05)] {
        let along = vec3(angle.sin(), 0.0, angle.cos()) * 1.6;
        let across = vec3(angle.cos(), 0.0, -angle.sin()) * 0.022;
        let corner = vec3(at, 1.0, -0.8);
        builder.mesh("strip", shape::plane(corner, along, across, 1.0), strip);
    }
    builder.point_light(vec3(2.5, 4.0, 0.5), Vec3::splat(60.0));
    builder.camera(Camera::look_at(vec3(0.0, 6.0, 0.01), Vec3::ZERO, 0.7));
    let scene = builder.build().unwrap();
    let options = options(640, 512);
    let frame = gpu.render(&scene, &options);
    let truth = image(&options, &traced(&scene, &options, 1, None));
    let differ = |(a, b): &(&[f32; 3], &[f32; 3])| (a[0] - b[0]).abs() > 0.1;
    let wrong = frame.image.pixels.iter().zip(&truth.pixels).filter(differ).count();
    let traced = frame.stats.rays.pixel;
    println!("{wrong} pixels are wrong, {traced} rays of pixels");
    assert!(wrong < 30, "{wrong} pixels are wrong");
    assert!(traced < options.view.width as u64 * 100, "{traced} rays of pixels");
    gpu.finish();
}

/// What a mirror shows of another one ends within a face, and so may the shadow that is all that this face's corners see in
/// the other: beside it a sliver of the lit wall.
#[test]
fn light_beside_shadows_at_the_rim_of_a_mirror_in_a_mirror_is_found() {
    let gpu = TestGpu::open();
    let mut builder = SceneBuilder::new("periscope");
    let white = builder.material(Material { double_sided: true, ..matte("white") });
    let black = builder.material(Material { double_sided: true, ..matte("grey").colored(Vec3::splat(0.2)) });
    let metal = builder.material(Material { double_sided: true, ..chrome("silver", Vec3::splat(0.95)) });
    builder.mesh("back", shape::plane(vec3(-3.0, 0.0, -3.0), Vec3::X * 6.0, Vec3::Y * 3.0, 1.0), white);
    builder.mesh("ceiling", shape::plane(vec3(-3.0, 3.0, -3.0), Vec3::X * 6.0, Vec3::Z * 6.0, 1.0), white);
    for bottom in [0.3, 1.7] {
        let mirror = shape::plane(vec3(-0.35, bottom, 0.35), Vec3::X * 0.7, vec3(0.0, 0.7, -0.7), 1.0);
        builder.mesh("mirror", mirror, metal);
    }
    builder.mesh("plate", shape::plane(vec3(-0.4, 0.2, -0.4), Vec3::X * 0.8, Vec3::Y * 2.2, 1.0), black);
    builder.point_light(vec3(1.0, 2.6, 1.0), Vec3::splat(40.0));
    builder.point_light(vec3(-1.5, 2.5, -1.0), Vec3::splat(20.0));
    builder.camera(Camera::look_at(vec3(0.0, 0.65, 2.0), vec3(0.0, 0.65, 0.0), 0.61));
    let scene = builder.build().unwrap();
    let mut options = options(320, 256);
    // With a smaller one it is found, too, where nothing is predicted.
    options.effort.error = Some(2.0);
    let wrong = wrong(&gpu, &scene, &options);
    assert!(wrong < 30, "{wrong} pixels are wrong");
    gpu.finish();
}

/// Metal of roughness 1, glTF's default material, scatters evenly: its exponent is 0, also where the mirrored light
/// points away from the eye.
#[test]
fn the_default_material_has_no_edge_where_its_highlight_turns_away() {
    let mut builder = SceneBuilder::new("rough");
    let rough = builder.material(Material { metallic: 1.0, roughness: 1.0, ..matte("rough") });
    builder.mesh("floor", shape::plane(vec3(-4.0, 0.0, 4.0), Vec3::X * 8.0, Vec3::NEG_Z * 8.0, 1.0), rough);
    builder.point_light(vec3(-3.0, 0.4, 0.0), Vec3::splat(4.0));
    builder.camera(Camera::look_at(vec3(-3.5, 1.0, 1.0), vec3(0.0, 0.0, 0.0), 0.8));
    let scene = builder.build().unwrap();
    let gpu = TestGpu::open();
    let options = options(96, 80);
    let error = compare(
        &image(&options, &traced(&scene, &options, 1, None)),
        &gpu.render(&scene, &options).image,
        None,
        Encoding::Srgb,
    );
    assert!(error.unwrap().psnr.is_none_or(|psnr| psnr > 50.0));
    gpu.finish();
}

/// A mirror with a normal map reflects as the reference has it: its pixels are traced.
#[test]
fn normal_maps_bend_reflections() {
    const SIZE: u32 = 32;
    let mut builder = SceneBuilder::new("ripples");
    glowing_floor(&mut builder);
    let texel = |i: u32| {
        let slope = ((i % SIZE) as f32 * std::f32::consts::TAU / SIZE as f32).sin() * 0.2;
        let n = vec3(slope, 0.0, 1.0).normalize() * 0.5 + 0.5;
        [(n.x * 255.0) as u8, (n.y * 255.0) as u8, (n.z * 255.0) as u8, 255]
    };
    let rgba: Vec<u8> = (0..SIZE * SIZE).flat_map(texel).collect();
    let image = Image { name: "ripples".into(), width: SIZE, height: SIZE, rgba: rgba.into() };
    let slot = builder.sampled_texture(image, Sampler::default(), false);
    let rippled =
        builder.material(Material { normal_texture: Some(slot), ..chrome("rippled", Vec3::splat(0.9)) });
    builder.mesh("mirror", shape::plane(vec3(-3.0, 0.5, -3.0), Vec3::X * 6.0, Vec3::Y * 3.0, 4.0), rippled);
    builder.camera(Camera::look_at(vec3(0.3, 1.5, 3.0), vec3(0.0, 1.0, -3.0), 0.9));
    let mut scene = builder.build().unwrap();
    scene.geometry.tangents = vec![Vec4::X + Vec4::W; scene.geometry.positions.len()];

    let gpu = TestGpu::open();
    let mut options = options(160, 128);
    options.scene.shadows = Shadows::None;
    let truth = traced(&scene, &options, 1, None);
    let frame = gpu.render(&scene, &options);
    let error = over_vt(&frame, &options, &truth);
    assert!(error.psnr.is_none_or(|psnr| psnr > 45.0), "{:?} dB", error.psnr);
    assert!(frame.stats.vertices < truth.rays.primary / 4, "{} vertices", frame.stats.vertices);
    assert!(scene.notes.iter().any(|note| note.contains("rippled") && note.contains("traced one by one")));

    // Flat, the same mirror needs none of it.
    scene.geometry.tangents.clear();
    assert!(gpu.render(&scene, &options).stats.rays.pixel < frame.stats.rays.pixel / 2);
    gpu.finish();
}

/// PSNR of a frame of 320x256, in dB.
fn near(gpu: &TestGpu, scene: &Scene) -> f64 {
    let options = options(320, 256);
    let frame = gpu.render(scene, &options);
    let psnr = psnr(&image(&options, &traced(scene, &options, 1, None)), &frame.image);
    println!("{}: {psnr:.1} dB", scene.name);
    psnr
}

/// A face whose plane has a light behind it hides it from itself, though normals of its vertices point to that light.
#[test]
fn faces_hide_what_is_behind_them_from_themselves() {
    let gpu = TestGpu::open();
    let mut builder = SceneBuilder::new("coarse balls in slanting light");
    let white = builder.material(matte("white"));
    for (i, level) in [1, 2, 2].into_iter().enumerate() {
        builder.mesh("ball", shape::sphere(vec3(2.2 * i as f32 - 2.2, 0.0, 0.0), 1.0, level), white);
    }
    let kind = LightKind::Directional { direction: vec3(-0.8, -0.3, -0.1).normalize() };
    builder.light(Light { name: "sun".into(), kind, intensity: Vec3::splat(3.0) });
    builder.camera(Camera::look_at(vec3(0.0, 0.5, 6.0), Vec3::ZERO, 0.8));
    let scene = builder.build().unwrap();
    assert!(near(&gpu, &scene) > 45.0);
    gpu.finish();
}

/// Nor does a normal map that bends a surface towards a light bring that light round it.
#[test]
fn normal_maps_let_no_light_through() {
    const SIZE: u32 = 8;
    let gpu = TestGpu::open();
    let mut builder = SceneBuilder::new("studded box");
    let stud = |i: u32| {
        let slope = if i.is_multiple_of(2) { 0.8 } else { -0.8 };
        let n = vec3(slope, slope, 1.0).normalize() * 0.5 + 0.5;
        [(n.x * 255.0) as u8, (n.y * 255.0) as u8, (n.z * 255.0) as u8, 255]
    };
    let rgba: Vec<u8> = (0..SIZE * SIZE).flat_map(stud).collect();
    let studs = Image { name: "studs".into(), width: SIZE, height: SIZE, rgba: rgba.into() };
    let sampler = Sampler { mip: None, ..Sampler::default() };
    let slot = builder.sampled_texture(studs, sampler, false);
    let studded = builder.material(Material { normal_texture: Some(slot), ..matte("studded") });
    builder.mesh("box", shape::cuboid(Vec3::splat(-1.0), Vec3::ONE, 1.0), studded);
    let kind = LightKind::Directional { direction: vec3(0.95, -0.25, 0.2).normalize() };
    builder.light(Light { name: "sun".into(), kind, intensity: Vec3::splat(3.0) });
    builder.camera(Camera::look_at(vec3(3.0, 2.5, 3.5), Vec3::ZERO, 0.8));
    let mut scene = builder.build().unwrap();
    scene.geometry.tangents = vec![Vec4::X + Vec4::W; scene.geometry.positions.len()];
    assert!(near(&gpu, &scene) > 45.0);
    gpu.finish();
}

/// A normal map so strong that its normals have no length a float holds leaves the surface as it is, drawn or traced.
#[test]
fn normal_maps_of_any_strength_leave_surfaces_lit() {
    let gpu = TestGpu::open();
    for scale in [1.0, 1e20, f32::MAX] {
        let mut builder = SceneBuilder::new("embossed");
        let texel = |i: u32| if i.is_multiple_of(2) { [100, 128, 230, 255] } else { [150, 140, 230, 255] };
        let rgba: Vec<u8> = (0..64).flat_map(texel).collect();
        let image = Image { name: "bumps".into(), width: 8, height: 8, rgba: rgba.into() };
        let nearest = Sampler { mag: Filter::Nearest, min: Filter::Nearest, mip: None, ..Sampler::default() };
        let slot = builder.sampled_texture(image, nearest, false);
        let embossed = Material { normal_texture: Some(slot), normal_scale: scale, ..matte("embossed") };
        let embossed = builder.material(embossed);
        builder.mesh("wall", shape::plane(vec3(-2.0, 0.0, 0.0), Vec3::X * 4.0, Vec3::Y * 3.0, 4.0), embossed);
        builder.point_light(vec3(0.5, 2.0, 2.0), Vec3::splat(15.0));
        builder.camera(Camera::look_at(vec3(0.0, 1.5, 3.0), vec3(0.0, 1.5, 0.0), 0.7));
        let mut scene = builder.build().unwrap();
        scene.geometry.tangents = vec![Vec4::X + Vec4::W; scene.geometry.positions.len()];
        let options = options(96, 80);
        let truth = traced(&scene, &options, 1, None);
        let truth = common::image(&options, &truth);
        let psnr = psnr(&truth, &gpu.render(&scene, &options).image);
        println!("{scale:e}: {psnr:.1} dB");
        assert!(psnr > 35.0, "{scale:e}: {psnr:.1} dB");
        assert!(truth.pixels.iter().all(|pixel| pixel[0] > 0.01), "{scale:e}: the wall is lit");
    }
    gpu.finish();
}
