//! The base image of single-pass visibility: drawn once in the ordinary way, read for its primary-face codes,
//! and kept for the leaves to be drawn on (paper §5; design §3).
//!
//! A mark in the stencil says where leaves belong. There they have the depth buffer to themselves: bisected
//! vertices do not rasterise to the depth of the base face that the base image shows.

use std::{sync::Arc, time::Instant};

use super::{Painter, Target, record_base};
use crate::error::Result;
use crate::gpu::{
    DepthMode, DepthTarget, Format, Gpu, GraphicsDesc, GraphicsPipeline, Recording, StencilMode, Targets,
};
use crate::reconstruct::frame_block::FrameBlock;
use crate::spirv;
use crate::visibility::single_pass::CodedImage;

impl Painter {
    /// Draws all faces but blended ones without samples, and reads back the image with its codes.
    ///
    /// # Errors
    /// No device memory left; a lost device.
    pub fn draw_base(&mut self, block: &FrameBlock) -> Result<CodedImage<'_>> {
        self.make_target(block)?;
        let opaque: Vec<_> = self.base_draws.iter().filter(|draw| !draw.blended).cloned().collect();
        let keys: Vec<_> = opaque.iter().map(|draw| self.base_key(draw)).collect();
        for (draw, &key) in opaque.iter().zip(&keys) {
            self.pipeline(key)?;
            self.array_set([draw.array, 0, 0])?;
        }
        let started = Instant::now();
        let frustum = block.frustum();
        self.uploads.write(&self.frame, 0, std::slice::from_ref(block))?;
        let Self {
            options,
            panoramas,
            samples,
            commands,
            uploads,
            target,
            pipelines,
            scene_set,
            base,
            array_sets,
            ..
        } = self;
        let target = target.as_mut().expect("made above");
        let mut recording = commands.begin()?;
        uploads.record(&mut recording);
        recording.timed("base image", |recording| {
            target.render(recording, Some(options.clear()), |commands| {
                for (draw, key) in opaque.iter().zip(&keys) {
                    let arrays = &array_sets[&[draw.array, 0, 0]];
                    record_base(commands, &pipelines[key], [scene_set, &base.set, arrays], draw, &frustum);
                }
                if let Some(pipeline) = panoramas.get(samples) {
                    commands.pipeline(pipeline).set(0, scene_set).draw(0..3);
                }
            });
        });
        recording.timed("copy", |recording| recording.read_image(&target.color, &mut target.staging));
        recording.submit_and_wait()?;
        self.fresh_base = Some(*block);
        let memory = target.staging.memory();
        let drawn = started.elapsed();
        let pixels = target.staging.read((block.width * block.height) as usize)?;
        let until_read = started.elapsed();
        let map = until_read - drawn;
        Ok(CodedImage { pixels, timings: self.commands.timings()?, until_read, map, memory })
    }
}

impl Target {
    /// Moves what is marked as far away as can be.
    pub(super) fn reset_depth(&self, recording: &mut Recording<'_>, pipeline: &GraphicsPipeline) {
        let depth = Some(DepthTarget { image: &self.depth, clear: false });
        recording.render(&Targets { colors: &[], depth }, |draws| {
            draws.pipeline(pipeline).draw(0..3);
        });
    }
}

/// The pipeline of [`Target::reset_depth`].
pub(super) fn depth_reset(gpu: &Arc<Gpu>) -> Result<GraphicsPipeline> {
    GraphicsPipeline::new(
        gpu,
        &GraphicsDesc {
            depth_format: Some(Format::Depth32fStencil8),
            depth: DepthMode::Replace,
            stencil: StencilMode::Test(1),
            ..GraphicsDesc::opaque("depth reset", spirv!("reset_depth.vert"), spirv!("reset_depth.frag"))
        },
    )
}
