//! Where a scene is and how large: scale, offset, rotation, depth range, number of threads, leaks.

use std::path::Path;

use glam::{Affine3A, DVec3, Mat3, Quat, Vec3};

use super::super::leak::Body;
use super::*;
use crate::scene::demo::glb;
use crate::scene::gltf::{Limits, load_slice};
use crate::scene::{LightKind, classify};

pub(super) const CASES: &[Case] = &[
    Case {
        name: "scale",
        parameter: "units",
        values: &[1e-6, 1e-4, 1e-2, 1.0, 1e2, 1e4, 1e6],
        bound: Bound { reference: 0.006, truth: 0.003 },
        limit: None,
        experiment: Experiment::Picture(|scale| twin(scale as f32, Quat::IDENTITY, Vec3::ZERO)),
    },
    Case {
        name: "rotation",
        parameter: "degrees",
        values: &[0.0, 1e-3, 1.0, 45.0, 90.0, 123.0, 180.0],
        bound: Bound { reference: 0.006, truth: 0.003 },
        limit: None,
        experiment: Experiment::Picture(|angle| {
            let axis = Vec3::new(0.3, 0.9, -0.2).normalize();
            twin(1.0, Quat::from_axis_angle(axis, angle.to_radians() as f32), Vec3::ZERO)
        }),
    },
    Case {
        name: "translation",
        parameter: "units",
        values: &[0.0, 1.0, 10.0, 100.0, 1000.0],
        bound: Bound { reference: 0.006, truth: 0.01 },
        limit: None,
        experiment: Experiment::Picture(|d| twin(1.0, Quat::IDENTITY, Vec3::new(1.0, -0.7, 0.4) * d as f32)),
    },
    Case {
        name: "offset-node",
        parameter: "units",
        values: &[0.0, 1.0, 1e2, 1e4, 1e6],
        bound: Bound { reference: 0.006, truth: 0.001 },
        limit: None,
        experiment: Experiment::Picture(|offset| {
            let mut moved = still_life()?;
            moved.origin = DVec3::new(offset, -offset, offset);
            loaded(&moved)?.against_still_life()
        }),
    },
    Case {
        name: "offset-vertices",
        parameter: "units",
        values: &[0.0, 1.0, 1e2, 1e4, 1e6],
        // The file's own numbers are rounded: there is no twin.
        bound: Bound::both(0.006),
        limit: None,
        experiment: Experiment::Picture(|offset| {
            let moved =
                moved(still_life()?, 100.0, Quat::IDENTITY, Vec3::new(1.0, -0.5, 0.25) * offset as f32);
            loaded(&moved)
        }),
    },
    Case {
        name: "near-far",
        parameter: "ratio",
        values: &[1e1, 1e3, 1e5, 1e6, 1e7],
        bound: Bound::both(0.003),
        limit: None,
        experiment: Experiment::Picture(|ratio| {
            // The walls stand HALF away from the eye, the mirror HALF / ratio.
            let near = HALF / ratio as f32;
            let mut scene = stage("near and far");
            let metal = scene.material(silver());
            let low = Vec3::new(-0.3, -0.4, -1.0) * near;
            let high = Vec3::new(0.5, 0.2, -1.0) * near;
            scene.mesh(
                "mirror",
                shape::plane(low, Vec3::X * (high - low), Vec3::Y * (high - low), 1.0),
                metal,
            );
            let camera = Camera::look_at(Vec3::ZERO, Vec3::new(0.1, 0.05, -1.0), 1.2);
            Ok(trial(scene, camera, 5)?.against(form(vec![pane(low, high)], 5)))
        }),
    },
    Case {
        name: "threads",
        parameter: "threads",
        values: &[2.0, 3.0, 5.0, 8.0, 16.0],
        bound: Bound::both(0.0),
        limit: None,
        experiment: Experiment::Threads(|| Ok(Trial::new(still_life()?))),
    },
    Case {
        name: "leaks",
        parameter: "offset",
        values: &[0.0, 1.0, 1e2, 1e3, 1e4, 1e5, 1e6],
        bound: Bound::both(1e-5),
        limit: None,
        experiment: Experiment::Leak(|offset| {
            let centre = Vec3::new(1.0, -0.7, 0.3) * offset as f32;
            let mut scene = SceneBuilder::new("closed sphere");
            let white = scene.material(matte("white"));
            // As round as the numbers at the offset allow: no face may vanish.
            scene.mesh("sphere", shape::sphere(centre, 30.0, 2), white);
            let scene = scene.build()?;
            let inside = (centre.as_dvec3() - scene.origin).as_vec3() + Vec3::new(3.1, -2.3, 1.7);
            Ok(Body { scene, inside })
        }),
    },
];

impl Trial {
    fn against_still_life(self) -> Result<Self> {
        Ok(self.against(Truth::Twin(Box::new(Trial::new(still_life()?)))))
    }
}

/// The still life moved, which must look as before.
fn twin(scale: f32, rotation: Quat, translation: Vec3) -> Result<Trial> {
    Trial::new(moved(still_life()?, scale, rotation, translation)).against_still_life()
}

/// The scene as the loader gives it back.
fn loaded(scene: &Scene) -> Result<Trial> {
    let mut back = load_slice(&glb::encode(scene)?, None, Path::new(&scene.name), &Limits::default())?;
    classify::classify(&mut back, &classify::VtRules::default())?;
    Ok(Trial::new(back))
}

/// The scene with its camera and lights scaled, turned and moved.
fn moved(mut scene: Scene, scale: f32, rotation: Quat, translation: Vec3) -> Scene {
    let turn = Mat3::from_quat(rotation);
    let place = Affine3A::from_scale_rotation_translation(Vec3::splat(scale), rotation, translation);
    let geometry = &mut scene.geometry;
    geometry.positions.iter_mut().for_each(|position| *position = place.transform_point3(*position));
    geometry.normals.iter_mut().for_each(|normal| *normal = (turn * *normal).normalize());
    for light in &mut scene.lights {
        if let LightKind::Point { position, .. } = &mut light.kind {
            *position = place.transform_point3(*position);
        }
        light.intensity *= scale * scale;
    }
    for camera in &mut scene.cameras {
        camera.position = place.transform_point3(camera.position);
        (camera.right, camera.up, camera.forward) =
            (turn * camera.right, turn * camera.up, turn * camera.forward);
    }
    scene.recentre();
    scene
}
