//! Vertex tracing: geometrically exact reflections and refractions of textured surroundings on any
//! Vulkan 1.3 device, without ray tracing hardware.
//!
//! Rays start from the vertices of specular objects, not from pixels. Refinement bisects their faces in
//! object space; of every sample only the *texture coordinates* of what is reflected or transmitted are
//! kept, and the rasteriser looks the textures up. After Ullmann, Preidel, Bruderlin: *Efficient Sampling
//! of Textured Scenes in Vertex Tracing* (2003).
//!
//! A frame is a script of stages ([`frame`]), each a room of its own, and data flows one way through them:
//!
//! | paper | what | room |
//! |---|---|---|
//! | §4, Fig. 5 | VT objects and ordinary ones, planar patches, textures | [`scene`] |
//! | §3.1, Fig. 3 | ID buffer, readback, visible faces with their pixel counts | [`visibility`] |
//! | §4, Eq. 1–2 | local component, reflection and transmission, samples at vertices | [`trace`] |
//! | §3, Fig. 1–2 | adaptive refinement in object space | [`refine`] |
//! | | pixels where samples of vertices do not serve, traced one by one | [`pixels`] |
//! | §4, Fig. 5–6 | defined and undefined faces, interpolated coordinates | [`reconstruct::paper`] |
//! | §5, Fig. 9 | coordinates without the paper's distortion: rays followed per fragment | [`reconstruct::nodes`] |
//! | §4.1, §4.2, Eq. 3–4 | one multi-texture pass, or blended passes | [`reconstruct::passes`] |
//! | §5 | counts, times, and the error against a conventional tracer | [`report`], [`trace::reference`] |
//!
//! [`plan`] decides beforehand which stages, passes and buffers a frame needs; [`gpu`] is the only room that
//! talks to Vulkan, and the only one with `unsafe`.
//!
//! ```no_run
//! use vertex_tracing::{frame::Renderer, gpu::{self, Gpu}, options::Options};
//!
//! let options = Options::default();
//! let (scene, view) = options.load("assets/cup.glb".as_ref())?;
//! let gpu = Gpu::new(&gpu::Options::default())?;
//! let frame = Renderer::new(&gpu, &scene, &options)?.render(&view)?;
//! println!("{} samples, {} rays", frame.stats.samples, frame.stats.rays.total);
//! # Ok::<(), vertex_tracing::error::Error>(())
//! ```
//!
//! Scenes are built in code by [`scene::demo::SceneBuilder`].

#![deny(unsafe_code)]

#[cfg(feature = "cli")]
pub mod cli;
pub mod constants;
pub mod error;
pub mod frame;
pub mod gpu;
mod memory;
pub mod options;
pub mod pixels;
pub mod plan;
pub mod reconstruct;
pub mod refine;
pub mod report;
pub mod scene;
pub mod trace;
#[cfg(feature = "view")]
pub mod view;
pub mod visibility;

/// The vectors and matrices of the public interface.
pub use glam;
