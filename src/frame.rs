//! One frame, from camera to finished image: a script of the stages (design §1).

use std::sync::Arc;
use std::time::Instant;

use crate::constants::MAX_LIGHTS;
use crate::error::Result;
use crate::gpu::{Gpu, Uploads};
use crate::options::{Msaa, Options, Ss, VisibilityWay};
use crate::plan::Plan;
use crate::reconstruct::bank::Bank;
use crate::reconstruct::frame_block::FrameBlock;
use crate::reconstruct::leaves::{self, Leaves};
use crate::reconstruct::nodes::Matcher;
use crate::reconstruct::passes::{BaseDraw, BaseFaces, Painter, PassOptions};
use crate::reconstruct::table::SceneTable;
use crate::refine::mesh::Mesh;
use crate::refine::pixels::Shown;
use crate::refine::predict::Predictor;
use crate::refine::{Refiner, StoppedBy, pixels};
use crate::report::image::FloatImage;
use crate::report::stats::{self, Stats};
use crate::scene::patch::Targets;
use crate::scene::structure::Structure;
use crate::scene::topology::Topology;
use crate::scene::{AlphaMode, Scene, View};
use crate::trace::sample::Context;
use crate::trace::{Rays, Settings, Tracer};
use crate::visibility::single_pass::CodedImage;
use crate::visibility::{self, Adjacency, Class, Finder, Found, single_pass};

/// Bytes of the staging buffer that textures are uploaded through.
const TEXTURE_STAGING: u64 = 32 << 20;

/// What tracing needs of a scene, whatever the view: absent if nothing is traced.
struct Traced<'s> {
    tracer: Tracer<'s>,
    topology: Topology,
    structures: Vec<Structure>,
    adjacency: Adjacency,
    classes: Vec<Class>,
    finder: Finder<'s>,
}

/// Renders frames of one scene on one device.
pub struct Renderer<'s> {
    gpu: Arc<Gpu>,
    scene: &'s Scene,
    options: Options,
    plan: Plan,
    traced: Option<Traced<'s>>,
    targets: Targets,
    table: SceneTable,
    base_textures: Vec<u32>,
    painter: Painter,
    settings: Settings,
    bvh_ms: f64,
}

/// A finished frame.
pub struct Frame {
    /// The image, linear.
    pub image: FloatImage,
    /// What it took.
    pub stats: Stats,
}

impl<'s> Renderer<'s> {
    /// Prepares what does not depend on the view: hierarchy, patches, textures, pipelines.
    ///
    /// # Errors
    /// More faces or texels than the device can hold; no device memory left.
    pub fn new(gpu: &Arc<Gpu>, scene: &'s Scene, options: &Options) -> Result<Self> {
        let plan = Plan::new(scene, options);
        let started = Instant::now();
        let topology = Topology::new(&scene.geometry);
        let targets = Targets::new(scene, &topology);
        let mut bvh_ms = 0.0;
        let traced = if plan.traces() {
            let tracer = Tracer::new(scene);
            bvh_ms = ms(started);
            let classes = visibility::classes(scene, plan.receivers);
            Some(Traced {
                tracer,
                adjacency: Adjacency::new(scene, &topology),
                topology,
                structures: Structure::all(scene),
                finder: Finder::new(gpu, scene, &classes, options.method.visibility)?,
                classes,
            })
        } else {
            None
        };
        let mut uploads = Uploads::new(gpu, "texture uploads", TEXTURE_STAGING)?;
        let bank = Bank::new(&mut uploads, scene, &plan.textures, options.method.filter)?;
        let table = SceneTable::new(scene, &targets, &bank, options.scene.fresnel);
        let base_textures = scene.materials.iter().map(|m| bank.reference(m.base_color_texture)).collect();
        let single_pass = traced.is_some() && options.method.visibility == VisibilityWay::SinglePass;
        let classes = traced.as_ref().map(|traced| traced.classes.as_slice());
        let base = base_faces(scene, &table, classes, single_pass);
        let pass_options = PassOptions {
            passes: plan.passes.clone(),
            single_pass,
            equation: options.method.equation,
            samples: if options.method.msaa == Msaa::Four { 4 } else { 1 },
            shaded: match options.method.ss {
                Ss::One => 1,
                Ss::Four => 4,
                Ss::Sixteen => 16,
            },
            detail_textures: plan.detail_textures,
            lights: (scene.lights.len() as u32).min(MAX_LIGHTS),
            highlights: plan.highlights,
        };
        let painter = Painter::new(gpu, pass_options, bank, &table, &base)?;
        let settings = Settings::new(&options.paths, &options.scene);
        Ok(Self {
            gpu: gpu.clone(),
            scene,
            options: options.clone(),
            plan,
            traced,
            targets,
            table,
            base_textures,
            painter,
            settings,
            bvh_ms,
        })
    }

