//! A process that is ended when it takes too much time or memory.

use std::{
    fs,
    io::Read,
    path::Path,
    process::{Command, Stdio},
    thread,
    time::{Duration, Instant},
};

/// Longest time that a broken file may take, whatever is in it.
pub const MOST_TIME: Duration = Duration::from_secs(10);
/// Most memory, in bytes, that a file may take at once.
const MOST_BYTES: u64 = 3_000_000_000;

/// What a process did within the limits.
#[derive(Debug)]
pub struct Watched {
    /// Its exit code; `None` if a signal ended it.
    pub code: Option<i32>,
    /// What it wrote to stderr.
    pub stderr: String,
    /// Its time in seconds.
    pub seconds: f64,
    /// The most memory that it held, in bytes; 0 where the system does not tell.
    pub bytes: u64,
}

/// The program of the profile that this example was built in.
///
/// # Errors
/// Why this example does not know where it is.
#[allow(dead_code)] // tests know their program
pub fn vtrace() -> Result<Command, String> {
    // Examples are built into a folder below the programs'.
    let own = std::env::current_exe().map_err(|error| error.to_string())?;
    Ok(Command::new(own.parent().and_then(Path::parent).unwrap_or(Path::new("")).join("vtrace")))
}

/// Runs `command` to its end, and no further than `most_time` and 3 GB.
///
/// # Errors
/// Which limit it passed, or why it could not be started.
pub fn watched(command: &mut Command, most_time: Duration) -> Result<Watched, String> {
    let program = command.get_program().to_string_lossy().into_owned();
    let started = Instant::now();
    let mut child = command
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .map_err(|error| format!("{program}: {error}"))?;
    let pipe = child.stderr.take();
    let reader = thread::spawn(move || {
        let mut text = Vec::new();
        // What cannot be read was not written.
        let _ = pipe.map(|mut pipe| pipe.read_to_end(&mut text));
        String::from_utf8_lossy(&text).into_owned()
    });
    let mut bytes = 0;
    let status = loop {
        bytes = peak(child.id()).unwrap_or(0).max(bytes);
        if let Some(status) = child.try_wait().map_err(|error| error.to_string())? {
            break status;
        }
        let passed = if bytes > MOST_BYTES {
            Some(format!("holds {} MiB", bytes >> 20))
        } else {
            (started.elapsed() > most_time).then(|| format!("still running after {} s", most_time.as_secs()))
        };
        if let Some(passed) = passed {
            child.kill().and_then(|()| child.wait()).map_err(|error| error.to_string())?;
            return Err(passed);
        }
        thread::sleep(Duration::from_millis(2));
    };
    let stderr = reader.join().unwrap_or_default();
    Ok(Watched { code: status.code(), stderr, seconds: started.elapsed().as_secs_f64(), bytes })
}

/// The high-water mark of a process's memory, in bytes. It never falls, so that no peak between two looks is missed but
/// the last one's.
fn peak(process: u32) -> Option<u64> {
    let status = fs::read_to_string(format!("/proc/{process}/status")).ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    Some(line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()? * 1024)
}
