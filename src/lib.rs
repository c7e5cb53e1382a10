//! Vertex tracing.

#[cfg(feature = "cli")]
pub mod cli;
pub mod constants;
pub mod error;
pub mod options;
pub mod report;
pub mod scene;
pub mod trace;
