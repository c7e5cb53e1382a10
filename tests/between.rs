//! What shows between samples that agree: holes, glowing textures, borders of shadows, metal between paint, slivers of faces.
//! Each picture is wrong, though predicted to be right, where these are not looked for.

mod common;

use glam::{Vec3, Vec4, vec3};
use vertex_tracing::scene::{
    AlphaMode, Background, Camera, Filter, Image, Light, LightKind, Material, Sampler, TextureSlot,
    demo::{Demo, MaterialId, SceneBuilder, chrome, glass, matte, shape, texture},
};

use common::{TestGpu, image, options, psnr, traced, wrong};

/// A room of 6 by 3 by 6 with a chequered floor and a light near its ceiling.
fn room(name: &str) -> SceneBuilder {
    let mut builder = SceneBuilder::new(name);
    let tiles = builder.texture(texture::chessboard(128));
    let floor = builder.material(matte("floor").textured(tiles));
    let wall = builder.material(matte("wall").colored(vec3(0.5, 0.6, 0.7)));
    let (x, y, z) = (Vec3::X * 6.0, Vec3::Y * 3.0, Vec3::Z * 6.0);
    builder.mesh("floor", shape::plane(vec3(-3.0, 0.0, 3.0), x, -z, 1.0), floor);
    builder.mesh("back", shape::plane(vec3(-3.0, 0.0, -3.0), x, y, 1.0), wall);
    builder.mesh("front", shape::plane(vec3(3.0, 0.0, 3.0), -x, y, 1.0), wall);
    builder.mesh("left", shape::plane(vec3(-3.0, 0.0, 3.0), -z, y, 1.0), wall);
    builder.mesh("right", shape::plane(vec3(3.0, 0.0, -3.0), z, y, 1.0), wall);
    builder.point_light(vec3(1.0, 2.6, 1.0), Vec3::splat(20.0));
    builder
}

fn mirror(builder: &mut SceneBuilder) {
    let silver = builder.material(chrome("silver", Vec3::splat(0.9)));
    builder.mesh("mirror", shape::plane(vec3(-2.9, 0.05, -1.2), Vec3::X * 5.8, Vec3::Y * 2.8, 1.0), silver);
}

/// A texture of squares, `cells` to a side, each of `edge` texels, unfiltered.
fn squares(
    builder: &mut SceneBuilder,
    cells: u32,
    srgb: bool,
    texel: impl Fn(u32, u32) -> [u8; 4],
) -> TextureSlot {
    let at = |i: u32| texel(i % cells, i / cells);
    let rgba: Vec<u8> = (0..cells * cells).flat_map(at).collect();
    let image = Image { name: "squares".into(), width: cells, height: cells, rgba: rgba.into() };
    let sampler = Sampler { mag: Filter::Nearest, min: Filter::Nearest, mip: None, ..Sampler::default() };
    builder.sampled_texture(image, sampler, srgb)
}

/// A sheet with eight by eight square holes.
fn perforated(builder: &mut SceneBuilder) -> MaterialId {
    let is_hole = |x: u32, y: u32| matches!(x % 4, 1 | 2) && matches!(y % 4, 1 | 2);
    let slot = squares(builder, 32, true, |x, y| [90, 90, 100, if is_hole(x, y) { 0 } else { 255 }]);
    let sheet = matte("perforated").textured(slot);
    builder.material(Material { alpha_mode: AlphaMode::Mask(0.5), double_sided: true, ..sheet })
}

