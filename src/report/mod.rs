//! What came out: images, their difference, and what the frame did.

pub mod flip;
pub mod image;
pub mod metrics;
pub mod output;
mod pfm;
#[cfg(feature = "bench")]
pub mod profile;
pub mod stats;

pub use image::FloatImage;
pub use metrics::{Comparison, Encoding, compare};
pub use stats::Stats;
