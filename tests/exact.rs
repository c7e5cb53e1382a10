//! What exact reconstruction promises: closed-form coordinates through glass, the error that it predicts, no ray
//! for anti-aliasing, no more rays than conventional tracing on dense meshes.

mod common;

use glam::{Vec2, Vec3, Vec4, vec3};
use vertex_tracing::{
    frame::{Frame, Renderer},
    options::{CameraChoice, Mode, Msaa, Options, Reconstruction, Shadows, Ss, VisibilityWay},
    report::{
        FloatImage,
        metrics::{Comparison, Encoding, compare},
    },
    scene::{
        AlphaMode, Background, Camera, Image, Material, Sampler, Scene, View, Volume, Wrap,
        demo::{Demo, SceneBuilder, chrome, glass, matte, shape, stress, texture},
        light::{Light, LightKind},
    },
    trace::{
        Settings, Tracer,
        reference::{self, Reference},
    },
};

use common::TestGpu;

fn options(width: u32, height: u32) -> Options {
    let mut options = Options::default();
    (options.view.width, options.view.height) = (width, height);
    options
}

/// The view by the reference tracer, of the pixels that `only` marks.
fn traced(scene: &Scene, options: &Options, spp: u32, only: Option<&[bool]>) -> Reference {
    let view = options.view.resolve(scene).unwrap();
    let settings = Settings::new(&options.paths, &options.scene);
    reference::render(&Tracer::new(scene), &view, &settings, spp, only, &Default::default(), &|_| {}).unwrap()
}

fn image(options: &Options, reference: &Reference) -> FloatImage {
    let (width, height) = (options.view.width, options.view.height);
    FloatImage { width, height, pixels: reference.image.clone() }
}

fn over_vt(frame: &Frame, options: &Options, truth: &Reference) -> Comparison {
    compare(&image(options, truth), &frame.image, Some(&truth.vt_mask), Encoding::Srgb).unwrap()
}

/// A floor, 8 × 8 around the origin, that glows in the colour of its own coordinates.
fn glowing_floor(builder: &mut SceneBuilder) {
    const SIZE: u32 = 256;
    let texel = |i: u32| [(i % SIZE) as u8, (i / SIZE) as u8, 0, 255];
    let rgba: Vec<u8> = (0..SIZE * SIZE).flat_map(texel).collect();
    let image = Image { name: "coordinates".into(), width: SIZE, height: SIZE, rgba: rgba.into() };
    let clamped = Sampler { wrap_u: Wrap::Clamp, wrap_v: Wrap::Clamp, mip: None, ..Sampler::default() };
    let slot = builder.sampled_texture(image, clamped, false);
    let floor =
        builder.material(Material { base_color_texture: Some(slot), unlit: true, ..matte("coordinates") });
    builder.mesh("floor", shape::plane(vec3(-4.0, 0.0, 4.0), Vec3::X * 8.0, Vec3::NEG_Z * 8.0, 8.0), floor);
}

/// Coordinates that the floor shows at a point of it.
fn floor_uv(point: Vec3) -> Vec2 {
    Vec2::new((point.x + 4.0) / 8.0, (point.z + 4.0) / 8.0)
}

/// Coordinates back from a colour of the glowing floor. Texel i is i/255 at (i + 0.5)/256.
fn shown_uv(color: Vec3) -> Vec2 {
    Vec2::new(color.x * 255.0 + 0.5, color.y * 255.0 + 0.5) / 256.0
}

const IOR: f32 = 1.5;

/// Clear glass that absorbs nothing.
fn clear() -> Material {
    Material {
        volume: Some(Volume { attenuation_color: Vec3::ONE, attenuation_distance: f32::INFINITY }),
        base_color: Vec4::ONE,
        ..glass("clear", IOR)
    }
}

/// Snell's law for a unit direction against a unit normal on the ray's side, and the share that passes.
fn refract(d: Vec3, n: Vec3, from: f32, to: f32) -> Option<(Vec3, f32)> {
    let eta = from / to;
    let cos_in = -d.dot(n);
    let square = 1.0 - eta * eta * (1.0 - cos_in * cos_in);
    if square <= 0.0 {
        return None;
    }
    let cos_out = square.sqrt();
    let s = (from * cos_in - to * cos_out) / (from * cos_in + to * cos_out);
    let p = (from * cos_out - to * cos_in) / (from * cos_out + to * cos_in);
    Some((d * eta + n * (eta * cos_in - cos_out), 1.0 - 0.5 * (s * s + p * p)))
}

