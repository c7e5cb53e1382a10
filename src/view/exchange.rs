//! What the window's thread and the render thread tell each other.

use std::{
    path::PathBuf,
    sync::{
        Arc, Condvar, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
    time::Duration,
};

use glam::{DVec3, Vec3};

use super::{encode, inspect::Path as SpecularPath};
use crate::{
    error::Error,
    options::{EffortOptions, Options},
    report::{FloatImage, Stats},
    scene::{Camera, Light, View},
};

/// What the window should show.
#[derive(Debug, Clone)]
pub struct Wanted {
    /// Counts what was wanted: updates say which they answer.
    pub serial: u64,
    /// The scene file, and how often it was asked to be read again.
    pub source: (PathBuf, u32),
    /// Image, camera, method and effort.
    pub options: Options,
    /// Lights in place of those of the file.
    pub lights: Option<Arc<[Light]>>,
    /// Whether the camera moves: then one frame within `budget`, else all that `options` ask for.
    pub moving: bool,
    /// Time that a frame may take while the camera moves.
    pub budget: Duration,
    /// Pixels of the window along each side of a pixel that is drawn while the camera moves; as the budget allows if
    /// `None`.
    pub coarse: Option<u32>,
    /// Scale of the shown image, in stops.
    pub exposure: f32,
    /// Whether to trace the reference too.
    pub reference: bool,
    /// The pixel whose specular path to follow.
    pub pixel: Option<(u32, u32)>,
}

impl Wanted {
    /// Whether a renderer made for `other` can draw it.
    pub(super) fn shares_renderer(&self, other: &Self) -> bool {
        let timeless = |options: &Options| Options {
            view: Default::default(),
            effort: EffortOptions::default(),
            ..options.clone()
        };
        let same_lights = match (&self.lights, &other.lights) {
            (Some(a), Some(b)) => Arc::ptr_eq(a, b),
            (a, b) => a.is_none() && b.is_none(),
        };
        self.source == other.source && same_lights && timeless(&self.options) == timeless(&other.options)
    }

    /// The last picture of a frame.
    pub(super) fn finished(&self, image: &FloatImage, view: View, stats: Stats) -> Update {
        let progress = (stats.steps as u32, stats.samples, stats.predicted_error.unwrap_or(0.0) as f32);
        self.picture(image, view, progress, Some(Box::new(stats)))
    }

    /// An image on the way to the last one, or the last one, with its stats.
    pub(super) fn picture(
        &self,
        image: &FloatImage,
        view: View,
        progress: (u32, u64, f32),
        stats: Option<Box<Stats>>,
    ) -> Update {
        let complete = !self.moving && stats.is_some();
        let pixels = Pixels::encoded(image, self.exposure);
        Update::Picture(Box::new(Picture { serial: self.serial, pixels, view, progress, stats, complete }))
    }
}

/// What the window hears of.
pub enum Update {
    /// A scene was read.
    Scene(Box<Facts>),
    /// An image, better than the one before or of another view.
    Picture(Box<Picture>),
    /// The reference of the view that is shown.
    Reference(Pixels),
    /// The path behind the pixel that was clicked.
    Path(SpecularPath),
    /// What was wanted cannot be had; what is shown stays.
    Problem(Error),
}

/// What the window knows of a scene.
pub struct Facts {
    /// Smallest and largest corner.
    pub bounds: (Vec3, Vec3),
    /// What to look at: the centre of the specular objects, of all where there are none.
    pub focus: Vec3,
    /// World position of the scene's coordinate origin.
    pub origin: DVec3,
    /// Cameras of the file.
    pub cameras: Vec<Camera>,
    /// Lights, those added for want of any left out.
    pub lights: Vec<Light>,
    /// Files that the scene was read from besides its own.
    pub beside: Vec<PathBuf>,
}

/// Opaque RGBA bytes, row by row from the top.
#[derive(Clone, Default)]
pub struct Pixels {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `4 · width · height` bytes.
    pub rgba: Vec<u8>,
}

impl Pixels {
    /// `image` as the window shows it, at so many stops.
    pub(super) fn encoded(image: &FloatImage, exposure: f32) -> Self {
        Self { width: image.width, height: image.height, rgba: encode::rgba(image, exposure) }
    }
}

/// An image with what is known of it.
pub struct Picture {
    /// Which wish it answers.
    pub serial: u64,
    /// What is shown.
    pub pixels: Pixels,
    /// From where.
    pub view: View,
    /// Refinement steps, samples and predicted error so far.
    pub progress: (u32, u64, f32),
    /// What it took; `None` before refinement ended.
    pub stats: Option<Box<Stats>>,
    /// Whether refinement went as far as it was asked to, the camera at rest.
    pub complete: bool,
}

/// Where the window leaves what it wants, and the render thread finds it.
#[derive(Default)]
pub struct Mailbox {
    slot: Mutex<Slot>,
    filled: Condvar,
    /// Ends what is worked on.
    pub(super) interrupt: Arc<AtomicBool>,
}

#[derive(Default)]
struct Slot {
    wanted: Option<Wanted>,
    closed: bool,
    /// Whether what is worked on may be given up for something newer.
    patient: bool,
}

impl Mailbox {
    /// Replaces what was wanted before. A frame of a moving camera is still finished, anything else is given up.
    pub fn post(&self, wanted: Wanted) {
        let mut slot = self.lock();
        // A click is answered even if the camera moved on meanwhile.
        let pixel = wanted.pixel.or(slot.wanted.as_ref().and_then(|before| before.pixel));
        slot.wanted = Some(Wanted { pixel, ..wanted });
        if slot.patient {
            self.interrupt.store(true, Ordering::Relaxed);
        }
        self.filled.notify_one();
    }

    /// Ends the render thread.
    pub fn close(&self) {
        self.lock().closed = true;
        self.interrupt.store(true, Ordering::Relaxed);
        self.filled.notify_one();
    }

    /// Waits for something new; `None` once closed.
    pub(super) fn next(&self) -> Option<Wanted> {
        let mut slot = self.lock();
        loop {
            if slot.closed {
                return None;
            }
            if let Some(wanted) = slot.wanted.take() {
                slot.patient = !wanted.moving;
                self.interrupt.store(false, Ordering::Relaxed);
                return Some(wanted);
            }
            slot.patient = false;
            slot = self.filled.wait(slot).unwrap_or_else(PoisonError::into_inner);
        }
    }

    fn lock(&self) -> MutexGuard<'_, Slot> {
        self.slot.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
