//! What came out: images, their difference, and what the frame did.

pub mod bench;
pub mod flip;
pub mod image;
pub mod metrics;
pub mod output;
pub mod page;
mod pfm;
pub mod profile;
pub mod stats;

pub use image::FloatImage;
pub use metrics::{Comparison, Encoding, compare};
pub use stats::Stats;
