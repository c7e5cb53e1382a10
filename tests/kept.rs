//! What a renderer keeps from frame to frame, and leaves to the next one, saves work and changes no picture.

mod common;

use common::TestGpu;
use glam::{DVec3, Vec3};
use vertex_tracing::{
    frame::{Frame, Kept, Renderer},
    options::{
        CameraChoice, Equation, FilterMode, Mode, Msaa, Options, Reconstruction, Shadows, Show, Ss,
        VisibilityWay,
    },
    scene::{LightKind, Scene, demo::Demo},
};

const PLENTY: usize = 64 << 20;

/// The demo's own view as an eye and a target.
fn options(scene: &Scene) -> Options {
    let mut options = Options::default();
    (options.view.width, options.view.height) = (96, 72);
    (options.effort.max_samples, options.effort.sparing) = (Some(3000), true);
    let camera = &scene.cameras[0];
    let world = |point: Vec3| scene.origin + point.as_dvec3();
    options.view.camera = CameraChoice::Eye {
        eye: world(camera.position),
        target: Some(world(camera.position + camera.forward * 4.0)),
    };
    options
}

fn look_elsewhere(options: &mut Options, by: DVec3) {
    let CameraChoice::Eye { target: Some(target), .. } = &mut options.view.camera else { panic!("an eye") };
    *target += by;
}

/// A frame by a renderer that goes on with `kept`, and what that leaves.
fn go_on(gpu: &TestGpu, kept: Kept, scene: &Scene, options: &Options) -> (Frame, Kept) {
    let view = options.view.resolve(scene).unwrap();
    let mut renderer = Renderer::reusing(kept, gpu, scene, options).unwrap();
    let frame = renderer.render(&view).unwrap();
    (frame, renderer.into_kept())
}

/// What is kept after a first frame, which is returned too.
fn begin(gpu: &TestGpu, scene: &Scene, options: &Options, most_bytes: usize) -> (Frame, Kept) {
    let mut renderer = Renderer::new(gpu, scene, options).unwrap();
    renderer.keep_samples(most_bytes);
    let frame = renderer.render(&options.view.resolve(scene).unwrap()).unwrap();
    (frame, renderer.into_kept())
}

fn assert_same(kept: &Frame, fresh: &Frame, what: &str) {
    assert!(kept.image == fresh.image, "{what}: another picture");
    assert_eq!(kept.stats.samples, fresh.stats.samples, "{what}: samples");
    assert_eq!(kept.stats.steps, fresh.stats.steps, "{what}: steps");
    assert_eq!(fresh.stats.reused, 0, "{what}: a fresh renderer has nothing to reuse");
}

#[test]
fn samples_are_kept_while_the_eye_stays() {
    let gpu = TestGpu::open();
    let scene = Demo::CupAndGlass.scene();
    let first = options(&scene);
    let (frame, mut kept) = begin(&gpu, &scene, &first, PLENTY);
    assert!(frame.stats.samples > 300 && frame.stats.reused == 0, "{} samples", frame.stats.samples);

    // (what changes, least share of samples that are not traced again)
    type Change = (&'static str, f64, fn(&mut Options));
    let changes: [Change; 13] = [
        ("nothing", 1.0, |_| {}),
        ("mode", 1.0, |o| o.method.mode = Mode::MultiPass),
        ("equation", 1.0, |o| o.method.equation = Equation::Four),
        ("visibility", 1.0, |o| o.method.visibility = VisibilityWay::SinglePass),
        ("multisampling", 1.0, |o| o.method.msaa = Msaa::Four),
        ("supersampling", 1.0, |o| o.method.ss = Ss::Four),
        ("filter", 1.0, |o| o.method.filter = FilterMode::Trilinear),
        ("nodes", 1.0, |o| o.method.nodes = 2),
        ("show", 1.0, |o| o.show = Some(Show::Faces)),
        ("reconstruction", 0.14, |o| o.method.reconstruction = Reconstruction::Paper),
        ("size", 0.5, |o| (o.view.width, o.view.height) = (120, 90)),
        ("field of view", 0.5, |o| o.view.fov = Some(36.0)),
        ("looking elsewhere", 0.5, |o| look_elsewhere(o, DVec3::new(0.3, 0.1, 0.0))),
    ];
    for (what, least, change) in changes {
        let mut options = first.clone();
        change(&mut options);
        let (frame, left) = go_on(&gpu, kept, &scene, &options);
        kept = left;
        assert_same(&frame, &gpu.render(&scene, &options), what);
        let share = frame.stats.reused as f64 / frame.stats.vertices as f64;
        println!("{what}: {} vertices, {:.1} % of them kept", frame.stats.vertices, 100.0 * share);
        assert!(share >= least, "{what}: only {share:.3} of the vertices were kept");
        if least == 1.0 {
            assert_eq!(frame.stats.rays.total, frame.stats.rays.pixel, "{what}: rays were traced again");
        }
    }
    drop(kept);
    gpu.finish();
}

#[test]
fn samples_that_no_longer_hold_are_forgotten() {
    let gpu = TestGpu::open();
    let mut scene = Demo::CupAndGlass.scene();
    let first = options(&scene);
    let mut kept = begin(&gpu, &scene, &first, PLENTY).1;
    type Change = (&'static str, fn(&mut Options));
    let changes: [Change; 4] = [
        ("depth", |o| o.paths.depth = 2),
        ("shadows", |o| o.scene.shadows = Shadows::None),
        ("fresnel", |o| o.scene.fresnel = true),
        ("eye", |o| {
            let CameraChoice::Eye { eye, .. } = &mut o.view.camera else { panic!("an eye") };
            eye.x += 1e-3;
        }),
    ];
    for (what, change) in changes {
        let mut options = first.clone();
        change(&mut options);
        let (frame, left) = go_on(&gpu, kept, &scene, &options);
        kept = left;
        assert_eq!(frame.stats.reused, 0, "{what}");
        assert_same(&frame, &gpu.render(&scene, &options), what);
    }
    // A light that moves takes the samples with it, and leaves hierarchy and textures.
    let (frame, kept) = go_on(&gpu, kept, &scene, &first);
    let before = frame.stats.time_ms.bvh;
    let position = scene.lights.iter_mut().find_map(|light| match &mut light.kind {
        LightKind::Point { position, .. } | LightKind::Spot { position, .. } => Some(position),
        LightKind::Directional { .. } => None,
    });
    position.expect("a lamp").y += 0.2;
    let (frame, _) = go_on(&gpu, kept, &scene, &first);
    assert_eq!(frame.stats.reused, 0, "a light moved");
    assert_eq!(frame.stats.time_ms.bvh, before, "the hierarchy was not built again");
    assert_same(&frame, &gpu.render(&scene, &first), "a light moved");
    gpu.finish();
}

#[test]
fn a_full_store_takes_no_more() {
    let gpu = TestGpu::open();
    let scene = Demo::CupAndGlass.scene();
    let first = options(&scene);
    let (fresh, kept) = begin(&gpu, &scene, &first, 96 << 10);
    let (frame, _) = go_on(&gpu, kept, &scene, &first);
    assert_same(&frame, &fresh, "full");
    assert!((1..frame.stats.vertices / 2).contains(&frame.stats.reused), "{} kept", frame.stats.reused);
    gpu.finish();
}
