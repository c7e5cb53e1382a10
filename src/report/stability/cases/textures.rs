//! Textures: extreme sizes, coordinates far from zero, seams, mirrored coordinates; all seen in a mirror.

use glam::Vec2;

use super::*;

pub(super) const CASES: &[Case] = &[
    Case {
        name: "texture-width",
        parameter: "texels",
        values: &[1.0, 2.0, 64.0, 1024.0, 16384.0],
        bound: Bound::both(0.015),
        limit: None,
        experiment: Experiment::Picture(|width| poster(smooth(width as u32, 1), 1, Vec2::new, 0.7)),
    },
    Case {
        name: "uv-scale",
        parameter: "repeats",
        values: &[1.0, 1e1, 1e2, 1e3, 1e4],
        bound: Bound::both(0.01),
        limit: None,
        // The field of view narrows as the texture shrinks, so that a texel stays larger than a pixel.
        experiment: Experiment::Picture(|repeats| {
            let scale = repeats as f32;
            poster(smooth(64, 64), 1, move |u, v| Vec2::new(u, v) * scale, 0.7 / scale)
        }),
    },
    Case {
        name: "uv-seams",
        parameter: "seams",
        values: &[0.0, 1.0, 3.0, 7.0, 15.0],
        bound: Bound::both(0.015),
        limit: None,
        // Strips of one texture whose coordinates turn round at every seam.
        experiment: Experiment::Picture(|seams| {
            let strips = seams as u32 + 1;
            let turned = move |u: f32, v: f32| {
                let odd = (u * strips as f32).round() as u32 % 2;
                Vec2::new(0.3 + odd as f32 / strips as f32, v)
            };
            poster(smooth(256, 256), strips, turned, 0.7)
        }),
    },
];

/// A poster in `columns` strips, seen in a mirror that leans a little, by a camera of `yfov` radians.
fn poster(image: Image, columns: u32, uv: impl Fn(f32, f32) -> Vec2, yfov: f32) -> Result<Trial> {
    let mut scene = stage("poster");
    let slot = scene.texture(image);
    let paper =
        scene.material(Material { unlit: true, double_sided: true, ..matte("poster").textured(slot) });
    let metal = scene.material(silver());
    let mut mesh = shape::grid(Vec3::new(-2.5, -2.5, 2.5), Vec3::X * 5.0, Vec3::Y * 5.0, 5.0, columns, 1);
    for (coordinates, position) in mesh.uvs.iter_mut().zip(&mesh.positions) {
        *coordinates = uv((position.x + 2.5) / 5.0, (position.y + 2.5) / 5.0);
    }
    let mirror = shape::plane(Vec3::new(-2.0, -2.0, -2.0), Vec3::X * 4.0, Vec3::new(0.0, 4.0, 0.3), 1.0);
    scene.mesh("poster", mesh, paper).mesh("mirror", mirror, metal);
    trial(scene, Camera::look_at(Vec3::new(0.4, 0.3, 2.0), Vec3::new(0.1, 0.1, -2.0), yfov), 5)
}
