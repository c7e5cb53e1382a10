//! Which faces are visible, and on how many pixels (paper §3.1, §5; design §3).
//!
//! [`id_buffer`] draws the faces and reads their IDs back, [`scan`] counts them, and [`ring`] adds the
//! neighbours that are too small to own a pixel.
#![forbid(unsafe_code)]

pub mod draw_list;
pub mod id_buffer;
mod mask;
pub mod ring;
pub mod scan;

pub use draw_list::{Class, DrawList, classes};
pub use id_buffer::{Pass, Times, Visibility};
pub use ring::Adjacency;
pub use scan::{IdImage, VisibleFaces};
