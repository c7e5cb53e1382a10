//! Frames of a rung, and what they took.

#![allow(dead_code)] // tests/plan.rs measures the same ladder, and reads more of it

use std::{sync::Arc, time::Instant};

use vertex_tracing::{
    constants::MAX_LIGHTS,
    error::Result,
    frame::Renderer,
    gpu::{
        Census, Gpu, Uploads,
        census::{Kind, Tally},
    },
    options::Options,
    plan::Plan,
    reconstruct::{
        bank::{self, Bank},
        base,
        frame_block::FrameBlock,
        passes::{Painter, PassOptions, clear_color, color_passes},
        table::SceneTable,
        vertex::VertexLayout,
    },
    report::FloatImage,
    scene::Scene,
};

use super::rungs::Rung;

/// Objects that were created on a device.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counts {
    /// Pipelines compiled.
    pub pipelines: u64,
    /// Buffers of all kinds.
    pub buffers: u64,
    /// Textures and targets.
    pub images: u64,
    /// Samplers.
    pub samplers: u64,
    /// Bytes of buffers and images.
    pub bytes: u64,
}

impl From<&Census> for Counts {
    fn from(census: &Census) -> Self {
        let [pipelines, buffers, images, samplers] =
            [Kind::Pipeline, Kind::Buffer, Kind::Image, Kind::Sampler].map(|kind| census.all(kind));
        let count = |tally: Tally| tally.count;
        Self {
            pipelines: count(pipelines),
            buffers: count(buffers),
            images: count(images),
            samplers: count(samplers),
            bytes: buffers.bytes + images.bytes,
        }
    }
}

/// What a rung took, by whichever way.
pub struct Taken {
    /// Objects created, the first frame included.
    pub counts: Counts,
    /// The same by name.
    pub census: Census,
    /// Rays of one frame.
    pub rays: u64,
    /// Samples of one frame.
    pub samples: u64,
    /// Colour passes of one frame.
    pub passes: Vec<String>,
    /// The fastest frame in milliseconds.
    pub ms: f64,
    /// The image.
    pub image: FloatImage,
}

/// Renders `rung` as planned, or with nothing left out, on a device that was just opened.
///
/// # Errors
/// No device, or none of its memory left.
pub fn take(gpu: &Arc<Gpu>, rung: Rung, everything: bool, size: (u32, u32), runs: u32) -> Result<Taken> {
    let options = Options { everything, ..rung.options(size) };
    take_scene(gpu, &rung.scene()?, &options, runs)
}

/// The same for any scene.
///
/// # Errors
/// As for [`take`].
pub fn take_scene(gpu: &Arc<Gpu>, scene: &Scene, options: &Options, runs: u32) -> Result<Taken> {
    let view = options.view.resolve(scene)?;
    let mut renderer = Renderer::new(gpu, scene, options)?;
    renderer.warm_up(&view)?;
    let mut frame = renderer.render(&view)?;
    let census = gpu.census();
    let mut ms = f64::INFINITY;
    for _ in 1..runs.max(2) {
        frame = renderer.render(&view)?;
        ms = ms.min(frame.stats.time_ms.frame);
    }
    Ok(Taken {
        counts: (&census).into(),
        census,
        rays: frame.stats.rays.total,
        samples: frame.stats.vertices,
        passes: frame.stats.passes.into_iter().map(|pass| pass.name).collect(),
        ms,
        image: frame.image,
    })
}

/// Draws `rung` by the rasteriser's own parts alone, no plan asked: one pass over all faces.
///
/// # Errors
/// As for [`take`].
pub fn plain(gpu: &Arc<Gpu>, rung: Rung, size: (u32, u32), runs: u32) -> Result<Taken> {
    let scene = &rung.scene()?;
    let options = rung.options(size);
    let view = options.view.resolve(scene)?;
    let mut painter = painter(gpu, scene, &options)?;
    let passes = color_passes(options.method.mode, options.method.equation);
    let block = FrameBlock::new(scene, &view);
    painter.draw(&block, None, passes)?;
    let census = gpu.census();
    let mut ms = f64::INFINITY;
    for _ in 1..runs.max(2) {
        let started = Instant::now();
        painter.draw(&FrameBlock::new(scene, &view), None, passes)?;
        ms = ms.min(started.elapsed().as_secs_f64() * 1e3);
    }
    let image = painter.read_image()?;
    let passes = passes.iter().map(|pass| pass.name.into()).collect();
    Ok(Taken { counts: (&census).into(), census, rays: 0, samples: 0, passes, ms, image })
}

fn painter(gpu: &Arc<Gpu>, scene: &Scene, options: &Options) -> Result<Painter> {
    let wanted = bank::Wanted { textures: vec![true; scene.textures.len()], all_mips: false };
    let filter = options.method.filter;
    let mut uploads = Uploads::new(gpu, "texture uploads", bank::staging_bytes(wanted.bytes(scene, filter)))?;
    let bank = Bank::new(&mut uploads, scene, &wanted, filter)?;
    let table = SceneTable::new(scene, &Default::default(), &bank, false);
    let textures: Vec<u32> = scene.materials.iter().map(|m| bank.reference(m.base_color_texture)).collect();
    // The plan's, so that both run the same shader.
    let features = Plan::new(scene, options).features;
    let base = base::faces(scene, &table, VertexLayout::of(features), &textures, None, false);
    let pass_options = PassOptions {
        reconstruction: options.method.reconstruction,
        passes: color_passes(options.method.mode, options.method.equation).to_vec(),
        equation: options.method.equation,
        samples: 1,
        features,
        single_pass: false,
        leaves: false,
        lights: (scene.lights.len() as u32).min(MAX_LIGHTS),
        background: clear_color(&scene.background),
    };
    Painter::new(gpu, pass_options, bank, &table, &base)
}
