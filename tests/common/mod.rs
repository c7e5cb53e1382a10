//! A device under validation, and pictures of the reference tracer, for all tests that need them.

#![allow(dead_code)] // each test program is compiled with all of it and uses a part

pub mod floor;

use std::{ops::Deref, sync::Arc};

use vertex_tracing::{
    frame::{Frame, Renderer},
    gpu::{Gpu, Messages, Options as DeviceOptions},
    options::Options,
    report::{
        FloatImage,
        metrics::{Comparison, Encoding, compare},
    },
    scene::Scene,
    trace::{
        Settings, Tracer,
        reference::{self, Reference},
    },
};

/// Default options for images of this size.
pub fn options(width: u32, height: u32) -> Options {
    let mut options = Options::default();
    (options.view.width, options.view.height) = (width, height);
    options
}

/// The view by the reference tracer, of the pixels that `only` marks.
pub fn traced(scene: &Scene, options: &Options, spp: u32, only: Option<&[bool]>) -> Reference {
    let view = options.view.resolve(scene).unwrap();
    let settings = Settings::new(&options.paths, &options.scene);
    reference::render(&Tracer::new(scene), &view, &settings, spp, only, &Default::default(), &|_| {}).unwrap()
}

/// What the reference tracer made, as an image.
pub fn image(options: &Options, reference: &Reference) -> FloatImage {
    let (width, height) = (options.view.width, options.view.height);
    FloatImage { width, height, pixels: reference.image.clone() }
}

/// A frame over the VT pixels of what the reference tracer made.
pub fn over_vt(frame: &Frame, options: &Options, truth: &Reference) -> Comparison {
    compare(&image(options, truth), &frame.image, Some(&truth.vt_mask), Encoding::Srgb).unwrap()
}

/// Peak signal to noise ratio in dB of one image against another as they are displayed.
pub fn psnr(a: &FloatImage, b: &FloatImage) -> f64 {
    compare(a, b, None, Encoding::Srgb).unwrap().psnr.unwrap_or(f64::INFINITY)
}

/// Pixels that differ from the reference by more than a tenth, as they are displayed.
pub fn wrong(gpu: &TestGpu, scene: &Scene, options: &Options) -> usize {
    let frame = gpu.render(scene, options);
    let truth = image(options, &traced(scene, options, 1, None));
    let error = compare(&truth, &frame.image, None, Encoding::Srgb).unwrap();
    let count = (error.over_0_1 * frame.image.pixels.len() as f64).round() as usize;
    println!("{}: {count} pixels are wrong, {:.1} dB", scene.name, error.psnr.unwrap_or(99.0));
    count
}

/// A device under validation, whose messages [`finish`](Self::finish) checks.
pub struct TestGpu {
    gpu: Arc<Gpu>,
    messages: Arc<Messages>,
}

impl TestGpu {
    /// Fails, with the remedy, where there is no device: a suite that skips proves nothing.
    pub fn open() -> Self {
        let options = DeviceOptions { validation: true, ..DeviceOptions::default() };
        let gpu = Gpu::new(&options).unwrap_or_else(|error| {
            panic!("the tests need a Vulkan device and the validation layer: {error}")
        });
        Self { messages: gpu.messages(), gpu }
    }

    /// One frame by a renderer of its own.
    pub fn render(&self, scene: &Scene, options: &Options) -> Frame {
        let view = options.view.resolve(scene).unwrap();
        Renderer::new(self, scene, options).unwrap().render(&view).unwrap()
    }

    /// To be called when everything on the device is gone: leaks are reported at the very end.
    pub fn finish(self) {
        assert_eq!(Arc::strong_count(&self.gpu), 1, "something still holds the device");
        drop(self.gpu);
        assert_eq!(self.messages.errors(), Vec::<String>::new());
    }
}

impl Deref for TestGpu {
    type Target = Arc<Gpu>;

    fn deref(&self) -> &Arc<Gpu> {
        &self.gpu
    }
}
