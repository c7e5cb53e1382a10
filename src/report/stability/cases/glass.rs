//! Glass: every index, both sides of the critical angle, bodies inside bodies, the eye inside a body.

use super::*;

pub(super) const CASES: &[Case] = &[
    Case {
        name: "slab",
        parameter: "ior",
        values: &[1.0, 1.000_1, 1.1, 1.33, 1.5, 2.0, 2.5],
        bound: Bound::both(0.007),
        limit: None,
        experiment: Experiment::Picture(|ior| {
            block_seen(ior as f32, Camera::look_at(Vec3::new(1.3, 0.8, 2.6), Vec3::ZERO, 0.7), 4)
        }),
    },
    Case {
        name: "critical-angle",
        parameter: "degrees",
        values: &[0.0, 30.0, 41.0, 41.81, 42.6, 60.0, 80.0],
        bound: Bound::both(0.005),
        limit: None,
        // The eye is inside a block of index 1.5, whose critical angle is 41.81°.
        experiment: Experiment::Picture(|degrees| {
            let (sin, cos) = (degrees.to_radians().sin() as f32, degrees.to_radians().cos() as f32);
            let eye = Vec3::new(-0.4, 0.1, 0.0);
            block_seen(1.5, Camera::look_at(eye, eye + Vec3::new(sin, 0.05, -cos), 0.5), 4)
        }),
    },
    Case {
        name: "nested-glass",
        parameter: "bodies",
        values: &[1.0, 2.0, 3.0],
        bound: Bound::both(0.02),
        limit: None,
        experiment: Experiment::Picture(|bodies| {
            let mut scene = stage("nested glass");
            let mut panes = Vec::new();
            for body in 0..bodies as u32 {
                let ior = 1.2 + 0.2 * body as f32;
                let (low, high) = corners(1.0 - 0.3 * body as f32);
                let glass = scene.material(solid(ior));
                scene.mesh(format!("body {body}"), shape::cuboid(low, high, 1.0), glass);
                panes.extend(block(low.as_dvec3(), high.as_dvec3(), ior.into()));
            }
            let camera = Camera::look_at(Vec3::new(0.9, 0.6, 3.0), Vec3::ZERO, 0.6);
            Ok(trial(scene, camera, 7)?.against(form(panes, 7)))
        }),
    },
    Case {
        name: "glass-ball",
        parameter: "ior",
        values: &[1.0, 1.000_1, 1.1, 1.5, 2.0, 2.5],
        bound: Bound::both(0.005),
        limit: None,
        experiment: Experiment::Picture(|ior| {
            let mut scene = stage("glass ball");
            let glass = scene.material(solid(ior as f32));
            scene.mesh("ball", shape::sphere(Vec3::ZERO, 1.0, 4), glass);
            trial(scene, Camera::look_at(Vec3::new(0.5, 0.4, 3.4), Vec3::ZERO, 0.7), 4)
        }),
    },
];

/// Opposite corners of a block, `size` times as large as the largest.
fn corners(size: f32) -> (Vec3, Vec3) {
    (Vec3::new(-1.0, -0.8, -0.6) * size, Vec3::new(1.0, 0.7, 0.5) * size)
}

/// One block of glass in the painted box.
fn block_seen(ior: f32, camera: Camera, depth: u32) -> Result<Trial> {
    let mut scene = stage("glass block");
    let glass = scene.material(Material { double_sided: true, ..solid(ior) });
    let (low, high) = corners(1.0);
    scene.mesh("block", shape::cuboid(low, high, 1.0), glass);
    let panes = block(low.as_dvec3(), high.as_dvec3(), ior.into());
    Ok(trial(scene, camera, depth)?.against(form(panes, depth)))
}
