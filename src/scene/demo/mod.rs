//! Demo scenes made in code.