#[test]
fn holes_are_seen_in_mirrors_and_through_glass() {
    let gpu = TestGpu::open();
    let mut builder = room("perforated sheet in a mirror");
    mirror(&mut builder);
    let sheet = perforated(&mut builder);
    builder.mesh("sheet", shape::plane(vec3(1.6, 0.2, 2.9), Vec3::X * -3.2, Vec3::Y * 2.2, 3.2), sheet);
    builder.camera(Camera::look_at(vec3(0.0, 1.3, 2.7), vec3(0.0, 1.2, -1.0), 0.61));
    let scene = builder.build().unwrap();
    let wrong_by_default = wrong(&gpu, &scene, &options(320, 256));
    assert!(wrong_by_default < 40, "{wrong_by_default} pixels are wrong in the mirror");

    // A limit that is far away makes no picture worse.
    let mut limited = options(320, 256);
    limited.effort.max_samples = Some(1_000_000_000);
    let count = wrong(&gpu, &scene, &limited);
    assert!(count <= wrong_by_default, "{count} pixels are wrong with all samples there are");

    let mut builder = room("perforated sheet behind glass");
    let clear = builder.material(glass("clear", 1.5));
    builder.mesh("slab", shape::cuboid(vec3(-2.0, 0.05, 1.3), vec3(2.0, 2.5, 1.5), 1.0), clear);
    let sheet = perforated(&mut builder);
    builder.mesh("sheet", shape::plane(vec3(-1.6, 0.2, -1.0), Vec3::X * 3.2, Vec3::Y * 2.2, 3.2), sheet);
    builder.camera(Camera::look_at(vec3(0.0, 1.3, 2.7), vec3(0.0, 1.2, -1.0), 0.9));
    let count = wrong(&gpu, &builder.build().unwrap(), &options(320, 256));
    assert!(count < 60, "{count} pixels are wrong behind the glass");
    gpu.finish();
}

#[test]
fn displays_glow_through_glass() {
    let gpu = TestGpu::open();
    let mut builder = room("display behind a slab");
    let clear = builder.material(glass("clear", 1.5));
    builder.mesh("slab", shape::cuboid(vec3(-2.0, 0.05, 1.3), vec3(2.0, 2.5, 1.5), 1.0), clear);
    let digits = |x: u32, y: u32| if x % 16 < 2 && y % 8 < 5 { [40, 255, 160, 255] } else { [0, 0, 0, 255] };
    let slot = squares(&mut builder, 64, true, digits);
    let display = Material {
        emissive: Vec3::ONE,
        emissive_texture: Some(slot),
        ..matte("display").colored(Vec3::ZERO)
    };
    let display = builder.material(display);
    builder.mesh("display", shape::plane(vec3(-1.0, 0.5, -1.0), Vec3::X * 2.0, Vec3::Y * 1.5, 2.0), display);
    builder.camera(Camera::look_at(vec3(0.0, 1.3, 2.7), vec3(0.0, 1.2, -1.0), 0.9));
    let count = wrong(&gpu, &builder.build().unwrap(), &options(320, 256));
    assert!(count < 10, "{count} pixels are wrong");
    gpu.finish();
}

/// Where shadows' borders run on what a mirror shows, in strips thinner than its leaves, and along the foot of a wall.
/// Where a mirror's corners see nothing but the night, what stands before it is looked for all the same.
#[test]
fn lit_things_before_the_dark_are_seen_in_mirrors() {
    let gpu = TestGpu::open();
    let mut builder = SceneBuilder::new("boxes at night");
    mirror(&mut builder);
    let paint = builder.material(matte("paint").colored(vec3(0.8, 0.5, 0.2)));
    let lamp = builder.material(Material { emissive: vec3(0.2, 0.9, 0.8), ..matte("lamp") });
    for i in 0..8 {
        let (x, y) = (0.55 * i as f32 - 2.1, 0.7 + 0.5 * (i * 5 % 4) as f32);
        let at = vec3(x, y, 3.5);
        builder.mesh("box", shape::cuboid(at, at + Vec3::splat(0.2), 1.0), paint);
        builder.mesh("lamp", shape::plane(at + Vec3::Y * 0.4, Vec3::X * -0.1, Vec3::Y * 0.1, 1.0), lamp);
    }
    builder.background(Background::Color(Vec3::ZERO));
    builder.point_light(vec3(0.0, 2.5, 2.5), Vec3::splat(8.0));
    builder.camera(Camera::look_at(vec3(0.0, 1.3, 2.7), vec3(0.0, 1.2, -1.0), 0.9));
    let count = wrong(&gpu, &builder.build().unwrap(), &options(320, 256));
    assert!(count < 20, "{count} pixels are wrong");
    gpu.finish();
}

