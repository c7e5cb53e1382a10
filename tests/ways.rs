//! The ways to find the visible faces, held against each other, and the images that follow from them.

mod common;

use std::sync::Arc;

use glam::{Vec3, Vec4, vec3};
use vertex_tracing::{
    frame::{Renderer, Step},
    gpu::{Fault, Gpu},
    options::{Options, Shadows, Ss, ViewOptions, VisibilityWay},
    report::metrics::{Encoding, compare},
    scene::{
        AlphaMode, Camera, Material, Scene, View,
        demo::{Demo, SceneBuilder, chrome, matte, shape, stress, texture},
    },
    visibility::{VisibleFaces, single_pass::CODES},
};

use common::TestGpu;

fn view(scene: &Scene, width: u32, height: u32) -> View {
    ViewOptions { width, height, ..ViewOptions::default() }.resolve(scene).unwrap()
}

fn options(way: VisibilityWay) -> Options {
    let mut options = Options::default();
    options.method.visibility = way;
    options
}

/// What one way finds: marked faces, the pixels of each face, the image of faces if there is one.
struct Faces {
    marked: Vec<u32>,
    faces: VisibleFaces,
    ids: Option<Vec<u32>>,
}

fn find(gpu: &Arc<Gpu>, scene: &Scene, view: &View, way: VisibilityWay) -> Faces {
    let mut renderer = Renderer::new(gpu, scene, &options(way)).unwrap();
    renderer.warm_up(view).unwrap();
    let found = renderer.find_visible(view).unwrap().expect("something is traced");
    Faces {
        marked: found.visible.to_vec(),
        faces: found.faces.clone(),
        ids: found.ids.map(|ids| ids.pixels.to_vec()),
    }
}

/// Share of the pixels at which the single pass recovers the face that the ID buffer has, and how many faces
/// it marks in excess.
fn hold_single_pass(gpu: &Arc<Gpu>, scene: &Scene, view: &View, exact: &Faces) -> (f64, usize) {
    let single = find(gpu, scene, view, VisibilityWay::SinglePass);
    let missed = exact.marked.iter().filter(|face| single.marked.binary_search(face).is_err()).count();
    assert_eq!(missed, 0, "{}: faces of the ID buffer that the single pass misses", scene.name);
    let (exact_ids, ids) = (exact.ids.as_ref().unwrap(), single.ids.unwrap());
    let same = exact_ids.iter().zip(&ids).filter(|(a, b)| a == b).count();
    (same as f64 / ids.len() as f64, single.marked.len() - exact.marked.len())
}

#[test]
fn all_ways_agree_on_every_demo() {
    let gpu = TestGpu::open();
    for demo in Demo::ALL {
        let scene = demo.scene();
        let view = view(&scene, 240, 192);
        let exact = find(&gpu, &scene, &view, VisibilityWay::IdBuffer);
        assert!(exact.faces.vt_pixels > 0 && exact.faces.shadow_pixels > 0, "{}", demo.name());
        let counted = find(&gpu, &scene, &view, VisibilityWay::Device);
        assert!(counted.ids.is_none());
        assert_eq!((counted.marked, counted.faces), (exact.marked.clone(), exact.faces.clone()));
        let (same, excess) = hold_single_pass(&gpu, &scene, &view, &exact);
        println!("{}: {} faces, {excess} more, {same} of the pixels", demo.name(), exact.marked.len());
        assert!(same == 1.0 && excess == 0, "{}: every face has a code of its own", demo.name());
    }
    gpu.finish();
}

#[test]
fn shared_codes_mark_too_much_and_never_too_little() {
    let scene = stress::wavy_mirror(4 * CODES).unwrap();
    let view = view(&scene, 320, 256);
    let gpu = TestGpu::open();
    let exact = find(&gpu, &scene, &view, VisibilityWay::IdBuffer);
    let (same, excess) = hold_single_pass(&gpu, &scene, &view, &exact);
    let share = excess as f64 / exact.marked.len() as f64;
    println!("{} faces, {excess} more ({share:.4}), {same:.5} of the pixels", exact.marked.len());
    assert!(same > 0.999 && share < 0.01, "{same} of the pixels, {share} more faces");
    gpu.finish();
}

#[test]
fn every_way_renders_the_same_picture() {
    let gpu = TestGpu::open();
    for demo in [Demo::Cup, Demo::GlassBowl] {
        let scene = demo.scene();
        let view = view(&scene, 200, 160);
        let image = |way| {
            let mut renderer = Renderer::new(&gpu, &scene, &options(way)).unwrap();
            renderer.warm_up(&view).unwrap();
            renderer.render(&view).unwrap()
        };
        let exact = image(VisibilityWay::IdBuffer);
        for way in [VisibilityWay::SinglePass, VisibilityWay::Device] {
            let other = image(way);
            let compared = compare(&exact.image, &other.image, None, Encoding::Srgb).unwrap();
            let psnr = compared.psnr.unwrap_or(f64::INFINITY);
            println!("{}, {way}: {psnr:.1} dB, {} samples", demo.name(), other.stats.samples);
            assert!(psnr > if way == VisibilityWay::SinglePass { 45.0 } else { 35.0 }, "{way}: {psnr} dB");
            assert_eq!(exact.stats.faces.visible, other.stats.faces.visible, "{way}");
            assert_ne!(exact.stats.readback.bytes, other.stats.readback.bytes, "{way} reads something else");
        }
    }
    gpu.finish();
}