    /// Draws every pipeline once, so that drivers compile before anything is timed. Returns milliseconds.
    ///
    /// # Errors
    /// What the driver says; no device memory left.
    pub fn warm_up(&mut self, view: &View) -> Result<f64> {
        let started = Instant::now();
        if let Some(traced) = &mut self.traced {
            traced.finder.warm_up(view)?;
        }
        self.painter.warm_up(&FrameBlock::new(self.scene, view), self.traced.is_some())?;
        Ok(ms(started))
    }

    /// Finds the visible faces of `view` in the way that the options say, and nothing more; `None` if nothing
    /// is traced.
    ///
    /// # Errors
    /// No device memory left; a lost device.
    pub fn find_visible(&mut self, view: &View) -> Result<Option<Found<'_>>> {
        let block = FrameBlock::new(self.scene, view);
        let Self { traced, painter, .. } = self;
        traced.as_mut().map(|traced| traced.finder.find(view, || painter.draw_base(&block))).transpose()
    }

    /// Renders one frame. `after_step` is shown the image after every refinement step, if given.
    ///
    /// # Errors
    /// No device memory left; a lost device; whatever `after_step` returns.
    pub fn render(&mut self, view: &View) -> Result<Frame> {
        let started = Instant::now();
        let mut stats = self.blank_stats(view);
        let block = FrameBlock::new(self.scene, view);
        let leaves = match &mut self.traced {
            None => None,
            Some(traced) => {
                let matcher = Matcher {
                    scene: self.scene,
                    targets: &self.targets,
                    table: &self.table,
                    base_textures: &self.base_textures,
                    room: self.options.method.nodes as usize,
                };
                let (painter, block) = (&mut self.painter, &block);
                let (settings, options) = (&self.settings, &self.options);
                Some(sample(traced, || painter.draw_base(block), &matcher, settings, options, view, &mut stats)?)
            }
        };
        let time = Instant::now();
        if let Some(leaves) = &leaves {
            self.painter.upload(leaves)?;
        }
        stats.time_ms.upload = ms(time);
        let time = Instant::now();
        let timings = self.painter.draw(&block, leaves.as_ref())?;
        stats.time_ms.draw = ms(time);
        stats.time_ms.frame = ms(started);
        stats.passes =
            timings.into_iter().map(|timing| stats::Pass { name: timing.name.into(), ms: timing.ms }).collect();
        Ok(Frame { image: self.painter.read_image()?, stats })
    }

    fn blank_stats(&self, view: &View) -> Stats {
        let scene = self.scene;
        let info = self.gpu.info();
        Stats {
            scene: stats::SceneStats {
                triangles: scene.geometry.faces.len() as u64,
                vt_faces: scene.vt_faces() as u64,
                textures: scene.textures.len() as u64,
                lights: scene.lights.len() as u64,
            },
            image: stats::ImageStats { width: view.width, height: view.height, vt_pixels: 0 },
            time_ms: stats::Times { bvh: self.bvh_ms, ..stats::Times::default() },
            left_out: self.plan.left_out.clone(),
            notes: scene.notes.iter().chain(&self.painter.bank().notes).cloned().collect(),
            options: Some(stats::UsedOptions::Render(Box::new(self.options.clone()))),
            device: stats::Device { name: Some(info.name.clone()), driver: Some(info.driver.clone()) },
            ..Stats::default()
        }
    }
}

