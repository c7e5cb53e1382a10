//! What a frame needs, decided once from scene and options, and what it leaves out.

mod cost;
mod features;
mod needs;
mod recursion;
mod summary;

pub use cost::{Cost, Resource};
pub use summary::{Saved, Summary};

use crate::constants::*;
use crate::options::{FilterMode, Msaa, Options, PixelSamples, Reconstruction, Shadows, Ss};
use crate::reconstruct::bank::Wanted;
use crate::reconstruct::passes::{ColorPass, color_passes};
use crate::reconstruct::vertex::VertexLayout;
use crate::report::stats::LeftOut;
use crate::scene::{Scene, Unread, patch::Targets, topology::Topology};
use needs::{Needs, Used};

/// The stages, passes, textures and shader features of a frame.
#[derive(Debug)]
pub struct Plan {
    /// Whether specular objects are traced.
    pub specular: bool,
    /// Whether diffuse objects are traced for their shadows.
    pub receivers: bool,
    /// Whether pixels of the finished picture are traced again.
    pub smooths: bool,
    /// Most specular bounces of a path.
    pub depth: u32,
    /// Which vertices are one point; empty if no ray is traced.
    pub topology: Topology,
    /// What specular paths can end on; empty if there are none.
    pub targets: Targets,
    /// The colour passes.
    pub passes: Vec<ColorPass>,
    /// Which textures are uploaded.
    pub textures: Wanted,
    /// What shaders are compiled with: bits of `FEATURE_…`.
    pub features: u32,
    /// What is not left out, in words.
    pub used: Vec<String>,
    /// What is left out, and why.
    pub left_out: Vec<LeftOut>,
    /// Whether nothing is.
    everything: bool,
}

impl Plan {
    /// The plan of `scene` under `options`.
    pub fn new(scene: &Scene, options: &Options) -> Self {
        Self::after(None, scene, options)
    }

    /// The same, with what it shares with the plan `before` of the same faces and materials.
    pub fn after(before: Option<Self>, scene: &Scene, options: &Options) -> Self {
        let (topology, targets) = before.map_or_else(Default::default, |plan| (plan.topology, plan.targets));
        let known = (!topology.point.is_empty()).then_some(topology);
        let known_targets = (!targets.targets.is_empty()).then_some(targets);
        let used = Used::of(scene, options.scene.fresnel);
        let mut needs = Needs::new(options.everything);
        let lit = !scene.lights.is_empty();

        // What the file brings and what it lacks.
        for Unread { what, count, of, bytes, why } in &scene.unread {
            let bytes = if *bytes > 0 { format!(", {bytes} bytes") } else { String::new() };
            needs.leave_out(&format!("{count} of {of} {what} of the file{bytes}"), why);
        }
        needs.option(
            scene.ambient == 0.0,
            "light from the camera, ambient light",
            "only a file without lights is given them",
        );

        // Tracing.
        let specular = needs.part(used.specular, "specular tracing", "no object is specular");
        let shadows = lit && options.scene.shadows != Shadows::None && (used.specular || used.lit);
        needs.part(
            shadows,
            "shadow rays",
            if lit { "--shadows none or nothing lit" } else { "the scene has no light" },
        );
        let receivers = needs.part(
            lit && options.scene.shadows == Shadows::All && used.lit,
            "samples of diffuse objects",
            match (options.scene.shadows, lit) {
                (Shadows::All, true) => "no diffuse object is lit",
                (Shadows::All, false) => "the scene has no light that could be hidden from them",
                _ => "--shadows leaves their shadows out",
            },
        );
        let smooths = options.method.pixel_samples != PixelSamples::One;
        let nothing = "nothing is traced: all objects are rasterised in the ordinary way";
        let traces = needs.part(specular || receivers, "ID buffer, readback and refinement", nothing);
        let rays = needs.part(traces || smooths, "bounding volume hierarchy", nothing);
        let topology = match rays {
            true => known.unwrap_or_else(|| Topology::new(&scene.geometry)),
            false => Topology::default(),
        };
        let targets = match specular {
            true => known_targets.unwrap_or_else(|| Targets::new(scene, &topology)),
            false => Targets::default(),
        };
        let mut depth = options.paths.depth;
        if specular {
            let recursive = needs.part(
                depth <= 1 || recursion::can_meet(scene, &topology),
                "paths of more than one bounce",
                "no specular object can see another, or itself",
            );
            depth = if recursive { depth } else { 1 };
            let exact = options.method.reconstruction == Reconstruction::Exact;
            needs.option(
                options.effort.preview || !exact,
                "pixels traced one by one",
                "--preview or --reconstruction paper",
            );
        }

        let passes = wanted_passes(options, &used, specular, &mut needs);
        let features = features::wanted(scene, &used, &targets, specular, &mut needs);
        let textures = wanted_textures(scene, options, &used, traces, &mut needs);
        needs.option(options.method.msaa == Msaa::One, "multisampling", "--msaa 1");
        needs.option(options.method.ss == Ss::One, "supersampling", "--ss 1");
        needs.option(!smooths, "edges traced again", "--pixel-samples 1");
        Self {
            specular,
            receivers,
            smooths,
            depth,
            topology,
            targets,
            passes,
            textures,
            features,
            used: needs.used,
            left_out: needs.left_out,
            everything: options.everything,
        }
    }

