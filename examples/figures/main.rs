//! Makes the paper's figures and checks its claims: `cargo run --release --example figures -- out/figures`.
//!
//! Writes a PNG for each picture and one self-contained page, index.html, that shows them beside the reference
//! tracer's. Everything the page says in numbers was measured by this run.

mod claims;
mod lab;
mod page;
mod plates;

use std::path::PathBuf;
use std::process::ExitCode;

use vertex_tracing::error::{Error, Result};
use vertex_tracing::report::output::{write_file, write_image};

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
    let folder = PathBuf::from(std::env::args().nth(1).unwrap_or_else(|| "out/figures".into()));
    std::fs::create_dir_all(&folder).map_err(Error::io(&folder))?;
    let lab = lab::Lab::new()?;
    let plates = plates::all(&lab)?;
    for picture in plates.iter().flat_map(|plate| &plate.pictures) {
        let path = folder.join(format!("{}.png", picture.name));
        write_image(&path, &picture.image, 0.0)?;
        println!("{}", path.display());
    }
    let claims = claims::all(&lab)?;
    for claim in &claims {
        println!(
            "{}: {} ({})",
            if claim.holds { "holds" } else { "DOES NOT HOLD" },
            claim.claim,
            claim.measured
        );
    }
    let page = folder.join("index.html");
    write_file(&page, page::html(&lab, &plates, &claims)?.as_bytes())?;
    println!("{}", page.display());
    Ok(())
}
