//! What is fuzzed, without a fuzzer: its corpus, and inputs of random bytes.

#[path = "../fuzz/bodies/frame.rs"]
mod frame;
#[path = "../fuzz/bodies/loader.rs"]
mod loader;

use std::{fs, path::Path};

use proptest::prelude::*;

/// Calls `body` with every input of the corpus of `target`; returns how many of them are scenes.
fn scenes(target: &str, body: fn(&[u8]) -> bool) -> usize {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/corpus").join(target);
    let files = fs::read_dir(folder).expect("there is a corpus").map(|entry| entry.unwrap().path());
    files.filter(|file| body(&fs::read(file).unwrap())).count()
}

#[test]
fn the_corpus_is_served_or_refused() {
    assert!(scenes("loader", loader::loader) >= 6);
    assert!(scenes("frame", frame::frame) >= 20);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    /// From one face to a dozen, of numbers of any size.
    #[test]
    fn any_numbers_give_a_frame(
        head in prop::array::uniform12(any::<u8>()),
        numbers in prop::collection::vec(-8.0_f32..8.0, 24..300),
        exponents in prop::collection::vec(-40_i32..40, 8),
    ) {
        let scaled = numbers.iter().zip(exponents.iter().cycle());
        let numbers = scaled.map(|(number, &exponent)| if head[2] & 2 == 0 { *number } else { number * 2_f32.powi(exponent) });
        let bytes: Vec<u8> = head.into_iter().chain(numbers.flat_map(f32::to_le_bytes)).collect();
        frame::frame(&bytes);
    }
}