/// Floor coordinates behind two glass planes (unit normal towards the eye, distance from the origin), by Snell's
/// law at each, and the share of light that passes both. Reflection inside adds nothing: it meets black.
fn through(view: &View, x: u32, y: u32, planes: [(Vec3, f32); 2]) -> Option<(Vec3, Vec3, f32)> {
    let (origin, direction) = view.ray(Vec2::new(x as f32, y as f32) + 0.5);
    let hit = |o: Vec3, d: Vec3, (n, k): (Vec3, f32)| o + d * ((k - n.dot(o)) / n.dot(d));
    let first = hit(origin, direction, planes[0]);
    let (inside, enters) = refract(direction, planes[0].0, 1.0, IOR)?;
    let second = hit(first, inside, planes[1]);
    let (out, leaves) = refract(inside, planes[1].0, IOR, 1.0)?;
    (out.y < -1e-3).then(|| (first, second - out * (second.y / out.y), enters * leaves))
}

/// Holds every pixel that sees the floor through the two planes against Snell's law; `meets` says whether the
/// path passes both faces well inside of their borders.
fn holds_to_snell(builder: SceneBuilder, planes: [(Vec3, f32); 2], inside: impl Fn(Vec3) -> bool) {
    let gpu = TestGpu::open();
    let scene = builder.build().unwrap();
    let mut options = options(160, 120);
    // Once in, once out: what is reflected inside never leaves within two bounces.
    options.paths.depth = 2;
    let frame = gpu.render(&scene, &options);
    let view = options.view.resolve(&scene).unwrap();
    let (mut checked, mut errors) = (0, Vec::new());
    for (x, y) in (0..120).flat_map(|y| (0..160).map(move |x| (x, y))) {
        let Some((first, point, passes)) = through(&view, x, y, planes) else { continue };
        if !inside(first) || point.x.abs() > 3.8 || point.z.abs() > 3.8 {
            continue;
        }
        let color = Vec3::from(frame.image.pixels[(y * 160 + x) as usize]) / passes;
        errors.push((shown_uv(color) - floor_uv(point)).abs().max_element());
        checked += 1;
    }
    errors.sort_by(f32::total_cmp);
    assert!(checked > 1500, "{checked} pixels show the floor through the glass");
    let (median, high) = (errors[checked / 2], errors[checked * 98 / 100]);
    // Halves resolve 2^-11 near 1; a texel is 1/256.
    assert!(median < 2e-3 && high < 4e-3, "coordinates are off: median {median}, 98th percentile {high}");
    gpu.finish();
}

#[test]
fn a_glass_slab_shifts_the_floor_as_snell_says() {
    let mut builder = SceneBuilder::new("slab");
    glowing_floor(&mut builder);
    let clear = builder.material(clear());
    builder.mesh("slab", shape::cuboid(vec3(-2.0, 1.0, -2.0), vec3(2.0, 1.5, 2.0), 1.0), clear);
    builder.camera(Camera::look_at(vec3(0.3, 5.0, 2.0), vec3(0.0, 1.0, 0.0), 0.5));
    let planes = [(Vec3::Y, 1.5), (Vec3::Y, 1.0)];
    holds_to_snell(builder, planes, |first| first.x.abs() < 1.5 && first.z.abs() < 1.3);
}

#[test]
fn a_prism_turns_the_view_as_snell_says() {
    let mut builder = SceneBuilder::new("prism");
    glowing_floor(&mut builder);
    let clear = builder.material(clear());
    // A wedge: the cuboid's upper side leans by 10 degrees.
    let (sin, cos) = 10_f32.to_radians().sin_cos();
    let mut wedge = shape::cuboid(vec3(-2.0, 1.0, -2.0), vec3(2.0, 1.5, 2.0), 1.0);
    let leaning = vec3(sin, cos, 0.0);
    for (position, normal) in wedge.positions.iter_mut().zip(&mut wedge.normals) {
        if position.y > 1.2 {
            position.y -= position.x * sin / cos;
        }
        if normal.y > 0.5 {
            *normal = leaning;
        }
    }
    builder.mesh("prism", wedge, clear);
    builder.camera(Camera::look_at(vec3(0.3, 5.0, 2.0), vec3(0.0, 1.0, 0.0), 0.5));
    let planes = [(leaning, 1.5 * cos), (Vec3::Y, 1.0)];
    holds_to_snell(builder, planes, |first| first.x.abs() < 1.4 && first.z.abs() < 1.3);
}