/// Visibility, tracing and refinement: from the view to the leaves that are drawn.
fn sample<'i>(
    traced: &mut Traced,
    base: impl FnOnce() -> Result<CodedImage<'i>>,
    matcher: &Matcher,
    settings: &Settings,
    options: &Options,
    view: &View,
    stats: &mut Stats,
) -> Result<Leaves> {
    let scene = matcher.scene;
    let Traced { tracer, topology, structures, adjacency, classes, finder } = traced;
    let targets = matcher.targets;
    let visible = finder.find(view, base)?;
    stats.time_ms.visibility = visible.times.visibility;
    stats.time_ms.readback = visible.times.readback;
    stats.time_ms.scan = visible.times.scan;
    stats.readback.bytes = visible.readback_bytes;
    stats.readback.memory = Some(visible.readback_memory.name().into());
    stats.image.vt_pixels = visible.faces.vt_pixels;
    stats.faces.visible = visible.visible_vt as u64;

    let shown = Shown::from(&visible);
    let time = Instant::now();
    let context = Context { tracer, targets, settings, view };
    let predictor =
        Predictor { targets, structures, scene, view, reconstruction: options.method.reconstruction };
    let seeds = adjacency.one_ring(scene, topology, classes, view, visible.visible);
    let mesh = Mesh::new(scene, topology, view, &seeds);
    let mut refiner = Refiner::new(&context, &predictor, mesh, shown);
    let stopped_by = refiner.run(&options.effort, time, |_| Ok::<_, crate::error::Error>(()))?;
    let (predicted, _) = refiner.predicted();
    let refined = ms(time);

    let time = Instant::now();
    let (traced_pixels, pixel_rays) = pixels::trace(&context, &refiner.mesh, shown, &refiner.pixel_faces);
    let pixels_ms = ms(time);
    stats.time_ms.trace = refiner.samples.time.as_secs_f64() * 1e3 + pixels_ms;

    let time = Instant::now();
    let leaves =
        leaves::assemble(matcher, view, &refiner.mesh, &refiner.samples, &traced_pixels, &refiner.pixel_faces);
    stats.time_ms.refine = refined - refiner.samples.time.as_secs_f64() * 1e3 + ms(time);

    stats.samples = refiner.samples.len() as u64;
    stats.rays = ray_stats(refiner.samples.rays, pixel_rays, traced_pixels.len());
    stats.steps = u64::from(refiner.steps);
    stats.stopped_by = Some(match stopped_by {
        StoppedBy::Error => stats::StoppedBy::Error,
        StoppedBy::MaxSamples => stats::StoppedBy::MaxSamples,
        StoppedBy::Budget => stats::StoppedBy::Budget,
        StoppedBy::Exhausted => stats::StoppedBy::NothingLeft,
        StoppedBy::Preview => stats::StoppedBy::Preview,
    });
    stats.predicted_error = Some(f64::from(predicted));
    stats.faces.leaves = leaves.leaves.len() as u64;
    stats.faces.defined = u64::from(leaves.defined);
    stats.faces.undefined = u64::from(leaves.undefined);
    stats.notes.extend(finder.note.clone());
    Ok(leaves)
}

fn ray_stats(vertices: Rays, pixels: Rays, _traced: usize) -> stats::Rays {
    stats::Rays {
        total: vertices.total() + pixels.total(),
        primary: vertices.primary,
        reflected: vertices.reflected,
        transmitted: vertices.transmitted,
        shadow: vertices.shadow,
        pixel: pixels.total(),
    }
}

/// Faces that are drawn without samples: all of them if nothing is traced, else occluders and blended faces.
/// In a single pass those that need samples are drawn too, marked, until leaves take their place.
fn base_faces(scene: &Scene, table: &SceneTable, classes: Option<&[Class]>, single_pass: bool) -> BaseFaces {
    let mut base = BaseFaces::default();
    let mut opaque: Vec<(bool, bool, usize)> = Vec::new();
    let mut blended: Vec<usize> = Vec::new();
    for (index, object) in scene.objects.iter().enumerate() {
        let class = classes.map_or(Class::Occluder, |classes| classes[index]);
        let material = &scene.materials[object.material as usize];
        let is_blended = material.alpha_mode == AlphaMode::Blend;
        match class {
            Class::Occluder | Class::Shadow if is_blended => blended.push(index),
            Class::Occluder => opaque.push((false, !material.double_sided, index)),
            Class::Shadow | Class::Vt if single_pass => opaque.push((true, !material.double_sided, index)),
            Class::Shadow | Class::Vt => {}
        }
    }
    if opaque.is_empty() && blended.is_empty() {
        return base;
    }
    opaque.sort_unstable();
    let groups = opaque.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)).map(|group| {
        let (marked, cull, _) = group[0];
        (marked, cull, false, group.iter().map(|&(.., index)| index).collect::<Vec<_>>())
    });
    let blended = blended.into_iter().map(|index| {
        (false, !scene.materials[scene.objects[index].material as usize].double_sided, true, vec![index])
    });
    for (marked, cull, blended, objects) in groups.chain(blended) {
        let start = base.leaves.len() as u32;
        for object in objects {
            let faces = scene.objects[object].faces.clone();
            let code = |face| if marked { single_pass::code(face) } else { 0 };
            base.leaves.extend(faces.map(|face| leaves::base_leaf(scene, table, face, code(face))));
        }
        base.draws.push(BaseDraw { leaves: start..base.leaves.len() as u32, cull, blended, marked });
    }
    base.vertices = leaves::base_vertices(&scene.geometry);
    base
}

fn ms(since: Instant) -> f64 {
    since.elapsed().as_secs_f64() * 1e3
}
