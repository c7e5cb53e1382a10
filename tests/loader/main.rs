//! The glTF loader: what a file must come out as, and what each known trap must end in.
//!
//! All files are made here, so that each test shows the few bytes that matter.

mod features;
mod hostile;
mod materials;
mod model;
