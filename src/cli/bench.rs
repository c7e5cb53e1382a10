//! `vtrace bench`: error against run time, in one command.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use clap::{Args, value_parser};

use super::{
    Failure,
    args::{PathArgs, SceneArgs, ThreadArgs, ViewArgs},
    files::{self, Folder, Inputs},
    terminal, values,
};
use crate::{
    error::{Error, Result},
    gpu::{self, Gpu},
    options::{Options, Reconstruction},
    report::{
        bench::{
            Bench, csv,
            ladder::{Antialiasing, Ladder, Outside, Rate},
            measure::{self, Measured},
            page,
            rounds::Observer,
            scaling::{self, Extent},
        },
        output::{check_writable, to_json, write_file},
    },
};

/// Measure error against run time: vertex tracing, the ray tracer, and other programs' images
///
/// Runs every way at a ladder of efforts, in turn, and writes bench.csv, bench.json, SVG plots and one
/// self-contained page, index.html, into a folder. Errors are against a picture of many samples a pixel, which
/// is kept in the folder for the next run.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  vtrace bench assets/cup.glb --out out/bench
  vtrace bench scene.glb --out out/bench --size 640x512 --samples 1000,8000 --spp 1/4,1,4 --repeats 3
  vtrace bench scene.glb --out out/bench --compare embree=embree.pfm,0.38")]
pub struct BenchArgs {
    /// Scene, a .glb or .gltf file
    scene: PathBuf,
    /// Folder to write into; made if absent
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Budgets of vertex tracing, in samples; a preview comes before them
    #[arg(
        long,
        value_name = "N,…",
        value_delimiter = ',',
        default_value = "1000,4000,16000,64000",
        value_parser = values::count,
        allow_hyphen_values = true
    )]
    samples: Vec<u64>,
    /// Sampling rates of the ray tracer, in samples a pixel
    #[arg(
        long,
        value_name = "N,…",
        value_delimiter = ',',
        default_value = "1/4,1,2,4,8,16",
        allow_hyphen_values = true
    )]
    spp: Vec<Rate>,
    /// What is interpolated between traced vertices
    #[arg(long, value_delimiter = ',', default_value = "exact,paper", value_parser = values::choice::<Reconstruction>())]
    reconstruction: Vec<Reconstruction>,
    /// How vertex tracing smooths edges
    #[arg(long, value_delimiter = ',', default_value = "ss1,ss4,msaa4,pixels16", value_parser = values::choice::<Antialiasing>())]
    antialiasing: Vec<Antialiasing>,
    /// Timed runs of every point, 1 to 1000
    #[arg(
        long,
        value_name = "N",
        default_value_t = 5,
        value_parser = value_parser!(u16).range(1..=1000),
        allow_negative_numbers = true
    )]
    repeats: u16,
    /// Samples a pixel of the picture that errors are against, 1 to 65536
    #[arg(
        long,
        value_name = "N",
        default_value_t = 64,
        value_parser = value_parser!(u32).range(1..=65536),
        allow_negative_numbers = true
    )]
    reference_spp: u32,
    /// Another program's image of the same view, and the seconds that it took; may be repeated
    #[arg(long, value_name = "NAME=IMAGE,SECONDS", value_parser = outside)]
    compare: Vec<Outside>,
    /// Measure how times grow with pixels, triangles, bounces and threads too
    #[arg(long, num_args = 0..=1, require_equals = true, default_missing_value = "full", value_name = "full|quick", value_parser = ["full", "quick"])]
    scaling: Option<String>,
    #[command(flatten)]
    view: ViewArgs,
    #[command(flatten)]
    paths: PathArgs,
    #[command(flatten)]
    what: SceneArgs,
    /// Device to draw with, by name or by index of `vtrace devices`
    #[arg(long, value_name = "NAME|INDEX", help_heading = "Machine")]
    device: Option<String>,
    #[command(flatten)]
    threads: ThreadArgs,
}

/// `NAME=IMAGE,SECONDS`; the image's name may hold commas and equals signs.
fn outside(text: &str) -> Result<Outside, String> {
    let parts = text.split_once('=').and_then(|(name, rest)| Some((name, rest.rsplit_once(',')?)));
    let (name, (image, seconds)) =
        parts.ok_or("not a name, an image and seconds such as embree=embree.pfm,0.38")?;
    let seconds: f64 = seconds
        .trim()
        .parse()
        .ok()
        .filter(|&s: &f64| s.is_finite() && s > 0.0)
        .ok_or("the seconds after the last comma are not a number above 0")?;
    if name.is_empty() || image.is_empty() {
        return Err("not a name, an image and seconds such as embree=embree.pfm,0.38".into());
    }
    Ok(Outside { name: name.into(), image: image.into(), seconds })
}

