//! Further samples of traced pixels, where the pixels around say that one is not enough: as Whitted (1980) has it, in rounds.

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use crate::trace::reference::sample_pattern;
use crate::trace::sample::Context;
use crate::trace::wave::Points;
use crate::trace::{Hit, Rays};

/// Numbers of further samples, and from which difference between a pixel and one beside it they are taken of both: of any
/// channel's square root, none above 1, which is about how displays encode it. Half of it buys a tenth of a decibel with
/// a fifth more time (docs/speed.md).
const ROUNDS: [(u32, f32); 2] = [(4, 0.08), (16, 0.12)];

/// Pixels of which one task takes further samples.
const CHUNK: usize = 256;

/// Which traced pixels are worth further samples, and where these lie.
pub(super) struct Smooth {
    /// By pixel: roots of its radiance; not a number where it is not traced.
    roots: Vec<Vec3>,
    width: u32,
    pattern: Vec<Vec2>,
    rough: f32,
}

/// Takes as many further samples of traced `pixels` as the settings ask for, in rounds: `take` those of some
/// consecutive ones. `seen` says index and radiance of a pixel.
pub(super) fn smooth<P: Send>(
    context: &Context,
    pixels: &mut [P],
    seen: impl Fn(&P) -> (u32, Vec3),
    take: impl Fn(&mut [P], &Smooth) -> Rays + Sync,
) -> Rays {
    let mut rays = Rays::default();
    for (samples, rough) in ROUNDS {
        if samples <= context.settings.pixel_samples {
            let smooth = Smooth::new(context, samples, rough, pixels.iter().map(&seen));
            let parts = pixels.par_chunks_mut(CHUNK).map(|pixels| take(pixels, &smooth));
            rays += parts.reduce(Rays::default, |one, other| one + other);
        }
    }
    rays
}

impl Smooth {
    fn new(context: &Context, samples: u32, rough: f32, pixels: impl Iterator<Item = (u32, Vec3)>) -> Self {
        let mut roots = vec![Vec3::NAN; context.view.pixels()];
        for (index, radiance) in pixels {
            roots[index as usize] = radiance.clamp(Vec3::ZERO, Vec3::ONE).map(f32::sqrt);
        }
        Self { roots, width: context.view.width, pattern: sample_pattern(samples), rough }
    }

    /// Whether traced pixel `index` differs from one beside it, or there is none beside it.
    fn is_rough(&self, index: u32) -> bool {
        let (x, y) = (index % self.width, index / self.width);
        let own = self.roots[index as usize];
        let around = (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| (dx, dy))).filter(|&by| by != (0, 0));
        let beside = around.filter_map(|(dx, dy)| {
            let (x, y) = (x.checked_add_signed(dx)?, y.checked_add_signed(dy)?);
            let other = self.roots.get((y * self.width + x) as usize).filter(|_| x < self.width)?;
            (!other.is_nan()).then(|| (own - *other).abs().max_element())
        });
        beside.reduce(f32::max).is_none_or(|largest| largest > self.rough)
    }

    /// Makes the radiance of each of `pixels`, index and radiance, that is worth it the mean of what was known and of
    /// further samples: `find` says which point a view ray through a point of the image meets, and its direction.
    pub fn sample<'p>(
        &self,
        pixels: impl Iterator<Item = (u32, &'p mut Vec3)>,
        points: &mut Points,
        mut find: impl FnMut(Vec2) -> Option<(Vec3, Hit)>,
    ) {
        let mut found: Vec<(&mut Vec3, usize)> = Vec::new();
        for (index, radiance) in pixels.filter(|&(index, _)| self.is_rough(index)) {
            let corner = Vec2::new((index % self.width) as f32, (index / self.width) as f32);
            let hits = self.pattern.iter().filter_map(|&inside| find(corner + inside));
            found.push((radiance, hits.map(|(direction, hit)| points.add(direction, hit)).count()));
        }
        let mut radiances = points.radiances();
        for (known, count) in found {
            let sum: Vec3 = radiances.by_ref().take(count).sum();
            *known = (*known + sum) / (count + 1) as f32;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_are_rough_on_both_sides() {
        const WIDTH: u32 = 6;
        let (dark, light, off) = (Vec3::splat(0.3), Vec3::splat(0.5), Vec3::NAN);
        let slightly = dark + 0.05;
        #[rustfmt::skip]
        let roots = vec![
            dark, dark, slightly, light, light, dark,
            dark, dark, slightly, light, light, off,
            off,  off,  off,      off,   off,   off,
            off,  off,  light,    off,   off,   off,
        ];
        let smooth = Smooth { roots, width: WIDTH, pattern: Vec::new(), rough: 0.08 };
        let rough = |x: u32, y: u32| smooth.is_rough(y * WIDTH + x);
        assert_eq!([0, 1, 2, 3, 4, 5].map(|x| rough(x, 0)), [false, false, true, true, true, true]);
        assert_eq!([0, 1, 2, 3, 4].map(|x| rough(x, 1)), [false, false, true, true, true]);
        assert!(rough(2, 3), "nothing is known beside it");
    }
}
