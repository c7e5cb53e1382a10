//! The table of cases, and what they are built of.

mod faces;
mod glass;
mod lights;
mod mirrors;
mod place;
mod textures;
mod views;

use glam::Vec3;

use super::planar::{Pane, PaneKind, World, block, paint};
use super::{Bound, Case, Experiment, Trial, Truth};
use crate::error::Result;
use crate::scene::demo::{Mesh, SceneBuilder, chrome, glass as clear, matte, shape};
use crate::scene::{Camera, Image, Material, Scene, Volume};

/// Half the edge of the painted box that most cases are set in.
const HALF: f32 = 4.0;

/// Every case, in the order of the table.
pub fn all() -> Vec<Case> {
    [place::CASES, faces::CASES, mirrors::CASES, glass::CASES, textures::CASES, lights::CASES, views::CASES]
        .concat()
}

/// A scene in the painted box: unlit, so that radiance is the texture alone.
fn stage(name: &str) -> SceneBuilder {
    let mut scene = SceneBuilder::new(name);
    let painted = scene.texture(smooth(256, 256));
    let walls = Material { unlit: true, double_sided: true, ..matte("walls").textured(painted) };
    let walls = scene.material(walls);
    scene.mesh("walls", shape::cuboid(Vec3::splat(-HALF), Vec3::splat(HALF), 2.0 * HALF), walls);
    scene
}

/// [`paint`] as a texture: smooth, so that an error of the picture is in proportion to what is displaced.
fn smooth(width: u32, height: u32) -> Image {
    let texel = |index: u32| {
        let at = glam::DVec2::new((index % width).into(), (index / width).into()) + 0.5;
        let color = paint(at / glam::DVec2::new(width.into(), height.into())) * 255.0;
        [color.x.round() as u8, color.y.round() as u8, color.z.round() as u8, 255]
    };
    Image { name: "smooth".into(), width, height, rgba: (0..width * height).flat_map(texel).collect() }
}

/// Clear glass with a body.
fn solid(ior: f32) -> Material {
    let volume = Volume { attenuation_color: Vec3::ONE, attenuation_distance: f32::INFINITY };
    Material { volume: Some(volume), ..clear("glass", ior) }
}

/// A silver mirror that is seen from both sides.
fn silver() -> Material {
    Material { double_sided: true, ..chrome("silver", Vec3::splat(0.9)) }
}

/// The trial of a finished stage, seen by `camera`, whose paths no threshold cuts.
fn trial(mut scene: SceneBuilder, camera: Camera, depth: u32) -> Result<Trial> {
    scene.camera(camera);
    let mut trial = Trial::new(scene.build()?);
    trial.options.paths.depth = depth;
    trial.options.paths.min_throughput = 0.0;
    Ok(trial)
}

/// The closed form of `panes` in the painted box.
fn form(panes: Vec<Pane>, depth: u32) -> Truth {
    let world = World { half: HALF.into(), panes, depth };
    Truth::Radiance(Box::new(move |origin, direction| world.radiance(origin, direction)))
}

/// A mirror of [`silver`].
fn pane(low: Vec3, high: Vec3) -> Pane {
    Pane { low: low.as_dvec3(), high: high.as_dvec3(), kind: PaneKind::Mirror(f64::from(0.9_f32)) }
}

/// The scene that invariances are tried on: a mirror ball and a glass block over a lit floor in the painted box.
fn still_life() -> Result<Scene> {
    let mut scene = stage("still life");
    let floor = scene.material(matte("floor").colored(Vec3::new(0.6, 0.5, 0.4)));
    let metal = scene.material(silver());
    let glass = scene.material(solid(1.5));
    scene
        .mesh("floor", shape::plane(Vec3::new(-3.0, -1.0, 3.0), Vec3::X * 6.0, Vec3::NEG_Z * 6.0, 1.0), floor)
        .mesh("ball", shape::sphere(Vec3::new(-0.8, -0.2, 0.0), 0.75, 3), metal)
        .mesh("block", shape::cuboid(Vec3::new(0.4, -0.95, -0.5), Vec3::new(1.4, 0.3, 0.4), 1.0), glass)
        .point_light(Vec3::new(1.0, 3.0, 2.5), Vec3::splat(25.0))
        .camera(Camera::look_at(Vec3::new(0.3, 0.7, 3.6), Vec3::new(0.1, -0.3, 0.0), 0.7));
    scene.build()
}

/// A mesh from vertices whose coordinates a closure gives on a grid over [0, 1]², two faces a cell.
fn sheet(columns: u32, rows: u32, vertex: impl Fn(f32, f32) -> (Vec3, Vec3)) -> Mesh {
    let mut mesh = shape::grid(Vec3::ZERO, Vec3::X, Vec3::Y, 1.0, columns, rows);
    for (position, normal) in mesh.positions.iter_mut().zip(&mut mesh.normals) {
        (*position, *normal) = vertex(position.x, position.y);
    }
    mesh
}