/// What is drawn neither here nor there, a rasteriser and the view rays that do its work must agree upon.
#[test]
fn counts_alone_find_pixels_behind_what_no_id_buffer_shows() {
    let mut builder = SceneBuilder::new("veiled");
    let board = builder.texture(texture::chessboard(64));
    let floor = builder.material(Material { unlit: true, ..matte("floor").textured(board) });
    builder.mesh("floor", shape::plane(vec3(-3.0, 0.0, 3.0), Vec3::X * 6.0, Vec3::NEG_Z * 6.0, 4.0), floor);
    let ball = builder.material(chrome("ball", Vec3::splat(0.9)));
    builder.mesh("ball", shape::sphere(vec3(0.0, 1.0, 0.0), 1.0, 2), ball);
    // Over its left half a clear pane; over its right half the back of a wall.
    let clear = Vec4::new(1.0, 1.0, 1.0, 0.2);
    let pane = Material { alpha_mode: AlphaMode::Blend, base_color: clear, unlit: true, ..matte("pane") };
    let (pane, wall) = (builder.material(pane), builder.material(matte("wall")));
    builder.mesh("pane", shape::plane(vec3(-2.0, 0.2, 1.5), Vec3::X * 2.0, Vec3::Y * 2.0, 1.0), pane);
    builder.mesh("wall", shape::plane(vec3(2.0, 0.2, 1.5), Vec3::X * -2.0, Vec3::Y * 2.0, 1.0), wall);
    builder.camera(Camera::look_at(vec3(0.2, 1.6, 5.0), Vec3::Y, 0.6));
    let scene = builder.build().unwrap();
    let gpu = TestGpu::open();
    let image = |way| {
        let mut options = options(way);
        (options.view.width, options.view.height) = (320, 256);
        options.scene.shadows = Shadows::None;
        gpu.render(&scene, &options)
    };
    let [exact, counted] = [VisibilityWay::IdBuffer, VisibilityWay::Device].map(image);
    assert!(exact.stats.rays.pixel > 2000 && counted.stats.rays.pixel > 2000);
    let psnr = compare(&exact.image, &counted.image, None, Encoding::Srgb).unwrap().psnr.unwrap_or(99.0);
    println!("{psnr:.1} dB");
    assert!(psnr > 45.0, "{psnr:.1} dB");
    gpu.finish();
}

#[test]
fn a_single_pass_shown_step_by_step_ends_in_the_same_picture() {
    let scene = Demo::Cup.scene();
    let view = view(&scene, 120, 96);
    let gpu = TestGpu::open();
    let mut options = options(VisibilityWay::SinglePass);
    (options.effort.max_samples, options.effort.sparing) = (Some(1500), true);
    let mut renderer = Renderer::new(&gpu, &scene, &options).unwrap();
    let whole = renderer.render(&view).unwrap().image;
    let mut steps = 0;
    let mut count = |_: &Step| {
        steps += 1;
        Ok(())
    };
    let stepped = renderer.render_steps(&view, Some(&mut count)).unwrap().image;
    assert!(steps > 2, "{steps} steps");
    assert_eq!(whole.pixels, stepped.pixels);
    drop(renderer);
    gpu.finish();
}

#[test]
fn sub_samples_get_base_images_of_their_own() {
    let scene = Demo::Cup.scene();
    let view = view(&scene, 120, 96);
    let gpu = TestGpu::open();
    let image = |way| {
        let mut options = options(way);
        options.method.ss = Ss::Four;
        Renderer::new(&gpu, &scene, &options).unwrap().render(&view).unwrap().image
    };
    let (exact, single) = (image(VisibilityWay::IdBuffer), image(VisibilityWay::SinglePass));
    let psnr = compare(&exact, &single, None, Encoding::Srgb).unwrap().psnr.unwrap_or(f64::INFINITY);
    assert!(psnr > 45.0, "{psnr} dB");
    gpu.finish();
}

#[test]
fn auto_says_what_it_chose_and_why() {
    let scene = Demo::Cup.scene();
    let view = view(&scene, 160, 128);
    let gpu = TestGpu::open();
    let mut renderer = Renderer::new(&gpu, &scene, &options(VisibilityWay::Auto)).unwrap();
    renderer.warm_up(&view).unwrap();
    let stats = renderer.render(&view).unwrap().stats;
    let note = stats.notes.iter().find(|note| note.starts_with("--visibility auto took")).expect("a note");
    let chosen = if stats.readback.bytes == 160 * 128 * 4 { "id-buffer" } else { "device" };
    assert!(note.contains(chosen) && note.contains("ms"), "{note}");
    let exact = find(&gpu, &scene, &view, VisibilityWay::IdBuffer);
    assert_eq!(renderer.find_visible(&view).unwrap().unwrap().faces, &exact.faces);
    drop(renderer);
    gpu.finish();
}

#[test]
fn a_failing_base_image_leaves_nothing_behind() {
    let scene = Demo::Sphere.scene();
    let view = view(&scene, 64, 48);
    for (call, fault) in [
        ("vkCreateImage", Fault::OutOfDeviceMemory),
        ("vkCreateGraphicsPipelines", Fault::OutOfDeviceMemory),
        ("vkQueueSubmit2", Fault::DeviceLost),
    ] {
        let gpu = TestGpu::open();
        let mut renderer = Renderer::new(&gpu, &scene, &options(VisibilityWay::SinglePass)).unwrap();
        gpu.fail_next(call, fault);
        assert!(renderer.find_visible(&view).is_err(), "{call}");
        assert!(renderer.find_visible(&view).is_ok(), "{call}");
        drop(renderer);
        gpu.finish();
    }
}
