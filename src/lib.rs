//! Vertex tracing.

#[cfg(feature = "cli")]
pub mod cli;
pub mod constants;
pub mod error;
pub mod frame;
pub mod gpu;
pub mod options;
pub mod plan;
pub mod reconstruct;
pub mod refine;
pub mod report;
pub mod scene;
pub mod trace;
pub mod visibility;
