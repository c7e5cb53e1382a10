//! Pixels that are traced beside the refined mesh, and drawn before it as one picture.

use std::borrow::Cow;
use std::sync::atomic::AtomicBool;

use super::HalfRadiance;
use super::direct::Direct;
use super::store::PixelStore;
use super::veils::Veils;
use crate::error::Result;
use crate::options::{EffortOptions, Options};
use crate::scene::{Scene, View};
use crate::trace::Rays;
use crate::trace::sample::Context;
use crate::visibility::{Class, Found, IdImage};

/// The part of the samples allowed, where they are spared, that pixels of what is blended may take.
const VEILS_SHARE: u64 = 4;

/// Pixels of what is blended up to which a frame of this effort traces them: none where it has to be quick, for they take some
/// times as long as to be drawn, nor where its samples are to make what a quick one shows.
pub fn most_veils(effort: &EffortOptions) -> u64 {
    match effort.spared_samples() {
        Some(most) => most / VEILS_SHARE,
        None if effort.preview || effort.is_limited() => 0,
        None => u64::MAX,
    }
}

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
    /// Whether something is drawn and blended, not traced.
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
    /// How many show what is blended.
    pub veils: u64,
    /// How many show faces of the refined kind, and count as samples.
    pub direct: u64,
    /// Rays that they took.
    pub rays: Rays,
}

impl Subject {
    /// That of `view`, in which `found` is visible; what is blended only if it covers no more than `most_veils` pixels.
    pub fn find(scene: &Scene, view: &View, found: &Found, options: &Options, most_veils: u64) -> Self {
        let veils = (most_veils > 0).then(|| Veils::find(scene, view));
        let veils = veils.filter(|veils| veils.pixels <= most_veils);
        let blends = veils.is_none() && scene.objects.iter().any(|object| scene.is_veil(object));
        let veils = veils.unwrap_or_default();
        let direct = Direct::find(scene, view, found, options, |face| !veils.holds(scene, face));
        Self { direct, veils, blends }
    }

    /// Whether the mesh need not know `face`.
    pub fn holds(&self, scene: &Scene, face: u32) -> bool {
        self.direct.is(face) || self.veils.holds(scene, face)
    }

    /// `classes` for finding the faces around the others: beside these, faces that own no pixel are not worth the samples of
    /// their corners.
    pub fn without<'c>(&self, classes: &'c [Class]) -> Cow<'c, [Class]> {
        let mut classes = Cow::Borrowed(classes);
        for &object in self.direct.objects.iter().chain(&self.veils.specular) {
            classes.to_mut()[object as usize] = Class::Occluder;
        }
        classes
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
            return Ok(Picture {
                pixels,
                depth: self.direct.depth,
                depths,
                veiled: false,
                veils: 0,
                direct,
                rays,
            });
        }
        let (veiled, veil_rays) = self.veils.trace(context, most, interrupt)?;
        let veils = veiled.len() as u64;
        pixels.retain(|pixel| !self.veils.covers(pixel.index));
        pixels.extend(veiled);
        Ok(Picture {
            pixels,
            depth: nearest_depth(context.view),
            depths: Vec::new(),
            veiled: true,
            veils,
            direct,
            rays: rays + veil_rays,
        })
    }
}
