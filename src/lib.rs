//! Vertex tracing.

pub mod constants;
pub mod error;
pub mod scene;
pub mod trace;
