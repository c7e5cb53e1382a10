//! What leaving out saves, scene by scene: `cargo run --release --example ladder`.
//!
//! Renders a ladder of scenes, each of which needs more than the one before, as planned and with nothing left
//! out, and prints the table of docs/plan.md: objects created on the device, bytes, rays, the frame's time,
//! and the largest difference between the two images. Fails where a scene without specular objects costs more
//! than plain rasterising by the same code.

mod measure;
mod rungs;

use std::process::ExitCode;

use measure::{Taken, plain, take};
use rungs::Rung;
use vertex_tracing::{
    error::{Error, Result},
    gpu::{Gpu, Options as DeviceOptions},
    report::metrics::{Encoding, compare},
};

const SIZE: (u32, u32) = (640, 512);
/// Frames of which the fastest counts.
const RUNS: u32 = 5;
/// Most that a planned frame of a scene without specular objects may take, as a multiple of plain rasterising.
const MOST: f64 = 1.1;
/// Turns that both are given at most to show it: a busy machine needs some.
const TURNS: u32 = 20;

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
    // Counts are those since the device was opened: each measurement opens it anew.
    let open = || Gpu::new(&DeviceOptions::default());
    println!("On {}, {}x{}; planned / everything:\n", open()?.info().name, SIZE.0, SIZE.1);
    println!(
        "| scene | pipelines | buffers | images | samplers | MiB | samples | rays | frame ms | difference |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|");
    for rung in Rung::ALL {
        let planned = take(&open()?, rung, false, SIZE, RUNS)?;
        let everything = take(&open()?, rung, true, SIZE, RUNS)?;
        let pair = |value: &dyn Fn(&Taken) -> String| format!("{} / {}", value(&planned), value(&everything));
        println!(
            "| {} | {} | {} | {} | {} | {} | {} | {} | {} | {:.4} |",
            rung.name(),
            pair(&|taken| taken.counts.pipelines.to_string()),
            pair(&|taken| taken.counts.buffers.to_string()),
            pair(&|taken| taken.counts.images.to_string()),
            pair(&|taken| taken.counts.samplers.to_string()),
            pair(&|taken| format!("{:.1}", taken.counts.bytes as f64 / f64::from(1 << 20))),
            pair(&|taken| taken.samples.to_string()),
            pair(&|taken| taken.rays.to_string()),
            pair(&|taken| format!("{:.1}", taken.ms)),
            compare(&everything.image, &planned.image, None, Encoding::Srgb)?.max,
        );
    }
    println!("\n| without specular objects | as planned, ms | plain rasterising, ms | ratio |");
    println!("|---|---|---|---|");
    for rung in Rung::ALL.into_iter().filter(|rung| rung.is_plain()) {
        // In turn, so that a machine that slows down slows both.
        let mut best = [f64::INFINITY; 2];
        for turn in 0..TURNS {
            best[0] = best[0].min(take(&open()?, rung, false, SIZE, 4 * RUNS)?.ms);
            best[1] = best[1].min(plain(&open()?, rung, SIZE, 4 * RUNS)?.ms);
            if turn > 0 && best[0] <= MOST * best[1] {
                break;
            }
        }
        let ratio = best[0] / best[1];
        println!("| {} | {:.2} | {:.2} | {ratio:.2} |", rung.name(), best[0], best[1]);
        if ratio > MOST {
            let problem = format!("{}: {ratio:.2} times plain rasterising; at most {MOST}", rung.name());
            return Err(Error::Compare(problem));
        }
    }
    Ok(())
}
