//! Mirrors: grazing, facing each other, strongly curved, concave.

use super::*;

pub(super) const CASES: &[Case] = &[
    Case {
        name: "grazing",
        parameter: "degrees",
        values: &[0.0, 45.0, 80.0, 89.0, 89.9, 89.99],
        bound: Bound::both(0.003),
        limit: None,
        experiment: Experiment::Picture(|degrees| {
            let (sin, cos) = (degrees.to_radians().sin() as f32, degrees.to_radians().cos() as f32);
            let mut scene = stage("grazing");
            let metal = scene.material(silver());
            let (low, high) = (Vec3::new(-3.0, 0.0, -3.0), Vec3::new(3.0, 0.0, 3.0));
            let floor = shape::plane(Vec3::new(-3.0, 0.0, 3.0), Vec3::X * 6.0, Vec3::NEG_Z * 6.0, 1.0);
            scene.mesh("mirror", floor, metal);
            let camera = Camera::look_at(Vec3::new(0.1, cos, sin) * 3.4, Vec3::new(0.1, 0.0, 0.0), 0.5);
            Ok(trial(scene, camera, 5)?.against(form(vec![pane(low, high)], 5)))
        }),
    },
    Case {
        name: "parallel-mirrors",
        parameter: "depth",
        values: &[1.0, 4.0, 16.0, 32.0, 64.0],
        bound: Bound::both(0.012),
        limit: None,
        experiment: Experiment::Picture(|depth| {
            let mut scene = stage("parallel mirrors");
            let metal = scene.material(silver());
            let sides = [-1.0_f32, 1.0].map(|z| (Vec3::new(-1.5, -1.5, z), Vec3::new(1.5, 1.5, z)));
            for (low, _) in sides {
                scene.mesh("mirror", shape::plane(low, Vec3::X * 3.0, Vec3::Y * 3.0, 1.0), metal);
            }
            let camera = Camera::look_at(Vec3::new(0.2, 0.1, 0.3), Vec3::new(0.45, 0.3, -1.0), 0.9);
            let panes = sides.map(|(low, high)| pane(low, high)).to_vec();
            Ok(trial(scene, camera, depth as u32)?.against(form(panes, depth as u32)))
        }),
    },
    Case {
        name: "curved-mirror",
        parameter: "1/radius",
        values: &[1.0, 4.0, 16.0, 64.0, 128.0],
        bound: Bound::both(0.004),
        limit: None,
        experiment: Experiment::Picture(|inverse| {
            let mut scene = stage("curved mirror");
            let metal = scene.material(silver());
            scene.mesh("ball", shape::sphere(Vec3::ZERO, 1.0 / inverse as f32, 4), metal);
            trial(scene, Camera::look_at(Vec3::new(0.5, 0.7, 3.4), Vec3::ZERO, 0.7), 5)
        }),
    },
    Case {
        name: "concave-mirror",
        parameter: "magnification",
        values: &[1.0, 2.0, 8.0, 32.0, 128.0],
        bound: Bound::both(0.006),
        limit: None,
        experiment: Experiment::Picture(|magnification| {
            // f = R / 2; a wall at distance d is magnified f / (f - d) times: d = f (1 - 1 / magnification).
            let wall = 2.0 * HALF;
            let focus = if magnification > 1.0 { wall / (1.0 - 1.0 / magnification as f32) } else { 1e6 };
            let radius = 2.0 * focus;
            let mut scene = stage("concave mirror");
            let metal = scene.material(silver());
            let mesh = sheet(12, 12, |u, v| {
                let (x, y) = (u * 3.0 - 1.5, v * 3.0 - 1.5);
                let depth = (x * x + y * y) / (radius + (radius * radius - x * x - y * y).sqrt());
                let normal = Vec3::new(-x, -y, radius - depth);
                (Vec3::new(x, y, depth - HALF + 0.01), normal.normalize())
            });
            scene.mesh("mirror", mesh, metal);
            trial(scene, Camera::look_at(Vec3::new(0.5, 0.3, 3.0), Vec3::new(0.0, 0.0, -4.0), 0.5), 5)
        }),
    },
];
