//! Brackets of pictures for display: the camera's response is recovered, then they are merged.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a test fails by panicking, helpers outside of test functions included"
)]

mod common;

use common::*;
use eagpt_ingest::{IngestError, IngestOptions};
use eagpt_scene::color::srgb_from_linear;
use eagpt_scene::exr::{self, Precision};
use image::codecs::jpeg::JpegEncoder;
use std::fs;
use tiff::encoder::TiffEncoder;
use tiff::encoder::colortype::RGB8;

/// One stop apart.
const TIMES: [f64; 7] = [0.01, 0.02, 0.04, 0.08, 0.16, 0.32, 0.64];
/// Exposure at which light of 1 saturates.
const SATURATION_S: f64 = 0.25;

/// A camera's tone curve: sRGB's, then more contrast.
fn camera_code(light: f64) -> u8 {
    let display = f64::from(srgb_from_linear(light.clamp(0.0, 1.0) as f32));
    let contrast = 0.4 * display + 0.6 * (3.0 * display.powi(2) - 2.0 * display.powi(3));
    (255.0 * contrast).round() as u8
}

/// Takes a bracket of pictures `c/p<position>_<index>.<extension>`, quality 95 if they are JPEGs.
fn photograph(place: &Place, position: usize, extension: &str) {
    fs::create_dir_all(place.path("c")).unwrap();
    for (index, time) in TIMES.iter().enumerate() {
        let picture = image::RgbImage::from_fn(WIDTH, HEIGHT, |x, y| {
            let light = room(position).light(x, y).map(f64::from);
            image::Rgb(light.map(|v| camera_code(v * time / SATURATION_S)))
        });
        let path = place.path(&format!("c/p{position}_{index}.{extension}"));
        if extension == "jpg" {
            let mut file = fs::File::create(path).unwrap();
            let encoder = JpegEncoder::new_with_quality(&mut file, 95);
            picture.write_with_encoder(encoder).unwrap();
        } else if extension == "tif" {
            let file = fs::File::create(path).unwrap();
            let mut encoder = TiffEncoder::new(file).unwrap();
            let written = encoder.write_image::<RGB8>(WIDTH, HEIGHT, picture.as_raw());
            written.unwrap();
        } else {
            picture.save(path).unwrap();
        }
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
fn brackets_of_jpeg_png_and_tiff_become_the_light() {
    for (extension, num_positions) in [("jpg", 3), ("png", 1), ("tif", 1)] {
        let place = Place::new();
        for position in 0..num_positions {
            photograph(&place, position, extension);
        }
        let capture = place.ingests("c", "out", options()).capture;
        let response = capture.response.unwrap();
        assert_eq!(response.num_stacks, num_positions);
        for position in 0..num_positions {
            let image = place.path(&format!("out/Radiance-exr/p{position}.exr"));
            let image = exr::read_rgb(&image).unwrap();
            let flags = image::open(place.path(&format!("out/Unreliable/p{position}.png")));
            let flags = flags.unwrap().into_luma8().into_raw();
            let found = agreement(&image, &room(position).truth(), |i| flags[i] & 1 == 0);
            assert!(found.psnr_pq_db > 42.0, "{extension}: {found:?}");
            assert!(found.median_error < 0.02, "{extension}: {found:?}");
        }
        // The lamp is 14 times as bright as the shortest shot shows: 0.25 / 0.01 is enough.
        let clipped = capture.stacks[0].quality.clipped_share;
        assert!(clipped < 0.001, "{clipped}");
        let note = &capture.notes[0];
        assert!(note.contains("sRGB's (no profile)"), "{note}");
        let report = fs::read_to_string(place.path("out/report.html")).unwrap();
        assert!(report.contains("Response of the camera") && report.contains("<polyline"));
    }
}

#[test]
fn a_response_that_cannot_be_is_an_error() {
    // Exposures that are stated the wrong way round make brighter codes less light.
    let place = Place::new();
    photograph(&place, 0, "png");
    let mut times = TIMES.to_vec();
    times.reverse();
    let reversed = IngestOptions {
        exposures_s: Some(times),
        ..options()
    };
    let (outcome, _) = place.ingest("c", "out", reversed);
    let error = outcome.unwrap_err();
    assert!(matches!(error, IngestError::Response { .. }), "{error}");
    assert!(error.to_string().contains("less light"), "{error}");
    // A single level of grey determines no curve.
    let place = Place::new();
    fs::create_dir_all(place.path("c")).unwrap();
    for index in 0..TIMES.len() as u8 {
        let grey = image::RgbImage::from_pixel(64, 64, image::Rgb([60 + 20 * index; 3]));
        grey.save(place.path(&format!("c/p0_{index}.png"))).unwrap();
    }
    let (outcome, _) = place.ingest("c", "out", options());
    let error = outcome.unwrap_err().to_string();
    assert!(error.contains("7 different codes"), "{error}");
}
