//! `vtrace stability`: stiff and extreme cases held against the truth.

use std::path::PathBuf;

use clap::Args;

use super::{Failure, args::ThreadArgs, files::Folder, terminal};
use crate::{
    error::{Error, Result},
    gpu::{Gpu, Options as DeviceOptions},
    report::{
        output::write_file,
        stability::{Report, cases, measure},
    },
};

/// Render stiff and extreme cases and hold them against the reference and closed forms
#[derive(Debug, Args)]
#[command(after_help = "Example: vtrace stability --out out/stability")]
pub struct StabilityArgs {
    /// Write stability.json, stability.txt and a plot for each case into this folder too
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print JSON in place of the table
    #[arg(long)]
    json: bool,
    /// Three values of each case at 96x72
    #[arg(long)]
    quick: bool,
    /// Only cases whose name contains this
    #[arg(long, value_name = "TEXT", default_value = "")]
    only: String,
    /// Device to render on, by name or by index of `vtrace devices`
    #[arg(long, value_name = "NAME|INDEX", help_heading = "Machine")]
    device: Option<String>,
    #[command(flatten)]
    threads: ThreadArgs,
}

pub(super) fn run(args: &StabilityArgs) -> Result<(), Failure> {
    let table = cases::all();
    if !table.iter().any(|case| case.name.contains(&args.only)) {
        let known: Vec<&str> = table.iter().map(|case| case.name).collect();
        let problem = format!("--only {}: no such case; there are {}", args.only, known.join(", "));
        return Err(Failure::conflict("stability", problem));
    }
    args.threads.apply()?;
    let _made = args.out.as_deref().map(Folder::make).transpose()?;
    let gpu = Gpu::new(&DeviceOptions { device: args.device.clone(), ..DeviceOptions::default() })?;
    let plan = if args.quick { measure::Plan::quick() } else { measure::Plan::full() };
    let plan = measure::Plan { only: args.only.clone(), ..plan };
    let bar = terminal::Progress::new("measuring");
    let report = measure::measure(&gpu, &table, &plan, &terminal::interrupt(), &|share| bar.set(share))?;
    drop(bar);
    let json = format!("{:#}\n", serde_json::json!(report));
    if let Some(folder) = &args.out {
        write_file(&folder.join("stability.json"), json.as_bytes())?;
        write_file(&folder.join("stability.txt"), report.to_string().as_bytes())?;
        write_plots(folder, &report)?;
    }
    terminal::print(&if args.json { json } else { report.to_string() })?;
    match report.failures() {
        0 => Ok(()),
        failures => Err(Error::Compare(format!("{failures} values are out of bounds")).into()),
    }
}

#[cfg(feature = "plots")]
fn write_plots(folder: &std::path::Path, report: &Report) -> Result<()> {
    for rows in report.rows.chunk_by(|a, b| a.case == b.case) {
        let path = folder.join(format!("{}.svg", rows[0].case));
        let svg = crate::report::stability::plot::svg(rows).map_err(|error| Error::Image {
            path: path.clone(),
            problem: format!("cannot be plotted: {error}"),
        })?;
        write_file(&path, svg.as_bytes())?;
    }
    Ok(())
}

#[cfg(not(feature = "plots"))]
fn write_plots(_: &std::path::Path, _: &Report) -> Result<()> {
    terminal::note("plots are left out: built without the feature `plots`");
    Ok(())
}
