//! Sensors whose pixels are not square.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a test fails by panicking, helpers outside of test functions included"
)]

mod common;

use common::*;
use eagpt_ingest::IngestOptions;
use eagpt_scene::exr::{self, Precision};
use std::fs::{self, File};
use tiff::encoder::colortype::RGB16;
use tiff::encoder::{Rational, TiffEncoder};
use tiff::tags::Tag;

/// DNG's DefaultScale.
const DEFAULT_SCALE: Tag = Tag::Unknown(50718);
const TIMES: [f64; 2] = [0.1, 0.4];
/// Size of the files, and radius of a round lamp in heights of a pixel.
const SIZE: [u32; 2] = [80, 96];
const RADIUS: f32 = 15.0;

/// Takes a bracket of a lamp with pixels `scales[0] / scales[1]` times as wide as high.
fn photograph(place: &Place, scales: [[u32; 2]; 2]) {
    let aspect = scales.map(|[n, d]| n as f32 / d as f32);
    let aspect = aspect[0] / aspect[1];
    fs::create_dir_all(place.path("c")).unwrap();
    for (index, time) in TIMES.iter().enumerate() {
        let light = |i: u32| {
            let (x, y) = (i % SIZE[0], i / SIZE[0]);
            let dx = (x as f32 + 0.5 - 0.5 * SIZE[0] as f32) * aspect;
            let dy = y as f32 + 0.5 - 0.5 * SIZE[1] as f32;
            // An edge that is soft over some pixels.
            0.1 + 0.9 / (1.0 + ((dx.hypot(dy) - RADIUS) / 2.0).exp())
        };
        let code = |i| (60_000.0 * light(i) * *time as f32) as u16;
        let samples: Vec<u16> = (0..SIZE[0] * SIZE[1]).flat_map(|i| [code(i); 3]).collect();
        let file = File::create(place.path(&format!("c/p0_{index}.tif"))).unwrap();
        let mut encoder = TiffEncoder::new(file).unwrap();
        let mut image = encoder.new_image::<RGB16>(SIZE[0], SIZE[1]).unwrap();
        let scales = scales.map(|[n, d]| Rational { n, d });
        image
            .encoder()
            .write_tag(DEFAULT_SCALE, &scales[..])
            .unwrap();
        image.write_data(&samples).unwrap();
    }
}

fn options() -> IngestOptions {
    IngestOptions {
        exposures_s: Some(TIMES.to_vec()),
        precision: Precision::Float,
        ..IngestOptions::default()
    }
}

#[test]
fn round_things_become_round() {
    // Wider than high, higher than wide, and square.
    for (scales, size, height_of_pixel) in [
        ([[3, 2], [1, 1]], (80, 64), 1.5),
        ([[3, 4], [3, 2]], (40, 96), 1.0),
        ([[1, 1], [1, 1]], (80, 96), 1.0),
    ] {
        let place = Place::new();
        photograph(&place, scales);
        let capture = place.ingests("c", "out", options()).capture;
        let is_told = |note: &String| note.contains("times as wide as high: made square");
        assert_eq!(capture.notes.iter().any(is_told), size != (80, 96));
        let image = exr::read_rgb(&place.path("out/Radiance-exr/p0.exr")).unwrap();
        assert_eq!(image.size(), size, "{scales:?}");
        // Pixels of the lamp, from which its height and width follow.
        let brightest = image.pixels().iter().map(|p| p[1]).fold(0.0, f32::max);
        let is_lamp = |x: u32, y: u32| image.get(x, y)[1] > 0.55 * brightest;
        let middle = [size.0 / 2, size.1 / 2];
        let width = (0..size.0).filter(|&x| is_lamp(x, middle[1])).count() as f32;
        let height = (0..size.1).filter(|&y| is_lamp(middle[0], y)).count() as f32;
        let expected = 2.0 * RADIUS / height_of_pixel;
        for found in [width, height] {
            assert!(
                (found - expected).abs() <= 2.0,
                "{scales:?}: {width}x{height}"
            );
        }
    }
}

#[test]
fn impossible_pixels_are_an_error() {
    let place = Place::new();
    photograph(&place, [[90, 1], [1, 1]]);
    let (outcome, problems) = place.ingest("c", "out", options());
    outcome.unwrap_err();
    let is_told = |text: String| text.contains("90 times as wide as high");
    assert!(problems.iter().any(|problem| is_told(problem.to_string())));
}