#[test]
fn a_planar_mirror_of_the_floor_needs_no_refinement() {
    let gpu = TestGpu::open();
    let mut builder = SceneBuilder::new("mirror");
    let board = builder.texture(texture::chessboard(512));
    let floor = builder.material(matte("floor").textured(board));
    let silver = builder.material(chrome("silver", Vec3::splat(0.9)));
    builder.mesh("floor", shape::plane(vec3(-4.0, 0.0, 4.0), Vec3::X * 8.0, Vec3::NEG_Z * 8.0, 6.0), floor);
    builder.mesh("mirror", shape::plane(vec3(-1.5, 0.2, -1.0), Vec3::X * 3.0, Vec3::Y, 3.0), silver);
    builder.point_light(vec3(1.0, 4.0, 2.0), Vec3::splat(60.0));
    builder.camera(Camera::look_at(vec3(0.3, 3.0, 3.0), vec3(0.0, 0.7, -1.0), 0.6));
    let scene = builder.build().unwrap();
    // Near enough that no texture is minified: the tracer reads the finest level alone.
    let mut options = options(1280, 1024);
    options.scene.shadows = Shadows::None;
    options.effort.preview = true;
    let frame = gpu.render(&scene, &options);
    let psnr = over_vt(&frame, &options, &traced(&scene, &options, 1, None)).psnr.unwrap();
    assert_eq!(frame.stats.steps, 0);
    assert!(psnr > 55.0, "{psnr:.1} dB");
    gpu.finish();
}

#[test]
fn mirrors_that_reach_behind_the_eye_are_seen_whole() {
    let gpu = TestGpu::open();
    // Two triangles over the eye, most of whose corners are behind it.
    for (turn, length) in [(0.0_f32, 6.0_f32), (0.3, 6.0), (1.2, 9.0), (2.6, 40.0)] {
        let mut builder = SceneBuilder::new("over the eye");
        glowing_floor(&mut builder);
        let silver = Material { double_sided: true, ..chrome("silver", Vec3::splat(0.9)) };
        let silver = builder.material(silver);
        let (sin, cos) = turn.sin_cos();
        let (along, across) = (vec3(sin, 0.0, cos) * length, vec3(cos, 0.0, -sin) * 0.35 * length);
        let corner = vec3(0.0, 1.5, 0.0) - along - across;
        builder.mesh("mirror", shape::plane(corner, 2.0 * along, 2.0 * across, 1.0), silver);
        builder.camera(Camera::look_at(vec3(0.0, 0.7, 0.0), vec3(0.0, 0.7, -1.0), 1.05));
        let scene = builder.build().unwrap();
        for visibility in [VisibilityWay::IdBuffer, VisibilityWay::SinglePass, VisibilityWay::Device] {
            let mut options = options(640, 512);
            options.method.visibility = visibility;
            let frame = gpu.render(&scene, &options);
            let error = over_vt(&frame, &options, &traced(&scene, &options, 1, None));
            let psnr = error.psnr.unwrap_or(99.0);
            println!("turned {turn}, {length} long, {visibility:?}: {psnr:.1} dB");
            assert!(psnr > 45.0, "turned {turn}, {length} long, {visibility:?}: {psnr:.1} dB");
        }
    }
    gpu.finish();
}

/// A texture goes on from leaf to leaf as if there were no edges between them, however pixels are covered.
#[test]
fn coverage_samples_do_not_tear_textures() {
    let gpu = TestGpu::open();
    let scene = Demo::Mirror.scene();
    let off = |msaa| {
        let mut options = options(400, 320);
        options.method.msaa = msaa;
        let frame = gpu.render(&scene, &options).image;
        let truth = image(&options, &traced(&scene, &options, 16, None));
        let far =
            |(a, b): &(&[f32; 3], &[f32; 3])| (Vec3::from(**a) - Vec3::from(**b)).abs().max_element() > 0.3;
        frame.pixels.iter().zip(&truth.pixels).filter(far).count()
    };
    let (one, four) = (off(Msaa::One), off(Msaa::Four));
    println!("{one} pixels are off with one sample, {four} with four");
    assert!(four <= one + one / 10, "{one} pixels are off with one sample, {four} with four");
    gpu.finish();
}

