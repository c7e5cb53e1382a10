//! Vertex tracing.

pub mod constants;
pub mod error;
pub mod options;
pub mod progress;
pub mod refine;
pub mod report;
pub mod scene;
pub mod trace;
pub mod visibility;
