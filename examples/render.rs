//! Builds a scene in code, renders it by vertex tracing and writes `out/example.png`.

use glam::{Vec3, vec3};
use vertex_tracing::{
    error::Result,
    frame::Renderer,
    gpu::{self, Gpu},
    options::Options,
    report::output::write_image,
    scene::{
        Background, Camera,
        demo::{SceneBuilder, chrome, matte, shape, texture},
    },
};

fn main() -> Result<()> {
    let mut builder = SceneBuilder::new("mirror ball");
    let board = builder.texture(texture::chessboard(512));
    let floor = builder.material(matte("floor").textured(board));
    let ball = builder.material(chrome("ball", vec3(0.9, 0.85, 0.8)));
    builder.mesh("floor", shape::plane(vec3(-4.0, 0.0, 4.0), Vec3::X * 8.0, Vec3::NEG_Z * 8.0, 4.0), floor);
    builder.mesh("ball", shape::sphere(Vec3::Y, 1.0, 3), ball);
    builder.point_light(vec3(2.0, 5.0, 3.0), Vec3::splat(120.0));
    builder.background(Background::Color(vec3(0.4, 0.5, 0.7)));
    builder.camera(Camera::look_at(vec3(0.0, 2.2, 5.0), vec3(0.0, 0.9, 0.0), 0.6));
    let scene = builder.build()?;

    let options = Options::default();
    let gpu = Gpu::new(&gpu::Options::default())?;
    let view = options.view.resolve(&scene)?;
    let frame = Renderer::new(&gpu, &scene, &options)?.render(&view)?;
    println!("{}", frame.stats);
    std::fs::create_dir_all("out").expect("a folder for the picture");
    write_image("out/example.png".as_ref(), &frame.image, 0.0)
}
