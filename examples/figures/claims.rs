//! The paper's claims, each measured here and judged by a threshold that stands beside it.

use glam::{Affine2, Vec2};
use vertex_tracing::error::Result;
use vertex_tracing::frame::Frame;
use vertex_tracing::options::{Equation, Mode, Reconstruction};
use vertex_tracing::scene::Scene;
use vertex_tracing::scene::demo::{Demo, stress};

use crate::lab::{Effort, FULL_QUALITY, Lab, options};

const FULL: (u32, u32) = (1280, 1024);
const HALF: (u32, u32) = (640, 512);
const PAPER: Reconstruction = Reconstruction::Paper;

/// A claim and what was found.
pub struct Claim {
    /// What the paper says, and where.
    pub claim: &'static str,
    /// What was measured here, in numbers.
    pub measured: String,
    /// By what it is judged.
    pub judged: &'static str,
    pub holds: bool,
}

/// Every claim of the paper that can be measured.
pub fn all(lab: &Lab) -> Result<Vec<Claim>> {
    let mut claims = speed(lab)?;
    claims.extend([pixels(lab)?, complexity(lab)?, textures(lab)?, mirrored_textures(lab)?]);
    claims.extend(visibility(lab)?);
    claims.extend(passes(lab)?);
    claims.push(distortion(lab)?);
    Ok(claims)
}

fn speed(lab: &Lab) -> Result<Vec<Claim>> {
    let scene = Demo::Cup.scene();
    let preview = lab.measure(&scene, &options(FULL, PAPER, Effort::Preview))?;
    let full = lab.measure(&scene, &options(FULL, PAPER, Effort::Samples(FULL_QUALITY)))?;
    let conventional = lab.conventional(&scene, &options(FULL, PAPER, Effort::Preview))?;
    let claim = |claim, judged, frame: &Frame, wanted: f64| {
        let factor = conventional.ms / frame.stats.time_ms.frame;
        let measured = format!(
            "{factor:.1}×: {:.0} ms with {} samples and {} rays, conventional {:.0} ms with {} rays",
            frame.stats.time_ms.frame,
            frame.stats.vertices,
            frame.stats.rays.total,
            conventional.ms,
            conventional.rays
        );
        Claim { claim, measured, judged, holds: factor >= wanted }
    };
    let rays = conventional.rays as f64 / full.stats.rays.total as f64;
    let (samples, pixels) = (full.stats.vertices, f64::from(FULL.0) * f64::from(FULL.1));
    Ok(vec![
        claim(
            "The cup's preview is 98 times as fast as conventional ray tracing (§5: 130 ms to 12.7 s)",
            "at least 98×",
            &preview,
            98.0,
        ),
        claim(
            "The cup in full quality is 8.5 times as fast as conventional ray tracing (§5: 1.5 s to 12.7 s)",
            "at least 8.5×",
            &full,
            8.5,
        ),
        Claim {
            claim: "Vertex tracing significantly reduces the number of samples (§5)",
            measured: format!(
                "{samples} samples for {pixels} pixels; conventional ray tracing casts {rays:.1} times as many rays"
            ),
            judged: "at most a tenth as many samples as pixels, and fewer rays",
            holds: samples as f64 * 10.0 <= pixels && rays > 1.0,
        },
    ])
}

fn pixels(lab: &Lab) -> Result<Claim> {
    let scene = Demo::Cup.scene();
    let measure = |size| -> Result<(f64, f64, f64)> {
        let frame = lab.measure(&scene, &options(size, PAPER, Effort::Error(3.0)))?;
        let conventional = lab.conventional(&scene, &options(size, PAPER, Effort::Preview))?;
        Ok((frame.stats.rays.total as f64, frame.stats.time_ms.frame, conventional.ms))
    };
    let ((rays, ms, conventional), (more_rays, more_ms, more_conventional)) =
        (measure(HALF)?, measure(FULL)?);
    Ok(Claim {
        claim: "Run time is sub-linear in the number of pixels, where ray tracing's is linear (§3)",
        measured: format!(
            "4 times the pixels, to the same error of 3 pixels: {:.2} times the rays, {:.2} times the time; \
             conventional {:.2} times the time",
            more_rays / rays,
            more_ms / ms,
            more_conventional / conventional
        ),
        judged: "less than 3.6 times the time",
        holds: more_ms / ms < 3.6,
    })
}

