//! What is seen past all faces: a colour that the image is cleared to, or a panorama behind them.

use glam::Vec3;

use super::{Painter, PassOptions};
use crate::constants::MAX_RADIANCE;
use crate::error::Result;
use crate::gpu::{Blend, DepthMode, Format, GraphicsDesc, GraphicsPipeline};
use crate::scene::Background;
use crate::spirv;

/// The colour that an image in front of `background` is cleared to; `None` for a panorama.
pub fn clear_color(background: &Background) -> Option<[f32; 3]> {
    match background {
        Background::Color(color) => {
            Some(color.clamp(Vec3::splat(-MAX_RADIANCE), Vec3::splat(MAX_RADIANCE)).into())
        }
        Background::Environment(_) => None,
    }
}

impl PassOptions {
    /// The colour of an image without faces; alpha is the code of none.
    pub(super) fn clear(&self) -> [f32; 4] {
        let [r, g, b] = self.background.unwrap_or_default();
        [r, g, b, 0.0]
    }
}

impl Painter {
    /// Makes the pipeline that draws the panorama where nothing was drawn, unless it is there or there is no panorama.
    pub(super) fn make_panorama(&mut self) -> Result<()> {
        if self.options.background.is_some() || self.panoramas.contains_key(&self.samples) {
            return Ok(());
        }
        let desc = GraphicsDesc {
            sets: &[&self.layouts[0]],
            colors: &[(Format::Rgba16f, Blend::Replace)],
            depth_format: Some(self.depth_format()),
            depth: DepthMode::Test,
            samples: self.samples,
            ..GraphicsDesc::opaque("background", spirv!("background.vert"), spirv!("background.frag"))
        };
        self.panoramas.insert(self.samples, GraphicsPipeline::new(&self.gpu, &desc)?);
        Ok(())
    }
}
