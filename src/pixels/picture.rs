//! Pixels that are traced beside the refined mesh, and drawn before it as one picture.

use std::sync::atomic::AtomicBool;

use super::HalfRadiance;
use super::direct::Direct;
use super::store::PixelStore;
use super::veils::Veils;
use crate::error::Result;
use crate::options::Options;
use crate::scene::{Scene, View};
use crate::trace::Rays;
use crate::trace::sample::Context;
use crate::visibility::{Found, IdImage};

/// Roundings of the eye's largest coordinate before the eye at which the picture is drawn, at least: nearer its corners would not
/// be where they should, and what stands nearer hides it.
const NEAREST: f32 = 4096.0 * f32::EPSILON;

/// Least depth before the eye, along the view's axis, at which a picture can be drawn.
pub(super) fn nearest_depth(view: &View) -> f32 {
    (view.eye.abs().max_element() * NEAREST).max(2.0 * view.near)
}

/// A pixel of the picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PicturePixel {
    /// `y · width + x`.
    pub index: u32,
    /// Linear radiance.
    pub radiance: HalfRadiance,
}

/// What is traced beside the mesh.
#[derive(Debug, Default)]
pub struct Subject {
    /// Faces that the mesh need not know.
    pub direct: Direct,
    /// What is blended.
    pub veils: Veils,
    /// Whether something is that is not among it.
    blends: bool,
}

/// Its pixels.
#[derive(Debug, Default)]
pub struct Picture {
    /// Each of them once.
    pub pixels: Vec<PicturePixel>,
    /// Depth before the eye, along the view's axis, at which they are drawn: before all that they hide.
    pub depth: f32,
    /// The depths of what they show, if something is drawn among it and blended; else none.
    pub depths: Vec<f32>,
    /// Whether all that is blended is among them.
    pub veiled: bool,
    /// How many show faces of the refined kind, and count as samples.
    pub direct: u64,
    /// Rays that they took.
    pub rays: Rays,
}

impl Subject {
    /// That of `view`, in which `found` is visible; what is blended only where it `is_veiled`.
    pub fn find(scene: &Scene, view: &View, found: &Found, options: &Options, is_veiled: bool) -> Self {
        let veils = if is_veiled { Veils::find(scene, view) } else { Veils::default() };
        let blends = !is_veiled && scene.objects.iter().any(|object| scene.is_veil(object));
        Self { direct: Direct::find(scene, view, found, options), veils, blends }
    }

    /// Traces it: of each kind about as many pixels as `most`, if there are more. Pixels of faces that `store` knows are not
    /// traced, and it learns the others.
    ///
    /// # Errors
    /// [`Error::Interrupted`](crate::error::Error::Interrupted) once `interrupt` is set.
    pub fn trace(
        &self,
        context: &Context,
        ids: Option<IdImage>,
        most: u64,
        store: Option<&mut PixelStore>,
        interrupt: &AtomicBool,
    ) -> Result<Picture> {
        let (mut pixels, rays) = self.direct.trace(context, ids, most, store, interrupt)?;
        let direct = pixels.len() as u64;
        if self.veils.is_empty() {
            // A blended face before what is shown must not be hidden by the picture, and one behind it must be.
            let depths = match ids {
                Some(ids) if self.blends => self.direct.depths(context, ids, &pixels),
                _ => Vec::new(),
            };
            return Ok(Picture { pixels, depth: self.direct.depth, depths, veiled: false, direct, rays });
        }
        let (veiled, veil_rays) = self.veils.trace(context, most, interrupt)?;
        pixels.retain(|pixel| !self.veils.covers(pixel.index));
        pixels.extend(veiled);
        Ok(Picture {
            pixels,
            depth: nearest_depth(context.view),
            depths: Vec::new(),
            veiled: true,
            direct,
            rays: rays + veil_rays,
        })
    }
}
