//! What a preview looks into: large faces, whose corners say little of them.

use super::Refiner;
use super::footprint::Footprint;
use super::judge::State;
use crate::options::{EffortOptions, Reconstruction};
use crate::scene::View;

/// Longest edge of a face that the preview shows, as a share of the image's longer side.
const PREVIEW_SHARE: f32 = 0.08;

impl Refiner<'_> {
    /// Bisects the large faces until none is left, or `effort`'s samples are spent, half of them where they are spared, so that
    /// the preview shows what they show: corners of a mirror that are hidden in its frame say nothing of it, and corners of a
    /// floor nothing of the shadows on it.
    pub fn open_large(&mut self, effort: &EffortOptions) {
        if self.predictor.reconstruction == Reconstruction::Paper {
            return;
        }
        let half = effort.spared_samples().map(|most| most / 2);
        let most_samples = half.or(effort.max_samples).unwrap_or(u64::MAX);
        let View { width, height, .. } = *self.context.view;
        let longest = PREVIEW_SHARE * width.max(height) as f32;
        loop {
            let is_large = |&face: &u32| {
                let State { size, pixels, traced, .. } = self.state[face as usize];
                size > longest && pixels > 0.0 && !traced && self.is_in_frame(face)
            };
            let large: Vec<u32> = self.mesh.leaves().filter(is_large).collect();
            if large.is_empty() || self.cost() >= most_samples {
                return;
            }
            let mut splits = Vec::new();
            for face in large {
                // It may have been bisected for a neighbour's sake.
                if self.mesh.faces[face as usize].is_leaf() {
                    self.mesh.bisect(face, &mut splits);
                }
            }
            self.take(splits);
        }
    }

    /// Whether the face reaches into the frame, if no image says it.
    fn is_in_frame(&self, face: u32) -> bool {
        self.shown.ids.is_some() || !Footprint::new(&self.mesh, self.context.view, face).is_empty()
    }
}
