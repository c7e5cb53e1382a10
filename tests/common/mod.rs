//! A device under validation, for all tests that need one.

#![allow(dead_code)] // each test program is compiled with all of it and uses a part

use std::{ops::Deref, sync::Arc};

use vertex_tracing::{
    frame::{Frame, Renderer},
    gpu::{Gpu, Messages, Options as DeviceOptions},
    options::Options,
    scene::Scene,
};

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
