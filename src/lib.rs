//! Vertex tracing.

pub mod constants;
pub mod error;
pub mod gpu;
pub mod scene;
pub mod visibility;
