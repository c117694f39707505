//! Damaged and truncated files of sources: an error or a source, never a panic.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a test fails by panicking"
)]

mod common;

use eagpt_convert::{ImportOptions, SourceDataset, SourceFormat};
use eagpt_testkit::damage::{for_each_damage, for_each_truncation};
use std::path::Path;

/// Damaged copies of each file.
const NUM_COPIES: u32 = 200;

/// Opens the source with many damaged copies of one of its files.
fn damage(root: &Path, file: &str, format: SourceFormat) {
    let path = root.join(file);
    let bytes = std::fs::read(&path).unwrap();
    let mut num_refused = 0;
    let mut try_with = |damaged: &[u8]| {
        std::fs::write(&path, damaged).unwrap();
        if let Err(error) = SourceDataset::open(root, Some(format), &ImportOptions::default()) {
            let message = error.to_string();
            assert!(!message.contains('\n'), "{message}");
            num_refused += 1;
        }
    };
    for_each_damage(&bytes, 0..NUM_COPIES, &mut try_with);
    for_each_truncation(&bytes, 60, &mut try_with);
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
