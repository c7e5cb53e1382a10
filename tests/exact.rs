//! What exact reconstruction promises: closed-form coordinates through glass, textures that go on from leaf to leaf, mirrors
//! seen whole.

mod common;

use glam::{Vec2, Vec3, Vec4, vec3};
use vertex_tracing::{
    options::{CameraChoice, FilterMode, Msaa, Shadows, Ss, VisibilityWay},
    report::FloatImage,
    scene::{
        AlphaMode, Background, Camera, Material, Scene, View, Volume,
        demo::{Demo, Mesh, SceneBuilder, chrome, glass, matte, shape, texture},
    },
};

use common::floor::{floor_uv, glowing_floor, shown_uv};
use common::{TestGpu, image, options, over_vt, psnr, traced};

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

/// A mast of faces that are narrower than a pixel where it curves away: what they show is on them, not where their planes
/// meet the ray through a pixel's centre.
#[test]
fn coverage_samples_leave_no_dots_on_slivers() {
    let gpu = TestGpu::open();
    let mut builder = tiled_room("mast");
    let silver = builder.material(chrome("silver", Vec3::splat(0.95)));
    builder.mesh("mast", mast(0.15, 2.8, 200).translated(Vec3::X * -0.5), silver);
    let film = builder.material(film());
    builder.mesh("tube", mast(0.2, 2.8, 150).translated(vec3(0.5, 0.0, 0.3)), film);
    builder.camera(Camera::look_at(vec3(0.0, 1.4, 2.7), vec3(0.0, 1.2, 0.0), 0.9));
    let scene = builder.build().unwrap();
    let shown = |msaa| {
        let mut options = options(200, 160);
        options.method.msaa = msaa;
        let truth = image(&options, &traced(&scene, &options, 16, None));
        psnr(&truth, &gpu.render(&scene, &options).image)
    };
    let (one, four) = (shown(Msaa::One), shown(Msaa::Four));
    println!("{one:.1} dB with one sample, {four:.1} with four");
    assert!(four > one + 1.0, "{one:.1} dB with one sample, {four:.1} with four");
    gpu.finish();
}

/// Anti-aliasing looks at more points than pixels' centres: it must not make a picture worse of what only few of these show.
#[test]
fn anti_aliasing_loses_nothing() {
    let gpu = TestGpu::open();
    let mut worse = Vec::new();
    for (name, scene, gain) in [
        ("masts", masts(), 0.2),
        ("stars", stars(), -0.02),
        ("pearl", pearl(), 3.0),
        ("veil", veil(), 3.0),
        // Faces of many traced pixels.
        ("sphere", Demo::Sphere.scene(), 0.25),
    ] {
        let shown = |msaa, ss| {
            let mut options = options(200, 160);
            (options.method.msaa, options.method.ss) = (msaa, ss);
            let truth = image(&options, &traced(&scene, &options, 64, None));
            psnr(&truth, &gpu.render(&scene, &options).image)
        };
        let plain = shown(Msaa::One, Ss::One);
        for (msaa, ss) in [(Msaa::Four, Ss::One), (Msaa::One, Ss::Four)] {
            let smooth = shown(msaa, ss);
            println!("{name}: {plain:.2} dB, {smooth:.2} with --msaa {msaa} --ss {ss}");
            if smooth < plain + gain {
                worse.push((name, msaa, ss));
            }
        }
    }
    gpu.finish();
    assert!(worse.is_empty(), "{worse:?}");
}

/// Masts a few pixels wide, of faces far narrower than one, on a floor that glows.
fn masts() -> Scene {
    let mut builder = SceneBuilder::new("masts");
    let glow = builder.material(Material { emissive: vec3(0.8, 0.5, 0.2), ..matte("glow") });
    builder.mesh("floor", shape::plane(vec3(-3.0, 0.0, 3.0), Vec3::X * 6.0, Vec3::NEG_Z * 6.0, 1.0), glow);
    let silver = builder.material(chrome("silver", Vec3::splat(0.95)));
    let sizes = [(0.02, 200), (0.035, 150), (0.05, 200), (0.03, 150), (0.06, 200), (0.015, 150)];
    for (i, (radius, segments)) in (0..).zip(sizes) {
        let place = vec3(0.4 * i as f32 - 1.0, 0.0, -0.2 * i as f32);
        builder.mesh("mast", mast(radius, 2.2, segments).translated(place), silver);
    }
    builder.point_light(vec3(1.0, 2.6, 1.0), Vec3::splat(40.0));
    builder.camera(Camera::look_at(vec3(0.0, 1.2, 3.5), vec3(0.0, 1.0, 0.0), 0.8));
    builder.build().unwrap()
}

/// Lights smaller than a pixel in a mirror that is drawn from samples around them.
fn stars() -> Scene {
    let mut builder = SceneBuilder::new("stars");
    let glow = builder.material(Material { emissive: Vec3::splat(8.0), ..matte("glow") });
    let mut state = 1_u32;
    let mut random = move || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / (1 << 24) as f32
    };
    let mut sky = Mesh::default();
    for _ in 0..60 {
        let corner = vec3(4.0 * random() - 2.0, 2.0 * random() + 0.3, 5.0);
        sky = sky.merged(&shape::plane(corner, Vec3::NEG_X * 0.025, Vec3::Y * 0.025, 1.0));
    }
    builder.mesh("stars", sky, glow);
    let silver = builder.material(chrome("silver", Vec3::splat(0.95)));
    builder.mesh("mirror", shape::plane(vec3(-2.0, 0.0, -1.0), Vec3::X * 4.0, Vec3::Y * 2.5, 1.0), silver);
    builder.camera(Camera::look_at(vec3(0.0, 1.2, 3.0), vec3(0.0, 1.2, 0.0), 0.8));
    builder.build().unwrap()
}

