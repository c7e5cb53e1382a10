//! What the colour passes draw into, and its way to the host.

use std::sync::Arc;

use crate::error::Result;
use crate::gpu::{
    ColorTarget, DepthTarget, Draws, Format, Gpu, Image, ImageDesc, ReadbackBuffer, ReadbackChoice,
    Recording, Targets,
};

/// Bytes of images up to which pixels are divided into fragments of one draw.
const MOST_BYTES: u64 = 1 << 30;

/// Bytes of an image that go to the host at once: few enough to be converted while they are in the processor's caches.
const BAND_BYTES: u64 = 4 << 20;

/// What a target is made for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TargetDesc {
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// How often the side of a pixel is halved.
    pub halvings: u32,
    /// Coverage samples of a fragment.
    pub samples: u32,
    /// Format of the depth image.
    pub depth: Format,
    /// Whether it is for the plain picture beside the frame's own.
    pub is_plain: bool,
}

impl TargetDesc {
    /// Bytes of all images, and of the staging buffer.
    pub fn bytes(&self) -> u64 {
        let multisampled = if self.samples > 1 { self.multisampled().bytes() } else { 0 };
        let mean = if self.halvings > 0 { self.mean().bytes() } else { 0 };
        let color = self.color().bytes();
        color + mean + multisampled + self.depth_image().bytes() + self.staging_bytes()
    }

    /// Bytes of the staging buffer: of the whole image where its codes are scanned.
    fn staging_bytes(&self) -> u64 {
        let image = self.mean().bytes();
        let band = BAND_BYTES.max(image / u64::from(self.height.max(1)));
        if self.depth.has_stencil() { image } else { image.min(band) }
    }

    /// The same with four times as many fragments, unless they had better be drawn in turns.
    pub fn halved(self) -> Option<Self> {
        let halved = Self { halvings: self.halvings + 1, ..self };
        (halved.bytes() <= MOST_BYTES).then_some(halved)
    }

    fn mean(&self) -> ImageDesc<'static> {
        ImageDesc::texture("mean color", Format::Rgba16f, (self.width, self.height), 1, false)
    }

    fn image<'n>(&self, name: &'n str, format: Format) -> ImageDesc<'n> {
        ImageDesc::target(name, format, self.width << self.halvings, self.height << self.halvings)
    }

    fn color(&self) -> ImageDesc<'static> {
        self.image(if self.is_plain { "plain color" } else { "color" }, Format::Rgba16f)
    }

    fn depth_image(&self) -> ImageDesc<'static> {
        self.image(if self.is_plain { "plain depth" } else { "depth" }, self.depth).with_samples(self.samples)
    }

    fn multisampled(&self) -> ImageDesc<'static> {
        self.image("multisampled color", Format::Rgba16f).with_samples(self.samples)
    }
}

/// Images of a size, all of one frame.
pub(super) struct Target {
    pub desc: TargetDesc,
    /// Of the fragments.
    pub color: Image,
    /// Means over the fragments of each pixel, where there are several.
    pub mean: Option<Image>,
    multisampled: Option<Image>,
    pub depth: Image,
    pub staging: ReadbackBuffer,
}

impl Target {
    /// Whether the device has images of this size.
    pub fn is_possible(gpu: &Gpu, desc: &TargetDesc) -> bool {
        [desc.color(), desc.multisampled(), desc.depth_image()]
            .iter()
            .all(|image| Image::is_supported(gpu, image))
    }

    /// Makes the images; their content is undefined.
    ///
    /// # Errors
    /// A size that the device does not support; no memory left.
    pub fn new(gpu: &Arc<Gpu>, desc: TargetDesc) -> Result<Self> {
        let color = Image::new(gpu, &desc.color())?;
        let mean = (desc.halvings > 0).then(|| Image::new(gpu, &desc.mean())).transpose()?;
        let multisampled = (desc.samples > 1).then(|| Image::new(gpu, &desc.multisampled())).transpose()?;
        let depth = Image::new(gpu, &desc.depth_image())?;
        let name = if desc.is_plain { "plain staging" } else { "image staging" };
        let staging = ReadbackBuffer::new(gpu, name, desc.staging_bytes(), ReadbackChoice::Best)?;
        Ok(Self { desc, color, mean, multisampled, depth, staging })
    }

    /// What is read: a texel for each pixel.
    pub fn picture(&self) -> &Image {
        self.mean.as_ref().unwrap_or(&self.color)
    }

    /// Records `work` as draws into it: into what is there, or upon the colour `clear` and nothing nearer than infinity.
    pub fn render<'a>(
        &self,
        recording: &mut Recording<'a>,
        clear: Option<[f32; 4]>,
        work: impl FnOnce(&mut Draws<'_, 'a>),
    ) {
        let color = match &self.multisampled {
            None => ColorTarget { image: &self.color, clear, resolve: None },
            Some(image) => ColorTarget { image, clear, resolve: Some(&self.color) },
        };
        let depth = Some(DepthTarget { image: &self.depth, clear: clear.is_some() });
        recording.render(&Targets { colors: &[color], depth }, work);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_so_many_fragments_are_drawn_at_once() {
        let desc = |width, height, samples| {
            let depth = Format::Depth32f;
            TargetDesc { width, height, halvings: 0, samples, depth, is_plain: false }.halved()
        };
        assert_eq!(desc(3840, 2160, 1).map(|desc| desc.halvings), Some(1));
        assert_eq!(desc(3840, 2160, 4), None);
        assert_eq!(desc(16384, 16384, 1), None);
        assert!(desc(1, 1, 4).is_some());
    }
}