/// A facade with lit windows ends before the night within faces of a pane: where one corner looks past it, no fragment looks
/// the windows up.
#[test]
fn lit_windows_are_seen_up_to_the_end_of_the_facade() {
    let gpu = TestGpu::open();
    let mut builder = SceneBuilder::new("facades at night");
    let pane = Material { double_sided: true, ..glass("pane", 1.5) };
    let pane = builder.material(Material { volume: None, ..pane });
    builder.mesh("pane", shape::plane(vec3(-2.9, 0.05, 1.2), Vec3::X * 5.8, Vec3::Y * 2.8, 1.0), pane);
    let lights =
        |x: u32, y: u32| if x % 2 == 1 && y % 2 == 1 { [255, 220, 120, 255] } else { [0, 0, 0, 255] };
    let slot = squares(&mut builder, 16, true, lights);
    let windows = Material {
        emissive: Vec3::ONE,
        emissive_texture: Some(slot),
        ..matte("windows").colored(Vec3::splat(0.01))
    };
    let windows = builder.material(windows);
    for i in 0..5 {
        let low = vec3(0.9 * i as f32 - 2.2, 0.2, -2.0);
        builder.mesh(
            "facade",
            shape::plane(low, Vec3::X * 0.5, Vec3::Y * (1.2 + 0.3 * (i % 3) as f32), 0.5),
            windows,
        );
    }
    builder.background(Background::Color(Vec3::ZERO));
    builder.camera(Camera::look_at(vec3(0.0, 1.3, 2.7), vec3(0.0, 1.2, -1.0), 0.9));
    let count = wrong(&gpu, &builder.build().unwrap(), &options(320, 256));
    assert!(count < 20, "{count} pixels are wrong");
    gpu.finish();
}

#[test]
fn borders_of_shadows_are_followed_in_mirrors() {
    let gpu = TestGpu::open();
    let mut builder = room("bars in a mirror");
    mirror(&mut builder);
    let dark = builder.material(Material { double_sided: true, ..matte("dark").colored(Vec3::splat(0.1)) });
    for i in 0..12 {
        let at = vec3(-1.6 + 0.28 * i as f32, 0.2, 2.9);
        builder.mesh("bar", shape::plane(at, Vec3::X * 0.14, Vec3::Y * 2.2, 1.0), dark);
        let at = vec3(-2.0 + 0.35 * i as f32, 1.8, 0.4);
        builder.mesh("rod", shape::plane(at, Vec3::X * 0.02, vec3(0.3, 0.0, 1.8), 1.0), dark);
    }
    builder.camera(Camera::look_at(vec3(0.0, 1.3, 2.7), vec3(0.0, 1.2, -1.0), 0.61));
    let count = wrong(&gpu, &builder.build().unwrap(), &options(320, 256));
    assert!(count < 60, "{count} pixels are wrong");
    gpu.finish();
}

