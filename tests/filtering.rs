//! Textures of pixels that are traced, filtered as those are that the rasteriser draws.

mod common;

use common::{TestGpu, image, options, psnr, traced};
use glam::{Vec3, vec3};
use vertex_tracing::{
    options::{FilterMode, Options},
    report::FloatImage,
    scene::{
        AlphaMode, Camera, Filter, Image, Material, Sampler, Scene, Volume, Wrap,
        demo::{SceneBuilder, chrome, glass, matte, shape},
    },
};

/// 128 × 128 texels, each of a colour of its own.
fn noise() -> Image {
    let mut state = 1_u32;
    let mut byte = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 24) as u8
    };
    let rgba: Vec<u8> = (0..128 * 128).flat_map(|_| [byte(), byte(), byte(), 255]).collect();
    Image { name: "noise".into(), width: 128, height: 128, rgba: rgba.into() }
}

/// A floor of noise that glows; its texels are smaller than pixels.
fn floor(sampler: Sampler) -> SceneBuilder {
    let mut scene = SceneBuilder::new("floor");
    let slot = scene.sampled_texture(noise(), sampler, true);
    let floor = scene.material(Material { unlit: true, ..matte("floor").textured(slot) });
    scene.mesh("floor", shape::plane(vec3(-6.0, 0.0, 6.0), Vec3::X * 12.0, Vec3::Z * -12.0, 2.0), floor);
    scene.camera(Camera::look_at(vec3(0.0, 2.0, 5.0), vec3(0.0, 0.6, 0.0), 0.7));
    scene
}

const LEVEL_0: Sampler = Sampler { mip: None, ..TRILINEAR };

const TRILINEAR: Sampler = Sampler {
    wrap_u: Wrap::Repeat,
    wrap_v: Wrap::Repeat,
    mag: Filter::Linear,
    min: Filter::Linear,
    mip: Some(Filter::Linear),
};

/// How near frames of what `complete` makes of the floor come to many samples a pixel: of its texture read at level 0, and
/// with mip levels.
fn errors(gpu: &TestGpu, options: &Options, complete: impl Fn(&mut SceneBuilder)) -> [f64; 2] {
    let scene = |sampler| {
        let mut scene = floor(sampler);
        complete(&mut scene);
        scene.build().unwrap()
    };
    let truth = traced(&scene(LEVEL_0), options, 36, None);
    let masked = |image: &FloatImage| {
        let pixels = image.pixels.iter().zip(&truth.vt_mask);
        FloatImage {
            pixels: pixels.map(|(pixel, &vt)| if vt { *pixel } else { [0.0; 3] }).collect(),
            ..image.clone()
        }
    };
    let wanted = masked(&image(options, &truth));
    [LEVEL_0, TRILINEAR].map(|sampler| psnr(&wanted, &masked(&gpu.render(&scene(sampler), options).image)))
}

#[test]
fn mirrors_and_glass_show_mip_levels() {
    let gpu = TestGpu::open();
    let options = options(96, 72);
    type Complete = fn(&mut SceneBuilder);
    let things: [(&str, f64, Complete); 3] = [
        ("chrome ball", 4.0, |scene| {
            let chrome = scene.material(chrome("chrome", Vec3::ONE));
            scene.mesh("ball", shape::sphere(vec3(0.0, 1.0, 0.0), 1.0, 3), chrome);
        }),
        ("mirror", 4.0, |scene| {
            let chrome = scene.material(chrome("chrome", Vec3::ONE));
            scene.mesh("mirror", shape::cuboid(vec3(-1.0, 0.1, -1.0), vec3(1.0, 1.8, 0.0), 1.0), chrome);
        }),
        ("glass ball", 2.0, |scene| {
            let clear = Volume { attenuation_color: Vec3::ONE, attenuation_distance: f32::INFINITY };
            let glass = scene.material(Material { volume: Some(clear), ..glass("glass", 1.5) });
            scene.mesh("ball", shape::sphere(vec3(0.0, 1.0, 0.0), 1.0, 3), glass);
        }),
    ];
    for (what, least, complete) in things {
        let [before, after] = errors(&gpu, &options, complete);
        println!("{what}: {before:.2} dB at level 0, {after:.2} dB");
        assert!(after > before + least, "{what}: {after:.2} dB, {before:.2} at level 0");
    }
    gpu.finish();
}

/// The floor as it is drawn, or behind a pane that cannot be seen but has all its pixels traced.
fn pictures(gpu: &TestGpu, sampler: Sampler, options: &Options) -> [FloatImage; 2] {
    let scene = |veiled: bool| -> Scene {
        let mut scene = floor(sampler);
        if veiled {
            let clear = Material { alpha_mode: AlphaMode::Blend, ..matte("clear") };
            let clear = scene.material(Material { base_color: Vec3::ONE.extend(0.0), ..clear });
            scene.mesh("pane", shape::plane(vec3(-3.0, 0.5, 4.0), Vec3::X * 6.0, Vec3::Y * 3.0, 1.0), clear);
        }
        // Something that is traced, out of sight.
        let chrome = scene.material(chrome("chrome", Vec3::ONE));
        scene.mesh("ball", shape::sphere(vec3(0.0, 1.0, 9.0), 0.1, 0), chrome);
        scene.build().unwrap()
    };
    [false, true].map(|veiled| gpu.render(&scene(veiled), options).image)
}

#[test]
fn traced_pixels_look_as_drawn_ones() {
    let gpu = TestGpu::open();
    let (linear, nearest) = (Filter::Linear, Filter::Nearest);
    for (mag, min, mip) in [
        (linear, linear, Some(linear)),
        (nearest, linear, Some(nearest)),
        (linear, nearest, Some(nearest)),
        (nearest, nearest, Some(linear)),
    ] {
        let options = options(96, 72);
        let [drawn, traced] = pictures(&gpu, Sampler { mag, min, mip, ..TRILINEAR }, &options);
        let psnr = psnr(&drawn, &traced);
        println!("{mag:?} {min:?} {mip:?}: {psnr:.2} dB");
        assert!(psnr > 30.0, "{mag:?} {min:?} {mip:?}: {psnr:.2} dB");
    }
    for (filter, least) in [(FilterMode::Trilinear, 30.0), (FilterMode::Aniso8, 20.0)] {
        let mut options = options(96, 72);
        options.method.filter = filter;
        let [drawn, traced] = pictures(&gpu, LEVEL_0, &options);
        let psnr = psnr(&drawn, &traced);
        println!("{filter}: {psnr:.2} dB");
        assert!(psnr > least, "{filter}: {psnr:.2} dB");
    }
    gpu.finish();
}
