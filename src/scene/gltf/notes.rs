//! Collects what was ignored or repaired, and keeps a file with a million faults from making a million lines.

use std::cell::RefCell;
use std::collections::BTreeMap;

/// Lines of one kind that are kept word for word.
const KEPT: usize = 8;

/// Notes in the order that they were made.
#[derive(Default)]
pub struct Notes(RefCell<Collected>);

#[derive(Default)]
struct Collected {
    lines: Vec<String>,
    by_kind: BTreeMap<&'static str, usize>,
}

impl Notes {
    /// Adds a line of a kind; beyond the first few of a kind it is counted only.
    pub fn add(&self, kind: &'static str, line: impl FnOnce() -> String) {
        let mut collected = self.0.borrow_mut();
        let count = collected.by_kind.entry(kind).or_default();
        *count += 1;
        if *count <= KEPT {
            collected.lines.push(line());
        }
    }

    /// All lines, with one closing line for each kind that was cut short.
    pub fn into_lines(self) -> Vec<String> {
        let Collected { mut lines, by_kind } = self.0.into_inner();
        for (kind, count) in by_kind {
            if count > KEPT {
                lines.push(format!("{kind}: {} more", count - KEPT));
            }
        }
        lines
    }
}
