//! Where images and stats go.

use std::path::{Path, PathBuf};

use clap::Args;

use super::{terminal, values};
use crate::{
    error::Result,
    report::{
        FloatImage, Stats,
        output::{Format, check_writable, same_file, to_json, write_file, write_image},
    },
};

/// Names of standard output.
const STDOUT: [&str; 4] = ["-", "/dev/stdout", "/dev/fd/1", "/proc/self/fd/1"];

#[derive(Debug, Args)]
#[command(next_help_heading = "Output")]
#[allow(missing_docs)] // the comments are the help texts
pub struct OutputArgs {
    /// Brighten a PNG by this many stops; EXR and PFM hold radiance untouched
    #[arg(long, value_name = "EV", default_value_t = 0.0, allow_hyphen_values = true, value_parser = values::exposure)]
    pub exposure: f32,
    /// Write counts and times as JSON to a file, or with - to standard output and nothing else there
    #[arg(long, value_name = "FILE.json|-")]
    pub stats: Option<PathBuf>,
}

impl OutputArgs {
    fn stats_on_stdout(&self) -> bool {
        self.stats.as_deref().is_some_and(|stats| STDOUT.iter().any(|name| stats == Path::new(name)))
    }

    /// The files that are written, each with the option that names it.
    pub fn results(&self, image: Option<&Path>) -> Vec<(&'static str, PathBuf)> {
        let stats = self.stats.as_deref().filter(|_| !self.stats_on_stdout());
        let named = [("--output", image), ("--stats", stats)].into_iter();
        named.filter_map(|(option, path)| Some((option, path?.to_path_buf()))).collect()
    }

    /// Checks that no two of the options in `named`, each with its path, and `--stats` name one file.
    ///
    /// # Errors
    /// Which do.
    pub fn check_distinct(&self, named: &[(&str, Option<&Path>)]) -> Result<(), String> {
        let stats = self.stats.as_deref().filter(|_| !self.stats_on_stdout());
        let given: Vec<(&str, &Path)> = named
            .iter()
            .chain([&("--stats", stats)])
            .filter_map(|&(option, path)| Some((option, path?)))
            .collect();
        for (index, (option, path)) in given.iter().enumerate() {
            if let Some((other, _)) = given[..index].iter().find(|(_, other)| same_file(path, other)) {
                return Err(format!("{other} and {option} name the same file, {}", path.display()));
            }
        }
        Ok(())
    }

    /// Checks, before the work, that its results can be written.
    ///
    /// # Errors
    /// See [`check_writable`].
    pub fn check(&self, image: Option<&Path>) -> Result<()> {
        let stats = self.stats.as_deref().filter(|_| !self.stats_on_stdout());
        for file in [image, stats].into_iter().flatten() {
            check_writable(file)?;
        }
        if let Some(image) = image.filter(|_| self.exposure != 0.0)
            && Format::of(image)? != Format::Png
        {
            terminal::note(&format!("{}: --exposure does not apply, only PNG is exposed", image.display()));
        }
        Ok(())
    }

    /// Writes the image and the stats, and tells on stdout what was done.
    ///
    /// # Errors
    /// See [`write_image`] and [`write_file`].
    pub fn write(&self, file: Option<&Path>, image: &FloatImage, stats: &Stats) -> Result<()> {
        if let Some(file) = file {
            write_image(file, image, self.exposure)?;
        }
        match &self.stats {
            Some(_) if self.stats_on_stdout() => return terminal::print(&to_json(stats)?),
            Some(path) => write_file(path, to_json(stats)?.as_bytes())?,
            None => {}
        }
        let written = file.map_or(String::new(), |file| format!("wrote    {}\n", file.display()));
        terminal::print(&format!("{stats}{written}"))
    }
}
