//! The ID buffer: a pass of its own that draws every face's ID, read back through staging (paper §3.1).

use std::{sync::Arc, time::Instant};

use bytemuck::{Pod, Zeroable};
use glam::{Mat4, Vec3};

use super::{
    Class, DrawList, IdImage, VisibleFaces,
    draw_list::Batch,
    mask,
    scan::Scanner,
};
use crate::{
    error::Result,
    gpu::{
        Binding, Blend, ColorTarget, Commands, Cull, DepthTarget, DescriptorSet, Draws, Format, Gpu, GraphicsDesc,
        GraphicsPipeline, Image, ImageDesc, ReadbackBuffer, ReadbackChoice, ReadbackMemory, Recording, Resource,
        SetLayout, Targets, Uploads,
    },
    scene::{AlphaMode, Scene, View},
    spirv,
};

/// Bindings of set 0: what every face needs.
pub const FACE_BINDINGS: [Binding; 4] = [
    Binding::storage("positions"),
    Binding::storage("faces"),
    Binding::storage("entries"),
    Binding::storage("mask_vertices"),
];
/// Bindings of set 1: what faces with holes need besides.
pub const MASK_BINDINGS: [Binding; 1] = [Binding::textures("alpha_map", 1)];

/// Push constants of `face_fetch.glsl`.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
pub struct Push {
    /// Clip coordinates from positions relative to the eye.
    pub clip_from_eye_relative: Mat4,
    /// Eye, relative to the scene's origin.
    pub eye: Vec3,
    /// Least alpha that counts, for masked faces.
    pub alpha_cutoff: f32,
}

/// What a run of the [`Pass`] found; borrowed from it until the next run.
#[derive(Debug)]
pub struct Visibility<'a> {
    /// Visible faces and their pixels.
    pub faces: &'a VisibleFaces,
    /// Every pixel's face.
    pub ids: IdImage<'a>,
    /// Visible faces of specular VT objects: the stats' `faces.visible`.
    pub visible_vt: usize,
    /// Where the time went.
    pub times: Times,
    /// Bytes read back.
    pub readback_bytes: u64,
    /// Kind of memory they were read from.
    pub readback_memory: ReadbackMemory,
}

/// Wall time of the stages of one run, in milliseconds, one after the other.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Times {
    /// Drawing the ID buffer, by the device's clock; 0 on a device without one.
    pub visibility: f64,
    /// Recording, copying to the staging buffer, waiting and invalidating.
    pub readback: f64,
    /// Scanning the staging buffer.
    pub scan: f64,
    /// The copy on the device alone, by its clock; a part of `readback`.
    pub copy: f64,
}

/// Draws, reads back and scans the ID buffer of one scene; keeps its buffers from run to run.
pub struct Pass {
    gpu: Arc<Gpu>,
    commands: Commands,
    readback: ReadbackChoice,
    draws: Vec<BatchDraw>,
    face_set: DescriptorSet,
    vt_faces: Vec<std::ops::Range<u32>>,
    face_count: usize,
    target: Option<Target>,
    scanner: Scanner,
    faces: VisibleFaces,
}

struct BatchDraw {
    batch: Batch,
    pipeline: GraphicsPipeline,
    mask: Option<(DescriptorSet, f32)>,
}

/// Images and staging buffer of one image size.
struct Target {
    ids: Image,
    depth: Image,
    staging: ReadbackBuffer,
}

