//! Reconstruction of the image from samples (paper §4; design §5).

pub mod bank;
pub mod base;
pub mod beside;
pub mod between;
mod blocks;
pub mod drawn;
pub mod frame_block;
pub mod leaves;
pub mod nodes;
pub mod paper;
mod parts;
pub mod passes;
mod picture;
pub mod readback;
pub mod show;
pub mod supersample;
pub mod table;
pub mod vertex;
