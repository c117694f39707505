//! Channels, parts, display window and primaries that are taken of a file.

use super::super::*;
use super::{Folder, layer};
use crate::testing::assert_error;
use ::exr::prelude::{IntegerBounds, Vec2, WritableImage};
use eagpt_testkit::test_data;
use std::path::Path;

fn write_layer(path: &Path, names: &[&str]) {
    let image = ::exr::prelude::Image::from_layer(layer("", names));
    image.write().to_file(path).unwrap();
}

/// The tens of the first pixel's channels: which channels were taken.
fn taken_rgb(path: &Path) -> [f32; 3] {
    read_rgb(path).unwrap().get(0, 0).map(|v| v / 10.0)
}

fn taken_single(path: &Path) -> f32 {
    read_single(path).unwrap().get(0, 0)[0] / 10.0
}

#[test]
fn colour_channels_are_found_by_name() {
    let folder = Folder::new();
    let path = folder.path("a.exr");
    let cases: [(&[&str], [f32; 3]); 9] = [
        (&["R", "G", "B"], [0.0, 1.0, 2.0]),
        (&["A", "B", "G", "R"], [3.0, 2.0, 1.0]),
        (&["X", "Y", "Z"], [0.0, 1.0, 2.0]),
        (&["Y"], [0.0, 0.0, 0.0]),
        (&["A", "Y"], [1.0, 1.0, 1.0]),
        (&["depth.V"], [0.0, 0.0, 0.0]),
        (
            &[
                "ViewLayer.Combined.R",
                "ViewLayer.Combined.G",
                "ViewLayer.Combined.B",
            ],
            [0.0, 1.0, 2.0],
        ),
        // Ambient occlusion sorts before the picture itself.
        (
            &[
                "View.AO.R",
                "View.AO.G",
                "View.AO.B",
                "View.Combined.R",
                "View.Combined.G",
                "View.Combined.B",
                "View.Normal.X",
                "View.Normal.Y",
                "View.Normal.Z",
            ],
            [3.0, 4.0, 5.0],
        ),
        // The layer without a name is the picture.
        (&["a.R", "a.G", "a.B", "b", "g", "r"], [5.0, 4.0, 3.0]),
    ];
    for (names, wanted) in cases {
        write_layer(&path, names);
        assert_eq!(taken_rgb(&path), wanted, "{names:?}");
    }
    write_layer(&path, &["R", "G", "Depth.Z"]);
    assert_error(
        read_rgb(&path),
        &["a.exr: channels: no R, G, B among", "Depth.Z", "G", "R"],
    );
}

#[test]
fn single_channels_are_found_by_name() {
    let folder = Folder::new();
    let path = folder.path("a.exr");
    let cases: [(&[&str], f32); 7] = [
        (&["Y"], 0.0),
        (&["anything"], 0.0),
        (&["A"], 0.0),
        (&["A", "V"], 1.0),
        (&["A", "B", "G", "R"], 3.0),
        (&["X", "Y", "Z"], 0.0),
        (&["id", "Z", "weight"], 1.0),
    ];
    for (names, wanted) in cases {
        write_layer(&path, names);
        assert_eq!(taken_single(&path), wanted, "{names:?}");
    }
    write_layer(&path, &["id", "weight"]);
    assert_error(read_single(&path), &["no single value among id, weight"]);
}

#[test]
fn parts_are_layers() {
    let folder = Folder::new();
    let path = folder.path("a.exr");
    let image = ::exr::prelude::Image::empty(::exr::prelude::ImageAttributes::new(
        IntegerBounds::from_dimensions((3, 2)),
    ))
    .with_layer(layer("depth", &["Z"]))
    .with_layer(layer("Combined", &["q", "R", "G", "B"]));
    image.write().to_file(&path).unwrap();
    assert_eq!(taken_rgb(&path), [1.0, 2.0, 3.0]);
    assert_eq!(taken_single(&path), 1.0);
}

#[test]
fn the_image_is_the_display_window() {
    let folder = Folder::new();
    let path = folder.path("a.exr");
    // Data of 3x2 at (-1, 1) in a display of 4x4: the first column is outside, rows 0 and 3 are
    // empty.
    let mut layer = layer("", &["Y"]);
    layer.attributes.layer_position = Vec2(-1, 1);
    let mut image = ::exr::prelude::Image::from_layer(layer);
    image.attributes.display_window = IntegerBounds::from_dimensions((4, 4));
    image.write().to_file(&path).unwrap();
    assert_eq!(read_size(&path).unwrap(), (4, 4));
    let values = read_single(&path).unwrap();
    #[rustfmt::skip]
    let wanted = [
        0.0, 0.0, 0.0, 0.0,
        1.0, 2.0, 0.0, 0.0,
        4.0, 5.0, 0.0, 0.0,
        0.0, 0.0, 0.0, 0.0,
    ];
    assert_eq!(values.values(), wanted);
}

#[test]
fn files_of_other_programs_are_read() {
    let Some(root) = test_data("files_of_other_programs_are_read", "kitchen") else {
        return;
    };
    let emission = read_single(&root.join("Emissive-exr/0000.exr")).unwrap();
    assert_eq!(emission.size(), (270, 180));
    assert!(emission.values().iter().all(|&v| v == 0.0 || v == 1.0));
    let normals = read_rgb(&root.join("Normal-exr/0000.exr")).unwrap();
    let unit = |n: &&[f32; 3]| (n.iter().map(|v| v * v).sum::<f32>() - 1.0).abs() < 0.01;
    let num_unit = normals.pixels().iter().filter(unit).count();
    assert!(num_unit > 270 * 180 * 9 / 10, "{num_unit}");
}

/// Eight by four colours of linear Rec.709 in other spaces: by colour-science 0.4 (Bradford), as
/// 32-bit floats by OpenEXR 3.4, with the attribute `chromaticities`; `none` has none.
fn stored(name: &str) -> std::path::PathBuf {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/chromaticities");
    data.join(format!("{name}.exr"))
}

#[test]
fn colours_of_other_primaries_become_rec709() {
    let expected = read_rgb(&stored("none")).unwrap();
    assert_eq!(read_rgb(&stored("rec709")).unwrap(), expected);
    for name in ["acescg", "aces2065", "xyz_e", "xyz_d65"] {
        let found = read_rgb(&stored(name)).unwrap();
        let unclipped = read_rgb_unclipped(&stored(name)).unwrap();
        let as_stored = read_vectors(&stored(name)).unwrap();
        let pixels = found.pixels().iter().zip(expected.pixels());
        for ((own, light), unclipped) in pixels.zip(unclipped.pixels()) {
            for channel in 0..3 {
                // Spaces round their matrices to a few digits; the largest colour is 16.
                let near = |value: f32| (value - light[channel]).abs() < 2e-4 * (1.0 + light[0]);
                assert!(near(own[channel]), "{name}: {own:?}, {light:?}");
                assert!(
                    near(unclipped[channel]) && own[channel] >= 0.0,
                    "{name}: {own:?}"
                );
            }
        }
        let far = as_stored.pixels().iter().zip(expected.pixels());
        assert!(
            far.into_iter().any(|(a, b)| (a[0] - b[0]).abs() > 0.1),
            "{name}"
        );
    }
}
