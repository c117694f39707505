//! Metrics against numbers of other programs: NVIDIA's flip-evaluator 1.7, and numpy in f64 for the
//! rest.

use eagpt_eval::magma_rgb8;
use eagpt_eval::{FlipOptions, compare, flip_hdr};
use eagpt_scene::exr;
use eagpt_testkit::test_data;
use serde_json::Value;
use std::path::PathBuf;

/// The folder of image pairs, or `None` after saying that `test` is skipped.
fn pairs(test: &str) -> Option<PathBuf> {
    test_data(test, "metrics")
}

#[test]
fn all_pairs_agree_with_the_official_tools() {
    let Some(folder) = pairs("all_pairs_agree_with_the_official_tools") else {
        return;
    };
    let text = std::fs::read_to_string(folder.join("expected.json")).unwrap();
    let expected: Value = serde_json::from_str(&text).unwrap();
    let pairs = expected["pairs"].as_array().unwrap();
    assert_eq!(pairs.len(), 16);
    // Name, tolerance and the largest deviation found. Measured 8e-7, 2e-13 and 2e-6 dB, then 5e-6
    // (f32 against f64), 1.2e-6 and 6e-7.
    let mut columns = [
        ("psnr_srgb_db", 1e-5, 0.0_f64),
        ("psnr_linear_db", 1e-5, 0.0),
        ("psnr_pq_db", 1e-5, 0.0),
        ("ssim_srgb", 2e-5, 0.0),
        ("flip_hdr", 1e-5, 0.0),
        ("flip_ldr_srgb", 1e-5, 0.0),
    ];
    for pair in pairs {
        let read = |key: &str| exr::read_rgb(&folder.join(pair[key].as_str().unwrap())).unwrap();
        let found = compare(&read("reference"), &read("test"), &FlipOptions::default()).unwrap();
        let found = serde_json::to_value(found.metrics).unwrap();
        for (key, _, largest) in &mut columns {
            let difference = found[*key].as_f64().unwrap() - pair[*key].as_f64().unwrap();
            *largest = largest.max(difference.abs());
        }
        let (found, expected) = (&found["flip_hdr_parameters"], &pair["flip_hdr_parameters"]);
        for (key, official) in [
            ("ppd", "ppd"),
            ("start_exposure", "startExposure"),
            ("stop_exposure", "stopExposure"),
            ("num_exposures", "numExposures"),
        ] {
            let difference = found[key].as_f64().unwrap() - expected[official].as_f64().unwrap();
            assert!(difference.abs() < 1e-5, "{key}: {found} {expected}");
        }
        assert_eq!(found["tonemapper"], expected["tonemapper"]);
    }
    println!("largest deviations: {columns:?}");
    for (key, tolerance, largest) in columns {
        assert!(largest < tolerance, "{key}: off by {largest}");
    }
}

#[test]
fn error_maps_agree_with_the_official_tool() {
    let Some(folder) = pairs("error_maps_agree_with_the_official_tool") else {
        return;
    };
    for view in ["0000", "0011", "0016", "0040"] {
        let read = |kind: &str| exr::read_rgb(&folder.join(format!("{view}_{kind}.exr"))).unwrap();
        let found = flip_hdr(&read("ref"), &read("noise"), &FlipOptions::default()).unwrap();
        // The stored maps are the red channel of the magma map of the errors.
        let expected = exr::read_single(&folder.join(format!("{view}_noise_flip.exr"))).unwrap();
        assert_eq!(found.error.size(), expected.size());
        let expected = expected.values().iter().map(|red| (red * 255.0).round());
        let found = magma_rgb8(&found.error);
        let found = found.chunks_exact(3).map(|rgb| f32::from(rgb[0]));
        let differences: Vec<f32> = found.zip(expected).map(|(a, b)| (a - b).abs()).collect();
        let num_other = differences.iter().filter(|d| **d > 0.0).count();
        let largest = differences.iter().copied().fold(0.0, f32::max);
        println!(
            "{view}: {num_other} of {} differ, by up to {largest}",
            differences.len()
        );
        // Neighbouring colours differ by up to 2 in red; rounding decides between them.
        assert!(largest <= 2.0, "{view}: off by {largest}");
        assert!(
            num_other * 200 < differences.len(),
            "{view}: {num_other} differ"
        );
    }
}
