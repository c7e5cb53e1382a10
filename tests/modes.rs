//! The paper's modes and equations: equal where they should be, and really different work (paper §4).

use std::sync::Arc;

use vertex_tracing::{
    frame::{Frame, Renderer},
    gpu::{self, Gpu, Messages},
    options::{Equation, MethodOptions, Mode, Options, Reconstruction, ViewOptions},
    report::{
        FloatImage,
        metrics::{Encoding, compare},
    },
    scene::{Scene, demo::Demo},
};

const WIDTH: u32 = 320;
const HEIGHT: u32 = 256;

/// A device under validation whose messages are checked at the end.
struct Bench {
    gpu: Arc<Gpu>,
    messages: Arc<Messages>,
}

impl Bench {
    fn new() -> Self {
        let gpu =
            Gpu::new(&gpu::Options { validation: true, ..gpu::Options::default() }).unwrap_or_else(|error| {
                panic!("the tests need a Vulkan device and the validation layer: {error}")
            });
        Self { messages: gpu.messages(), gpu }
    }

    fn render(&self, scene: &Scene, options: &Options) -> Frame {
        let view = options.view.resolve(scene).unwrap();
        Renderer::new(&self.gpu, scene, options).unwrap().render(&view).unwrap()
    }

    fn finish(self) {
        assert_eq!(Arc::strong_count(&self.gpu), 1, "something still holds the device");
        drop(self.gpu);
        assert_eq!(self.messages.errors(), Vec::<String>::new());
    }
}

fn options(mode: Mode, equation: Equation, reconstruction: Reconstruction) -> Options {
    let mut options = Options {
        view: ViewOptions { width: WIDTH, height: HEIGHT, ..ViewOptions::default() },
        method: MethodOptions { mode, equation, reconstruction, ..MethodOptions::default() },
        ..Options::default()
    };
    options.effort.max_samples = Some(4000);
    options
}

fn psnr(a: &FloatImage, b: &FloatImage) -> f64 {
    compare(a, b, None, Encoding::Srgb).unwrap().psnr.unwrap_or(f64::INFINITY)
}

fn names(frame: &Frame) -> Vec<&str> {
    frame.stats.passes.iter().map(|pass| pass.name.as_str()).collect()
}

#[test]
fn one_equation_gives_one_image_in_both_modes() {
    let bench = Bench::new();
    for demo in Demo::ALL {
        let scene = demo.scene();
        for reconstruction in [Reconstruction::Exact, Reconstruction::Paper] {
            for equation in [Equation::Three, Equation::Four] {
                let render = |mode| bench.render(&scene, &options(mode, equation, reconstruction));
                let (one, several) = (render(Mode::MultiTexture), render(Mode::MultiPass));
                let what = format!("{} {reconstruction} Eq. {equation}", demo.name());
                let psnr = psnr(&one.image, &several.image);
                println!("{what}: {psnr:.1} dB, {:?} {:?}", names(&several), one.stats.faces);
                assert!(psnr >= 55.0, "{what}: the modes differ by {psnr:.1} dB");
                assert_eq!(one.stats.samples, several.stats.samples, "{what}");
                assert_eq!(names(&one), ["multi-texture"], "{what}");
                assert!(several.stats.passes.len() > 1, "{what}: one pass only");
            }
        }
    }
    bench.finish();
}
