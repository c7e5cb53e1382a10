//! What a renderer leaves to the next one of its scene: all that options and lights do not touch.

use std::sync::Arc;
use std::time::Instant;

use super::{Traced, ms};
use crate::constants::MAX_LIGHTS;
use crate::error::Result;
use crate::gpu::{Gpu, Uploads};
use crate::options::{FilterMode, Options, VisibilityWay};
use crate::pixels::store::PixelStore;
use crate::plan::Plan;
use crate::reconstruct::bank::{self, Bank, Wanted};
use crate::reconstruct::base;
use crate::reconstruct::passes::{self, Painter, PassOptions};
use crate::reconstruct::table::SceneTable;
use crate::refine::reserve::Reserve;
use crate::refine::store::SampleStore;
use crate::refine::structure::Structure;
use crate::scene::{Light, Scene};
use crate::trace::pyramid::Pyramids;
use crate::trace::{Hierarchy, Settings, Tracer};
use crate::visibility::{self, Adjacency, Class, Finder};

/// Parts of a [`Renderer`](super::Renderer) that another one of the same scene can go on using.
///
/// The scene may have other lights by then, and nothing else.
#[derive(Default)]
pub struct Kept {
    pub(super) plan: Option<Plan>,
    pub(super) traced: Option<TracedParts>,
    pub(super) finder: Option<((VisibilityWay, Vec<Class>), Finder<'static>)>,
    pub(super) painted: Option<Painted>,
    pub(super) samples: Option<Samples>,
    pub(super) reserve: Reserve,
}

/// [`Traced`] without its scene.
pub(super) struct TracedParts {
    hierarchy: Hierarchy,
    structures: Vec<Structure>,
    adjacency: Adjacency,
    pyramids: Option<Pyramids>,
    bvh_ms: f64,
}

/// Samples of earlier frames, and what they were traced with.
pub(super) struct Samples {
    pub vertices: SampleStore,
    pub pixels: PixelStore,
    traced_with: Option<(Settings, Vec<Light>, f32)>,
    /// Of pixels alone: samples read textures at level 0.
    filtered_by: Option<FilterMode>,
}

/// What draws, and what it was made for.
pub(super) struct Painted {
    pub painter: Painter,
    pub table: SceneTable,
    pub base_textures: Vec<u32>,
    made_for: MadeFor,
}

#[derive(PartialEq)]
struct MadeFor {
    options: PassOptions,
    bank: (Wanted, FilterMode),
    fresnel: bool,
    classes: Option<Vec<Class>>,
}

impl Kept {
    /// What tracing needs of `scene`.
    pub(super) fn traced<'s>(&mut self, scene: &'s Scene, plan: &Plan, filter: FilterMode) -> Traced<'s> {
        let pyramids = Pyramids::new(scene, &plan.textures.textures, filter);
        let classes = visibility::classes(scene, plan.receivers);
        let structures = |known: Vec<Structure>| match plan.specular && known.is_empty() {
            true => Structure::all(scene),
            false => known,
        };
        if let Some(parts) = self.traced.take() {
            let TracedParts { hierarchy, structures: known, adjacency, pyramids: made, bvh_ms } = parts;
            let tracer = Tracer::with(scene, hierarchy);
            let pyramids = pyramids.map(|pyramids| pyramids.or_same(made));
            return Traced { tracer, structures: structures(known), adjacency, classes, pyramids, bvh_ms };
        }
        let started = Instant::now();
        let tracer = Tracer::new(scene);
        let bvh_ms = ms(started);
        let adjacency = Adjacency::new(scene, &plan.topology);
        Traced { tracer, structures: structures(Vec::new()), adjacency, classes, pyramids, bvh_ms }
    }

    /// What finds visible faces of `scene` in the way that `options` say.
    pub(super) fn finder<'s>(
        &mut self,
        gpu: &Arc<Gpu>,
        scene: &'s Scene,
        classes: &[Class],
        way: VisibilityWay,
    ) -> Result<Finder<'s>> {
        match self.finder.take() {
            Some(((its_way, of), finder)) if its_way == way && of == classes => Ok(finder),
            _ => Finder::new(gpu, scene, classes, way),
        }
    }

    /// What draws `scene` as `options` and `plan` say; `classes` are those of a scene that is traced.
    pub(super) fn painted(
        &mut self,
        gpu: &Arc<Gpu>,
        scene: &Scene,
        (options, plan): (&Options, &Plan),
        classes: Option<&[Class]>,
    ) -> Result<Painted> {
        let (method, fresnel) = (&options.method, options.scene.fresnel);
        let single_pass = classes.is_some() && method.visibility == VisibilityWay::SinglePass;
        let pass_options = PassOptions {
            reconstruction: method.reconstruction,
            passes: plan.passes.clone(),
            single_pass,
            equation: method.equation,
            samples: method.msaa.samples(),
            features: plan.features,
            leaves: plan.traces(),
            lights: (scene.lights.len() as u32).min(MAX_LIGHTS),
            background: passes::clear_color(&scene.background),
        };
        let made_for = MadeFor {
            options: pass_options.clone(),
            bank: (plan.textures.clone(), method.filter),
            fresnel,
            classes: classes.map(<[Class]>::to_vec),
        };
        let bank = match self.painted.take() {
            Some(painted) if painted.made_for == made_for => return Ok(painted),
            Some(painted) if painted.made_for.bank == made_for.bank => painted.painter.into_bank(),
            _ => {
                let texels = plan.textures.bytes(scene, method.filter) + bank::panorama_bytes(scene);
                let mut uploads = Uploads::new(gpu, "texture uploads", bank::staging_bytes(texels))?;
                Bank::new(&mut uploads, scene, &plan.textures, method.filter)?
            }
        };
        let table = SceneTable::new(scene, &plan.targets, &bank, fresnel);
        let base_textures: Vec<u32> =
            scene.materials.iter().map(|m| bank.reference(m.base_color_texture)).collect();
        let base = base::faces(scene, &table, plan.vertex_layout(), &base_textures, classes, single_pass);
        let painter = Painter::new(gpu, pass_options, bank, &table, &base)?;
        Ok(Painted { painter, table, base_textures, made_for })
    }
}

impl Traced<'_> {
    pub(super) fn into_parts(self) -> TracedParts {
        let Self { tracer, structures, adjacency, pyramids, bvh_ms, .. } = self;
        TracedParts { hierarchy: tracer.into_hierarchy(), structures, adjacency, pyramids, bvh_ms }
    }
}

impl Samples {
    /// No samples yet; at most about `most_bytes` bytes of them.
    pub fn new(most_bytes: usize) -> Self {
        Self {
            vertices: SampleStore::new(most_bytes),
            pixels: PixelStore::default(),
            traced_with: None,
            filtered_by: None,
        }
    }

    /// Forgets samples that `settings` and the lights of `scene` would not give, and pixels that `filter` would not.
    pub fn trace_with(&mut self, settings: &Settings, scene: &Scene, filter: Option<FilterMode>) {
        let now = (*settings, scene.lights.clone(), scene.ambient);
        if self.traced_with.as_ref() != Some(&now) {
            self.vertices.clear();
            self.pixels.clear();
            self.traced_with = Some(now);
        }
        if self.filtered_by != filter {
            self.pixels.clear();
            self.filtered_by = filter;
        }
    }
}
