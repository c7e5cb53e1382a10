//! Adaptive refinement in object space (paper §3; design §6).

pub mod mesh;
