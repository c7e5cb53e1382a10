//! Renders a glTF file by vertex tracing: `cargo run --release --example render_file -- assets/cup.glb out/cup.png`.

use std::path::PathBuf;

use vertex_tracing::{
    error::Result,
    frame::Renderer,
    glam::DVec3,
    gpu::{self, Gpu},
    options::{CameraChoice, Options, ViewOptions},
    report::output::write_image,
};

fn main() -> Result<()> {
    let mut arguments = std::env::args_os().skip(1).map(PathBuf::from);
    let (Some(file), Some(picture)) = (arguments.next(), arguments.next()) else {
        eprintln!("usage: render_file SCENE.glb PICTURE.png");
        std::process::exit(2);
    };

    let camera = CameraChoice::Eye { eye: DVec3::new(0.0, 1.5, 4.0), target: None };
    let view = ViewOptions { width: 640, height: 480, camera, fov: None };
    let options = Options { view, ..Options::default() };
    let (scene, view) = options.load(&file)?;
    scene.notes.iter().for_each(|note| eprintln!("note: {note}"));

    let gpu = Gpu::new(&gpu::Options::default())?;
    let frame = Renderer::new(&gpu, &scene, &options)?.render(&view)?;
    println!("{}", frame.stats);
    write_image(&picture, &frame.image, 0.0)
}
