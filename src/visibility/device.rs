//! The ID buffer counted on the device: only the pixels per face are read back (design §3, `device`).

use std::{sync::Arc, time::Instant};

use super::{
    Class, Found, Times, VisibleFaces,
    face_draw::{FaceDraw, IdImages},
    scan::{Scanner, visible_in},
};
use crate::{
    constants::{COUNT_GROUP, COUNT_STRIP},
    error::Result,
    gpu::{
        Access, AddressMode, Binding, Commands, ComputePipeline, DescriptorSet, DeviceBuffer, Gpu,
        ReadbackBuffer, ReadbackChoice, Resource, SamplerDesc, SetLayout, Shader, TexelFilter,
    },
    scene::{Scene, View},
    spirv,
};

/// Bindings of `count_faces.comp`.
pub const BINDINGS: [Binding; 2] = [Binding::textures("ids", 1), Binding::storage("counts")];

/// Draws the ID buffer of one scene and counts it on the device; keeps its buffers from run to run.
pub struct Pass {
    gpu: Arc<Gpu>,
    commands: Commands,
    draw: FaceDraw,
    layout: SetLayout,
    pipeline: ComputePipeline,
    counts: DeviceBuffer,
    staging: ReadbackBuffer,
    target: Option<(IdImages, DescriptorSet)>,
    scanner: Scanner,
    faces: VisibleFaces,
}

impl Pass {
    /// Uploads what the ID buffer of `scene` needs; `classes` has one entry for each object.
    ///
    /// # Errors
    /// More faces than IDs; no device memory left.
    pub fn new(gpu: &Arc<Gpu>, scene: &Scene, classes: &[Class], readback: ReadbackChoice) -> Result<Self> {
        let layout = SetLayout::new(gpu, "face counts", &BINDINGS)?;
        let bytes = size_of_val(scene.geometry.faces.as_slice()) as u64 / 3;
        Ok(Self {
            gpu: gpu.clone(),
            commands: Commands::new(gpu, "face counts", 2)?,
            draw: FaceDraw::new(gpu, scene, classes)?,
            pipeline: ComputePipeline::new(
                gpu,
                "face counts",
                Shader::new(spirv!("count_faces.comp")),
                &[&layout],
                0,
            )?,
            layout,
            counts: DeviceBuffer::new(gpu, "face counts", bytes)?,
            staging: ReadbackBuffer::new(gpu, "face counts staging", bytes, readback)?,
            target: None,
            scanner: Scanner::default(),
            faces: VisibleFaces::default(),
        })
    }

    /// Draws and counts a single pixel, since drivers compile at the first use, and makes the images for the
    /// size of `view`.
    ///
    /// # Errors
    /// An image size that the device does not support; no device memory left; a lost device.
    pub fn warm_up(&mut self, view: &View) -> Result<()> {
        self.record(view, true)?;
        Ok(())
    }

    /// Finds the visible faces of `view`.
    ///
    /// # Errors
    /// An image size that the device does not support; no device memory left; a lost device.
    pub fn run(&mut self, view: &View) -> Result<Found<'_>> {
        let start = Instant::now();
        self.record(view, false)?;
        let readback_memory = self.staging.memory();
        let drawn = start.elapsed();
        let counts: &[u32] = self.staging.read(self.draw.face_count)?;
        let total = start.elapsed();
        let start = Instant::now();
        let FaceDraw { vt_faces, shadow_faces, .. } = &self.draw;
        self.scanner.take_counts(counts, vt_faces, shadow_faces, &mut self.faces);
        let scan = start.elapsed();
        Ok(Found {
            visible: &self.faces.visible,
            visible_vt: visible_in(&self.faces.visible, &self.draw.vt_faces),
            times: Times::new("id buffer", &self.commands.timings()?, total, scan).with_map(total - drawn),
            readback_bytes: size_of_val(counts) as u64,
            readback_memory,
            faces: &self.faces,
            ids: None,
        })
    }

    fn record(&mut self, view: &View, one_pixel: bool) -> Result<()> {
        let target = match self.target.take().filter(|(images, _)| images.fit(view)) {
            Some(target) => target,
            None => {
                let images = IdImages::new(&self.gpu, view)?;
                let set = self
                    .layout
                    .set(
                        "face counts",
                        &[
                            ("ids", Resource::Textures(&[(&images.ids, TEXELS)])),
                            ("counts", Resource::Buffer(&self.counts)),
                        ],
                    )
                    .map_err(|error| error.with_remedy("use a smaller scene"))?;
                (images, set)
            }
        };
        let (images, set) = self.target.insert(target);
        let groups = if one_pixel {
            [1; 3]
        } else {
            [view.width.div_ceil(COUNT_GROUP), view.height.div_ceil(COUNT_STRIP), 1]
        };
        let mut recording = self.commands.begin()?;
        recording.timed("id buffer", |recording| {
            self.draw.record(recording, images, view, one_pixel);
            recording.fill(&self.counts, 0);
            recording.use_buffer(&self.counts, Access::ShaderWrite);
            recording.use_image(&images.ids, Access::ShaderRead);
            recording.dispatch(&self.pipeline, &[set], &(), groups);
        });
        let bytes = self.counts.size();
        recording.timed("copy", |recording| recording.read_buffer(&self.counts, &mut self.staging, bytes));
        recording.submit_and_wait()
    }
}

/// For texelFetch, which ignores it.
const TEXELS: SamplerDesc = SamplerDesc {
    u: AddressMode::Clamp,
    v: AddressMode::Clamp,
    mag: TexelFilter::Nearest,
    min: TexelFilter::Nearest,
    mip: None,
    anisotropy: 1,
};
