//! Host memory that may not be there.
//!
//! An allocation that fails ends the process, and no caller learns of it. So where a file or a picture says how much is
//! taken, it is asked for here first.

use std::hint::black_box;

use crate::error::{Error, Result};

/// What makes a picture, and what is sampled for it, need less.
pub const SMALLER_PICTURE: &str = "a smaller --size needs less";
/// What makes a scene need less.
pub const SMALLER_SCENE: &str = "a model with fewer triangles needs less";
/// What makes images need less.
pub const SMALLER_TEXTURES: &str = "smaller textures need less";

/// Bytes that must be left beside those asked for: for what is too small to be asked for by itself. More than what
/// glibc's malloc could keep for itself once it is given back.
const SPARE: u64 = 64 << 20;

/// Bytes that a face of a scene takes.
pub const FACE_LOADED: u64 = 128;
/// Bytes that a face takes while what tracing needs of it is built.
pub const FACE_TRACED: u64 = 512;

/// Whether `bytes` can be had for `object`, at this moment and with something to spare. They are not kept: libraries,
/// too, take memory without asking.
///
/// # Errors
/// [`Error::HostMemory`], with the `remedy`, unless so little is asked for that it would be none.
pub fn check(bytes: u64, object: &str, remedy: &'static str) -> Result<()> {
    let asked = usize::try_from(bytes.saturating_add(SPARE)).unwrap_or(usize::MAX);
    let mut room: Vec<u8> = Vec::new();
    let had = room.try_reserve_exact(asked);
    // Else the compiler may leave out both the allocation and its failure.
    black_box(&room);
    let remedy = if bytes < SPARE { "next to none is left: free some, or allow more" } else { remedy };
    had.map_err(|_| Error::HostMemory { object: object.into(), bytes, remedy })
}

/// [`check`] for a picture of so many bytes a pixel.
///
/// # Errors
/// As there.
pub fn check_picture(width: u32, height: u32, bytes: u64) -> Result<()> {
    let object = format!("a picture of {width}x{height}");
    check(u64::from(width) * u64::from(height) * bytes, &object, SMALLER_PICTURE)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_cannot_be_had_is_named() {
        assert!(check(1 << 20, "little", SMALLER_PICTURE).is_ok());
        for bytes in [1 << 62, u64::MAX] {
            let refused = check(bytes, "a picture of 2x1", SMALLER_PICTURE).unwrap_err().to_string();
            let mib = bytes as f64 / f64::from(1 << 20);
            let expected = format!(
                "memory for a picture of 2x1: {mib:.1} MiB could not be had; a smaller --size needs less"
            );
            assert_eq!(refused, expected);
        }
    }
}
