//! What the terminal shows: results, messages, progress, and the ways a run can end early.

use std::{
    fmt::Display,
    io::{self, IsTerminal, Write},
    panic,
    sync::{
        Arc, LazyLock, Once,
        atomic::{AtomicBool, Ordering},
    },
    thread,
    time::Duration,
};

use indicatif::{ProgressBar, ProgressStyle};

use crate::{
    error::{Error, Result, one_line},
    gpu::{end_at_once, keeping_hangups_ignored},
    report::output::hold_files,
    scene::Scene,
};

/// Exit code of a program that was interrupted: 128 and the number of SIGINT, as shells have it.
pub const INTERRUPTED: u8 = 130;

/// Lets signals end the program, and routes log messages and panics to stderr, one line each; of the former only errors, unless RUST_LOG says
/// otherwise: drivers and loaders warn of much that is no concern of the user.
pub fn prepare() {
    end_on_signals();
    env_logger::Builder::from_env(env_logger::Env::default().default_filter_or("error"))
        .format(|out, record| writeln!(out, "{}: {}", record.level().as_str().to_lowercase(), record.args()))
        .init();
    panic::set_hook(Box::new(|info| {
        static FIRST: Once = Once::new();
        FIRST.call_once(|| {
            let place = info.location().map_or(String::new(), |place| format!(" at {place}"));
            let payload = info.payload();
            let message = payload.downcast_ref::<&str>().copied();
            let message = message.or_else(|| payload.downcast_ref::<String>().map(String::as_str));
            let message = message.unwrap_or("no message");
            complain(&format!("internal error{place}: {message}; please report it with the command line"));
            let trace = std::backtrace::Backtrace::capture();
            if trace.status() == std::backtrace::BacktraceStatus::Captured {
                let _ = writeln!(io::stderr(), "{trace}");
            }
        });
    }));
}

/// The value of `work`, or `None` if it panicked; unwinding has then removed temporary files.
pub fn catch<T>(work: impl FnOnce() -> T) -> Option<T> {
    panic::catch_unwind(panic::AssertUnwindSafe(work)).ok()
}

/// Writes `error: problem` to stderr, in one line.
pub fn complain(problem: &dyn Display) {
    let _ = writeln!(io::stderr(), "error: {}", one_line(&problem.to_string()));
}

/// Tells that the user stopped the work; once, whether the work itself or the clock is the first to say so.
pub fn complain_of_interrupt() {
    static TOLD: Once = Once::new();
    TOLD.call_once(|| complain(&Error::Interrupted));
}

/// Writes `note: text` to stderr, in one line.
pub fn note(text: &str) {
    let _ = writeln!(io::stderr(), "note: {}", one_line(text));
}

/// Writes all notes on a scene to stderr.
pub fn notes_on(scene: &Scene) {
    scene.notes.iter().for_each(|line| note(line));
}

/// What work has after a first Ctrl-C to end by itself.
const GRACE: Duration = Duration::from_millis(500);

/// A flag that these signals set for long work to see.
pub fn interrupt() -> Arc<AtomicBool> {
    static FLAG: LazyLock<Arc<AtomicBool>> = LazyLock::new(Arc::default);
    FLAG.clone()
}

/// Lets Ctrl-C, SIGTERM and, unless it is ignored, SIGHUP end the program: work that looks at [`interrupt`] ends by itself. What does not in time,
/// a driver that compiles or a decoder, is ended with the process, between two files. A second signal does not wait.
fn end_on_signals() {
    let flag = interrupt();
    let handler = move || {
        if flag.swap(true, Ordering::Relaxed) {
            end_at_once(INTERRUPTED);
        }
        // Aside, so that a second signal is heard.
        thread::spawn(|| {
            thread::sleep(GRACE);
            let _held = hold_files();
            if io::stderr().is_terminal() {
                // A progress bar has stood here.
                let _ = write!(io::stderr(), "\r\x1b[2K");
            }
            complain_of_interrupt();
            end_at_once(INTERRUPTED);
        });
    };
    if let Err(error) = keeping_hangups_ignored(|| ctrlc::set_handler(handler)) {
        note(&format!("Ctrl-C will end the program without cleaning up: {error}"));
    }
}

/// A progress bar on stderr, where that is a terminal; gone when dropped.
pub struct Progress(ProgressBar);

impl Progress {
    const UNITS: u64 = 1000;

    /// A bar for the stage `name`.
    pub fn new(name: &'static str) -> Self {
        // indicatif draws nothing where stderr is not a terminal.
        let bar = ProgressBar::new(Self::UNITS).with_message(name);
        if let Ok(style) = ProgressStyle::with_template("{msg} {wide_bar} {percent:>3} %  {eta} left") {
            bar.set_style(style);
        }
        bar.enable_steady_tick(Duration::from_millis(200));
        Self(bar)
    }

    /// Shows that `share` of the stage is done, 0 to 1.
    pub fn set(&self, share: f32) {
        self.0.set_position((share * Self::UNITS as f32) as u64);
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.0.finish_and_clear();
    }
}

/// Writes a result to stdout.
pub fn print(text: &str) -> Result<()> {
    let mut stdout = io::stdout().lock();
    printed(stdout.write_all(text.as_bytes()).and_then(|()| stdout.flush()))
}

/// What came of writing to stdout; a reader that closed the pipe has read enough.
pub fn printed(outcome: io::Result<()>) -> Result<()> {
    match outcome {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => Err(Error::io("standard output")(error)),
        _ => Ok(()),
    }
}
