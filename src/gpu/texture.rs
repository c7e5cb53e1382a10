//! Array textures with mip levels, uploaded from slices.

use super::{Format, Image, ImageDesc, Uploads};
use crate::error::Result;

impl Uploads {
    /// A `sampler2DArray` texture whose layers hold `layers`, each `width · height` texels of `format`, row by
    /// row from the top; all mip levels, by repeated halving, if `mipped`. Ready for shaders once
    /// [`flush`](Self::flush)ed.
    ///
    /// # Errors
    /// A size that the device does not support; no memory left.
    ///
    /// # Panics
    /// If a layer has the wrong length.
    pub fn texture(
        &mut self,
        name: &str,
        format: Format,
        size: (u32, u32),
        layers: &[&[u8]],
        mipped: bool,
    ) -> Result<Image> {
        let desc = ImageDesc::texture(name, format, size, layers.len() as u32, mipped);
        let image = Image::new(self.gpu(), &desc)?;
        for (layer, texels) in (0..).zip(layers) {
            assert_eq!(texels.len() as u64, image.bytes(), "{name}: texels of layer {layer}");
            self.write_layer(&image, layer, texels)?;
        }
        self.make_mips(&image);
        Ok(image)
    }
}
