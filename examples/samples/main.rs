//! Measures how many samples a picture of given error takes: exact against the paper's reconstruction against
//! conventional tracing, over the specular pixels, as a table in Markdown.
//!
//! ```text
//! cargo run --release --example samples -- OUT.md [SCENE.glb…]
//! ```
//!
//! Without a scene the demos are measured with `--shadows none`; a scene file is measured with `none` and `all`.

mod measure;
mod page;

use std::{path::Path, process::ExitCode};

use measure::{Lab, Measured};
use vertex_tracing::{
    error::{Error, Result},
    options::Shadows,
    scene::{demo::Demo, gltf},
};

/// Demos that stand for a curved mirror, a planar one and glass.
const DEMOS: [Demo; 4] = [Demo::Cup, Demo::Sphere, Demo::Mirror, Demo::GlassBowl];
/// Demos whose anti-aliasing is measured.
const SMOOTHED: [Demo; 2] = [Demo::Cup, Demo::Sphere];

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
    let out = arguments.next().unwrap_or_else(|| "out/samples.md".into());
    let files: Vec<String> = arguments.collect();
    let lab = Lab::new()?;
    let mut all: Vec<Measured> = Vec::new();
    for demo in DEMOS {
        all.push(lab.measure(demo.name(), demo.scene(), Shadows::None, SMOOTHED.contains(&demo))?);
    }
    for file in &files {
        let path = Path::new(file);
        // A folder names the scene where the file has a general name.
        let parent =
            path.parent().and_then(Path::file_name).filter(|_| path.file_stem() == Some("scene".as_ref()));
        let name = parent.or(path.file_stem()).map_or(file.as_str().into(), |name| name.to_string_lossy());
        for shadows in [Shadows::None, Shadows::All] {
            all.push(lab.measure(&name, gltf::load(path, &gltf::Limits::default())?, shadows, false)?);
        }
    }
    let page = page::markdown(&all, &lab.device(), &files);
    std::fs::write(&out, page).map_err(Error::io(&out))?;
    println!("wrote {out}");
    Ok(())
}
