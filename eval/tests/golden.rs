//! Metrics of a small synthetic pair against numbers of other programs, which `data/golden.py`
//! wrote to `data/golden.json`: NVIDIA's flip-evaluator 1.7, numpy and scipy.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use eagpt_eval::{
    FlipOptions, compare, flip_hdr, flip_ldr, psnr_linear, psnr_pq, psnr_srgb, srgb_clipped,
    ssim_srgb,
};
use eagpt_scene::Image;
use serde_json::Value;

const WIDTH: u32 = 32;
const HEIGHT: u32 = 24;
/// Largest difference of an error map; measured 6e-6. Rounding of f32 in flat areas (some 1e-8)
/// passes through a square root, so another system's mathematical functions may cost more.
const MAP_TOLERANCE: f64 = 5e-5;
/// Measured 4e-6.
const MEAN_TOLERANCE: f64 = 1e-5;

/// The pair that `golden.py` measures.
fn pair() -> (Image<3>, Image<3>) {
    let mut reference = Image::filled(WIDTH, HEIGHT, [0.0; 3]);
    let mut test = reference.clone();
    for y in 0..HEIGHT {
        for x in 0..WIDTH {
            let i = (y * WIDTH + x) as usize;
            for c in 0..3 {
                let mut light =
                    ((x * 7 + y * 3 + c * 11) % 32 + (x / 8 + y / 6) % 2 * 32) as f32 / 64.0;
                if (20..24).contains(&x) && (4..8).contains(&y) {
                    light = 12.5;
                }
                let noise = (((x * 37 + y * 91 + c * 53) % 17) as f32 - 8.0) / 256.0;
                let tint = if x < 6 && y > 16 && c == 0 { 0.25 } else { 0.0 };
                reference.pixels_mut()[i][c as usize] = light;
                test.pixels_mut()[i][c as usize] = (light + noise).max(0.0) + tint;
            }
        }
    }
    (reference, test)
}

fn golden() -> Value {
    serde_json::from_str(include_str!("data/golden.json")).unwrap()
}

#[track_caller]
fn assert_near(found: f64, expected: &Value, tolerance: f64) {
    let expected = expected.as_f64().unwrap();
    assert!(
        (found - expected).abs() < tolerance,
        "{found}, expected {expected}"
    );
}

#[track_caller]
fn assert_map(found: &Image<1>, golden: &Value, expected: &Value) {
    let step = golden["map_step"].as_u64().unwrap() as usize;
    let expected = expected.as_array().unwrap();
    assert_eq!(expected.len(), found.values().len().div_ceil(step));
    for (i, expected) in expected.iter().enumerate() {
        let found = f64::from(found.values()[i * step]);
        assert_near(found, expected, MAP_TOLERANCE);
    }
}

#[test]
fn psnr_and_ssim_are_those_of_numpy() {
    let (reference, test) = pair();
    let golden = golden();
    // f32 encodings: measured 4e-7 dB and 1e-7.
    assert_near(psnr_srgb(&reference, &test), &golden["psnr_srgb_db"], 1e-5);
    assert_near(
        psnr_linear(&reference, &test),
        &golden["psnr_linear_db"],
        1e-5,
    );
    assert_near(psnr_pq(&reference, &test), &golden["psnr_pq_db"], 1e-5);
    assert_near(ssim_srgb(&reference, &test), &golden["ssim_srgb"], 2e-6);
    let together = compare(&reference, &test, &FlipOptions::default()).unwrap();
    assert_eq!(together.metrics.psnr_pq_db, psnr_pq(&reference, &test));
    assert_eq!(together.metrics.ssim_srgb, ssim_srgb(&reference, &test));
}

#[test]
fn ldr_flip_is_that_of_the_official_tool() {
    let (reference, test) = pair();
    let (reference, test) = (srgb_clipped(&reference), srgb_clipped(&test));
    let golden = golden();
    let cases = golden["flip_ldr"].as_array().unwrap();
    assert_eq!(cases.len(), 2);
    for expected in cases {
        let ppd = expected["given"]["ppd"].as_f64();
        let ppd = ppd.map_or(FlipOptions::default().ppd, |ppd| ppd as f32);
        let found = flip_ldr(&reference, &test, ppd).unwrap();
        assert_near(found.mean, &expected["mean"], MEAN_TOLERANCE);
        assert_map(&found.error, &golden, &expected["map"]);
    }
    let black = Image::filled(WIDTH, HEIGHT, [0.0; 3]);
    let white = Image::filled(WIDTH, HEIGHT, [1.0; 3]);
    let found = flip_ldr(&black, &white, FlipOptions::default().ppd).unwrap();
    assert_near(found.mean, &golden["flip_ldr_black_white"], MEAN_TOLERANCE);
}

#[test]
fn hdr_flip_is_that_of_the_official_tool() {
    let (reference, test) = pair();
    let golden = golden();
    let cases = golden["flip_hdr"].as_array().unwrap();
    assert_eq!(cases.len(), 4);
    for expected in cases {
        let given = &expected["given"];
        let number = |key: &str| given[key].as_f64().map(|v| v as f32);
        let mut options = FlipOptions {
            start_exposure: number("startExposure"),
            stop_exposure: number("stopExposure"),
            num_exposures: given["numExposures"].as_u64().map(|v| v as u32),
            ..FlipOptions::default()
        };
        if let Some(ppd) = number("ppd") {
            options.ppd = ppd;
        }
        if let Some(name) = given.get("tonemapper") {
            options.tonemapper = serde_json::from_value(name.clone()).unwrap();
        }
        let found = flip_hdr(&reference, &test, &options).unwrap();
        let used = &expected["used"];
        assert_near(found.parameters.ppd.into(), &used["ppd"], 1e-5);
        assert_near(
            found.parameters.start_exposure.into(),
            &used["startExposure"],
            1e-5,
        );
        assert_near(
            found.parameters.stop_exposure.into(),
            &used["stopExposure"],
            1e-5,
        );
        assert_near(
            found.parameters.num_exposures.into(),
            &used["numExposures"],
            0.1,
        );
        assert_eq!(used["tonemapper"], found.parameters.tonemapper.name());
        assert_near(found.mean, &expected["mean"], MEAN_TOLERANCE);
        assert_map(&found.error, &golden, &expected["map"]);
    }
}