/// Wires, and their shadows on the wall behind them, are thinner than a pixel or two: no corner sees either.
#[test]
fn wires_and_their_shadows_are_seen_in_mirrors_and_through_panes() {
    let gpu = TestGpu::open();
    for (what, depth, eye, target) in [
        ("a mirror", 2.2, vec3(0.3, 1.5, 1.2), vec3(0.0, 1.5, -3.0)),
        ("a pane", -2.6, vec3(0.2, 1.5, 2.4), vec3(0.0, 1.5, 0.0)),
    ] {
        let mut builder = room(&format!("wires and {what}"));
        if what == "a mirror" {
            mirror(&mut builder);
        } else {
            let clear = builder.material(glass("clear", 1.5));
            let corner = vec3(-1.5, 0.5, 0.0);
            builder.mesh("pane", shape::plane(corner, Vec3::X * 3.0, Vec3::Y * 2.0, 1.0), clear);
        }
        let black = matte("black").colored(Vec3::splat(0.03));
        let black = builder.material(Material { double_sided: true, ..black });
        for i in 0..6 {
            let start = vec3(-2.8, 0.9 + 0.31 * i as f32, depth);
            let along = vec3(5.6, 0.06 * i as f32 - 0.2, 0.3);
            builder.mesh("wire", shape::plane(start, along, Vec3::Y * 0.006, 1.0), black);
        }
        builder.camera(Camera::look_at(eye, target, 0.8));
        let count = wrong(&gpu, &builder.build().unwrap(), &options(320, 256));
        assert!(count < 90, "{what}: {count} pixels are wrong");
    }
    gpu.finish();
}

#[test]
fn metal_shows_between_stripes_of_paint() {
    let gpu = TestGpu::open();
    let mut builder = room("striped box");
    // Metal in the blue channel: all corners, and the first halves of edges, fall on paint.
    let slot = squares(&mut builder, 8, false, |x, _| [255, 10, if x % 2 == 1 { 255 } else { 0 }, 255]);
    let striped = Material {
        metallic: 1.0,
        metallic_roughness_texture: Some(slot),
        base_color: Vec4::new(0.9, 0.6, 0.3, 1.0),
        ..matte("striped")
    };
    let striped = builder.material(striped);
    builder.mesh("box", shape::cuboid(vec3(-1.0, 0.05, -0.4), vec3(-0.2, 1.0, 0.4), 0.8), striped);
    builder.camera(Camera::look_at(vec3(0.0, 1.4, 2.7), vec3(0.0, 0.6, 0.0), 0.9));
    let count = wrong(&gpu, &builder.build().unwrap(), &options(320, 256));
    assert!(count < 40, "{count} pixels are wrong");
    gpu.finish();
}

/// Of a large floor a slit shows, with a shadow's border in it.
#[test]
fn slivers_of_hidden_faces_are_refined() {
    let gpu = TestGpu::open();
    let mut builder = room("floor behind a slit");
    let cover = builder.material(Material { unlit: true, ..matte("cover").colored(Vec3::splat(0.3)) });
    for (left, width) in [(-2.0, 1.97), (0.0, 2.0)] {
        let plane = shape::plane(vec3(left, 1.2, 1.5), Vec3::X * width, vec3(0.0, 0.0, -3.0), 1.0);
        builder.mesh("cover", plane, cover);
    }
    builder.camera(Camera::look_at(vec3(0.0, 2.9, 0.01), Vec3::ZERO, 0.9));
    let count = wrong(&gpu, &builder.build().unwrap(), &options(320, 256));
    assert!(count < 8, "{count} pixels are wrong");
    gpu.finish();
}

/// A ball and a floor at the rim of a spot light.
fn spot_light(name: &str) -> SceneBuilder {
    let mut builder = SceneBuilder::new(name);
    let white = builder.material(matte("white"));
    let dark = builder.material(matte("dark").colored(Vec3::splat(0.05)));
    builder.mesh("floor", shape::plane(vec3(-4.0, 0.0, 4.0), Vec3::X * 8.0, Vec3::NEG_Z * 8.0, 1.0), white);
    builder.mesh("back", shape::plane(vec3(-4.0, 0.0, -4.0), Vec3::X * 8.0, Vec3::Y * 5.0, 1.0), white);
    builder.mesh("ball", shape::sphere(vec3(1.5, 0.8, -1.0), 0.8, 3), dark);
    let kind = LightKind::Spot {
        position: vec3(3.0, 3.0, 3.0),
        direction: vec3(-0.558, -0.279, -0.781).normalize(),
        range: f32::INFINITY,
        inner_cos: 0.39_f32.cos(),
        outer_cos: 0.4_f32.cos(),
    };
    builder.light(Light { name: "spot".into(), kind, intensity: Vec3::splat(60.0) });
    builder
}

