//! The ID buffer read back through a staging buffer and scanned on the host (paper §3.1).

use std::{sync::Arc, time::Instant};

use super::{
    Class, IdImage, Times, VisibleFaces,
    face_draw::{FaceDraw, IdImages},
    scan::{Scanner, visible_in},
};
use crate::{
    error::Result,
    gpu::{Commands, Gpu, ReadbackBuffer, ReadbackChoice, ReadbackMemory},
    scene::{Scene, View},
};

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

/// Draws, reads back and scans the ID buffer of one scene; keeps its buffers from run to run.
pub struct Pass {
    gpu: Arc<Gpu>,
    commands: Commands,
    readback: ReadbackChoice,
    draw: FaceDraw,
    target: Option<(IdImages, ReadbackBuffer)>,
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

    /// Draws every pipeline once on a single pixel, since drivers compile at the first draw, and makes the
    /// buffers for the size of `view`.
    ///
    /// # Errors
    /// An image size that the device does not support; no device memory left; a lost device.
    pub fn warm_up(&mut self, view: &View) -> Result<()> {
        let (images, _) = target(&self.gpu, &mut self.target, self.readback, view)?;
        let mut recording = self.commands.begin()?;
        self.draw.record(&mut recording, images, view, true);
        recording.submit_and_wait()
    }

    /// Finds the visible faces of `view`.
    ///
    /// # Errors
    /// An image size that the device does not support; no device memory left; a lost device.
    pub fn run(&mut self, view: &View) -> Result<Visibility<'_>> {
        let (images, staging) = target(&self.gpu, &mut self.target, self.readback, view)?;
        let start = Instant::now();
        let mut recording = self.commands.begin()?;
        recording.timed("id buffer", |recording| self.draw.record(recording, images, view, false));
        recording.timed("copy", |recording| recording.read_image(&images.ids, staging));
        recording.submit_and_wait()?;
        let readback_memory = staging.memory();
        let drawn = start.elapsed();
        let pixels: &[u32] = staging.read(view.pixels())?;
        let total = start.elapsed();
        let start = Instant::now();
        self.scanner.scan(pixels, self.draw.face_count, &mut self.faces);
        let scan = start.elapsed();
        Ok(Visibility {
            visible_vt: visible_in(&self.faces.visible, &self.draw.vt_faces),
            faces: &self.faces,
            ids: IdImage { width: view.width, height: view.height, pixels },
            times: Times::new("id buffer", &self.commands.timings()?, total, scan).with_map(total - drawn),
            readback_bytes: images.ids.bytes(),
            readback_memory,
        })
    }
}

/// The images and staging buffer in `slot` if they have the view's size, else new ones.
fn target<'a>(
    gpu: &Arc<Gpu>,
    slot: &'a mut Option<(IdImages, ReadbackBuffer)>,
    readback: ReadbackChoice,
    view: &View,
) -> Result<&'a mut (IdImages, ReadbackBuffer)> {
    let target = match slot.take().filter(|(images, _)| images.fit(view)) {
        Some(target) => target,
        None => {
            let images = IdImages::new(gpu, view)?;
            let staging = ReadbackBuffer::new(gpu, "ID buffer staging", images.ids.bytes(), readback)?;
            (images, staging)
        }
    };
    Ok(slot.insert(target))
}
