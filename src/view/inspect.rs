//! The specular path behind a pixel: every surface that it meets, as the tracer follows it.

use glam::{Vec2, Vec3};

use crate::{
    error::one_line,
    scene::View,
    trace::{
        Appearance, Settings, Surface, Tracer,
        optics::{self, BranchKind},
    },
};

/// Surfaces kept at most: a deep glass has a tree of thousands.
const MOST_HITS: usize = 64;

/// A straight part of the path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Segment {
    /// Where it starts, relative to the scene's origin.
    pub from: Vec3,
    /// Where it ends; far outside of the scene if it meets nothing.
    pub to: Vec3,
    /// How it came about; `None` for the ray from the eye.
    pub kind: Option<BranchKind>,
}

/// What a path meets.
#[derive(Debug, Clone, PartialEq)]
pub struct Met {
    /// Specular bounces before it.
    pub bounces: u32,
    /// How the ray that met it came about.
    pub kind: Option<BranchKind>,
    /// The object's name; `None` outside of the scene.
    pub object: Option<String>,
    /// Length of the ray; infinite outside of the scene.
    pub distance: f32,
    /// Share of the radiance that reaches the eye, its largest component, 0 to 1.
    pub throughput: f32,
}

/// The tree of rays behind a pixel, depth first, reflection before transmission.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Path {
    /// Column and row of the pixel.
    pub pixel: (u32, u32),
    /// What to draw.
    pub segments: Vec<Segment>,
    /// What to list.
    pub met: Vec<Met>,
}

impl Path {
    /// What it meets, one line each, as deep in as it has bounced.
    pub fn lines(&self) -> Vec<String> {
        let head = format!("pixel {},{}", self.pixel.0, self.pixel.1);
        let line = |met: &Met| {
            let way = match met.kind {
                None => "sees",
                Some(BranchKind::Reflect) => "reflects",
                Some(BranchKind::Refract) => "transmits",
            };
            let indent = " ".repeat(met.bounces as usize * 2 + 2);
            match &met.object {
                Some(name) => format!(
                    "{indent}{way} {}, distance {:.4}, weight {:.3}",
                    one_line(name),
                    met.distance,
                    met.throughput
                ),
                None => format!("{indent}{way} the background, weight {:.3}", met.throughput),
            }
        };
        std::iter::once(head).chain(self.met.iter().map(line)).collect()
    }
}

/// Follows the ray through the centre of `pixel`.
pub fn follow(tracer: &Tracer, settings: &Settings, view: &View, pixel: (u32, u32)) -> Path {
    let (origin, direction) = view.ray(Vec2::new(pixel.0 as f32 + 0.5, pixel.1 as f32 + 0.5));
    let (low, high) = tracer.scene().bounds();
    let reach = (high - low).length() + (view.eye - (low + high) * 0.5).length();
    let mut walk = Walk { tracer, settings, reach, path: Path { pixel, ..Path::default() } };
    walk.ray(Ray { start: origin, origin, direction, kind: None, bounces: 0, throughput: Vec3::ONE });
    walk.path
}

struct Walk<'t, 's> {
    tracer: &'t Tracer<'s>,
    settings: &'t Settings,
    /// Length of a ray that meets nothing, as drawn.
    reach: f32,
    path: Path,
}

struct Ray {
    start: Vec3,
    origin: Vec3,
    direction: Vec3,
    kind: Option<BranchKind>,
    bounces: u32,
    throughput: Vec3,
}

impl Walk<'_, '_> {
    fn ray(&mut self, ray: Ray) {
        if self.path.met.len() >= MOST_HITS {
            return;
        }
        let scene = self.tracer.scene();
        let hit = self.tracer.closest(ray.origin, ray.direction);
        let distance = hit.map_or(f32::INFINITY, |hit| hit.t);
        let to = ray.origin + ray.direction * distance.min(self.reach);
        self.path.segments.push(Segment { from: ray.start, to, kind: ray.kind });
        let surface = hit.map(|hit| Surface::new(self.tracer, hit.face, hit.u, hit.v, ray.direction));
        self.path.met.push(Met {
            bounces: ray.bounces,
            kind: ray.kind,
            object: surface.map(|surface| scene.objects[surface.object as usize].name.clone()),
            distance,
            throughput: ray.throughput.max_element(),
        });
        let Some(surface) = surface.filter(|surface| surface.vt && ray.bounces < self.settings.depth) else {
            return;
        };
        let appearance = Appearance::new(scene, &surface);
        let material = &scene.materials[surface.material as usize];
        let branches = optics::branches(self.settings, material, &appearance, &surface, ray.direction);
        for branch in branches.into_iter().flatten() {
            let throughput = ray.throughput * branch.attenuation;
            if throughput.max_element() >= self.settings.min_throughput {
                self.ray(Ray {
                    start: branch.start,
                    origin: branch.origin,
                    direction: branch.direction,
                    kind: Some(branch.kind),
                    bounces: ray.bounces + 1,
                    throughput,
                });
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{options::ViewOptions, scene::demo::Demo};

    #[test]
    fn a_mirror_shows_what_is_before_it() {
        let scene = Demo::Mirror.scene();
        let view = ViewOptions { width: 64, height: 48, ..ViewOptions::default() }.resolve(&scene).unwrap();
        let tracer = Tracer::new(&scene);
        let settings = Settings::default();
        let mask = crate::trace::reference::vt_mask(&tracer, &view);
        let on_mirror = mask.iter().position(|&vt| vt).expect("the mirror is seen") as u32;
        let path = follow(&tracer, &settings, &view, (on_mirror % 64, on_mirror / 64));
        assert_eq!((path.met[0].kind, path.met[0].bounces), (None, 0));
        assert_eq!((path.met[1].kind, path.met[1].bounces), (Some(BranchKind::Reflect), 1));
        assert_eq!(path.segments.len(), path.met.len());
        let mut forged = path.clone();
        forged.met[0].object = Some("cup\nerror: \u{1b}[2J".into());
        assert!(
            forged.lines()[1].starts_with("  sees cup error: \\u{1b}[2J, distance "),
            "{:?}",
            forged.lines()
        );
        assert!((path.segments[1].from - path.segments[0].to).length() < 1e-3, "the path hangs together");
        let off = mask.iter().position(|&vt| !vt).expect("not all is mirror") as u32;
        assert_eq!(follow(&tracer, &settings, &view, (off % 64, off / 64)).met.len(), 1);
    }
}
