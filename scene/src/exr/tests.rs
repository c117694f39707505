use super::*;
use crate::image::Image;
use crate::testing::assert_error;
use ::exr::prelude::{
    AnyChannel, AnyChannels, Blocks, Compression, Encoding, FlatSamples, IntegerBounds, Layer,
    LayerAttributes, LineOrder, Vec2, WritableImage,
};
use eagpt_testkit::damage::{for_each_damage, for_each_truncation};
use eagpt_testkit::test_data;
use half::f16;
use std::path::{Path, PathBuf};

struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }
}

/// A 3x2 layer whose channel number k holds 10 k, 10 k + 1, … 10 k + 5.
fn layer(part: &str, names: &[&str]) -> Layer<AnyChannels<FlatSamples>> {
    let channels = names.iter().enumerate().map(|(k, name)| {
        let samples = (0..6).map(|i| (10 * k + i) as f32).collect();
        AnyChannel::new(*name, FlatSamples::F32(samples))
    });
    let attributes = if part.is_empty() {
        LayerAttributes::default()
    } else {
        LayerAttributes::named(part)
    };
    Layer::new(
        (3, 2),
        attributes,
        Encoding::SMALL_LOSSLESS,
        AnyChannels::sort(channels.collect()),
    )
}

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

fn gradient(width: u32, height: u32) -> Image<3> {
    let pixels = (0..width * height).map(|i| {
        let x = i as f32;
        [x * 0.37, 1.0 / (1.0 + x), (x * 0.01).sin().abs() * 900.0]
    });
    Image::from_pixels(width, height, pixels.collect()).unwrap()
}

#[test]
fn float_files_hold_every_bit() {
    let folder = Folder::new();
    let path = folder.path("a.exr");
    let mut image = gradient(37, 41);
    image.pixels_mut()[5] = [f32::INFINITY, f32::MIN_POSITIVE / 4.0, -0.0];
    write_rgb(&path, &image, Precision::Float).unwrap();
    let back = read_rgb(&path).unwrap();
    assert_eq!(back.size(), (37, 41));
    let bits = |image: &Image<3>| {
        image
            .values()
            .iter()
            .map(|v| v.to_bits())
            .collect::<Vec<_>>()
    };
    assert_eq!(bits(&back), bits(&image));
    assert_eq!(read_size(&path).unwrap(), (37, 41));

    let mask = image.map(|pixel| [pixel[1]]);
    write_single(&path, &mask, Precision::Float).unwrap();
    assert_eq!(read_single(&path).unwrap(), mask);
}

#[test]
fn half_files_hold_the_nearest_half() {
    let folder = Folder::new();
    let path = folder.path("a.exr");
    let image = gradient(20, 30);
    write_rgb(&path, &image, Precision::Half).unwrap();
    let nearest = image.map(|pixel| pixel.map(|v| f16::from_f32(v).to_f32()));
    assert_eq!(read_rgb(&path).unwrap(), nearest);
}

#[test]
fn half_overflow_is_refused_with_its_pixel() {
    let folder = Folder::new();
    let path = folder.path("a.exr");
    let mut image = Image::filled(4, 3, [1.0; 3]);
    image.pixels_mut()[6] = [0.0, 65_519.0, 65_520.0];
    let wanted = ["a.exr: pixel (2, 1) channel B: 65520.0 does not fit"];
    assert_error(write_rgb(&path, &image, Precision::Half), &wanted);
    assert!(!path.exists());
    image.pixels_mut()[6][2] = f32::INFINITY;
    write_rgb(&path, &image, Precision::Half).unwrap();
    assert_eq!(
        read_rgb(&path).unwrap().get(2, 1),
        [0.0, 65_504.0, f32::INFINITY]
    );
}

#[test]
fn large_images_are_compressed_in_parallel_to_the_same_bytes_each_time() {
    let folder = Folder::new();
    let image = Image::from_pixels(
        1100,
        1000,
        (0..1_100_000_u32).map(|i| [(i % 4099) as f32]).collect(),
    )
    .unwrap();
    let (a, b) = (folder.path("a.exr"), folder.path("b.exr"));
    write_single(&a, &image, Precision::Half).unwrap();
    write_single(&b, &image, Precision::Half).unwrap();
    assert_eq!(std::fs::read(&a).unwrap(), std::fs::read(&b).unwrap());
    let nearest = image.map(|pixel| pixel.map(|v| f16::from_f32(v).to_f32()));
    assert_eq!(read_single(&a).unwrap(), nearest);
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
fn unsigned_integers_are_read() {
    let folder = Folder::new();
    let path = folder.path("a.exr");
    let ids = AnyChannel::new("id", FlatSamples::U32(vec![0, 7, 16_777_216]));
    let layer = Layer::new(
        (3, 1),
        LayerAttributes::default(),
        Encoding::FAST_LOSSLESS,
        AnyChannels::sort([ids].into_iter().collect()),
    );
    let image = ::exr::prelude::Image::from_layer(layer);
    image.write().to_file(&path).unwrap();
    let values = read_single(&path).unwrap();
    assert_eq!(values.values(), [0.0, 7.0, 16_777_216.0]);
}

#[test]
fn every_lossless_encoding_reads_the_same() {
    let folder = Folder::new();
    let path = folder.path("a.exr");
    let wanted = gradient(70, 45).map(|pixel| [f16::from_f32(pixel[2]).to_f32()]);
    let compressions = [
        Compression::Uncompressed,
        Compression::RLE,
        Compression::ZIP1,
        Compression::ZIP16,
        Compression::PIZ,
        Compression::PXR24,
    ];
    let orders = [LineOrder::Increasing, LineOrder::Decreasing];
    for compression in compressions {
        for blocks in [Blocks::ScanLines, Blocks::Tiles(Vec2(32, 16))] {
            for line_order in orders {
                let halves = wanted.values().iter().map(|v| f16::from_f32(*v)).collect();
                let channel = AnyChannel::new("Y", FlatSamples::F16(halves));
                let layer = Layer::new(
                    (70, 45),
                    LayerAttributes::default(),
                    Encoding {
                        compression,
                        blocks,
                        line_order,
                    },
                    AnyChannels::sort([channel].into_iter().collect()),
                );
                let image = ::exr::prelude::Image::from_layer(layer);
                image.write().to_file(&path).unwrap();
                let back = read_single(&path).unwrap();
                assert_eq!(back, wanted, "{compression} {blocks:?} {line_order:?}");
            }
        }
    }
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
    let outcome = super::read::guarded::<()>(Path::new("a.exr"), || panic!("on purpose"));
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
