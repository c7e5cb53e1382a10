//! Frames after the first create nothing on the device, and next to nothing on the heap that finds what is visible.

mod common;

use std::collections::BTreeMap;

use common::TestGpu;
use glam::Vec3;
use vertex_tracing::{
    frame::{Ahead, Renderer},
    gpu::{Gpu, ReadbackChoice},
    options::{
        CameraChoice, EffortOptions, Mode, Msaa, Options, Reconstruction, Ss, ViewOptions, VisibilityWay,
    },
    scene::{
        Scene, View,
        demo::{Demo, stress},
    },
    visibility::{Pass, classes, device},
};

/// Most bytes that a run allocates: lists of draws, barriers and timings.
const MOST_BYTES: u64 = 4 << 10;

/// Fewer than the scene would get, so that more of them mean more leaves.
const MOST_SAMPLES: u64 = 1500;

fn options() -> Options {
    let mut options = Options::default();
    (options.view.width, options.view.height) = (320, 256);
    (options.effort.max_samples, options.effort.sparing) = (Some(MOST_SAMPLES), true);
    options
}

/// The scene's own view, its eye moved by `by`.
fn view(scene: &Scene, options: &Options, by: Vec3) -> View {
    let mut view = options.view.clone();
    let camera = &scene.cameras[0];
    let world = |point: Vec3| scene.origin + point.as_dvec3();
    view.camera = CameraChoice::Eye {
        eye: world(camera.position + by),
        target: Some(world(camera.position + camera.forward * 4.0)),
    };
    view.resolve(scene).unwrap()
}

/// What the calls so far created and allocated, apart from those in `before`.
fn made_since(gpu: &Gpu, before: &BTreeMap<&'static str, u64>) -> Vec<(&'static str, u64)> {
    let census = gpu.census();
    let calls = census.calls().iter().map(|(&call, &count)| (call, count - before.get(call).unwrap_or(&0)));
    calls.filter(|&(_, count)| count > 0).collect()
}

/// Frames of a moved camera and of up to a third more samples than the first had.
fn render_more(renderer: &mut Renderer, scene: &Scene, options: &Options) {
    let mut frame = |by, max_samples| {
        renderer.set_effort(EffortOptions { max_samples: Some(max_samples), ..options.effort.clone() });
        renderer.render(&view(scene, options, by)).unwrap().stats.vertices
    };
    let first = frame(Vec3::ZERO, MOST_SAMPLES);
    frame(Vec3::new(0.02, 0.01, 0.0), MOST_SAMPLES * 9 / 8);
    let last = frame(Vec3::ZERO, MOST_SAMPLES * 4 / 3);
    assert!(last > first && first > MOST_SAMPLES / 2, "{first} and {last} vertices");
}

#[test]
fn frames_after_the_first_make_nothing_on_the_device() {
    type Change = (&'static str, fn(&mut Options));
    let changes: [Change; 8] = [
        ("default", |_| {}),
        ("device", |o| o.method.visibility = VisibilityWay::Device),
        ("single pass", |o| o.method.visibility = VisibilityWay::SinglePass),
        ("auto", |o| o.method.visibility = VisibilityWay::Auto),
        ("multi-pass", |o| o.method.mode = Mode::MultiPass),
        ("paper", |o| o.method.reconstruction = Reconstruction::Paper),
        ("multisampling", |o| o.method.msaa = Msaa::Four),
        ("supersampling", |o| o.method.ss = Ss::Four),
    ];
    let gpu = TestGpu::open();
    let scene = Demo::CupAndGlass.scene();
    for (what, change) in changes {
        let mut options = options();
        change(&mut options);
        let mut renderer = Renderer::new(&gpu, &scene, &options).unwrap();
        renderer.render(&view(&scene, &options, Vec3::ZERO)).unwrap();
        let before = gpu.census().calls().clone();
        assert!(before["vkCreateBuffer"] > 0 && before["vkAllocateMemory"] > 0);
        render_more(&mut renderer, &scene, &options);
        assert_eq!(made_since(&gpu, &before), [], "{what}");
        options.view.width = 200;
        renderer.render(&view(&scene, &options, Vec3::ZERO)).unwrap();
        assert!(
            made_since(&gpu, &before).iter().any(|call| call.0 == "vkCreateImage"),
            "{what}: another size"
        );
    }
    gpu.finish();
}

#[test]
fn pictures_read_ahead_make_nothing_after_the_second() {
    let gpu = TestGpu::open();
    let scene = Demo::CupAndGlass.scene();
    let options = options();
    let mut renderer = Renderer::new(&gpu, &scene, &options).unwrap();
    renderer.keep_samples(16 << 20);
    let mut ahead = None;
    let mut before = BTreeMap::new();
    for number in 0..6 {
        let next = renderer.render_ahead(&view(&scene, &options, Vec3::X * 0.004 * number as f32)).unwrap();
        // The last picture is opened while this one is on its way: there are two staging buffers.
        if let Some(last) = ahead.replace(next) {
            Ahead::finish(last).unwrap();
        }
        if number == 1 {
            before = gpu.census().calls().clone();
        }
    }
    assert_eq!(made_since(&gpu, &before), []);
    drop((ahead, renderer));
    gpu.finish();
}

/// What the thread that finds visible faces allocates, for there is but one.
#[test]
fn finding_visible_faces_again_allocates_next_to_nothing() {
    let gpu = TestGpu::open();
    for scene in [Demo::CupAndGlass.scene(), stress::wavy_mirror(20_000).unwrap()] {
        let view = ViewOptions { width: 320, height: 256, ..ViewOptions::default() }.resolve(&scene).unwrap();
        let classes = classes(&scene, true);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        let mut pass = Pass::new(&gpu, &scene, &classes).unwrap();
        let mut counting = device::Pass::new(&gpu, &scene, &classes, ReadbackChoice::Best).unwrap();
        let mut run = || {
            let read = allocation_counter::measure(|| assert!(pass.run(&view).is_ok()));
            let counted = allocation_counter::measure(|| assert!(counting.run(&view).is_ok()));
            [read.bytes_total, counted.bytes_total]
        };
        let (first, again) = pool.install(|| (run(), [run(), run()]));
        println!("{}: {first:?} bytes at first, then {again:?}", scene.name);
        let faces = 4 * scene.geometry.faces.len() as u64;
        assert!(first.iter().all(|&bytes| bytes > faces), "the counts of all faces: {first:?}");
        assert!(again.as_flattened().iter().all(|&bytes| bytes < MOST_BYTES), "{again:?}");
    }
    gpu.finish();
}

/// Every frame gives back what it took: measured on one thread, which then does all the work.
#[test]
fn frames_after_the_first_leave_nothing_on_the_heap() {
    let gpu = TestGpu::open();
    let scene = Demo::CupAndGlass.scene();
    let options = options();
    let view = view(&scene, &options, Vec3::ZERO);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let mut renderer = Renderer::new(&gpu, &scene, &options).unwrap();
    let mut frame = || allocation_counter::measure(|| drop(renderer.render(&view).unwrap()));
    let (first, again) = pool.install(|| (frame(), [frame(), frame()]));
    println!("{first:?} at first, then {again:?}");
    assert!(first.bytes_current > 0, "the first leaves what later ones use again");
    assert!(again.iter().all(|again| again.bytes_current == 0), "{again:?}");
    drop(renderer);
    gpu.finish();
}