impl Pass {
    /// Uploads what the ID buffer of `scene` needs; `classes` has one entry for each object.
    ///
    /// # Errors
    /// More faces than IDs; no device memory left.
    pub fn new(gpu: &Arc<Gpu>, scene: &Scene, classes: &[Class]) -> Result<Self> {
        let list = DrawList::new(scene, classes)?;
        let mut uploads = Uploads::new(gpu, "ID buffer uploads", 8 << 20)?;
        let masked = list.batches.iter().any(|batch| batch.mask.is_some());
        let mask_vertices = if masked { mask::vertices(scene) } else { Vec::new() };
        let face_layout = SetLayout::new(gpu, "ID buffer faces", &FACE_BINDINGS)?;
        let face_set = face_layout.set(
            "ID buffer faces",
            &[
                ("positions", Resource::Buffer(&uploads.buffer("ID buffer positions", &scene.geometry.positions)?)),
                ("faces", Resource::Buffer(&uploads.buffer("ID buffer faces", &scene.geometry.faces)?)),
                ("entries", Resource::Buffer(&uploads.buffer("ID buffer entries", &list.entries)?)),
                ("mask_vertices", Resource::Buffer(&uploads.buffer("ID buffer mask vertices", &mask_vertices)?)),
            ],
        )?;
        let mask_layout = SetLayout::new(gpu, "ID buffer mask", &MASK_BINDINGS)?;
        let mut draws: Vec<BatchDraw> = Vec::with_capacity(list.batches.len());
        for batch in list.batches {
            let alike = |draw: &&BatchDraw| {
                draw.batch.cull == batch.cull && draw.batch.mask.is_some() == batch.mask.is_some()
            };
            let pipeline = match draws.iter().find(alike) {
                Some(draw) => draw.pipeline.clone(),
                None => pipeline(gpu, &batch, &face_layout, &mask_layout)?,
            };
            let mask = match batch.mask {
                None => None,
                Some(material) => {
                    let AlphaMode::Mask(cutoff) = scene.materials[material as usize].alpha_mode else { continue };
                    Some((mask::set(gpu, &mut uploads, scene, &mask_layout, material)?, cutoff))
                }
            };
            draws.push(BatchDraw { batch, pipeline, mask });
        }
        uploads.flush()?;
        let vt_objects = scene.objects.iter().zip(classes).filter(|(_, class)| **class == Class::Vt);
        Ok(Self {
            gpu: gpu.clone(),
            commands: Commands::new(gpu, "ID buffer", 2)?,
            readback: ReadbackChoice::Best,
            draws,
            face_set,
            vt_faces: vt_objects.map(|(object, _)| object.faces.clone()).collect(),
            face_count: scene.geometry.faces.len(),
            target: None,
            scanner: Scanner::default(),
            faces: VisibleFaces::default(),
        })
    }

    /// Which memory the ID buffer is read back through, from the next run on.
    pub fn set_readback(&mut self, choice: ReadbackChoice) {
        self.readback = choice;
        self.target = None;
    }

    /// Draws every pipeline once on a single pixel, since drivers compile at the first draw, and makes the
    /// buffers for the size of `view`.
    ///
    /// # Errors
    /// An image size that the device does not support; no device memory left; a lost device.
    pub fn warm_up(&mut self, view: &View) -> Result<()> {
        let target = Target::for_view(&self.gpu, &mut self.target, self.readback, view)?;
        let mut recording = self.commands.begin()?;
        target.render(&mut recording, |pass| {
            pass.scissor([0, 0, 1, 1]);
            draw(pass, &self.draws, &self.face_set, view);
        });
        recording.submit_and_wait()
    }

    /// Finds the visible faces of `view`.
    ///
    /// # Errors
    /// An image size that the device does not support; no device memory left; a lost device.
    pub fn run(&mut self, view: &View) -> Result<Visibility<'_>> {
        let target = Target::for_view(&self.gpu, &mut self.target, self.readback, view)?;
        let start = Instant::now();
        let mut recording = self.commands.begin()?;
        recording.timed("id buffer", |recording| {
            target.render(recording, |pass| draw(pass, &self.draws, &self.face_set, view));
        });
        let Target { ids, staging, .. } = target;
        recording.timed("copy", |recording| recording.read_image(ids, staging));
        recording.submit_and_wait()?;
        let (readback_bytes, readback_memory) = (ids.bytes(), staging.memory());
        let pixels: &[u32] = staging.read(view.pixels())?;
        let read = Instant::now();
        self.scanner.scan(pixels, self.face_count, &mut self.faces);
        let scan = read.elapsed().as_secs_f64() * 1e3;