/// Unrefined, a room shows what its corners see, which are other walls' corners as well.
#[test]
fn corners_where_walls_meet_see_the_room() {
    let gpu = TestGpu::open();
    let mut builder = SceneBuilder::new("room");
    let plaster = builder.material(matte("plaster"));
    let mut wall = |name: &str, corner: Vec3, right: Vec3, up: Vec3, material| {
        builder.mesh(name, shape::plane(corner, right, up, 1.0), material);
    };
    let (x, y, z) = (Vec3::X * 4.0, Vec3::Y * 3.0, Vec3::Z * 4.0);
    wall("floor", vec3(-2.0, 0.0, 2.0), x, -z, plaster);
    wall("left", vec3(-2.0, 0.0, 2.0), -z, y, plaster);
    wall("right", vec3(2.0, 0.0, -2.0), z, y, plaster);
    wall("ceiling", vec3(-2.0, 3.0, -2.0), x, z, plaster);
    wall("back", vec3(2.0, 0.0, 2.0), -x, y, plaster);
    let silver = builder.material(chrome("silver", Vec3::splat(0.9)));
    builder.mesh("mirror", shape::plane(vec3(-2.0, 0.0, -2.0), x, y, 1.0), silver);
    builder.point_light(vec3(0.3, 2.0, 0.2), Vec3::splat(40.0));
    builder.camera(Camera::look_at(vec3(0.2, 1.5, 1.8), vec3(0.0, 1.4, -2.0), 1.2));
    let scene = builder.build().unwrap();
    let mut options = options(320, 256);
    options.effort.preview = true;
    let preview = gpu.render(&scene, &options).image;
    let truth = image(&options, &traced(&scene, &options, 1, None));
    let dark = |image: &FloatImage| image.pixels.iter().filter(|pixel| pixel[0] < 0.02).count();
    println!("{} pixels are dark, {} should be", dark(&preview), dark(&truth));
    assert!(dark(&truth) < 100 && dark(&preview) < 6000, "{} pixels are dark", dark(&preview));
    gpu.finish();
}

/// Beside mirrors of two triangles each, of which the eye sees a small part from anywhere: that part is refined.
#[test]
fn what_is_seen_of_faces_all_around_the_eye_is_refined() {
    let gpu = TestGpu::open();
    let mut builder = SceneBuilder::new("crossed mirrors");
    glowing_floor(&mut builder);
    let board = builder.texture(texture::chessboard(64));
    let lining = Material { unlit: true, double_sided: true, ..matte("lining").textured(board) };
    let lining = builder.material(lining);
    for (corner, along) in [
        (vec3(-4.0, 0.0, -4.0), Vec3::X * 8.0),
        (vec3(4.0, 0.0, -4.0), Vec3::Z * 8.0),
        (vec3(4.0, 0.0, 4.0), Vec3::X * -8.0),
        (vec3(-4.0, 0.0, 4.0), Vec3::Z * -8.0),
    ] {
        builder.mesh("wall", shape::plane(corner, along, Vec3::Y * 4.0, 2.0), lining);
    }
    let silver = Material { double_sided: true, ..chrome("silver", Vec3::splat(0.9)) };
    let silver = builder.material(silver);
    builder.mesh("mirror", shape::plane(vec3(-3.0, 0.1, -0.3), Vec3::X * 6.0, Vec3::Y * 3.0, 1.0), silver);
    builder.mesh("other", shape::plane(vec3(-0.2, 0.1, -3.0), Vec3::Z * 6.0, Vec3::Y * 3.0, 1.0), silver);
    let eye = vec3(0.1, 0.7, 0.1);
    for turn in 0..12 {
        let (sin, cos) = (turn as f32 * 0.53).sin_cos();
        builder.camera(Camera::look_at(eye, eye + vec3(sin, 0.3 * cos, cos), 1.22));
    }
    let scene = builder.build().unwrap();
    for camera in 0..scene.cameras.len() {
        let mut options = options(320, 256);
        options.view.camera = CameraChoice::Named(camera.to_string());
        options.scene.shadows = Shadows::None;
        let frame = gpu.render(&scene, &options);
        let psnr = over_vt(&frame, &options, &traced(&scene, &options, 1, None)).psnr.unwrap_or(99.0);
        println!("camera {camera}: {psnr:.1} dB");
        assert!(psnr > 50.0, "camera {camera}: {psnr:.1} dB");
    }
    gpu.finish();
}