/// Where a light does not reach any more, corners are as dark in a shadow as out of it; in between it may still reach.
#[test]
fn shadows_at_the_rim_of_a_light_are_dark() {
    let gpu = TestGpu::open();
    let mut scene = spot_light("ball at the rim of a spot light").build().unwrap();
    let mut worst = 0;
    for eye in [vec3(-1.32, 2.44, 0.68), vec3(0.41, 2.63, 1.23), vec3(-2.0, 3.0, 2.0), vec3(1.0, 4.0, 2.0)] {
        scene.cameras = vec![Camera::look_at(eye, vec3(0.7, 0.5, -1.3), 1.2)];
        worst = worst.max(wrong(&gpu, &scene, &options(320, 256)));
    }
    assert!(worst < 20, "{worst} pixels are wrong");
    gpu.finish();
}

/// The same as a mirror shows it.
#[test]
fn reflected_shadows_at_the_rim_of_a_light_are_dark() {
    let gpu = TestGpu::open();
    let mut builder = spot_light("rim of a spot light in a mirror");
    let silver = builder.material(chrome("silver", Vec3::splat(0.9)));
    builder.mesh("mirror", shape::plane(vec3(-4.0, 0.0, 4.0), Vec3::NEG_Z * 8.0, Vec3::Y * 5.0, 1.0), silver);
    let mut scene = builder.build().unwrap();
    let mut worst = 0;
    for eye in [vec3(3.0, 2.4, 0.7), vec3(2.0, 2.6, 2.0), vec3(0.5, 3.0, 2.0), vec3(-1.0, 2.0, -1.0)] {
        scene.cameras = vec![Camera::look_at(eye, vec3(-4.0, 1.0, -0.5), 1.2)];
        worst = worst.max(wrong(&gpu, &scene, &options(320, 256)));
    }
    assert!(worst < 20, "{worst} pixels are wrong");
    gpu.finish();
}

/// Crescents of balls in the light of a lamp that nothing else reaches, as a mirror shows them: corners see dark sides of balls or
/// the dark behind them.
#[test]
fn lit_crescents_in_the_dark_are_seen_in_mirrors() {
    let gpu = TestGpu::open();
    let mut builder = SceneBuilder::new("crescents in a mirror");
    let white = builder.material(matte("white"));
    let silver = builder.material(chrome("silver", Vec3::splat(0.9)));
    let left = shape::plane(vec3(-4.0, -2.0, 4.0), Vec3::NEG_Z * 8.0, Vec3::Y * 6.0, 1.0);
    builder.mesh("mirror", left, silver);
    for (i, radius) in [0.5, 0.3, 0.7, 0.2].into_iter().enumerate() {
        let centre = vec3(1.5, 0.6 + 0.4 * (i % 2) as f32, i as f32 * 1.3 - 2.6);
        builder.mesh("ball", shape::sphere(centre, radius, 4), white);
    }
    let kind = LightKind::Point { position: vec3(3.2, 2.4, 0.3), range: 6.0 };
    builder.light(Light { name: "lamp".into(), kind, intensity: Vec3::splat(8.0) });
    builder.background(Background::Color(Vec3::ZERO));
    let mut scene = builder.build().unwrap();
    let mut worst = 0;
    for eye in [vec3(-1.0, 1.2, 2.0), vec3(0.0, 1.0, -3.0), vec3(-2.0, 2.0, 0.5), vec3(0.5, 0.3, 3.0)] {
        scene.cameras = vec![Camera::look_at(eye, vec3(-4.0, 0.8, 0.0), 1.1)];
        worst = worst.max(wrong(&gpu, &scene, &options(320, 256)));
    }
    assert!(worst < 40, "{worst} pixels are wrong");
    gpu.finish();
}

