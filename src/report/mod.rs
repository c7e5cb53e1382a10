//! What came out: images, their difference, and what the frame did.

#[cfg(feature = "bench")]
pub mod bench;
pub mod flip;
pub mod image;
pub mod metrics;
pub mod output;
#[cfg(feature = "bench")]
pub mod page;
mod pfm;
#[cfg(feature = "bench")]
pub mod profile;
#[cfg(feature = "bench")]
pub mod stability;
pub mod stats;

pub use image::FloatImage;
pub use metrics::{Comparison, Encoding, compare};
pub use stats::Stats;
