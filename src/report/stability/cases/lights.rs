//! Lights: on a surface, behind it, of any strength.

use super::*;

pub(super) const CASES: &[Case] = &[
    Case {
        name: "light-distance",
        parameter: "-log10",
        // At 10^-n above the floor; 8: on it; 9: behind it.
        values: &[0.0, 1.0, 3.0, 5.0, 8.0, 9.0],
        bound: Bound::both(0.004),
        limit: None,
        experiment: Experiment::Picture(|n| {
            let height = match n as i32 {
                8 => 0.0,
                9 => -0.1,
                n => 10_f32.powi(-n),
            };
            lit(height, 1.0, 1.0)
        }),
    },
    Case {
        name: "light-intensity",
        parameter: "candela",
        values: &[1e-6, 1.0, 1e3, 1e6, 1e9],
        bound: Bound { reference: 0.004, truth: 0.001 },
        limit: None,
        // What reflects in inverse proportion must look the same.
        experiment: Experiment::Picture(|candela| {
            let twin = lit(1.0, 1.0, 1.0)?;
            Ok(lit(1.0, candela as f32, (candela as f32).recip())?.against(Truth::Twin(Box::new(twin))))
        }),
    },
];

/// A mirror ball on a floor under a point light at `height` above it.
fn lit(height: f32, candela: f32, reflectance: f32) -> Result<Trial> {
    let mut scene = SceneBuilder::new("lit");
    let floor = scene.material(matte("floor").colored(Vec3::new(1.0, 0.7, 0.5) * reflectance));
    let metal = scene.material(silver());
    scene
        .mesh("floor", shape::plane(Vec3::new(-4.0, 0.0, 4.0), Vec3::X * 8.0, Vec3::NEG_Z * 8.0, 1.0), floor)
        .mesh("ball", shape::sphere(Vec3::new(0.0, 0.8, 0.0), 0.75, 3), metal)
        .point_light(Vec3::new(1.2, height, 0.7), Vec3::splat(candela));
    trial(scene, Camera::look_at(Vec3::new(0.3, 1.9, 4.0), Vec3::Y * 0.5, 0.6), 5)
}