impl BenchArgs {
    fn ladder(&self) -> Result<Ladder, Failure> {
        let options = Options {
            view: self.view.options(),
            paths: self.paths.options(),
            scene: self.what.options(),
            device: self.device.clone(),
            ..Options::default()
        };
        let checked = options.check().and_then(|()| self.check_files(&options));
        checked.map_err(|problem| Failure::conflict("bench", problem))?;
        Ok(Ladder {
            options,
            samples: self.samples.clone(),
            reconstructions: self.reconstruction.clone(),
            antialiasings: self.antialiasing.clone(),
            rates: self.spp.clone(),
            outside: self.compare.clone(),
            repeats: self.repeats.into(),
            reference_spp: self.reference_spp,
            min_throughput: self.paths.min_throughput,
        })
    }

    /// Checks that no result takes the place of what is read.
    fn check_files(&self, options: &Options) -> Result<(), String> {
        let compared = self.compare.iter().map(|from| (from.name.as_str(), from.image.as_path())).collect();
        let results: Vec<_> = files::entries(&self.out, is_result).map(|path| ("--out", path)).collect();
        Inputs { compared, ..Inputs::for_scene(&self.scene, &options.scene) }.check_kept(&results)
    }
}

/// Whether [`write`] gives a file this name.
fn is_result(name: &OsStr) -> bool {
    let fixed = ["bench.csv", "scaling.csv", "bench.json", "index.html"].iter().any(|fixed| name == *fixed);
    fixed || Path::new(name).extension().is_some_and(|extension| extension == "svg")
}

pub(super) fn run(args: &BenchArgs) -> Result<(), Failure> {
    let ladder = args.ladder()?;
    args.threads.apply()?;
    let folder = args.out.as_path();
    let (scene, _) = ladder.options.load(&args.scene)?;
    terminal::notes_on(&scene);
    let gpu = Gpu::new(&gpu::Options { device: ladder.options.device.clone(), validation: false })?;
    let _made = Folder::make(folder)?;
    check_writable(&folder.join("index.html"))?;

    let interrupt = terminal::interrupt();
    let bar = Bar(Mutex::new(None));
    let cache = folder.join("cache");
    let mut measured = measure::measure(&gpu, &scene, &ladder, Some(&cache), &interrupt, &bar)?;
    if let Some(extent) = &args.scaling {
        let extent =
            if extent == "quick" { Extent::quick(ladder.repeats) } else { Extent::full(ladder.repeats) };
        measured.bench.scaling = scaling::measure(&gpu, &scene, &ladder.options, &extent, &interrupt, &bar)?;
    }
    drop(bar);
    write(folder, &measured)?;
    let mut text: String = measured.bench.findings.iter().map(|finding| format!("{finding}\n")).collect();
    text += &format!("wrote    {}\n", folder.join("index.html").display());
    terminal::print(&text)?;
    Ok(())
}

/// Writes every file, the page last.
fn write(folder: &Path, Measured { bench, pictures }: &Measured) -> Result<()> {
    let plots = plots(bench, folder)?;
    let captioned: Vec<(&str, &str)> =
        plots.iter().map(|(_, caption, svg)| (caption.as_str(), svg.as_str())).collect();
    let html = page::html(bench, pictures, &captioned)?;
    write_file(&folder.join("bench.csv"), csv::points(bench).as_bytes())?;
    if !bench.scaling.is_empty() {
        write_file(&folder.join("scaling.csv"), csv::scaling(bench).as_bytes())?;
    }
    write_file(&folder.join("bench.json"), to_json(bench)?.as_bytes())?;
    for (name, _, svg) in &plots {
        write_file(&folder.join(format!("{name}.svg")), svg.as_bytes())?;
    }
    write_file(&folder.join("index.html"), html.as_bytes())
}

/// Name, caption and document of every plot.
#[cfg(feature = "plots")]
fn plots(bench: &Bench, folder: &Path) -> Result<Vec<(String, String, String)>> {
    let plots = crate::report::bench::plot::all(bench).map_err(|error| Error::Image {
        path: folder.into(),
        problem: format!("cannot be plotted: {error}"),
    })?;
    Ok(plots.into_iter().map(|plot| (plot.name, plot.caption, plot.svg)).collect())
}

#[cfg(not(feature = "plots"))]
fn plots(_: &Bench, folder: &Path) -> Result<Vec<(String, String, String)>> {
    terminal::note(&format!("{}: plots are left out: built without the feature `plots`", folder.display()));
    Ok(Vec::new())
}

/// A progress bar for each stage.
struct Bar(Mutex<Option<terminal::Progress>>);

impl Observer for Bar {
    fn stage(&self, name: &'static str) {
        let mut bar = self.0.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        *bar = None; // the last one is cleared before the next is drawn
        *bar = Some(terminal::Progress::new(name));
    }

    fn share(&self, share: f32) {
        let bar = self.0.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        if let Some(bar) = bar.as_ref() {
            bar.set(share);
        }
    }
}
