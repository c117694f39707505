//! Values and how they are stored: bits, halves, integers, encodings.

use super::super::*;
use super::{Folder, gradient};
use crate::image::Image;
use crate::testing::assert_error;
use ::exr::prelude::{
    AnyChannel, AnyChannels, Blocks, Compression, Encoding, FlatSamples, Layer, LayerAttributes,
    LineOrder, Vec2, WritableImage,
};
use half::f16;

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
