//! A profile as text.

use std::fmt;

use super::{Bound, Profile, Row, STAGES, rate};

impl fmt::Display for Profile {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "visibility of {} on {} ({}), median ms\n", self.scene, self.device, self.driver)?;
        let header = format!("{:<12}{:<16}{:>10}{:>10}", "way", "memory", "image", "triangles");
        write!(f, "{header}")?;
        STAGES.iter().try_for_each(|stage| write!(f, "{stage:>9}"))?;
        writeln!(f, "{:>16}{:>9}{:>9}{:>9}", "p10-p90", "KiB", "GB/s", "x copy")?;
        for stages in self.rows.chunk_by(|a, b| key(a) == key(b)) {
            self.line(f, stages)?;
        }
        writeln!(
            f,
            "\nx copy: all but drawing, as a multiple of a plain copy of the same bytes by one thread:"
        )?;
        for copy in &self.memcpy {
            let (kib, ms) = (copy.bytes.div_ceil(1024), copy.spread.median_ms);
            writeln!(f, "  {kib:>7} KiB in {ms:.3} ms, {:.1} GB/s", copy.rate())?;
        }
        writeln!(f, "\nleast times of turns:")?;
        self.bounds.iter().try_for_each(|bound| writeln!(f, "  {bound}"))?;
        writeln!(f, "\nstaging buffers in flight, ID buffer")?;
        for ring in &self.rings {
            writeln!(
                f,
                "  {} at {}x{}: latency {:.2} ms ({:.2}-{:.2}), {:.0} frames/s, {} frames late",
                ring.buffers,
                ring.width,
                ring.height,
                ring.latency.median_ms,
                ring.latency.p10_ms,
                ring.latency.p90_ms,
                ring.frames_per_second,
                ring.frames_late
            )?;
        }
        if !self.unavailable.is_empty() {
            writeln!(f, "\nunavailable memory: {}", self.unavailable.join(", "))?;
        }
        for left_out in &self.left_out {
            writeln!(f, "\nleft out: {}: {}", left_out.what, left_out.why)?;
        }
        let paper = self.paper;
        writeln!(
            f,
            "\npaper (2003): {}x{} read in {}-{} ms, scanned in under {} ms",
            paper.width, paper.height, paper.read_ms[0], paper.read_ms[1], paper.scan_ms
        )
    }
}

impl fmt::Display for Bound {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { what, against, width, height, triangles, .. } = self;
        write!(f, "{what} {width}x{height}, {triangles} triangles: {:.3} ms, ", self.best_ms)?;
        write!(f, "{against} {:.3} ms: {:.2} times that ", self.against_best_ms, self.ratio)?;
        write!(f, "({:.2} by medians), at most {:.1}: ", self.median_ratio, self.most)?;
        f.write_str(match (self.promised, self.holds) {
            (true, true) => "kept",
            (true, false) => "NOT KEPT",
            (false, true) => "true, though not promised of a software device",
            (false, false) => "not so, and not promised of a software device",
        })
    }
}

impl Profile {
    fn line(&self, f: &mut fmt::Formatter<'_>, stages: &[Row]) -> fmt::Result {
        let (Some(first), Some(total)) = (stages.first(), stages.last()) else { return Ok(()) };
        let size = format!("{}x{}", first.width, first.height);
        let memory = if first.in_place { "in place" } else { first.memory };
        write!(f, "{:<12}{memory:<16}{size:>10}{:>10}", first.way, first.triangles)?;
        stages.iter().try_for_each(|row| write!(f, "{:>9.3}", row.spread.median_ms))?;
        let after_draw = total.spread.median_ms - first.spread.median_ms;
        let spread = format!("{:.2}-{:.2}", total.spread.p10_ms, total.spread.p90_ms);
        let copy = self.memcpy.iter().find(|copy| copy.bytes == total.bytes);
        let ratio = copy.map_or(0.0, |copy| after_draw / copy.spread.median_ms.max(1e-9));
        let kib = total.bytes.div_ceil(1024);
        writeln!(f, "{spread:>16}{kib:>9}{:>9.1}{ratio:>9.2}", rate(total.bytes, after_draw))
    }
}

/// What rows of one line have in common.
fn key(row: &Row) -> (&str, &str, bool, u32, u32, u64) {
    (&row.way, row.memory, row.in_place, row.width, row.height, row.triangles)
}