#[test]
fn dense_meshes_cost_no_more_than_conventional_tracing() {
    let gpu = TestGpu::open();
    // Below a pixel a face, a few pixels a face, and in between.
    for (faces, width, height) in
        [(200_000, 160, 128), (20_000, 160, 128), (8_000, 200, 160), (3_000, 160, 128)]
    {
        let scene = stress::wavy_mirror(faces).unwrap();
        let mut options = options(width, height);
        options.scene.shadows = Shadows::Vt;
        let frame = gpu.render(&scene, &options);
        let truth = traced(&scene, &options, 1, None);
        let conventional = traced(&scene, &options, 1, Some(&truth.vt_mask)).rays.total();
        let error = over_vt(&frame, &options, &truth);
        let (rays, psnr) = (frame.stats.rays.total, error.psnr.unwrap_or(99.0));
        println!("{faces} faces, {width}x{height}: {rays} rays, conventional {conventional}, {psnr:.1} dB");
        assert!(
            rays as f64 <= 1.2 * conventional as f64,
            "{faces} faces: {rays} rays, {conventional} would do"
        );
        if faces == 200_000 {
            assert!(psnr > 50.0, "{psnr:.1} dB where every pixel is traced");
        }
    }
    gpu.finish();
}

#[test]
fn many_faces_of_few_pixels_stay_out_of_the_mesh() {
    let gpu = TestGpu::open();
    let scene = stress::wavy_mirror(120_000).unwrap();
    let truth = traced(&scene, &options(320, 256), 1, None);
    for mode in [Mode::MultiTexture, Mode::MultiPass] {
        for visibility in [VisibilityWay::IdBuffer, VisibilityWay::SinglePass] {
            let mut options = options(320, 256);
            (options.method.mode, options.method.visibility) = (mode, visibility);
            let frame = gpu.render(&scene, &options);
            let stats = &frame.stats;
            let psnr = over_vt(&frame, &options, &truth).psnr.unwrap_or(99.0);
            println!("{} leaves, {} samples, {psnr:.1} dB", stats.faces.leaves, stats.samples);
            assert!(stats.faces.visible > 30_000, "{} faces are visible", stats.faces.visible);
            assert!(stats.faces.leaves < 10_000, "{} leaves", stats.faces.leaves);
            assert!(psnr > 45.0, "{psnr:.1} dB where nearly every pixel is traced");
            let mut renderer = Renderer::new(&gpu, &scene, &options).unwrap();
            renderer.keep_samples(64 << 20);
            let view = options.view.resolve(&scene).unwrap();
            let first = renderer.render(&view).unwrap();
            assert_eq!(first.image, frame.image);
            let second = renderer.render(&view).unwrap();
            assert_eq!(second.image, frame.image, "pixels that are kept are the same");
            assert!(second.stats.rays.pixel < stats.rays.pixel / 10, "pixels are kept");
        }
    }
    gpu.finish();
}

