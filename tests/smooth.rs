//! `--pixel-samples`: what differs from pixel to pixel becomes as smooth as many samples make it, and takes few of them.

mod common;

use glam::{Vec3, Vec4, vec3};
use vertex_tracing::{
    frame::Frame,
    options::{Options, PixelSamples, Shadows, Ss},
    report::{
        FloatImage,
        metrics::{Encoding, compare},
    },
    scene::{
        AlphaMode, Camera, Material,
        demo::{Demo, SceneBuilder, chrome, matte, shape, stress, texture},
    },
    trace::reference::Reference,
};

use common::{TestGpu, traced};

fn options(width: u32, height: u32, most: PixelSamples) -> Options {
    let mut options = common::options(width, height);
    options.method.pixel_samples = most;
    options
}

fn rmse(a: &FloatImage, b: &FloatImage) -> f64 {
    compare(a, b, None, Encoding::Srgb).unwrap().rmse
}

#[test]
fn pictures_are_nearer_to_many_samples_with_fewer_rays() {
    use PixelSamples::{Four, One, Sixteen, SixtyFour};
    let gpu = TestGpu::open();
    let scenes = [
        ("cup", Demo::Cup.scene()),
        ("glass bowl", Demo::GlassBowl.scene()),
        ("faces of few pixels", stress::wavy_mirror(120_000).unwrap()),
    ];
    for (name, scene) in scenes {
        let size = |most| options(320, 256, most);
        let image = |spp| {
            let Reference { image, rays, .. } = traced(&scene, &size(One), spp, None);
            (FloatImage { width: 320, height: 256, pixels: image }, rays.total())
        };
        let ((truth, _), (four, _), (_, all_sixteen)) = (image(64), image(4), image(16));
        let frames: Vec<Frame> =
            [One, Four, Sixteen, SixtyFour].map(|most| gpu.render(&scene, &size(most))).into();
        let errors: Vec<f64> = frames.iter().map(|frame| rmse(&frame.image, &truth)).collect();
        let rays: Vec<u64> = frames.iter().map(|frame| frame.stats.rays.total).collect();
        println!("{name}: {errors:.4?} with {rays:?} rays; tracer {:.4} at 4, {all_sixteen} rays at 16", {
            rmse(&four, &truth)
        });
        assert!(errors.is_sorted_by(|a, b| a > b));
        assert!(errors[1] < 0.6 * errors[0] && errors[2] < 0.45 * errors[0]);
        assert!(
            errors[2] < 1.1 * rmse(&four, &truth),
            "sixteen where it matters are as good as four everywhere"
        );
        assert!(3 * rays[2] < 2 * all_sixteen);
        assert!(frames.iter().all(|frame| frame.stats.samples == frames[0].stats.samples), "same samples");
        assert_eq!(frames[0].stats.time_ms.smooth, 0.0);
        assert!(frames[1].stats.time_ms.smooth > 0.0);
    }
    gpu.finish();
}

/// Where nothing else is traced, edges are; they show what the rasteriser shows: coverage of BLEND surfaces, and nothing of
/// the backs of one-sided ones.
#[test]
fn edges_show_what_is_drawn() {
    let mut builder = SceneBuilder::new("panes");
    let board = builder.texture(texture::chessboard(64));
    let floor =
        builder.material(Material { unlit: true, double_sided: true, ..matte("floor").textured(board) });
    builder.mesh("floor", shape::plane(vec3(-3.0, 0.0, 3.0), Vec3::X * 6.0, Vec3::NEG_Z * 6.0, 1.0), floor);
    let pane = builder.material(Material {
        unlit: true,
        alpha_mode: AlphaMode::Blend,
        base_color: Vec4::new(0.9, 0.3, 0.1, 0.5),
        double_sided: true,
        ..matte("pane")
    });
    builder.mesh(
        "pane",
        shape::plane(vec3(-1.3, 0.1, 0.2), vec3(1.9, 0.2, 0.0), vec3(0.3, 1.4, 0.0), 1.0),
        pane,
    );
    let behind = builder.material(Material { unlit: true, ..matte("seen from behind") });
    builder.mesh("away", shape::plane(vec3(1.4, 0.1, 0.9), vec3(-0.8, 0.3, 0.0), Vec3::Y, 1.0), behind);
    builder.camera(Camera::look_at(vec3(0.4, 1.6, 3.4), vec3(0.0, 0.4, 0.0), 0.8));
    let scene = builder.build().unwrap();

    let gpu = TestGpu::open();
    let with = |most, ss| {
        let mut options = options(160, 128, most);
        (options.method.ss, options.scene.shadows) = (ss, Shadows::None);
        gpu.render(&scene, &options)
    };
    let truth = with(PixelSamples::One, Ss::Sixteen).image;
    let plain = with(PixelSamples::One, Ss::One);
    let smooth = with(PixelSamples::Sixteen, Ss::One);
    let (before, after) = (rmse(&plain.image, &truth), rmse(&smooth.image, &truth));
    println!("{before:.4} became {after:.4}");
    assert_eq!((plain.stats.rays.total, smooth.stats.samples), (0, 0), "no vertex is traced");
    assert!(smooth.stats.rays.pixel > 0 && after < 0.4 * before);
    gpu.finish();
}

/// A preview draws a mirror whole, whatever its alpha mode: edges of it are not seen through.
#[test]
fn edges_of_reconstructed_objects_are_whole() {
    let gpu = TestGpu::open();
    let [opaque, blended] = [AlphaMode::Opaque, AlphaMode::Blend].map(|alpha_mode| {
        let mut builder = SceneBuilder::new("ball");
        let board = builder.texture(texture::chessboard(64));
        let floor = builder.material(Material { unlit: true, ..matte("floor").textured(board) });
        let plane = shape::plane(vec3(-3.0, 0.0, 3.0), Vec3::X * 6.0, Vec3::NEG_Z * 6.0, 4.0);
        builder.mesh("floor", plane, floor);
        let base_color = Vec4::new(0.9, 0.9, 0.9, 0.3);
        let mirror = Material { alpha_mode, base_color, ..chrome("mirror", Vec3::splat(0.9)) };
        let mirror = builder.material(mirror);
        builder.mesh("ball", shape::sphere(vec3(0.0, 1.0, 0.0), 1.0, 2), mirror);
        builder.camera(Camera::look_at(vec3(0.2, 1.6, 5.0), Vec3::Y, 0.6));
        let mut options = options(160, 128, PixelSamples::Sixteen);
        options.effort.preview = true;
        gpu.render(&builder.build().unwrap(), &options)
    });
    assert!(blended.stats.time_ms.smooth > 0.0);
    assert!(rmse(&opaque.image, &blended.image) < 1e-3, "{}", rmse(&opaque.image, &blended.image));
    gpu.finish();
}

#[test]
fn any_number_of_threads_gives_the_same_picture() {
    let gpu = TestGpu::open();
    let scene = Demo::CupAndGlass.scene();
    let options = options(96, 80, PixelSamples::SixtyFour);
    let image = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| gpu.render(&scene, &options).image)
    };
    assert!(image(1) == image(3));
    gpu.finish();
}