/// A ball of faces of a few pixels, whose pixels are all traced, before a bright sky.
fn pearl() -> Scene {
    let mut builder = SceneBuilder::new("pearl");
    let silver = builder.material(chrome("silver", Vec3::new(0.3, 0.2, 0.1)));
    builder.mesh("pearl", shape::sphere(Vec3::Y, 0.8, 4), silver);
    builder.background(Background::Color(Vec3::splat(0.8)));
    builder.camera(Camera::look_at(vec3(0.0, 1.0, 3.5), vec3(0.0, 1.0, 0.0), 0.8));
    builder.build().unwrap()
}

/// A slanted pane that light passes in part, before a bright sky and beside a mirror.
fn veil() -> Scene {
    let mut builder = SceneBuilder::new("veil");
    let pane = Material { base_color: Vec4::new(0.05, 0.1, 0.02, 0.8), unlit: true, ..matte("pane") };
    let pane = Material { alpha_mode: AlphaMode::Blend, double_sided: true, ..pane };
    let pane = builder.material(pane);
    let (right, up) = (vec3(1.2, 0.3, 0.0), vec3(-0.3, 1.2, 0.0));
    for shift in [0.0, 0.3] {
        let corner = vec3(-0.5, 0.2 + shift, shift);
        builder.mesh("pane", shape::plane(corner, right, up, 1.0), pane);
    }
    let silver = builder.material(chrome("silver", Vec3::splat(0.95)));
    builder.mesh("mirror", shape::plane(vec3(-1.5, 0.0, -1.0), Vec3::X * 0.7, Vec3::Y * 2.0, 1.0), silver);
    builder.background(Background::Color(Vec3::splat(0.8)));
    builder.camera(Camera::look_at(vec3(0.0, 1.0, 3.5), vec3(0.0, 1.0, 0.0), 0.8));
    builder.build().unwrap()
}

/// A room of 6 by 3 by 6 with chequered walls and a light near its ceiling.
fn tiled_room(name: &str) -> SceneBuilder {
    let mut builder = SceneBuilder::new(name);
    let tiles = builder.texture(texture::chessboard(128));
    let wall = builder.material(matte("wall").textured(tiles));
    let (x, y, z) = (Vec3::X * 6.0, Vec3::Y * 3.0, Vec3::Z * 6.0);
    builder.mesh("floor", shape::plane(vec3(-3.0, 0.0, 3.0), x, -z, 1.0), wall);
    builder.mesh("ceiling", shape::plane(vec3(-3.0, 3.0, -3.0), x, z, 1.0), wall);
    builder.mesh("back", shape::plane(vec3(-3.0, 0.0, -3.0), x, y, 1.0), wall);
    builder.mesh("front", shape::plane(vec3(3.0, 0.0, 3.0), -x, y, 1.0), wall);
    builder.mesh("left", shape::plane(vec3(-3.0, 0.0, 3.0), -z, y, 1.0), wall);
    builder.mesh("right", shape::plane(vec3(3.0, 0.0, -3.0), z, y, 1.0), wall);
    builder.point_light(vec3(1.0, 2.6, 1.0), Vec3::splat(20.0));
    builder
}

/// Glass without a body.
fn film() -> Material {
    Material { volume: None, double_sided: true, ..glass("film", IOR) }
}

/// An upright cylinder of two faces a segment, smooth, without ends.
fn mast(radius: f32, height: f32, segments: u32) -> Mesh {
    let mut mesh = Mesh::default();
    for i in 0..segments {
        let (z, x) = (std::f32::consts::TAU * i as f32 / segments as f32).sin_cos();
        let normal = vec3(x, 0.0, z);
        mesh.positions.extend([normal * radius, normal * radius + Vec3::Y * height]);
        mesh.normals.extend([normal; 2]);
        let (here, next) = (2 * i, 2 * ((i + 1) % segments));
        mesh.faces.extend([[here, here + 1, next + 1], [here, next + 1, next]]);
    }
    mesh
}

/// Rays that run nearly parallel to a plane meet it anywhere: some devices look at all texels between.
#[test]
fn anisotropic_filters_take_no_minute() {
    let gpu = TestGpu::open();
    let scene = Demo::Cup.scene();
    let shown = |filter| {
        let mut options = options(160, 128);
        options.method.filter = filter;
        let frame = gpu.render(&scene, &options);
        (frame.stats.time_ms.draw, frame.image)
    };
    let (plain_ms, plain) = shown(FilterMode::Trilinear);
    let (ms, sharp) = shown(FilterMode::Aniso8);
    let apart = psnr(&plain, &sharp);
    println!("draw {ms:.0} ms, {plain_ms:.0} ms without; {apart:.1} dB apart");
    // A second or two, pipelines included; it was 18 on an idle machine.
    assert!(ms < 10_000.0, "draw {ms:.0} ms, {plain_ms:.0} ms without");
    assert!(apart > 20.0, "{apart:.1} dB apart");
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
