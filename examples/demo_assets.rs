//! Writes demo scenes as .glb files: `cargo run --release --example demo_assets -- assets cup`.
//!
//! The first argument is the folder, the others are names of demos; without a name all are written. `wavy-mirror=N` and
//! `mirror-balls=N` are the scenes of N faces or balls that measurements scale with.

use std::path::PathBuf;
use std::process::ExitCode;

use vertex_tracing::error::{Error, Result};
use vertex_tracing::scene::Scene;
use vertex_tracing::scene::demo::{Demo, glb, stress};

fn main() -> ExitCode {
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run() -> Result<()> {
    let mut arguments = std::env::args().skip(1);
    let usage = || Error::Option(format!("usage: demo_assets FOLDER [NAME]…, NAME one of {}", names()));
    let folder = PathBuf::from(arguments.next().ok_or_else(usage)?);
    let mut names: Vec<String> = arguments.collect();
    if names.is_empty() {
        names = Demo::ALL.map(|demo| demo.name().into()).into();
    }
    std::fs::create_dir_all(&folder).map_err(Error::io(&folder))?;
    for name in names {
        let scene = scene(&name)?;
        let path = folder.join(name.replace('=', "-")).with_extension("glb");
        let bytes = glb::encode(&scene)?;
        std::fs::write(&path, &bytes).map_err(Error::io(&path))?;
        println!(
            "{}: {} faces, {} specular, {:.0} kB",
            path.display(),
            scene.geometry.faces.len(),
            scene.vt_faces(),
            bytes.len() as f64 / 1e3
        );
    }
    Ok(())
}

fn scene(name: &str) -> Result<Scene> {
    let size = |digits: &str| {
        digits.parse().map_err(|_| Error::Option(format!("{name}: {digits} is not a whole number")))
    };
    match name.split_once('=') {
        Some(("wavy-mirror", faces)) => stress::wavy_mirror(size(faces)?),
        Some(("mirror-balls", balls)) => stress::mirror_ball_room(size(balls)?),
        _ => match Demo::by_name(name) {
            Some(demo) => Ok(demo.scene()),
            None => Err(Error::Option(format!("{name}: no such demo, there are {}", names()))),
        },
    }
}

fn names() -> String {
    format!("{}, wavy-mirror=FACES, mirror-balls=BALLS", Demo::ALL.map(Demo::name).join(", "))
}
