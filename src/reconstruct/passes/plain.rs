//! The plain picture, of one sample a pixel, and what is drawn in its colours between the centres of pixels.

use std::mem;
use std::ops::Range;

use super::list::LeafList;
use super::{ColorPass, Painter};
use crate::error::Result;
use crate::reconstruct::between::BetweenLeaves;
use crate::reconstruct::drawn::Drawn;
use crate::reconstruct::frame_block::FrameBlock;
use crate::report::image::FloatImage;
use crate::visibility::clusters;

/// Faces between the centres of pixels, as they were handed over.
pub(super) struct Between {
    /// Their vertices, records and blocks.
    pub list: LeafList,
    /// How many, the first ones, the frustum does not clip.
    inside: u32,
    /// How many are drawn.
    pub count: u32,
    /// Whether they take the place of the picture of pixels beside the mesh.
    pub replaces_picture: bool,
}

impl Between {
    /// Ranges of its leaves, each a draw.
    pub fn draws(&self) -> impl Iterator<Item = Range<u32>> {
        let (inside, cut) = (self.inside, self.count);
        clusters::split(0..inside, false).chain(clusters::split(inside..cut, true))
    }
}

impl Painter {
    /// Hands over what only several samples a pixel show, for the draws until it is [forgotten](Self::forget_between); whether
    /// it takes the place of the picture of pixels beside the mesh.
    ///
    /// # Errors
    /// No device memory left; a lost device.
    pub fn upload_between(&mut self, leaves: &BetweenLeaves, replaces_picture: bool) -> Result<()> {
        let parts: [&[u8]; 3] = [
            bytemuck::cast_slice(&leaves.vertices),
            bytemuck::cast_slice(&leaves.leaves),
            bytemuck::cast_slice(&leaves.texels),
        ];
        let bytes = parts.map(|part| part.len() as u64);
        let list = match self.between.take().map(|between| between.list).filter(|list| list.fits(bytes)) {
            Some(list) => list,
            None => LeafList::new(&self.gpu, &self.layouts[1], ("between", true), bytes)?,
        };
        let mut write = list.writer(&mut self.uploads);
        (0..).zip(parts).try_for_each(|(buffer, part)| write(buffer, part))?;
        drop(write);
        self.uploads.flush()?;
        self.between = Some(Between {
            list,
            inside: leaves.inside,
            count: leaves.leaves.len() as u32,
            replaces_picture,
        });
        Ok(())
    }

    /// Draws without it again.
    pub fn forget_between(&mut self) {
        if let Some(between) = &mut self.between {
            (between.inside, between.count, between.replaces_picture) = (0, 0, false);
        }
    }

    /// Draws the plain picture of the frame, of one sample a pixel, and reads it.
    ///
    /// # Errors
    /// No device memory left; a lost device.
    pub fn draw_plain(
        &mut self,
        block: &FrameBlock,
        leaves: Option<&Drawn>,
        passes: &[ColorPass],
    ) -> Result<FloatImage> {
        mem::swap(&mut self.target, &mut self.plain_target);
        let samples = mem::replace(&mut self.samples, 1);
        self.is_plain = true;
        self.fresh_base = None;
        let image = self.draw(block, leaves, passes).and_then(|_| self.read_image());
        self.samples = samples;
        self.is_plain = false;
        mem::swap(&mut self.target, &mut self.plain_target);
        image
    }
}
