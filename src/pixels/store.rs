//! Pixels kept from frame to frame: those that are traced again in the same view.

use rustc_hash::FxHashMap;

use super::HalfRadiance;
use crate::scene::View;

/// Pixels of one view that were traced one by one, with the face that each shows: at most those of one image.
#[derive(Debug, Clone, Default)]
pub struct PixelStore {
    view: Option<View>,
    radiance: FxHashMap<u32, (u32, HalfRadiance)>,
}

impl PixelStore {
    /// Forgets pixels of another view than `view`.
    pub fn look_at(&mut self, view: &View) {
        if self.view != Some(*view) {
            *self = Self { view: Some(*view), ..Self::default() };
        }
    }

    /// Forgets everything.
    pub fn clear(&mut self) {
        *self = Self::default();
    }

    /// Radiance of pixel `index`, where it is known and shows `face` of the scene.
    pub fn get(&self, index: u32, face: u32) -> Option<HalfRadiance> {
        self.radiance.get(&index).filter(|(shown, _)| *shown == face).map(|(_, radiance)| *radiance)
    }

    /// Keeps the radiance of pixel `index`, which shows `face` of the scene.
    pub fn insert(&mut self, index: u32, face: u32, radiance: HalfRadiance) {
        self.radiance.insert(index, (face, radiance));
    }
}
