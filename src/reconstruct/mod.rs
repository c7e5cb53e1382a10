//! Reconstruction of the image from samples (paper §4; design §5).

pub mod bank;
pub mod frame_block;
pub mod leaves;
pub mod nodes;
pub mod passes;
pub mod table;
