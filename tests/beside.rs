//! What lies beside the refined mesh and beside a leaf: small faces that are drawn as one picture, and planes that neighbours see.

mod common;

use glam::{Vec3, vec3};
use vertex_tracing::scene::{
    Camera, Material,
    demo::{SceneBuilder, chrome, glass, matte, shape, texture},
};

use common::{TestGpu, options, wrong};

/// A floor of tiles and a light, for a camera at the height of a person's eyes.
fn floor(name: &str) -> SceneBuilder {
    let mut builder = SceneBuilder::new(name);
    let tiles = builder.texture(texture::chessboard(128));
    let floor = builder.material(matte("floor").textured(tiles));
    builder.mesh("floor", shape::plane(vec3(-3.0, 0.0, 3.0), Vec3::X * 6.0, Vec3::NEG_Z * 6.0, 1.0), floor);
    builder.point_light(vec3(1.0, 2.6, 1.0), Vec3::splat(40.0));
    builder
}

/// Of a rod that passes the eye some pixels show: it is one of the small faces, and lies behind the eye, too.
#[test]
fn small_faces_show_beside_one_that_reaches_behind_the_eye() {
    let gpu = TestGpu::open();
    let mut builder = floor("ball and a rod past the eye");
    let silver = builder.material(chrome("silver", Vec3::splat(0.9)));
    builder.mesh("ball", shape::sphere(vec3(0.0, 1.0, 0.0), 0.5, 4), silver);
    let red = builder.material(matte("red").colored(vec3(0.9, 0.2, 0.2)));
    let edge = -2.412;
    let rod = shape::plane(vec3(edge, 0.99, 5.0), vec3(0.0, 0.0, -6.9), vec3(0.0, 0.02, 0.0), 1.0);
    builder.mesh("rod", rod, red);
    builder.camera(Camera::look_at(vec3(0.0, 1.0, 2.7), vec3(0.0, 1.0, 0.0), 0.8));
    let scene = builder.build().unwrap();
    let count = wrong(&gpu, &scene, &options(320, 256));
    assert!(count < 20, "{count} pixels are wrong");
    gpu.finish();
}

/// Faces along a sharp edge see each other's planes in the dark; none of them sees its own.
#[test]
fn no_face_is_seen_in_itself() {
    let gpu = TestGpu::open();
    let silver = chrome("silver", Vec3::splat(0.9));
    let ends = [vec3(-0.7, 0.4, -0.8), vec3(0.9, 0.4, -0.3), vec3(0.9, 0.4, 0.5)];
    for (material, end) in [
        (silver.clone(), ends[0]),
        (silver.clone(), ends[1]),
        (silver, ends[2]),
        (glass("pane", 1.5), ends[0]),
    ] {
        let mut builder = floor(&format!("two {} of a common edge", material.name));
        let material = builder.material(Material { double_sided: true, ..material });
        let foot = vec3(0.3, 0.4, -0.1);
        for (name, end) in [("one", end), ("other", vec3(0.95, 0.4, -0.25))] {
            builder.mesh(name, shape::plane(foot, end - foot, Vec3::Y, 1.0), material);
        }
        let mut scene = builder.build().unwrap();
        let mut worst = 0;
        for eye in [vec3(0.65, 2.1, 0.2), vec3(0.0, 1.4, 1.5), vec3(1.5, 1.2, 0.8)] {
            scene.cameras = vec![Camera::look_at(eye, vec3(0.3, 0.9, -0.1), 0.9)];
            worst = worst.max(wrong(&gpu, &scene, &options(320, 256)));
        }
        assert!(worst < 40, "{}: {worst} pixels are wrong", scene.name);
    }
    gpu.finish();
}
