//! Renders every model of a folder small and holds it against the folder's `manifest.json`.
//!
//! `cargo run --release --example check_models -- DIR`; `make test-models DIR=…` does that. A row of the
//! manifest names a file and what must happen: `ok` a picture, `ok-warn` a picture and a note, `error` one
//! clear line on stderr and no picture, `either` any of these. Each model has a process of its own, so that a
//! crash or a hang is one failure among others.

use std::{
    fs,
    path::{Path, PathBuf},
    process::{Command, ExitCode, Output, Stdio},
    time::{Duration, Instant},
};

use serde_json::Value;

/// Longest time for one model.
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
    let output = render(model, picture)?;
    let stderr = String::from_utf8_lossy(&output.stderr);
    let lines: Vec<&str> = stderr.lines().collect();
    match (output.status.code(), expected) {
        (Some(0), "ok" | "ok-warn" | "either") => {
            let notes = lines.iter().filter(|line| line.starts_with("note: ")).count();
            if !picture.exists() {
                Err("exit code 0 and no picture".into())
            } else if expected == "ok-warn" && notes == 0 {
                Err("rendered without a note".into())
            } else {
                Ok(format!("rendered, {notes} notes"))
            }
        }
        (Some(1), "error" | "either") => {
            let errors: Vec<&&str> = lines.iter().filter(|line| line.starts_with("error: ")).collect();
            match errors[..] {
                [error] if !picture.exists() && !error.contains("internal error") => Ok((*error).to_string()),
                _ => Err(format!("not one clear error, or a picture left behind: {stderr}")),
            }
        }
        (code, _) => Err(format!("{expected} expected, exit code {code:?}: {stderr}")),
    }
}

fn render(model: &Path, picture: &Path) -> Result<Output, String> {
    // Examples are built into a folder below the programs'.
    let own = std::env::current_exe().map_err(|error| error.to_string())?;
    let program = own.parent().and_then(Path::parent).map(|folder| folder.join("vtrace")).unwrap_or_default();
    let mut child = Command::new(&program)
        .args(["render", "--size", "160x128", "--max-samples", "4000", "-o"])
        .args([picture, model])
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .map_err(|error| format!("{}: {error}", program.display()))?;
    let started = Instant::now();
    while child.try_wait().map_err(|error| error.to_string())?.is_none() {
        if started.elapsed() > PATIENCE {
            child.kill().and_then(|()| child.wait()).map_err(|error| error.to_string())?;
            return Err(format!("still running after {} s", PATIENCE.as_secs()));
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    child.wait_with_output().map_err(|error| error.to_string())
}
