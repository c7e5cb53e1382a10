//! The interactive viewer: a preview at once, refined while the camera rests (paper §3, §5).
//!
//! The window hands input to the viewer, which posts what it wants to the worker, a thread of its own:
//! a frame within the budget while the camera moves, and all refinement steps, shown as they come, while it
//! rests. Whatever is newer ends the refinement of what is older. See docs/viewer.md.

#![forbid(unsafe_code)]

mod artist;
mod asked;
mod camera;
mod canvas;
pub mod command;
mod encode;
mod exchange;
mod inspect;
pub mod keys;
mod output;
mod overlay;
mod pace;
mod pointer;
mod script;
mod timing;
mod viewer;
mod watch;
mod window;
mod worker;

pub use window::run;
pub use worker::Loader;

use std::{path::PathBuf, time::Duration};

use crate::options::Options;

/// What a viewer is opened with.
#[derive(Debug, Clone)]
pub struct Request {
    /// The scene file.
    pub scene: PathBuf,
    /// What `vtrace render` would be told; the image size is that of the window at first.
    pub options: Options,
    /// Time that a frame may take while the camera moves.
    pub budget: Duration,
    /// Pixels of the window along each side of a pixel that is drawn while the camera moves, 1 to 4; as the budget
    /// allows if `None`.
    pub coarse: Option<u32>,
    /// Scale of the shown image, in stops.
    pub exposure: f32,
    /// A file of scripted input.
    pub script: Option<PathBuf>,
}
