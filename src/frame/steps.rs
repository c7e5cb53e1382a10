//! What an observer is shown while a frame is refined.

use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use super::sampling::Job;
use crate::error::{Error, Result};
use crate::memory;
use crate::pixels;
use crate::pixels::leaves::TracedPixel;
use crate::pixels::picture::Picture;
use crate::pixels::store::PixelStore;
use crate::reconstruct::drawn::Drawn;
use crate::refine::Refiner;
use crate::refine::shown::Shown;
use crate::trace::Rays;
use crate::trace::sample::Context;

/// Times that a step took to be shown, which must have passed before the next is.
const PAUSE: u32 = 3;

/// Bytes that a step may take for each face of the mesh: the face, its vertex, its sample, and what is known of them.
const REFINED_FACE: u64 = 400;
/// Bytes that a face and a traced pixel take as they are drawn, beside what the device holds.
const DRAWN_FACE: u64 = 160;
const DRAWN_PIXEL: u64 = 32;

/// What is shown the leaves after every step.
pub(super) type LeafObserver<'o> = dyn FnMut(&mut Drawn, &Refiner, Rays) -> Result<()> + 'o;

/// The steps of one frame, each of which may be shown.
pub(super) struct Steps<'a, 'o> {
    job: &'a Job<'a>,
    context: &'a Context<'a>,
    shown: Shown<'a>,
    picture: &'a Picture,
    observer: Option<&'a mut LeafObserver<'o>>,
    /// Pixels of earlier frames, and of this one's steps.
    store: Option<&'a mut PixelStore>,
    /// When a step was shown last, and how long that took.
    last: Option<(Instant, Duration)>,
    /// Rays of pixels that were traced to be shown, and are known when the finished frame needs them.
    kept_rays: Rays,
}

impl<'a, 'o> Steps<'a, 'o> {
    /// No step yet.
    pub fn new(
        job: &'a Job,
        context: &'a Context,
        shown: Shown<'a>,
        picture: &'a Picture,
        store: Option<&'a mut PixelStore>,
        observer: Option<&'a mut LeafObserver<'o>>,
    ) -> Self {
        Self { job, context, shown, picture, observer, store, last: None, kept_rays: Rays::default() }
    }

    /// Shows what is refined so far, unless the last time is too short ago.
    ///
    /// # Errors
    /// [`Error::Interrupted`]; no memory left for a further step; whatever the observer returns.
    pub fn show(&mut self, refiner: &Refiner) -> Result<()> {
        if self.job.interrupt.load(Ordering::Relaxed) {
            return Err(Error::Interrupted);
        }
        // Lists that grow are doubled, and are there twice meanwhile.
        let bytes = refiner.mesh.faces.len() as u64 * REFINED_FACE;
        memory::check(bytes, "the refined mesh and its samples", memory::SMALLER_PICTURE)?;
        let least = self.job.step_interval;
        let too_soon = |(at, took): (Instant, Duration)| at.elapsed() < least.max(took * PAUSE);
        if self.observer.is_none() || !least.is_zero() && self.last.is_some_and(too_soon) {
            return Ok(());
        }
        let started = Instant::now();
        let (pixels, rays) = self.trace_pixels(refiner)?;
        if self.store.is_some() {
            self.kept_rays += rays;
        }
        let mut leaves = self.job.assemble(refiner, pixels, self.picture, refiner.steps == 0, None);
        if let Some(observer) = &mut self.observer {
            observer(&mut leaves, refiner, rays + self.picture.rays + refiner.border_rays)?;
        }
        self.last = Some((Instant::now(), started.elapsed()));
        Ok(())
    }

    /// The pixels of the finished mesh that are traced one by one, and all rays that they took.
    ///
    /// # Errors
    /// [`Error::Interrupted`]; no memory left to assemble them.
    pub fn finish(&mut self, refiner: &Refiner) -> Result<(Vec<TracedPixel>, Rays)> {
        let (pixels, rays) = self.trace_pixels(refiner)?;
        Ok((pixels, rays + self.kept_rays + refiner.border_rays))
    }

    fn trace_pixels(&mut self, refiner: &Refiner) -> Result<(Vec<TracedPixel>, Rays)> {
        let Refiner { mesh, pixel_faces, .. } = refiner;
        let store = self.store.as_deref_mut();
        let (pixels, rays) =
            pixels::leaves::trace(self.context, mesh, self.shown, pixel_faces, store, self.job.interrupt)?;
        let bytes = mesh.faces.len() as u64 * DRAWN_FACE + pixels.len() as u64 * DRAWN_PIXEL;
        memory::check(bytes, "what is drawn", memory::SMALLER_PICTURE)?;
        Ok((pixels, rays))
    }
}
