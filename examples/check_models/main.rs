//! Renders every model of a folder small and holds it against the folder's `manifest.json`.
//!
//! `cargo run --release --example check_models -- DIR`; `make test-models DIR=…` does that. A row of the
//! manifest names a file and what must happen: `ok` a picture, `ok-warn` a picture and a note, `error` one
//! clear line on stderr and no picture, `either` any of these. Each model has a process of its own, so that a
//! crash, a hang or a hunger for memory is one failure among others.

mod watch;

use std::{
    fs,
    path::{Path, PathBuf},
    process::ExitCode,
    time::Duration,
};

use serde_json::Value;
use watch::{MOST_TIME, Watched, vtrace, watched};

/// Longest time for a picture of a sound model, which a busy machine may need.
const PATIENCE: Duration = Duration::from_secs(60);

fn main() -> ExitCode {
    let Some(folder) = std::env::args_os().nth(1).map(PathBuf::from) else {
        eprintln!("usage: check_models DIR");
        return ExitCode::from(2);
    };
    let rows = match manifest(&folder) {
        Ok(rows) => rows,
        Err(problem) => {
            eprintln!("error: {}: {problem}", folder.join("manifest.json").display());
            return ExitCode::FAILURE;
        }
    };
    let pictures = tempfile::tempdir().expect("a temporary folder");
    let mut failed = 0;
    for (index, (file, expected)) in rows.iter().enumerate() {
        let picture = pictures.path().join(format!("{index}.png"));
        match check(&folder.join(file), expected, &picture) {
            Ok(what) => println!("ok      {file}: {what}"),
            Err(problem) => {
                failed += 1;
                println!("FAILED  {file}: {problem}");
            }
        }
    }
    println!("{} passed, {failed} failed", rows.len() - failed);
    if failed == 0 && !rows.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

/// File and expectation of every row.
fn manifest(folder: &Path) -> Result<Vec<(String, String)>, String> {
    let text = fs::read_to_string(folder.join("manifest.json")).map_err(|error| error.to_string())?;
    let rows: Vec<Value> = serde_json::from_str(&text).map_err(|error| error.to_string())?;
    let word = |row: &Value, key: &str| {
        row[key].as_str().map(String::from).ok_or_else(|| format!("a row without {key:?}: {row}"))
    };
    rows.iter().map(|row| Ok((word(row, "file")?, word(row, "expect")?))).collect()
}

fn check(model: &Path, expected: &str, picture: &Path) -> Result<String, String> {
    let Watched { code, stderr, seconds, bytes } = render(model, expected, picture)?;
    let lines: Vec<&str> = stderr.lines().collect();
    let cost = format!("{seconds:.1} s, {} MiB", bytes >> 20);
    match (code, expected) {
        (Some(0), "ok" | "ok-warn" | "either") => {
            let notes = lines.iter().filter(|line| line.starts_with("note: ")).count();
            if !picture.exists() {
                Err("exit code 0 and no picture".into())
            } else if expected == "ok-warn" && notes == 0 {
                Err("rendered without a note".into())
            } else {
                Ok(format!("{cost}: rendered, {notes} notes"))
            }
        }
        (Some(1), "error" | "either") => {
            let errors: Vec<&&str> = lines.iter().filter(|line| line.starts_with("error: ")).collect();
            match errors[..] {
                [error] if !picture.exists() && !error.contains("internal error") => {
                    Ok(format!("{cost}: {error}"))
                }
                _ => Err(format!("not one clear error, or a picture left behind: {stderr}")),
            }
        }
        (code, _) => Err(format!("{expected} expected, exit code {code:?}: {stderr}")),
    }
}

fn render(model: &Path, expected: &str, picture: &Path) -> Result<Watched, String> {
    let mut command = vtrace()?;
    command.args(["render", "--size", "160x128", "--max-samples", "4000", "-o"]).args([picture, model]);
    watched(&mut command, if expected == "ok" { PATIENCE } else { MOST_TIME })
}