    /// The colour passes of a frame in which only `present` components of Eq. 3 are not zero everywhere, and
    /// the others as left out.
    pub fn passes_for(&self, present: u32) -> (Vec<ColorPass>, Vec<LeftOut>) {
        let adds = |pass: &&ColorPass| self.everything || pass.components & present != 0;
        let (drawn, dropped): (Vec<&ColorPass>, _) = self.passes.iter().partition(adds);
        let left_out = |pass: &ColorPass| LeftOut {
            what: format!("{} pass", pass.name),
            why: "its colours are zero at every vertex".into(),
        };
        (drawn.into_iter().copied().collect(), dropped.into_iter().map(left_out).collect())
    }

    /// Whether faces are sampled: hierarchy, visibility, refinement.
    pub fn traces(&self) -> bool {
        self.specular || self.receivers
    }

    /// Whether any ray is traced.
    pub fn has_rays(&self) -> bool {
        self.traces() || self.smooths
    }

    /// Which attributes the vertices of leaves have.
    pub fn vertex_layout(&self) -> VertexLayout {
        VertexLayout::of(self.features)
    }
}

const REFLECTION: u32 = COMPONENT_REFLECTED | COMPONENT_REFLECTED_COMB;
const TRANSMISSION: u32 = COMPONENT_TRANSMITTED | COMPONENT_TRANSMITTED_COMB;

/// The colour passes, without components that no object has; without specular objects the needs say so already.
fn wanted_passes(options: &Options, used: &Used, specular: bool, needs: &mut Needs) -> Vec<ColorPass> {
    let mut absent = 0;
    if specular {
        for (needed, bits, what, why) in [
            (used.reflects, REFLECTION, "reflected texture and its passes", "no specular object reflects"),
            (
                used.transmits,
                TRANSMISSION,
                "transmitted texture and its passes, refraction",
                "no specular object transmits",
            ),
        ] {
            if !needs.part(needed, what, why) {
                absent |= bits;
            }
        }
    } else {
        absent = REFLECTION | TRANSMISSION;
    }
    color_passes(options.method.mode, options.method.equation)
        .iter()
        .map(|pass| ColorPass { components: pass.components & !absent, ..*pass })
        .filter(|pass| pass.components != 0)
        .collect()
}

/// The textures that are uploaded.
fn wanted_textures(scene: &Scene, options: &Options, used: &Used, traces: bool, needs: &mut Needs) -> Wanted {
    let textures = Wanted {
        textures: used.textures.iter().map(|&used| used || options.everything).collect(),
        all_mips: options.everything,
    };
    let unused = used.textures.iter().filter(|used| !**used).count();
    if !used.textures.is_empty() {
        let all = unused == 0 || options.everything;
        let unused = format!("{unused} of {} textures", used.textures.len());
        needs.part(all, if all { "all textures" } else { &unused }, "no material in use shows them");
        let mipped = textures.of(scene).any(|(_, texture)| texture.sampler.mip.is_some());
        let forced = options.method.filter != FilterMode::File;
        needs.part(mipped || forced, "mip levels", "no sampler asks for them");
        let exact = options.method.reconstruction == Reconstruction::Exact;
        if traces && exact && !options.effort.preview {
            let why = "no sampler asks for mip levels";
            needs.part(mipped || forced, "filtering of pixels traced one by one", why);
        }
    }
    textures
}
