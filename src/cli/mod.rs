//! The command line `vtrace`: arguments in, exit code out (design §9).
//!
//! Results go to stdout, messages to stderr. Exit codes: 0 done, 1 the input or the device could not
//! serve, 2 wrong usage, 130 interrupted.

pub mod args;
#[cfg(feature = "bench")]
mod bench;
mod compare;
mod devices;
mod files;
pub mod output;
mod plan;
#[cfg(feature = "bench")]
mod profile;
mod reference;
pub mod render;
#[cfg(feature = "bench")]
mod stability;
mod terminal;
pub mod values;
#[cfg(feature = "view")]
pub mod view;

#[cfg(not(feature = "view"))]
use std::ffi::OsString;
use std::process::ExitCode;

use clap::{CommandFactory, Parser, Subcommand, error::ErrorKind};

use crate::error::Error;

/// Reflections and refractions of textured surroundings by vertex tracing, on any Vulkan 1.3 device
#[derive(Debug, Parser)]
#[command(name = "vtrace", version, max_term_width = 100)]
pub struct Cli {
    /// What to do.
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Render(Box<render::RenderArgs>),
    Reference(Box<reference::ReferenceArgs>),
    Compare(compare::CompareArgs),
    Devices(devices::DevicesArgs),
    #[cfg(feature = "bench")]
    Profile(profile::ProfileArgs),
    #[cfg(feature = "bench")]
    Stability(stability::StabilityArgs),
    Plan(Box<plan::PlanArgs>),
    #[cfg(feature = "bench")]
    Bench(Box<bench::BenchArgs>),
    #[cfg(feature = "view")]
    View(Box<view::ViewerArgs>),
    /// Look at a scene in a window; not in this build
    #[cfg(not(feature = "view"))]
    #[command(hide = true, disable_help_flag = true)]
    View {
        /// Whatever else is said.
        #[arg(hide = true, trailing_var_arg = true, allow_hyphen_values = true)]
        _rest: Vec<OsString>,
    },
}

/// Why a command did not do its work.
enum Failure {
    /// The arguments are wrong, or it was help that was asked for.
    Usage(clap::Error),
    /// Input or device could not serve.
    Error(Error),
}

impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        Self::Error(error)
    }
}

impl From<clap::Error> for Failure {
    fn from(error: clap::Error) -> Self {
        Self::Usage(error)
    }
}

impl Failure {
    /// Arguments that are each valid and do not go together.
    fn conflict(subcommand: &str, problem: String) -> Self {
        let mut command = Cli::command();
        command.build(); // gives the subcommand its full name in the usage line
        let found = command.find_subcommand_mut(subcommand).expect("the subcommand that was parsed");
        Self::Usage(found.error(ErrorKind::ArgumentConflict, problem))
    }

    /// The viewer, asked of a build that lacks it.
    #[cfg(not(feature = "view"))]
    fn absent_view() -> Self {
        let problem = "this vtrace was built without the feature `view`; with it: \
                       cargo run --release --features view -- view SCENE\n";
        Self::Usage(clap::Error::raw(ErrorKind::InvalidSubcommand, problem))
    }
}

/// Runs the command that the arguments of this process name.
pub fn main() -> ExitCode {
    terminal::prepare();
    let outcome = terminal::catch(|| {
        let cli = Cli::try_parse()?;
        match cli.command {
            Command::Render(args) => render::run(&args)?,
            Command::Reference(args) => reference::run(&args)?,
            Command::Compare(args) => compare::run(&args)?,
            Command::Devices(args) => devices::run(&args)?,
            #[cfg(feature = "bench")]
            Command::Profile(args) => profile::run(&args)?,
            #[cfg(feature = "bench")]
            Command::Stability(args) => stability::run(&args)?,
            Command::Plan(args) => plan::run(&args)?,
            #[cfg(feature = "bench")]
            Command::Bench(args) => bench::run(&args)?,
            #[cfg(feature = "view")]
            Command::View(args) => view::run(&args)?,
            #[cfg(not(feature = "view"))]
            Command::View { .. } => return Err(Failure::absent_view()),
        }
        Ok(())
    });
    match outcome {
        Some(Ok(())) => ExitCode::SUCCESS,
        Some(Err(Failure::Usage(error))) if error.use_stderr() => {
            // Nobody is left to be told that it could not be told.
            let _ = error.print();
            ExitCode::from(2)
        }
        Some(Err(Failure::Usage(help))) => match terminal::printed(help.print()) {
            Ok(()) => ExitCode::SUCCESS,
            Err(error) => {
                terminal::complain(&error);
                ExitCode::from(1)
            }
        },
        Some(Err(Failure::Error(Error::Interrupted))) => {
            terminal::complain_of_interrupt();
            ExitCode::from(terminal::INTERRUPTED)
        }
        Some(Err(Failure::Error(error))) => {
            terminal::complain(&error);
            ExitCode::from(1)
        }
        None => ExitCode::from(1),
    }
}