/// Shadows of small things on a floor, and light that falls through a hole in one above it.
#[test]
fn shadows_between_corners_that_are_lit_alike_are_found() {
    let gpu = TestGpu::open();
    let shades = |with: fn(&mut SceneBuilder, MaterialId)| {
        let mut builder = SceneBuilder::new("shades on a floor");
        let white = builder.material(matte("white"));
        let red = builder.material(matte("red").colored(vec3(0.8, 0.1, 0.1)));
        let floor = shape::plane(vec3(-4.0, 0.0, 4.0), Vec3::X * 8.0, Vec3::NEG_Z * 8.0, 1.0);
        builder.mesh("floor", floor, white);
        builder.point_light(vec3(0.43, 5.0, 0.42), Vec3::splat(60.0));
        with(&mut builder, red);
        builder.build().unwrap()
    };
    let beads = shades(|builder, red| {
        for i in 0..5 {
            let centre = vec3(i as f32 * 0.83 - 1.7, 2.5, (i * i) as f32 * 0.21 - 1.9);
            builder.mesh("bead", shape::sphere(centre, 0.07, 2), red);
        }
    });
    let hole = shades(|builder, red| {
        for [low, high] in [[[-3.0, -3.0], [3.0, -0.03]], [[-3.0, 0.03], [3.0, 3.0]]] {
            let [from, to] = [low, high].map(|[x, z]| vec3(x, 3.0, z));
            builder.mesh("cover", shape::cuboid(from, to + Vec3::Y * 0.01, 1.0), red);
        }
        for [low, high] in [[[-3.0, -0.03], [-0.03, 0.03]], [[0.03, -0.03], [3.0, 0.03]]] {
            let [from, to] = [low, high].map(|[x, z]| vec3(x, 3.0, z));
            builder.mesh("cover", shape::cuboid(from, to + Vec3::Y * 0.01, 1.0), red);
        }
    });
    for mut scene in [beads, hole] {
        let (mut worst, mut unlooked) = (0, 0);
        for eye in [vec3(-2.3, 1.9, 3.2), vec3(1.3, 1.4, 2.6), vec3(3.1, 2.2, -0.7)] {
            scene.cameras = vec![Camera::look_at(eye, vec3(0.1, 0.0, -0.3), 0.9)];
            let mut options = options(320, 256);
            // With a smaller one, faces that the guard does not look into are looked into as all are.
            options.effort.error = Some(2.0);
            worst = worst.max(wrong(&gpu, &scene, &options));
            options.effort.shaft_guard = false;
            unlooked = unlooked.max(wrong(&gpu, &scene, &options));
        }
        assert!(
            worst < 10 && unlooked >= 20,
            "{worst} pixels are wrong, {unlooked} where nothing is looked for"
        );
    }
    gpu.finish();
}

/// The corners of a mirror lie in its frame, and those of a floor in the light: a preview bisects what is large.
#[test]
fn previews_look_into_large_faces() {
    let gpu = TestGpu::open();
    for (demo, psnr_at_least) in [(Demo::MirrorAndWall, 30.0), (Demo::Cup, 25.0)] {
        let scene = demo.scene();
        let mut options = options(320, 256);
        options.effort.preview = true;
        let frame = gpu.render(&scene, &options);
        let psnr = psnr(&image(&options, &traced(&scene, &options, 1, None)), &frame.image);
        println!("{}: {} samples, {psnr:.1} dB", scene.name, frame.stats.samples);
        assert!(psnr > psnr_at_least, "{}: {psnr:.1} dB", scene.name);
        assert!(frame.stats.vertices < 1200 && frame.stats.steps == 0, "{} vertices", frame.stats.vertices);
    }
    gpu.finish();
}
