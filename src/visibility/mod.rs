//! Which faces are visible, and on how many pixels (paper §3.1, §5; design §3).
//!
//! [`id_buffer`] draws every face's ID, reads the image back and [`scan`]s it; [`device`] counts it where it
//! is and reads the counts alone; [`single_pass`] reads codes from the base image. A [`Finder`] is one of
//! them. [`ring`] adds the neighbours that are too small to own a pixel.
#![forbid(unsafe_code)]

pub mod clusters;
pub mod device;
pub mod draw_list;
pub mod face_draw;
mod finder;
pub mod id_buffer;
pub mod mask;
pub mod ring;
mod runs;
pub mod sampler;
pub mod scan;
pub mod single_pass;

pub use clusters::Clusters;
pub use draw_list::{Class, DrawList, classes};
pub use finder::Finder;
pub use id_buffer::Pass;
pub use mask::MaskVertex;
pub use ring::Adjacency;
pub use scan::{IdImage, VisibleFaces};

use std::time::Duration;

use crate::gpu::{ReadbackMemory, Timing};

/// What any way found in one view; borrowed from it until the next.
#[derive(Debug, Clone, Copy)]
pub struct Found<'a> {
    /// Visible faces, ascending; in a single pass also some that may not be.
    pub visible: &'a [u32],
    /// Pixels of each face.
    pub faces: &'a VisibleFaces,
    /// Every pixel's face, if it was read back.
    pub ids: Option<IdImage<'a>>,
    /// Visible faces of specular VT objects: the stats' `faces.visible`.
    pub visible_vt: usize,
    /// Where the time went; counting on the device is a part of `visibility`.
    pub times: Times,
    /// Bytes read back.
    pub readback_bytes: u64,
    /// Kind of memory they were read from.
    pub readback_memory: ReadbackMemory,
}

/// Time of the stages of one run in milliseconds, one after the other.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Times {
    /// Drawing the ID buffer or base image, by the device's clock; 0 on a device without one.
    pub visibility: f64,
    /// The rest of the time until the host can read: recording, copying to the staging buffer, waiting,
    /// invalidating.
    pub readback: f64,
    /// Scanning what was read back.
    pub scan: f64,
    /// The copy on the device alone, by its clock; a part of `readback`.
    pub copy: f64,
    /// Making the staging buffer readable: invalidating it, or copying it out of uncached memory; a part of
    /// `readback`.
    pub map: f64,
}

impl Times {
    /// From the device's `timings`, of which `drawn` names the draw, the wall time until the host could read,
    /// and that of the scan.
    fn new(drawn: &str, timings: &[Timing], until_read: Duration, scan: Duration) -> Self {
        let device = |name| timings.iter().find(|timing| timing.name == name).map_or(0.0, |timing| timing.ms);
        let ms = |duration: Duration| duration.as_secs_f64() * 1e3;
        let visibility = device(drawn).min(ms(until_read));
        let readback = ms(until_read) - visibility;
        Self { visibility, readback, scan: ms(scan), copy: device("copy").min(readback), map: 0.0 }
    }

    /// The same, with what [`map`](Self::map) took.
    fn with_map(self, map: Duration) -> Self {
        Self { map: (map.as_secs_f64() * 1e3).min(self.readback - self.copy), ..self }
    }

    /// All of it.
    pub fn total(&self) -> f64 {
        self.visibility + self.readback + self.scan
    }
}
