//! Any numbers at all as positions, normals, coordinates, factors and a camera: from scene to small frame.

#![no_main]

use libfuzzer_sys::fuzz_target;

#[path = "../bodies/frame.rs"]
mod body;

fuzz_target!(|bytes: &[u8]| {
    body::frame(bytes);
});