        let timings = self.commands.timings()?;
        let device = |name| timings.iter().find(|timing| timing.name == name).map_or(0.0, |timing| timing.ms);
        let total = (read - start).as_secs_f64() * 1e3;
        let visibility = device("id buffer").min(total);
        let visible = &self.faces.visible;
        let visible_in = |range: &std::ops::Range<u32>| {
            visible.partition_point(|&face| face < range.end) - visible.partition_point(|&face| face < range.start)
        };
        Ok(Visibility {
            visible_vt: self.vt_faces.iter().map(visible_in).sum(),
            faces: &self.faces,
            ids: IdImage { width: view.width, height: view.height, pixels },
            times: Times { visibility, readback: total - visibility, scan, copy: device("copy") },
            readback_bytes,
            readback_memory,
        })
    }
}

impl Target {
    /// The target in `slot` if it has the view's size, else a new one.
    fn for_view<'a>(
        gpu: &Arc<Gpu>,
        slot: &'a mut Option<Self>,
        readback: ReadbackChoice,
        view: &View,
    ) -> Result<&'a mut Self> {
        let (width, height) = (view.width, view.height);
        let fits = |target: &Self| (target.ids.width(), target.ids.height()) == (width, height);
        let target = match slot.take().filter(fits) {
            Some(target) => target,
            None => {
                let ids = Image::new(gpu, &ImageDesc::target("ID buffer", Format::Rgba8, width, height))?;
                let depth = Image::new(gpu, &ImageDesc::target("ID buffer depth", Format::Depth32f, width, height))?;
                let staging = ReadbackBuffer::new(gpu, "ID buffer staging", ids.bytes(), readback)?;
                Self { ids, depth, staging }
            }
        };
        Ok(slot.insert(target))
    }

    /// A render pass over the cleared images.
    fn render<'a>(&self, recording: &mut Recording<'a>, work: impl FnOnce(&mut Draws<'_, 'a>)) {
        let colors = [ColorTarget { image: &self.ids, clear: Some([0.0; 4]), resolve: None }];
        let depth = Some(DepthTarget { image: &self.depth, clear: true });
        recording.render(&Targets { colors: &colors, depth }, work);
    }
}

fn draw(pass: &mut Draws<'_, '_>, draws: &[BatchDraw], face_set: &DescriptorSet, view: &View) {
    for BatchDraw { batch, pipeline, mask } in draws {
        pass.pipeline(pipeline).set(0, face_set);
        if let Some((set, _)) = mask {
            pass.set(1, set);
        }
        pass.push(&Push {
            clip_from_eye_relative: view.clip_from_eye_relative(),
            eye: view.eye,
            alpha_cutoff: mask.as_ref().map_or(0.0, |mask| mask.1),
        });
        pass.draw(3 * batch.entries.start..3 * batch.entries.end);
    }
}

fn pipeline(gpu: &Arc<Gpu>, batch: &Batch, faces: &SetLayout, mask: &SetLayout) -> Result<GraphicsPipeline> {
    let (name, vertex, fragment, sets): (_, &[u8], &[u8], &[&SetLayout]) = match batch.mask {
        None => ("ID buffer", spirv!("id_buffer.vert"), spirv!("id_buffer.frag"), &[faces]),
        Some(_) => {
            ("ID buffer mask", spirv!("id_buffer_mask.vert"), spirv!("id_buffer_mask.frag"), &[faces, mask])
        }
    };
    let desc = GraphicsDesc {
        sets,
        push_bytes: size_of::<Push>() as u32,
        colors: &[(Format::Rgba8, Blend::Replace)],
        cull: if batch.cull { Cull::Back } else { Cull::None },
        ..GraphicsDesc::opaque(name, vertex, fragment)
    };
    GraphicsPipeline::new(gpu, &desc)
}
