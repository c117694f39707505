//! Damaged and truncated files of sources: an error or a source, never a panic.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a test fails by panicking"
)]

mod common;

use eagpt_convert::{ImportOptions, Source, SourceFormat};
use eagpt_scene::rng::{Purpose, RandomKey};
use std::path::Path;

/// Copies of each file that are damaged, and truncations.
const NUM_COPIES: u32 = 200;

/// Opens the source with many damaged copies of one of its files.
fn damage(root: &Path, file: &str, format: SourceFormat) {
    let path = root.join(file);
    let bytes = std::fs::read(&path).unwrap();
    let key = RandomKey::new(20, Purpose::Initialise, 0);
    let mut num_refused = 0;
    let mut try_with = |damaged: &[u8]| {
        std::fs::write(&path, damaged).unwrap();
        if let Err(error) = Source::open(root, Some(format), &ImportOptions::default()) {
            let message = error.to_string();
            assert!(!message.contains('\n'), "{message}");
            num_refused += 1;
        }
    };
    for copy in 0..NUM_COPIES {
        let mut damaged = bytes.clone();
        let mut stream = key.stream(copy, 0);
        for _ in 0..=copy % 4 {
            let [place, value, kind, _] = stream.next_words();
            // Bytes with a meaning in numbers and JSON find more defects than others.
            let telling = b"0919eE-+.,:[]{}\"\n x";
            damaged[place as usize % bytes.len()] = match kind % 3 {
                0 => value as u8,
                _ => telling[value as usize % telling.len()],
            };
        }
        try_with(&damaged);
    }
    for length in (0..bytes.len()).step_by(bytes.len().div_ceil(60)) {
        try_with(&bytes[..length]);
    }
    assert!(num_refused > NUM_COPIES / 10, "{file}: {num_refused}");
    std::fs::write(&path, bytes).unwrap();
}

#[test]
fn no_damage_panics_a_reader() {
    let dir = tempfile::tempdir().unwrap();
    let root = |name: &str| dir.path().join(name);
    common::fipt(&root("fipt"));
    common::fipt_synthetic(&root("synthetic"));
    common::eyeful(&root("kitchen"), 2);
    common::eyeful(&root("workshop"), 1);
    common::nerfstudio(&root("nerfstudio"));
    common::instant_ngp(&root("ngp"));
    for (name, file, format) in [
        ("fipt", "cam.txt", SourceFormat::Fipt),
        ("fipt", "K_list.txt", SourceFormat::Fipt),
        (
            "synthetic",
            "val/transforms.json",
            SourceFormat::FiptSynthetic,
        ),
        ("kitchen", "cameras.json", SourceFormat::Eyeful),
        ("kitchen", "splits.json", SourceFormat::Eyeful),
        ("workshop", "cameras.json", SourceFormat::Eyeful),
        ("nerfstudio", "transforms.json", SourceFormat::Nerfstudio),
        ("ngp", "transforms.json", SourceFormat::InstantNgp),
    ] {
        damage(&root(name), file, format);
    }
}