fn complexity(lab: &Lab) -> Result<Claim> {
    let measure = |faces| -> Result<(f64, f64, f64)> {
        let scene = stress::wavy_mirror(faces)?;
        let preview = options(HALF, PAPER, Effort::Preview);
        let frame = lab.measure(&scene, &preview)?;
        let times = frame.stats.time_ms;
        let sampled = times.visibility + times.trace + times.refine;
        Ok((frame.stats.vertices as f64, sampled, lab.conventional(&scene, &preview)?.ms))
    };
    let ((samples, ms, conventional), (more, more_ms, more_conventional)) =
        (measure(4_000)?, measure(64_000)?);
    let exponent = |ratio: f64| ratio.ln() / 16_f64.ln();
    Ok(Claim {
        claim: "Vertex tracing scales linearly with scene complexity, ray tracing sub-linearly (§3)",
        measured: format!(
            "preview of 16 times the faces: {:.1} times the samples and {:.1} times the time until they are \
             traced (exponent {:.2}); conventional {:.1} times the time (exponent {:.2})",
            more / samples,
            more_ms / ms,
            exponent(more_ms / ms),
            more_conventional / conventional,
            exponent(more_conventional / conventional)
        ),
        judged: "exponent from 0.75 to 1.25 for vertex tracing, below 0.75 for ray tracing",
        holds: (0.75..=1.25).contains(&exponent(more_ms / ms))
            && exponent(more_conventional / conventional) < 0.75,
    })
}

fn without_textures(mut scene: Scene) -> Scene {
    for material in &mut scene.materials {
        material.base_color_texture = None;
    }
    scene
}

fn textures(lab: &Lab) -> Result<Claim> {
    let preview = options(FULL, PAPER, Effort::Preview);
    let with = lab.measure(&Demo::Cup.scene(), &preview)?.stats;
    let without = lab.measure(&without_textures(Demo::Cup.scene()), &preview)?.stats;
    Ok(Claim {
        claim: "The preview takes as long with textures as without (§5)",
        measured: format!(
            "{} samples and {} rays in {:.0} ms with textures, {} and {} in {:.0} ms without",
            with.vertices,
            with.rays.total,
            with.time_ms.frame,
            without.vertices,
            without.rays.total,
            without.time_ms.frame
        ),
        judged: "the same samples and rays, and at most 1.1 times the time",
        holds: with.vertices == without.vertices
            && with.rays.total == without.rays.total
            && with.time_ms.frame <= 1.1 * without.time_ms.frame,
    })
}

/// `scene` with every texture eight times as fine.
fn finer_textures(mut scene: Scene) -> Scene {
    for slot in scene.materials.iter_mut().filter_map(|material| material.base_color_texture.as_mut()) {
        slot.transform = Affine2::from_scale(Vec2::splat(8.0)) * slot.transform;
    }
    scene
}

fn mirrored_textures(lab: &Lab) -> Result<Claim> {
    let effort = options(HALF, PAPER, Effort::Error(3.0));
    let coarse = lab.frame(&Demo::Sphere.scene(), &effort)?.stats.vertices;
    let fine = lab.frame(&finer_textures(Demo::Sphere.scene()), &effort)?.stats.vertices;
    Ok(Claim {
        claim: "Despite a texture's radiance variance, no denser sampling is necessary for its reflection (§5)",
        measured: format!(
            "mirror sphere over the chessboard, to the same error of 3 pixels: {coarse} samples, and {fine} where \
             the chessboard has 64 times as many squares (no texel is looked at, but displacements are weighed \
             by what they change in the texture)"
        ),
        judged: "at most 1.1 times the samples",
        holds: fine as f64 <= 1.1 * coarse as f64,
    })
}

