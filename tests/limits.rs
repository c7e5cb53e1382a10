//! A limit of samples makes the frame again that time ended: the same image, bit by bit, at the same count.

mod common;

use std::time::Duration;

use glam::{Vec3, Vec4, vec3};
use vertex_tracing::{
    frame::{Renderer, Step},
    options::{EffortOptions, Msaa, PixelSamples, Reconstruction},
    report::stats::Stats,
    scene::{
        AlphaMode, Camera, Material, Scene,
        demo::{Demo, SceneBuilder, chrome, matte, shape, stress, texture},
    },
};

use common::{TestGpu, options};

/// Shares of the time in which a frame is refined to the end, from none to more than it takes.
const SHARES: [f64; 4] = [0.0, 0.6, 0.8, 10.0];

/// More time than any frame here takes.
const LONG: Duration = Duration::from_secs(3600);

fn timed(budget: Duration) -> EffortOptions {
    EffortOptions { budget: Some(budget), ..EffortOptions::default() }
}

fn limited(samples: u64) -> EffortOptions {
    EffortOptions { max_samples: Some(samples), ..EffortOptions::default() }
}

/// A chrome ball on a floor, behind a pane that is blended.
fn behind_a_pane() -> Scene {
    let mut builder = SceneBuilder::new("behind a pane");
    let board = builder.texture(texture::chessboard(64));
    let floor = builder.material(matte("floor").textured(board));
    builder.mesh("floor", shape::plane(vec3(-3.0, 0.0, 3.0), Vec3::X * 6.0, Vec3::NEG_Z * 6.0, 4.0), floor);
    let ball = builder.material(chrome("ball", Vec3::splat(0.9)));
    builder.mesh("ball", shape::sphere(vec3(0.0, 1.0, 0.0), 1.0, 2), ball);
    let clear = Vec4::new(0.2, 0.4, 1.0, 0.4);
    let pane = Material { alpha_mode: AlphaMode::Blend, base_color: clear, ..matte("pane") };
    let pane = builder.material(pane);
    builder.mesh("pane", shape::plane(vec3(-0.5, 1.0, 1.5), Vec3::X * 0.6, Vec3::Y * 0.6, 1.0), pane);
    builder.point_light(vec3(2.0, 3.0, 4.0), Vec3::splat(40.0));
    builder.camera(Camera::look_at(vec3(0.2, 1.6, 5.0), Vec3::Y, 0.6));
    builder.build().unwrap()
}

#[test]
fn the_samples_of_a_time_budget_make_its_image() {
    let gpu = TestGpu::open();
    let mut on_the_way = 0;
    let mut msaa = options(96, 72);
    msaa.method.msaa = Msaa::Four;
    let mut smooth = options(96, 72);
    smooth.method.pixel_samples = PixelSamples::Four;
    let mut paper = options(96, 72);
    paper.method.reconstruction = Reconstruction::Paper;
    for (scene, options) in [
        (Demo::Cup.scene(), options(96, 72)),
        (Demo::Cup.scene(), paper),
        (Demo::CupAndGlass.scene(), msaa),
        (Demo::GlassBowl.scene(), smooth),
        // Most of its faces stay out of the mesh.
        (stress::wavy_mirror(20_000).unwrap(), options(160, 128)),
        (behind_a_pane(), options(96, 72)),
    ] {
        let what = format!("{}, {:?}", scene.name, options.method);
        let view = options.view.resolve(&scene).unwrap();
        let mut renderer = Renderer::new(&gpu, &scene, &options).unwrap();
        let mut take = |effort| {
            renderer.set_effort(effort);
            renderer.render(&view).unwrap()
        };
        take(timed(LONG));
        let Stats { time_ms, steps: whole, .. } = take(timed(LONG)).stats;
        assert!(whole > 0, "{what}: nothing to refine");
        let refined = time_ms.frame - time_ms.upload - time_ms.draw - time_ms.smooth;
        for share in SHARES {
            let ended = take(timed(Duration::from_secs_f64(refined * share * 1e-3)));
            let Stats { samples, steps, .. } = ended.stats;
            println!("{what}, {share}: {samples} samples in {steps} of {whole} steps");
            let again = take(limited(samples));
            assert_eq!((again.stats.samples, again.stats.steps), (samples, steps), "{what}");
            assert!(ended.image == again.image, "{what}: another image with {samples} samples");
            on_the_way += u32::from(steps > 0 && steps < whole);
        }
        drop(renderer);
    }
    assert!(on_the_way > 0, "no frame ended between its first step and its last");
    gpu.finish();
}

/// However finely time cuts: no two steps of a frame have one count, and each is met by its own.
#[test]
fn every_step_is_told_by_its_samples() {
    let gpu = TestGpu::open();
    // All that there is of exact frames; the paper's go on for long.
    for (reconstruction, most) in [(Reconstruction::Exact, 1 << 40), (Reconstruction::Paper, 4000)] {
        for demo in [Demo::Cup, Demo::CupAndGlass] {
            let scene = demo.scene();
            let mut options = options(96, 72);
            options.method.reconstruction = reconstruction;
            options.effort = limited(most);
            let mut steps: Vec<(u64, u32)> = Vec::new();
            let mut note = |step: &Step| {
                steps.push((step.samples, step.number));
                Ok(())
            };
            let view = options.view.resolve(&scene).unwrap();
            let mut renderer = Renderer::new(&gpu, &scene, &options).unwrap();
            renderer.render_steps(&view, Some(&mut note)).unwrap();
            let what = format!("{} {reconstruction}: {steps:?}", demo.name());
            assert!(steps.len() > 5 && steps.windows(2).all(|pair| pair[0].0 < pair[1].0), "{what}");
            for &(samples, number) in steps.iter().step_by(3) {
                renderer.set_effort(limited(samples));
                let stats = renderer.render(&view).unwrap().stats;
                assert_eq!((stats.samples, stats.steps), (samples, number.into()), "{what}");
            }
            drop(renderer);
        }
    }
    gpu.finish();
}
