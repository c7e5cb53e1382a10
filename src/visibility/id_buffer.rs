//! The ID buffer read back through a staging buffer and scanned on the host (paper §3.1).

use std::{sync::Arc, time::Instant};

use super::{
    Class, Found, IdImage, Times, VisibleFaces,
    face_draw::{FaceDraw, IdImages},
    scan::{Scanner, visible_in},
};
use crate::{
    error::Result,
    gpu::{
        Commands, DepthTarget, DeviceKind, Format, Gpu, HostImage, Image, ReadbackBuffer, ReadbackChoice,
        ReadbackMemory, Recording,
    },
    scene::{Scene, View},
};

/// Draws, reads back and scans the ID buffer of one scene; keeps its buffers from run to run.
pub struct Pass {
    gpu: Arc<Gpu>,
    commands: Commands,
    readback: ReadbackChoice,
    draw: FaceDraw,
    target: Option<Target>,
    scanner: Scanner,
    faces: VisibleFaces,
}

impl Pass {
    /// Uploads what the ID buffer of `scene` needs; `classes` has one entry for each object.
    ///
    /// # Errors
    /// More faces than IDs; no device memory left.
    pub fn new(gpu: &Arc<Gpu>, scene: &Scene, classes: &[Class]) -> Result<Self> {
        Ok(Self {
            gpu: gpu.clone(),
            commands: Commands::new(gpu, "ID buffer", 2)?,
            readback: ReadbackChoice::Best,
            draw: FaceDraw::new(gpu, scene, classes)?,
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

    /// Whether the ID buffer is scanned where it was drawn, without a copy; known after a run.
    pub fn reads_in_place(&self) -> bool {
        matches!(self.target, Some(Target::InPlace { .. }))
    }

    /// Draws every pipeline once on a single pixel, since drivers compile at the first draw, and makes the
    /// buffers for the size of `view`.
    ///
    /// # Errors
    /// An image size that the device does not support; no device memory left; a lost device.
    pub fn warm_up(&mut self, view: &View) -> Result<()> {
        let target = target(&self.gpu, &mut self.target, self.readback, view)?;
        let mut recording = self.commands.begin()?;
        target.record(&self.draw, &mut recording, view, true);
        recording.submit_and_wait()
    }

    /// Finds the visible faces of `view`.
    ///
    /// # Errors
    /// An image size that the device does not support; no device memory left; a lost device.
    pub fn run(&mut self, view: &View) -> Result<Found<'_>> {
        let target = target(&self.gpu, &mut self.target, self.readback, view)?;
        let start = Instant::now();
        let mut recording = self.commands.begin()?;
        target.record(&self.draw, &mut recording, view, false);
        recording.submit_and_wait()?;
        let readback_memory = target.memory();
        let drawn = start.elapsed();
        let pixels = target.read(view)?;
        let total = start.elapsed();
        let start = Instant::now();
        self.scanner.scan(pixels, self.draw.face_count, &mut self.faces);
        let scan = start.elapsed();
        Ok(Found {
            visible: &self.faces.visible,
            visible_vt: visible_in(&self.faces.visible, &self.draw.vt_faces),
            faces: &self.faces,
            ids: Some(IdImage { width: view.width, height: view.height, pixels }),
            times: Times::new("id buffer", &self.commands.timings()?, total, scan).with_map(total - drawn),
            readback_bytes: size_of_val(pixels) as u64,
            readback_memory,
        })
    }
}

/// What the ID buffer is drawn into and read from.
enum Target {
    /// Copied to a staging buffer.
    Staged(IdImages, ReadbackBuffer),
    /// Read where it was drawn.
    InPlace { ids: HostImage, depth: Image },
}

impl Target {
    fn new(gpu: &Arc<Gpu>, readback: ReadbackChoice, view: &View) -> Result<Self> {
        // A copy is worth its time only where the host reads other memory than the device writes.
        if gpu.info().kind == DeviceKind::Cpu && readback == ReadbackChoice::Best {
            let size = (view.width, view.height);
            if let Some(ids) = HostImage::new(gpu, "ID buffer in place", Format::Rgba8, size)? {
                return Ok(Self::InPlace { ids, depth: IdImages::depth(gpu, view)? });
            }
        }
        let images = IdImages::new(gpu, view)?;
        let staging = ReadbackBuffer::new(gpu, "ID buffer staging", images.ids.bytes(), readback)?;
        Ok(Self::Staged(images, staging))
    }

    fn fits(&self, view: &View) -> bool {
        match self {
            Self::Staged(images, _) => images.fit(view),
            Self::InPlace { ids, .. } => ids.size() == (view.width, view.height),
        }
    }

    fn memory(&self) -> ReadbackMemory {
        match self {
            Self::Staged(_, staging) => staging.memory(),
            Self::InPlace { .. } => ReadbackMemory::CachedCoherent,
        }
    }

    fn record<'a>(
        &'a mut self,
        draw: &FaceDraw,
        recording: &mut Recording<'a>,
        view: &View,
        one_pixel: bool,
    ) {
        match self {
            Self::Staged(images, staging) => {
                recording.timed("id buffer", |recording| draw.record(recording, images, view, one_pixel));
                recording.timed("copy", |recording| recording.read_image(&images.ids, staging));
            }
            Self::InPlace { ids, depth } => recording.timed("id buffer", |recording| {
                let depth = Some(DepthTarget { image: depth, clear: true });
                recording.render_to_host(ids, depth, |pass| draw.draw(pass, view, one_pixel));
            }),
        }
    }

    fn read(&mut self, view: &View) -> Result<&[u32]> {
        match self {
            Self::Staged(_, staging) => staging.read(view.pixels()),
            Self::InPlace { ids, .. } => ids.read(),
        }
    }
}

/// The target in `slot` if it has the view's size, else a new one.
fn target<'a>(
    gpu: &Arc<Gpu>,
    slot: &'a mut Option<Target>,
    readback: ReadbackChoice,
    view: &View,
) -> Result<&'a mut Target> {
    let target = match slot.take().filter(|target| target.fits(view)) {
        Some(target) => target,
        None => Target::new(gpu, readback, view)?,
    };
    Ok(slot.insert(target))
}
