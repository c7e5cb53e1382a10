//! Any bytes at all as a glTF file: the loader gives a scene or an error.

#![no_main]

use libfuzzer_sys::fuzz_target;

#[path = "../bodies/loader.rs"]
mod body;

fuzz_target!(|bytes: &[u8]| {
    body::loader(bytes);
});
