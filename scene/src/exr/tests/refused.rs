//! Truncated, damaged and other files.

use super::super::*;
use super::{Folder, gradient, layer};
use crate::testing::assert_error;
use ::exr::prelude::{Blocks, Compression, Vec2, WritableImage};
use eagpt_testkit::damage::{for_each_damage, for_each_truncation};
use std::path::Path;

#[test]
fn truncated_files_are_errors() {
    let folder = Folder::new();
    let (whole, part) = (folder.path("whole.exr"), folder.path("part.exr"));
    write_rgb(&whole, &gradient(40, 50), Precision::Half).unwrap();
    let bytes = std::fs::read(&whole).unwrap();
    for_each_truncation(&bytes, 150, |prefix| {
        std::fs::write(&part, prefix).unwrap();
        assert_error(read_rgb(&part), &["part.exr: "]);
    });
}

#[test]
fn damaged_files_never_panic() {
    let folder = Folder::new();
    let path = folder.path("a.exr");
    let mut num_refused = 0;
    for compression in [Compression::ZIP16, Compression::PIZ, Compression::RLE] {
        for blocks in [Blocks::ScanLines, Blocks::Tiles(Vec2(16, 16))] {
            let mut layer = layer("", &["R", "G", "B"]);
            layer.encoding.compression = compression;
            layer.encoding.blocks = blocks;
            let image = ::exr::prelude::Image::from_layer(layer);
            image.write().to_file(&path).unwrap();
            let bytes = std::fs::read(&path).unwrap();
            for_each_damage(&bytes, 0..DAMAGES, |damaged| {
                std::fs::write(&path, damaged).unwrap();
                num_refused += u32::from(read_rgb(&path).is_err());
                let _size = read_size(&path);
            });
        }
    }
    assert!(num_refused > DAMAGES, "only {num_refused} refused");
}

#[test]
fn an_assertion_of_the_decoder_becomes_an_error() {
    let outcome = super::super::read::guarded::<()>(Path::new("a.exr"), || panic!("on purpose"));
    assert_error(outcome, &["a.exr: content: corrupt"]);
}

/// Damaged copies for each kind of file.
const DAMAGES: u32 = 300;

#[test]
fn sizes_that_the_file_cannot_hold_are_refused_before_allocating() {
    let folder = Folder::new();
    let path = folder.path("a.exr");
    write_rgb(&path, &gradient(8, 8), Precision::Float).unwrap();
    let mut bytes = std::fs::read(&path).unwrap();
    let with_window = |bytes: &[u8], key: &[u8], max: i32| {
        let mut bytes = bytes.to_vec();
        let at = bytes.windows(key.len()).position(|w| w == key).unwrap();
        // Name and type with their zeros, the size of the value, xMin and yMin; then xMax and yMax.
        let at = at + key.len() + 1 + "box2i".len() + 1 + 4 + 8;
        bytes[at..at + 4].copy_from_slice(&max.to_le_bytes());
        bytes[at + 4..at + 8].copy_from_slice(&max.to_le_bytes());
        std::fs::write(&path, bytes).unwrap();
    };
    with_window(&bytes, b"displayWindow", 999_999);
    let wanted = ["a.exr: displayWindow: 1000000x1000000 is larger than 2^28 pixels"];
    assert_error(read_rgb(&path), &wanted);
    assert_error(read_size(&path), &wanted);
    // The number of blocks is optional in files like this one; with it the decoder finds the
    // contradiction itself.
    with_window(&bytes, b"dataWindow", 9_999);
    assert_error(read_rgb(&path), &["a.exr: content: ", "chunk count"]);
    let at = bytes.windows(10).position(|w| w == b"chunkCount").unwrap();
    bytes[at..at + 10].copy_from_slice(b"chunkOther");
    with_window(&bytes, b"dataWindow", 9_999);
    assert_error(
        read_rgb(&path),
        &["a.exr: dataWindow: 10000x10000 cannot be held by a file of"],
    );
}

#[test]
fn other_files_are_named() {
    let folder = Folder::new();
    let path = folder.path("a.exr");
    assert_error(read_rgb(&path), &["a.exr: no such file"]);
    std::fs::write(&path, b"\x89PNG\r\n").unwrap();
    assert_error(read_rgb(&path), &["a.exr: content: "]);
    assert_error(read_size(&path), &["a.exr: content: "]);
}
