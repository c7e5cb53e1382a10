//! `vtrace compare`: the difference between two images.

use std::path::{Path, PathBuf};

use clap::Args;

use super::terminal;
use crate::{
    error::{Error, Result},
    report::{Comparison, Encoding, FloatImage, compare, metrics::first_nan, output::to_json},
};

/// Measure the difference between two images (PNG, JPEG, HDR, EXR or PFM)
///
/// Prints root mean square error, peak signal-to-noise ratio, mean FLIP, the 99th percentile and the
/// maximum of the largest channel difference, and the fraction of pixels where it exceeds 0.1; over values
/// clamped to 0..1 and encoded as sRGB.
#[derive(Debug, Args)]
#[command(after_help = "Example: vtrace compare out/cup_reference.png out/cup.png --json")]
pub struct CompareArgs {
    /// Reference image
    #[arg(value_name = "A")]
    reference: PathBuf,
    /// Image to measure
    #[arg(value_name = "B")]
    image: PathBuf,
    /// Print JSON
    #[arg(long)]
    json: bool,
    /// Measure linear values
    #[arg(long)]
    linear: bool,
    /// Measure only where this image is brighter than half
    #[arg(long, value_name = "VT.png")]
    mask: Option<PathBuf>,
}

pub(super) fn run(args: &CompareArgs) -> Result<()> {
    let reference = FloatImage::read(&args.reference)?;
    let image = FloatImage::read(&args.image)?;
    if (reference.width, reference.height) != (image.width, image.height) {
        return Err(Error::Compare(format!(
            "images differ in size: {} has {}x{} pixels, {} {}x{}",
            args.reference.display(),
            reference.width,
            reference.height,
            args.image.display(),
            image.width,
            image.height
        )));
    }
    let mask = args.mask.as_deref().map(|file| mask_of(file, &reference)).transpose()?;
    for (file, image) in [(&args.reference, &reference), (&args.image, &image)] {
        if let Some((x, y)) = first_nan(image, mask.as_deref()) {
            let problem = format!("pixel ({x}, {y}) is NaN");
            return Err(Error::Image { path: file.clone(), problem });
        }
    }
    let encoding = if args.linear { Encoding::Linear } else { Encoding::Srgb };
    let comparison = compare(&reference, &image, mask.as_deref(), encoding)?;
    if args.json {
        return terminal::print(&to_json(&comparison)?);
    }
    terminal::print(&in_words(&comparison))
}

/// The mask in `file`, of the size of `image`: one of as many pixels in other rows would choose others than it shows.
fn mask_of(file: &Path, image: &FloatImage) -> Result<Vec<bool>> {
    let mask = FloatImage::read(file)?;
    if (mask.width, mask.height) != (image.width, image.height) {
        return Err(Error::Compare(format!(
            "--mask {}: the mask has {}x{} pixels, the images {}x{}",
            file.display(),
            mask.width,
            mask.height,
            image.width,
            image.height
        )));
    }
    Ok(mask.to_mask())
}

fn in_words(comparison: &Comparison) -> String {
    let Comparison { rmse, psnr, flip, p99, max, over_0_1 } = comparison;
    let psnr = psnr.map_or("identical".into(), |psnr| format!("{psnr:.2} dB"));
    format!(
        "rmse      {rmse:.6}\npsnr      {psnr}\nflip      {flip:.6}\np99       {p99:.6}\nmax       {max:.6}\n\
         over 0.1  {:.3} % of the pixels\n",
        over_0_1 * 100.0
    )
}
