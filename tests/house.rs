//! The walls of the house: which room may know which (CONTRIBUTING.md), and where `unsafe` may live.

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    path::Path,
};

/// Rooms that each room may know besides itself, `error`, `memory` and `constants`.
const ALLOWED: [(&str, &[&str]); 13] = [
    ("gpu", &[]),
    ("scene", &[]),
    ("options", &["scene"]),
    ("visibility", &["scene", "options", "gpu"]),
    ("trace", &["scene", "options"]),
    ("refine", &["scene", "options", "visibility", "trace"]),
    // The image type and the stats' entries are what is handed on.
    ("pixels", &["scene", "options", "visibility", "trace", "refine", "report"]),
    ("reconstruct", &["scene", "options", "gpu", "visibility", "trace", "refine", "pixels", "report"]),
    ("report", &["scene", "options", "gpu", "visibility", "trace", "frame"]),
    ("plan", &["scene", "options", "visibility", "reconstruct", "report"]),
    (
        "frame",
        &[
            "scene",
            "options",
            "gpu",
            "visibility",
            "trace",
            "refine",
            "pixels",
            "reconstruct",
            "report",
            "plan",
        ],
    ),
    ("view", &["scene", "options", "gpu", "trace", "report", "frame"]),
    ("cli", &["scene", "options", "gpu", "trace", "report", "frame", "plan", "view"]),
];

/// What stands in no room: the program, the library's root, and what everyone may know.
const OUTSIDE: [&str; 5] = ["main", "lib", "error", "constants", "memory"];

/// Every Rust file below `folder` with its text, tests and comments left out.
fn sources(folder: &Path, files: &mut Vec<(String, String)>) {
    for entry in fs::read_dir(folder).expect("src is there").map(|entry| entry.unwrap().path()) {
        if entry.is_dir() {
            sources(&entry, files);
        } else if entry.extension().is_some_and(|extension| extension == "rs") {
            let text = fs::read_to_string(&entry).unwrap();
            let code = text.split("#[cfg(test)]\nmod tests").next().unwrap_or_default();
            let lines = code.lines().filter(|line| !line.trim_start().starts_with("//"));
            files.push((entry.to_str().unwrap().into(), lines.collect::<Vec<_>>().join("\n")));
        }
    }
}

/// First names after `crate::`, those of a braced list too.
fn rooms_named(code: &str) -> BTreeSet<String> {
    let mut rooms = BTreeSet::new();
    let word = |text: &str| text.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect::<String>();
    for (at, _) in code.match_indices("crate::") {
        // `vertex_tracing::…` and `$crate::…` are not meant.
        if code[..at].ends_with('$') || code[..at].ends_with('_') {
            continue;
        }
        let rest = &code[at + "crate::".len()..];
        let Some(list) = rest.strip_prefix('{') else {
            rooms.insert(word(rest));
            continue;
        };
        let mut depth = 0;
        let mut start = true;
        for (index, c) in list.char_indices() {
            match c {
                '{' => depth += 1,
                '}' if depth == 0 => break,
                '}' => depth -= 1,
                ',' if depth == 0 => start = true,
                c if start && c.is_alphabetic() => {
                    rooms.insert(word(&list[index..]));
                    start = false;
                }
                _ => {}
            }
        }
    }
    rooms
}

fn room_of(file: &str) -> String {
    let inside = file.rsplit_once("/src/").map_or(file, |(_, inside)| inside);
    inside.split(['/', '.']).next().unwrap_or_default().into()
}

fn files() -> Vec<(String, String)> {
    let mut files = Vec::new();
    sources(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src"), &mut files);
    assert!(files.len() > 50, "the sources were found");
    files
}

/// What is wrong with a file that has this code.
fn wrong_with(file: &str, code: &str) -> Vec<String> {
    let allowed: BTreeMap<&str, &[&str]> = ALLOWED.into();
    let room = room_of(file);
    if OUTSIDE.contains(&room.as_str()) {
        return Vec::new();
    }
    let Some(may) = allowed.get(room.as_str()) else {
        return vec![format!("{file}: nothing says whom {room} may know")];
    };
    let forbidden = rooms_named(code).into_iter().filter(|known| {
        let everyone = ["error", "memory", "constants", "spirv"].contains(&known.as_str());
        !everyone && *known != room && !may.contains(&known.as_str())
    });
    forbidden.map(|known| format!("{file}: {room} may not know {known}")).collect()
}

#[test]
fn rooms_know_only_whom_they_may() {
    let problems: Vec<String> = files().iter().flat_map(|(file, code)| wrong_with(file, code)).collect();
    assert!(problems.is_empty(), "{}", problems.join("\n"));
}

#[test]
fn new_rooms_and_forbidden_ones_are_noticed() {
    assert_eq!(wrong_with("/src/foo/mod.rs", "").len(), 1);
    assert_eq!(wrong_with("/src/scene/mod.rs", "use crate::gpu::Gpu;").len(), 1);
    assert!(wrong_with("/src/cli/mod.rs", "use crate::gpu::Gpu;").is_empty());
    assert!(wrong_with("/src/main.rs", "use crate::cli;").is_empty());
}

#[test]
fn only_gpu_names_ash_and_is_unsafe() {
    for (file, code) in files() {
        if room_of(&file) == "gpu" {
            continue;
        }
        let blocks = ["unsafe {", "unsafe fn", "unsafe impl"];
        assert!(!blocks.iter().any(|block| code.contains(block)), "{file} is unsafe");
        let whole_word = |at: usize| !code[..at].ends_with(|c: char| c.is_alphanumeric() || c == '_');
        let uses_ash = code.match_indices("ash::").any(|(at, _)| whole_word(at));
        assert!(!uses_ash, "{file} names ash");
    }
}

/// Crates that a feature brings, and the only place that may name them.
#[test]
fn optional_crates_stay_where_their_feature_is() {
    for (file, code) in files() {
        let place = file.rsplit_once("/src/").map_or(file.as_str(), |(_, inside)| inside);
        let named = |name: &str| code.contains(&format!("{name}::"));
        for name in ["clap", "ctrlc", "env_logger", "indicatif"] {
            assert!(
                !named(name) || place.starts_with("cli/"),
                "{file} names {name}, which only `cli` brings"
            );
        }
        let window = place.ends_with("view/window.rs");
        assert!(!named("winit") || window, "{file} names winit: only the viewer's window does");
        assert!(
            !named("font8x8") || place.starts_with("view/"),
            "{file} names font8x8, which only `view` brings"
        );
        for name in ["ash_window", "raw_window_handle"] {
            assert!(
                !named(name) || place == "gpu/surface.rs",
                "{file} names {name}, which only `view` brings"
            );
        }
        assert!(!named("plotters") || place.ends_with("plot.rs"), "{file} names plotters: only plots do");
    }
}

#[test]
fn braced_lists_are_read() {
    let code = "use crate::{a, b::{c, d}, e};\nlet x = crate::f::g();";
    let expected: BTreeSet<String> = ["a", "b", "e", "f"].map(String::from).into();
    assert_eq!(rooms_named(code), expected);
}
