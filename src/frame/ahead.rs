//! Frames whose images are read while the next frame is made.

use super::{Frame, Renderer};
use crate::error::Result;
use crate::reconstruct::readback::PendingImage;
use crate::reconstruct::show::Overlay;
use crate::report::image::FloatImage;
use crate::report::stats::Stats;
use crate::scene::View;

/// A frame whose image may be on its way to the host.
pub struct Ahead {
    /// `None` where nothing was drawn at all.
    image: Option<Delivery>,
    overlay: Option<Overlay>,
    stats: Stats,
}

enum Delivery {
    Pending(PendingImage),
    Done(FloatImage),
}

/// A frame whose image is still on the device, unless the host had a part in it.
pub(super) struct Undelivered {
    /// The mean of several draws, or what was traced again.
    pub image: Option<FloatImage>,
    pub overlay: Option<Overlay>,
    pub stats: Stats,
}

impl Renderer<'_> {
    /// As [`render`](Self::render), but the image may still be on its way to the host: it can be waited for, and the
    /// next frame be rendered, on different threads.
    ///
    /// # Errors
    /// No device memory left; a lost device.
    pub fn render_ahead(&mut self, view: &View) -> Result<Ahead> {
        let Undelivered { image, overlay, stats } = self.draw(view, None)?;
        let image = match image {
            None => self.painted.painter.start_reading()?.map(Delivery::Pending),
            Some(image) => Some(Delivery::Done(image)),
        };
        Ok(Ahead { image, overlay, stats })
    }
}

/// The picture that is asked for: of the image, or over it.
pub(super) fn overlaid(image: FloatImage, overlay: Option<Overlay>) -> FloatImage {
    match overlay {
        Some(overlay) => overlay.over(&image),
        None => image,
    }
}

impl Ahead {
    /// What it took.
    pub fn stats(&self) -> &Stats {
        &self.stats
    }

    /// Waits for the image.
    ///
    /// # Errors
    /// A lost device.
    pub fn finish(self) -> Result<Frame> {
        let image = match self.image {
            Some(Delivery::Pending(pending)) => pending.finish()?,
            Some(Delivery::Done(image)) => image,
            None => FloatImage { width: 0, height: 0, pixels: Vec::new() },
        };
        Ok(Frame { image: overlaid(image, self.overlay), stats: self.stats })
    }
}