fn visibility(lab: &Lab) -> Result<Vec<Claim>> {
    let preview = options((1024, 768), PAPER, Effort::Preview);
    let stats = lab.measure(&Demo::Cup.scene(), &preview)?.stats;
    let times = stats.time_ms;
    let draw_time = |faces| -> Result<f64> {
        Ok(lab.measure(&stress::wavy_mirror(faces)?, &preview)?.stats.time_ms.visibility)
    };
    let growth = draw_time(256_000)? / draw_time(32_000)?;
    Ok(vec![
        Claim {
            claim: "Reading the buffer back is the bottleneck of the visibility test, 20–40 ms at 1024×768 (§5)",
            measured: format!(
                "readback {:.2} ms ({} bytes, {} memory), drawing {:.2} ms, scan {:.2} ms",
                times.readback,
                stats.readback.bytes,
                stats.readback.memory.unwrap_or_default(),
                times.visibility,
                times.scan
            ),
            judged: "readback takes longer than drawing and scan together",
            holds: times.readback > times.visibility + times.scan,
        },
        Claim {
            claim: "The scan takes less than 10 ms at 1024×768 and less than the readback (§5)",
            measured: format!("scan {:.2} ms, readback {:.2} ms", times.scan, times.readback),
            judged: "both",
            holds: times.scan < 10.0 && times.scan < times.readback,
        },
        Claim {
            claim: "Without culling, the visibility test's rendering time grows linearly with the scene (§5)",
            measured: format!("8 times the faces: {growth:.1} times the time"),
            judged: "exponent from 0.75 to 1.25",
            holds: (0.75..=1.25).contains(&(growth.ln() / 8_f64.ln())),
        },
    ])
}

fn passes(lab: &Lab) -> Result<Vec<Claim>> {
    let scene = Demo::CupAndGlass.scene();
    let measure = |mode, equation| -> Result<(usize, f64)> {
        let mut options = options(FULL, PAPER, Effort::Samples(20_000));
        (options.method.mode, options.method.equation) = (mode, equation);
        options.everything = true;
        let passes = lab.measure(&scene, &options)?.stats.passes;
        Ok((passes.len(), passes.iter().map(|pass| pass.ms).sum()))
    };
    let one = measure(Mode::MultiTexture, Equation::Three)?;
    let claim = |claim, equation| -> Result<Claim> {
        let several = measure(Mode::MultiPass, equation)?;
        Ok(Claim {
            claim,
            measured: format!("{} pass {:.1} ms, {} passes {:.1} ms", one.0, one.1, several.0, several.1),
            judged: "one pass takes less time on the device",
            holds: one.0 == 1 && one.1 < several.1,
        })
    };
    Ok(vec![
        claim("One multi-texture pass beats the three passes of Eq. 4 (§4.2)", Equation::Four)?,
        claim("One multi-texture pass beats the five passes of Eq. 3 (§4.1, §4.2)", Equation::Three)?,
    ])
}

fn distortion(lab: &Lab) -> Result<Claim> {
    let scene = Demo::Cup.scene();
    let conventional = lab.conventional(&scene, &options(HALF, PAPER, Effort::Preview))?;
    let psnr = |effort| -> Result<f64> {
        conventional.psnr(&lab.frame(&scene, &options(HALF, PAPER, effort))?.image)
    };
    let (few, more, many) =
        (psnr(Effort::Preview)?, psnr(Effort::Samples(6_000))?, psnr(Effort::Samples(24_000))?);
    Ok(Claim {
        claim: "Reflected textures are distorted, the more so the fewer the samples (§5, Fig. 9)",
        measured: format!(
            "{few:.1} dB in the preview, {more:.1} dB with 6000 samples, {many:.1} dB with 24000"
        ),
        judged: "each is below the next",
        holds: few < more && more < many,
    })
}
