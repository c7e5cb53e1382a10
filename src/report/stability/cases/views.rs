//! Views: narrow and wide fields of view, images of a pixel and of a line.

use super::*;

pub(super) const CASES: &[Case] = &[
    Case {
        name: "field-of-view",
        parameter: "degrees",
        values: &[0.01, 0.1, 1.0, 40.0, 120.0, 170.0, 179.0],
        bound: Bound::both(0.005),
        limit: None,
        experiment: Experiment::Picture(|degrees| mirror_seen(degrees.to_radians() as f32)),
    },
    Case {
        name: "image-width",
        parameter: "pixels",
        values: &[1.0, 16.0, 255.0, 4097.0, 16384.0],
        bound: Bound::both(0.003),
        limit: None,
        experiment: Experiment::Picture(|width| {
            // As wide a view whatever the width, so that a line crosses the mirror.
            let yfov = 2.0 * (0.6 / width as f32).atan();
            Ok(Trial { size: Some((width as u32, 1)), ..mirror_seen(yfov)? })
        }),
    },
    Case {
        name: "image-height",
        parameter: "pixels",
        values: &[1.0, 16.0, 255.0, 4097.0, 16384.0],
        bound: Bound::both(0.003),
        limit: None,
        experiment: Experiment::Picture(|height| {
            Ok(Trial { size: Some((1, height as u32)), ..mirror_seen(0.9)? })
        }),
    },
];

/// A mirror before the far wall, seen at an angle.
fn mirror_seen(yfov: f32) -> Result<Trial> {
    let mut scene = stage("mirror");
    let metal = scene.material(silver());
    let (low, high) = (Vec3::new(-1.5, -1.2, -2.0), Vec3::new(1.3, 1.4, -2.0));
    scene.mesh("mirror", shape::plane(low, Vec3::X * (high - low), Vec3::Y * (high - low), 1.0), metal);
    let camera = Camera::look_at(Vec3::new(0.7, 0.4, 2.3), Vec3::new(0.1, 0.0, -2.0), yfov);
    Ok(trial(scene, camera, 5)?.against(form(vec![pane(low, high)], 5)))
}
