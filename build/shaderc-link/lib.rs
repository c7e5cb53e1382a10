//! Carries the link directives of its build script into the crate that calls [`link`].

/// Keeps this crate, and with it the libraries it names, in the caller's link.
pub fn link() {}
