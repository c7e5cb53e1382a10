//! Which faces are visible, and on how many pixels (paper §3.1, §5; design §3).
//!
//! [`id_buffer`] draws every face's ID, reads the image back and [`scan`]s it; [`device`] counts it where it
//! is and reads the counts alone; [`ring`] adds the neighbours that are too small to own a pixel.
#![forbid(unsafe_code)]

pub mod device;
pub mod draw_list;
pub mod face_draw;
pub mod id_buffer;
mod mask;
pub mod ring;
pub mod scan;

pub use draw_list::{Class, DrawList, classes};
pub use id_buffer::{Pass, Visibility};
pub use mask::MaskVertex;
pub use ring::Adjacency;
pub use scan::{IdImage, VisibleFaces};

use std::time::Duration;

use crate::gpu::Timing;

/// Time of the stages of one run in milliseconds, one after the other.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Times {
    /// Drawing the ID buffer, by the device's clock; 0 on a device without one.
    pub visibility: f64,
    /// The rest of the time until the host can read: recording, copying to the staging buffer, waiting,
    /// invalidating.
    pub readback: f64,
    /// Scanning what was read back.
    pub scan: f64,
    /// The copy on the device alone, by its clock; a part of `readback`.
    pub copy: f64,
}

impl Times {
    /// From the device's `timings`, the wall time until the host could read, and that of the scan.
    fn new(timings: &[Timing], until_read: Duration, scan: Duration) -> Self {
        let device = |name| timings.iter().find(|timing| timing.name == name).map_or(0.0, |timing| timing.ms);
        let ms = |duration: Duration| duration.as_secs_f64() * 1e3;
        let visibility = device("id buffer").min(ms(until_read));
        Self { visibility, readback: ms(until_read) - visibility, scan: ms(scan), copy: device("copy") }
    }
}
