//! Holds a frame of a million triangles at 2560x2048 to a gigabyte: `cargo run --release --example check_memory`;
//! `make promises` does that.

#[path = "check_models/watch.rs"]
#[allow(dead_code)] // what only models are held to
mod watch;

use std::{process::ExitCode, time::Duration};

use vertex_tracing::scene::demo::{glb, stress};
use watch::{vtrace, watched};

const FACES: u32 = 1_000_000;
const SIZE: &str = "2560x2048";
const MOST_BYTES: u64 = 1_000_000_000;

/// Longest time for the frame, which a busy machine may need.
const PATIENCE: Duration = Duration::from_secs(120);

fn main() -> ExitCode {
    match peak() {
        Ok(bytes) => {
            let kept = bytes < MOST_BYTES;
            let verdict = if kept { "kept" } else { "broken" };
            println!(
                "{FACES} faces at {SIZE}: at most {} MB at once, promised are {}: {verdict}",
                bytes / 1_000_000,
                MOST_BYTES / 1_000_000
            );
            if kept { ExitCode::SUCCESS } else { ExitCode::FAILURE }
        }
        Err(problem) => {
            eprintln!("error: {problem}");
            ExitCode::FAILURE
        }
    }
}

/// The most memory, in bytes, that the program held.
fn peak() -> Result<u64, String> {
    let folder = tempfile::tempdir().map_err(|error| error.to_string())?;
    let (scene, picture) = (folder.path().join("wavy-mirror.glb"), folder.path().join("picture.pfm"));
    let bytes = stress::wavy_mirror(FACES).and_then(|scene| glb::encode(&scene));
    let bytes = bytes.map_err(|error| error.to_string())?;
    std::fs::write(&scene, bytes).map_err(|error| format!("{}: {error}", scene.display()))?;
    let mut command = vtrace()?;
    command.args(["render", "--size", SIZE, "-o"]).args([&picture, &scene]);
    let watched = watched(&mut command, PATIENCE)?;
    match (watched.code, watched.bytes) {
        (Some(0), 0) => Err("this system does not tell how much memory a process holds".into()),
        (Some(0), bytes) => Ok(bytes),
        (code, _) => Err(format!("exit code {code:?}: {}", watched.stderr)),
    }
}
