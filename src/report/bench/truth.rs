//! The image that errors are against: many samples a pixel, kept on disk.

use std::path::Path;

use super::fingerprint;
use super::ladder::Rate;
use super::rounds::Observer;
use super::studio::Studio;
use crate::error::{Error, Result};
use crate::report::FloatImage;
use crate::report::output::write_image;
use crate::trace::reference::Following;

/// Traces with `spp` samples a pixel, or reads what an earlier run left in the folder `cache`.
///
/// The file's name tells scene, view, settings and samples apart, by hash; a file that cannot be read is made
/// anew.
///
/// # Errors
/// [`Error::Interrupted`]; [`Error::Io`] if the folder cannot be written to.
pub fn image(studio: &Studio, spp: u32, cache: Option<&Path>, observer: &dyn Observer) -> Result<FloatImage> {
    let trace = || {
        Ok(studio.trace(Rate { spp, side: 1 }, Following::Alone, None, &|share| observer.share(share))?.image)
    };
    let Some(cache) = cache else { return trace() };
    let probe = studio.trace(Rate { spp: 1, side: 4 }, Following::Alone, None, &|_| {})?.image;
    let settings = studio.samples(spp, Following::Alone).settings(&studio.settings);
    let hash = fingerprint::of(studio.scene, &studio.view, &settings, spp, &probe);
    let path = cache.join(format!("reference_{hash:016x}.pfm"));
    let fits = |image: &FloatImage| (image.width, image.height) == (studio.view.width, studio.view.height);
    if let Some(image) = FloatImage::read(&path).ok().filter(fits) {
        return Ok(image);
    }
    let image = trace()?;
    std::fs::create_dir_all(cache).map_err(Error::io(cache))?;
    write_image(&path, &image, 0.0)?;
    Ok(image)
}
