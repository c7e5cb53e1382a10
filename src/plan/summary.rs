//! A plan in words and numbers, beside the same frame with nothing left out.

use std::collections::BTreeMap;
use std::fmt;

use serde::Serialize;

use super::{Cost, Plan};
use crate::options::Options;
use crate::report::stats::LeftOut;
use crate::scene::Scene;

/// What `vtrace plan` tells.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Summary {
    /// Name of the scene.
    pub scene: String,
    /// Parts in the plan.
    pub used: Vec<String>,
    /// Parts that are not, and why.
    pub left_out: Vec<LeftOut>,
    /// What the plan takes before its first frame.
    pub planned: Cost,
    /// What it would take with nothing left out.
    pub everything: Cost,
    /// The difference.
    pub saved: Saved,
}

/// What leaving out saves.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Saved {
    /// Bytes of buffers and images.
    pub bytes: u64,
    /// Colour passes.
    pub passes: Vec<&'static str>,
}

impl Summary {
    /// The plan of `scene` under `options`, and the same with [`Options::everything`].
    pub fn new(scene: &Scene, options: &Options) -> Self {
        let plan = Plan::new(scene, options);
        let all = Options { everything: true, ..options.clone() };
        let everything = Plan::new(scene, &all).cost(scene, &all);
        let planned = plan.cost(scene, options);
        let spared = |pass: &&&'static str| !planned.passes.contains(pass);
        Self {
            scene: scene.name.clone(),
            saved: Saved {
                bytes: everything.bytes.saturating_sub(planned.bytes),
                passes: everything.passes.iter().filter(spared).copied().collect(),
            },
            used: plan.used,
            left_out: plan.left_out,
            planned,
            everything,
        }
    }
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{} uses\n  {}\n", self.scene, self.used.join("\n  "))?;
        writeln!(f, "left out")?;
        for LeftOut { what, why } in &self.left_out {
            writeln!(f, "  {what}: {why}")?;
        }
        let columns = [&self.planned, &self.everything].map(|cost| {
            cost.resources.iter().map(|resource| (resource.what, resource.bytes)).collect::<BTreeMap<_, _>>()
        });
        writeln!(f, "\n{:<46}{:>12}{:>14}", "bytes before a frame", "planned", "--everything")?;
        for resource in &self.everything.resources {
            let [planned, everything] =
                columns.each_ref().map(|column| mib(column.get(resource.what).copied().unwrap_or(0)));
            writeln!(f, "  {:<44}{planned:>12}{everything:>14}", resource.what)?;
        }
        let [planned, everything] = [&self.planned, &self.everything].map(|cost| mib(cost.bytes));
        writeln!(f, "  {:<44}{planned:>12}{everything:>14}", "all")?;
        let Saved { bytes, passes } = &self.saved;
        write!(f, "\nsaved: {}", mib(*bytes))?;
        match passes.len() {
            0 => writeln!(f),
            count => {
                writeln!(f, " and {count} of {} passes: {}", self.everything.passes.len(), passes.join(", "))
            }
        }
    }
}

fn mib(bytes: u64) -> String {
    match bytes {
        0 => "-".into(),
        bytes => format!("{:.3} MiB", bytes as f64 / f64::from(1 << 20)),
    }
}
