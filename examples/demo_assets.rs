//! Writes demo scenes as .glb files: `cargo run --release --example demo_assets -- assets cup`.
//!
//! The first argument is the folder, the others are names of demos; without a name all are written.

use std::path::PathBuf;
use std::process::ExitCode;

use vertex_tracing::error::{Error, Result};
use vertex_tracing::scene::demo::Demo;

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
    let mut demos = arguments
        .map(|name| {
            Demo::by_name(&name)
                .ok_or_else(|| Error::Option(format!("{name}: no such demo, there are {}", names())))
        })
        .collect::<Result<Vec<Demo>>>()?;
    if demos.is_empty() {
        demos = Demo::ALL.into();
    }
    std::fs::create_dir_all(&folder).map_err(Error::io(&folder))?;
    for demo in demos {
        let path = folder.join(demo.name()).with_extension("glb");
        let bytes = demo.glb();
        std::fs::write(&path, &bytes).map_err(Error::io(&path))?;
        let scene = demo.scene();
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

fn names() -> String {
    Demo::ALL.map(Demo::name).join(", ")
}