/// A pane hides what is behind it in part, be that a mesh whose pixels are all traced.
#[test]
fn panes_are_seen_before_dense_meshes() {
    let gpu = TestGpu::open();
    let mut builder = SceneBuilder::new("pane over waves");
    let metal = builder.material(chrome("silver", Vec3::splat(0.9)));
    builder.mesh("waves", shape::waves(2.0, 250, 0.02, 5.0), metal);
    let veil = Material { base_color: vec3(0.8, 0.1, 0.1).extend(0.6), unlit: true, ..matte("veil") };
    let veil = Material { alpha_mode: AlphaMode::Blend, double_sided: true, ..veil };
    let veil = builder.material(veil);
    builder.mesh("pane", shape::plane(vec3(-0.4, 0.3, 0.4), Vec3::X * 0.8, Vec3::NEG_Z * 0.8, 1.0), veil);
    builder.background(Background::Color(vec3(0.2, 0.5, 0.8)));
    builder.camera(Camera::look_at(vec3(0.0, 3.0, 0.5), Vec3::ZERO, 0.8));
    let scene = builder.build().unwrap();
    let options = options(320, 256);
    let frame = gpu.render(&scene, &options);
    assert!(frame.stats.faces.visible > 20_000, "{} faces are visible", frame.stats.faces.visible);
    let truth = image(&options, &traced(&scene, &options, 1, None));
    let psnr = compare(&truth, &frame.image, None, Encoding::Srgb).unwrap().psnr.unwrap_or(99.0);
    println!("{psnr:.1} dB");
    assert!(psnr > 45.0, "{psnr:.1} dB");
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
    for (mode, visibility, msaa) in [
        (Mode::MultiTexture, VisibilityWay::IdBuffer, Msaa::One),
        (Mode::MultiPass, VisibilityWay::IdBuffer, Msaa::One),
        (Mode::MultiTexture, VisibilityWay::SinglePass, Msaa::One),
        (Mode::MultiTexture, VisibilityWay::Device, Msaa::Four),
    ] {
        let mut options = options(320, 256);
        (options.method.mode, options.method.visibility, options.method.msaa) = (mode, visibility, msaa);
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

#[test]
fn a_larger_error_takes_fewer_rays() {
    let gpu = TestGpu::open();
    for demo in [Demo::CupAndGlass, Demo::GlassBowl] {
        let scene = demo.scene();
        let mut options = options(320, 256);
        let truth = traced(&scene, &options, 1, None);
        let mut before = (u64::MAX, 0.0);
        for error in [0.5, 32.0] {
            options.effort.error = Some(error);
            let frame = gpu.render(&scene, &options);
            let (rays, rmse) = (frame.stats.rays.total, over_vt(&frame, &options, &truth).rmse);
            println!("{} at {error}: {rays} rays, RMSE {rmse:.4}", demo.name());
            assert!(rays as f64 * 1.05 < before.0 as f64, "{}: {rays} rays after {}", demo.name(), before.0);
            assert!(rmse > before.1, "{}: RMSE {rmse:.4} after {:.4}", demo.name(), before.1);
            assert!(frame.stats.predicted_error.unwrap() <= f64::from(error));
            before = (rays, rmse);
        }
    }
    gpu.finish();
}

// The budgets of docs/samples.md, which tells of other scenes too.
#[test]
fn few_samples_go_farther_than_the_papers() {
    let gpu = TestGpu::open();
    for (demo, least) in [(Demo::Cup, 8.0), (Demo::GlassBowl, 5.0)] {
        let scene = demo.scene();
        let mut options = options(1280, 1024);
        options.scene.shadows = Shadows::None;
        options.effort.max_samples = Some(12_000);
        let truth = traced(&scene, &options, 1, None);
        let [exact, paper] = [Reconstruction::Exact, Reconstruction::Paper].map(|reconstruction| {
            options.method.reconstruction = reconstruction;
            over_vt(&gpu.render(&scene, &options), &options, &truth).psnr.unwrap()
        });
        println!("{}: exact {exact:.1} dB, the paper's {paper:.1} dB", demo.name());
        assert!(exact - paper >= least, "{}: exact {exact:.1} dB, the paper's {paper:.1} dB", demo.name());
    }
    gpu.finish();
}

// Of scenes with curved mirrors. Of planar ones, hardly any error is left that could be foreseen; of glass, up to
// three times as much is measured (docs/samples.md).
#[test]
fn the_error_is_predicted_within_a_factor_of_two() {
    let gpu = TestGpu::open();
    for demo in [Demo::Cup, Demo::CupAndGlass, Demo::PolishedTable] {
        let scene = demo.scene();
        let mut options = options(640, 512);
        options.scene.shadows = Shadows::None;
        let truth = traced(&scene, &options, 1, None);
        for samples in [2_000, 6_000] {
            options.effort.max_samples = Some(samples);
            let frame = gpu.render(&scene, &options);
            let shown = |c: &[f32; 3]| Vec3::from(*c).clamp(Vec3::ZERO, Vec3::ONE);
            let squares = |(a, b): (&[f32; 3], &[f32; 3])| (shown(a) - shown(b)).length_squared() / 3.0;
            let pixels = truth.image.iter().zip(&frame.image.pixels).zip(&truth.vt_mask);
            let sum: f32 = pixels.filter(|(_, vt)| **vt).map(|(pair, _)| squares(pair)).sum();
            let measured = f64::from(sum / frame.stats.image.vt_pixels as f32).sqrt();
            let predicted = frame.stats.predicted_rmse.unwrap();
            let ratio = predicted / measured;
            println!(
                "{} {samples}: predicted {predicted:.4}, measured {measured:.4}, {ratio:.2}",
                demo.name()
            );
            assert!((0.5..=2.0).contains(&ratio), "{}, {samples} samples: {ratio:.2}", demo.name());
        }
    }
    gpu.finish();
}

#[test]
fn the_shaft_guard_finds_what_stands_between_samples() {
    let gpu = TestGpu::open();
    let mut builder = SceneBuilder::new("needles before a mirror");
    let metal = builder.material(chrome("silver", Vec3::ONE));
    let bright = builder.material(Material { unlit: true, ..matte("bright") });
    let dark = builder.material(Material { base_color: Vec4::W, unlit: true, ..matte("dark") });
    builder.mesh("mirror", shape::plane(vec3(-2.0, -2.0, 0.0), Vec3::X * 4.0, Vec3::Y * 4.0, 1.0), metal);
    builder.mesh("wall", shape::plane(vec3(6.0, -6.0, 8.0), Vec3::NEG_X * 12.0, Vec3::Y * 12.0, 1.0), bright);
    for i in 0..5 {
        let at = vec3(-1.2 + 0.6 * i as f32, -0.63 + 0.29 * i as f32, 4.0);
        builder.mesh("needle", shape::plane(at, Vec3::NEG_X * 0.06, Vec3::Y * 0.5, 1.0), dark);
    }
    builder.camera(Camera::look_at(vec3(0.0, 0.0, 3.5), Vec3::ZERO, 0.8));
    let scene = builder.build().unwrap();
    let error = |shaft_guard: bool| {
        let mut options = options(320, 256);
        options.effort.shaft_guard = shaft_guard;
        let truth = traced(&scene, &options, 1, None);
        let frame = gpu.render(&scene, &options);
        over_vt(&frame, &options, &truth).rmse
    };
    let (with, without) = (error(true), error(false));
    println!("RMSE {with:.4} with the guard, {without:.4} without");
    assert!(with < 0.5 * without, "RMSE {with:.4} with the guard, {without:.4} without");
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

#[test]
fn anti_aliasing_adds_no_ray() {
    let gpu = TestGpu::open();
    for (demo, samples) in [(Demo::Cup, 4_000), (Demo::Sphere, 4_000)] {
        let scene = demo.scene();
        let mut options = options(320, 256);
        options.scene.shadows = Shadows::None;
        options.effort.max_samples = Some(samples);
        let truth = traced(&scene, &options, 64, None);
        let plain = traced(&scene, &options, 1, Some(&truth.vt_mask));
        let rmse = |frame: &Frame| over_vt(frame, &options, &truth).rmse;
        let one =
            compare(&image(&options, &truth), &image(&options, &plain), Some(&truth.vt_mask), Encoding::Srgb);
        let one = one.unwrap().rmse;
        let single = gpu.render(&scene, &options);
        let mut smooth = options.clone();
        smooth.method.ss = Ss::Four;
        let shaded = gpu.render(&scene, &smooth);
        smooth.method.ss = Ss::One;
        smooth.method.msaa = Msaa::Four;
        let covered = gpu.render(&scene, &smooth);
        println!(
            "{}: plain {:.4}, msaa 4 {:.4}, ss 4 {:.4}, tracer at 1 spp {one:.4}",
            demo.name(),
            rmse(&single),
            rmse(&covered),
            rmse(&shaded)
        );
        assert_eq!(single.stats.rays, covered.stats.rays, "--msaa 4 traced rays");
        assert_eq!(single.stats.rays, shaded.stats.rays, "--ss 4 traced rays");
        assert!(rmse(&shaded) < rmse(&single) && rmse(&shaded) < one);
        assert!(rmse(&covered) < rmse(&single));
    }
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
    assert!(frame.stats.samples < truth.rays.primary / 4, "{} vertices", frame.stats.samples);
    assert!(scene.notes.iter().any(|note| note.contains("rippled") && note.contains("traced one by one")));

    // Flat, the same mirror needs none of it.
    scene.geometry.tangents.clear();
    assert!(gpu.render(&scene, &options).stats.rays.pixel < frame.stats.rays.pixel / 2);
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
