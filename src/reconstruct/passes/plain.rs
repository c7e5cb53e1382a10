//! The plain picture, of one sample a pixel, and what is drawn in its colours between the centres of pixels.

use std::mem;
use std::ops::Range;
use std::sync::Arc;

use glam::Vec3;

use super::list::LeafList;
use super::{ColorPass, Painter, Target, depth_format};
use crate::error::Result;
use crate::gpu::{DepthMode, DepthTarget, Gpu, GraphicsDesc, GraphicsPipeline, Recording, Targets};
use crate::reconstruct::between::BetweenLeaves;
use crate::reconstruct::drawn::Drawn;
use crate::reconstruct::frame_block::FrameBlock;
use crate::reconstruct::readback;
use crate::spirv;
use crate::visibility::clusters;

/// Part of the plain picture: left, top, width, height.
pub(super) type Tile = [u32; 4];

/// Pixels along the side of a tile.
const TILE: u32 = 16;

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

    /// Draws the plain picture of the frame, of one sample a pixel, around these `pixels`, and reads their colours.
    ///
    /// # Errors
    /// No device memory left; a lost device.
    pub fn draw_plain(
        &mut self,
        block: &FrameBlock,
        leaves: Option<&Drawn>,
        passes: &[ColorPass],
        pixels: &[u32],
    ) -> Result<Vec<Vec3>> {
        if pixels.is_empty() {
            return Ok(Vec::new());
        }
        // Marks in the stencil say where a single pass draws, in a depth image that is reset.
        if self.plain_opening.is_none() && !self.options.single_pass {
            self.plain_opening = Some(opening(&self.gpu)?);
        }
        mem::swap(&mut self.target, &mut self.plain_target);
        let samples = mem::replace(&mut self.samples, 1);
        self.plain_tiles = Some(tiles([block.width, block.height], pixels));
        self.fresh_base = None;
        let colors = self.draw(block, leaves, passes).and_then(|_| {
            let Self { commands, target, .. } = self;
            let Some(target) = target else { return Ok(Vec::new()) };
            readback::read_pixels(commands, &target.color.clone(), pixels, &mut target.staging)
        });
        self.samples = samples;
        self.plain_tiles = None;
        mem::swap(&mut self.target, &mut self.plain_target);
        colors
    }
}

impl Target {
    /// Lets nothing be drawn outside of `tiles` from now on: all else is as near as can be.
    pub(super) fn open(&self, recording: &mut Recording<'_>, pipeline: &GraphicsPipeline, tiles: &[Tile]) {
        let depth = Some(DepthTarget { image: &self.depth, clear: false });
        recording.render(&Targets { colors: &[], depth }, |draws| {
            draws.pipeline(pipeline).draw_instance(0..3, 1);
            for &tile in tiles {
                draws.scissor(tile).draw(0..3);
            }
        });
    }
}

/// The pipeline of [`Target::open`].
fn opening(gpu: &Arc<Gpu>) -> Result<GraphicsPipeline> {
    GraphicsPipeline::new(
        gpu,
        &GraphicsDesc {
            depth_format: Some(depth_format(false)),
            depth: DepthMode::Replace,
            ..GraphicsDesc::opaque("opening", spirv!("reset_depth.vert"), spirv!("reset_depth.frag"))
        },
    )
}

/// The tiles of an image of this `size` that hold `pixels`, those beside one another as one.
fn tiles([width, height]: [u32; 2], pixels: &[u32]) -> Vec<Tile> {
    let [across, down] = [width, height].map(|size| size.div_ceil(TILE) as usize);
    let mut holds = vec![false; across * down];
    for pixel in pixels {
        let (x, y) = (pixel % width, pixel / width);
        holds[(y / TILE) as usize * across + (x / TILE) as usize] = true;
    }
    let mut tiles = Vec::new();
    for (row, holds) in (0..).zip(holds.chunks(across)) {
        let mut first = 0;
        for run in holds.chunk_by(|a, b| a == b) {
            if run[0] {
                let (left, top) = (first * TILE, row * TILE);
                let right = (left + run.len() as u32 * TILE).min(width);
                tiles.push([left, top, right - left, TILE.min(height - top)]);
            }
            first += run.len() as u32;
        }
    }
    tiles
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_hold_their_pixels_within_the_image() {
        let at = |x: u32, y: u32| y * 40 + x;
        let pixels = [at(0, 0), at(17, 3), at(39, 15), at(3, 16), at(39, 20)];
        assert_eq!(tiles([40, 21], &pixels), [[0, 0, 40, 16], [0, 16, 16, 5], [32, 16, 8, 5]]);
        assert!(tiles([40, 21], &[]).is_empty());
    }
}
