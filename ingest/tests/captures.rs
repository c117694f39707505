//! Captures with problems, and captures that are resumed.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a test fails by panicking, helpers outside of test functions included"
)]

mod common;

use common::*;
use eagpt_ingest::{IngestError, IngestOptions, IngestProgress, ingest};
use eagpt_scene::exr;
use eagpt_testkit::damage::{for_each_damage, for_each_truncation};
use std::fs;
use std::sync::atomic::Ordering;

/// Ingests and expects exactly the problems whose parts are given, one line each, and nothing
/// written but surveys.
#[track_caller]
fn assert_problems(place: &Place, expected: &[&[&str]]) {
    let (outcome, problems) = place.ingest("c", "out", options());
    let lines: Vec<String> = problems.iter().map(ToString::to_string).collect();
    assert!(
        matches!(outcome, Err(IngestError::BadCapture { .. })),
        "{lines:?}"
    );
    assert_eq!(lines.len(), expected.len(), "{lines:#?}");
    for parts in expected {
        let found = lines
            .iter()
            .any(|line| parts.iter().all(|part| line.contains(part)) && !line.contains('\n'));
        assert!(found, "no line with {parts:?} in {lines:#?}");
    }
    assert!(!place.path("out/Radiance-exr").exists());
}

#[test]
fn everything_that_is_wrong_is_told_at_once() {
    let place = Place::new();
    place.capture("c", 8);
    // A missing shot, one too many, another camera, a zoomed lens, a truncated file, something
    // else, another aperture.
    fs::remove_file(place.file("c", 1, 2)).unwrap();
    fs::copy(place.file("c", 2, 4), place.file("c", 2, 5)).unwrap();
    for index in 0..5 {
        let shot = place.shot(3, index);
        Shot {
            model: "Other Rig",
            ..shot.clone()
        }
        .write(&place.file("c", 3, index));
        let shot = place.shot(4, index);
        Shot {
            focal_mm: 24.0,
            ..shot
        }
        .write(&place.file("c", 4, index));
    }
    let whole = fs::read(place.file("c", 5, 3)).unwrap();
    fs::write(place.file("c", 5, 3), &whole[..whole.len() / 2]).unwrap();
    fs::write(place.file("c", 6, 1), b"no photograph").unwrap();
    Shot {
        f_number: 4.0,
        exposure_s: 0.0025,
        stated_s: Some(0.0025 / 4.0),
        ..place.shot(7, 0)
    }
    .write(&place.file("c", 7, 0));
    assert_problems(
        &place,
        &[
            &["p1: misses 1 of 5 exposures: 1/25 s"],
            &["p2_5.dng: one too many in p2", "p2_4.dng"],
            &["p3: camera Virtual Other Rig where most of the capture has Virtual Test Rig"],
            &["p4: focal length 24 mm where most of the capture has 16 mm"],
            &["p5_3.dng: RAW: "],
            &["p6_1.dng: RAW: "],
            &["p7: f/4 in p7_0.dng, f/8 in p7_1.dng"],
        ],
    );
    let skipping = IngestOptions {
        skip_bad: true,
        ..options()
    };
    let summary = place.ingests("c", "skipped", skipping);
    let positions: Vec<&str> = summary
        .capture
        .stacks
        .iter()
        .map(|s| s.position.as_str())
        .collect();
    assert_eq!(positions, ["p0", "p2"]);
    assert_eq!(summary.capture.stacks[1].shots.len(), 5);
    assert_eq!(summary.capture.left_out.len(), 7);
    let page = fs::read_to_string(place.path("skipped/report.html")).unwrap();
    assert!(page.contains("p1: misses 1 of 5 exposures"));
}

#[test]
fn two_rooms_and_pictures_are_no_capture() {
    let place = Place::new();
    place.capture("c", 3);
    for index in 0..5 {
        let shot = place.shot(3, index);
        Shot {
            taken_ms: shot.taken_ms + 4 * 3_600_000,
            ..shot
        }
        .write(&place.file("c", 3, index));
    }
    assert_problems(
        &place,
        &[&["p3: 1 stack taken more than 30 min apart", "two rooms"]],
    );

    let place = Place::new();
    fs::create_dir_all(place.path("c")).unwrap();
    fs::write(place.path("c/IMG_1.HEIC"), b"x").unwrap();
    fs::write(place.path("c/IMG_2.HEIC"), b"x").unwrap();
    assert_problems(
        &place,
        &[&["2 pictures for display and neither RAW nor JPEG (IMG_1.HEIC, IMG_2.HEIC)"]],
    );
    // No colours.
    fs::remove_file(place.path("c/IMG_1.HEIC")).unwrap();
    image::GrayImage::new(8, 8)
        .save(place.path("c/a_0.png"))
        .unwrap();
    assert_problems(&place, &[&["a_0.png: PNG: L8"]]);
}

#[test]
fn an_empty_capture_and_bad_places_are_refused() {
    let place = Place::new();
    fs::create_dir_all(place.path("c")).unwrap();
    fs::write(place.path("c/notes.txt"), "").unwrap();
    let refusal = |capture: &str, out: &str| {
        place
            .ingest(capture, out, options())
            .0
            .unwrap_err()
            .to_string()
    };
    assert!(refusal("c", "out").contains("no photographs in it"));
    assert!(refusal("none", "out").contains("is not a folder"));
    assert!(refusal("c", "c/out").contains("outside of the capture"));
    fs::write(
        place.path("c/capture.toml"),
        "[[stack]]\nposition = 3\nfiles = [\"a\"]",
    )
    .unwrap();
    assert!(refusal("c", "out").contains("line 2: stack[0].position"));
}

#[test]
fn files_without_exposures_ask_for_them() {
    for (stated, part) in [(false, "no exposure time"), (true, "exposure time 0 s")] {
        let place = Place::new();
        for (index, exposure_s) in EXPOSURES[..3].iter().enumerate() {
            let (shot, path) = (place.shot(0, index), place.file("c", 0, index));
            let stated_s = stated.then_some(*exposure_s);
            Shot { stated_s, ..shot }.write(&path);
            if stated {
                state_zero(&path);
            }
        }
        let files = "p0_0.dng, p0_1.dng, p0_2.dng: ";
        assert_problems(&place, &[&[files, part, "--exposures"]]);
        let stating = IngestOptions {
            exposures_s: Some(EXPOSURES[..3].to_vec()),
            ..options()
        };
        let summary = place.ingests("c", "stated", stating);
        assert_eq!(summary.capture.stacks[0].shots[2].exposure_s, 0.04);
    }
}

/// Makes the exposure time of a file 0, as cameras write it for shots that they did not time.
fn state_zero(path: &std::path::Path) {
    let mut bytes = fs::read(path).unwrap();
    // The tag ExposureTime, the type of a rational number, one of them; its place follows.
    let entry = [0x9a, 0x82, 5, 0, 1, 0, 0, 0];
    let found = bytes.windows(8).position(|window| window == entry);
    let at = found.unwrap() + entry.len();
    let place = u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
    bytes[place..place + 4].fill(0);
    fs::write(path, bytes).unwrap();
}

#[test]
fn conditions_share_positions() {
    let place = Place::new();
    place.capture("c/day", 2);
    place.capture("c/night", 2);
    // The same photographs under two names would be doubles.
    for position in 0..2 {
        for index in 0..5 {
            let shot = place.shot(position, index);
            Shot {
                seed: shot.seed + 7,
                ..shot
            }
            .write(&place.file("c/night", position, index));
        }
    }
    let summary = place.ingests("c", "out", options());
    assert_eq!(summary.capture.conditions, ["day", "night"]);
    for file in ["Radiance-exr/p0.exr", "Preview/p1.png", "Unreliable/p1.png"] {
        for condition in ["day", "night"] {
            assert!(
                place.path(&format!("out/{condition}/{file}")).exists(),
                "{condition}/{file}"
            );
        }
    }
    // A counter of the camera names files; positions are matched by their order.
    let place = Place::new();
    for (number, condition) in ["a", "b"].iter().enumerate() {
        for shot in 0..10 {
            let name = format!("c/{condition}/DSC{:05}.dng", 100 * (number + 1) + shot);
            let taken = place.shot(shot / 5, shot % 5);
            Shot {
                seed: taken.seed + number as u64,
                ..taken
            }
            .write(&place.path(&name));
        }
    }
    let summary = place.ingests("c", "out", options());
    let names: Vec<String> = summary
        .capture
        .stacks
        .iter()
        .map(|s| format!("{}/{}", s.condition, s.position))
        .collect();
    assert_eq!(names, ["a/p000", "a/p001", "b/p000", "b/p001"]);
    assert!(
        summary
            .capture
            .notes
            .iter()
            .any(|note| note.contains("matched by their order"))
    );
}

#[test]
fn a_manifest_says_what_belongs_together() {
    let place = Place::new();
    place.capture("c/x", 1);
    let list = (0..5)
        .rev()
        .map(|i| format!("\"x/p0_{i}.dng\""))
        .collect::<Vec<_>>()
        .join(", ");
    let text = format!(
        "vignetting = [-0.22, 0.05, -0.01]\n[[stack]]\nposition = \"sofa\"\ncondition = \"lamp\"\nfiles = [{list}]\n"
    );
    fs::write(place.path("c/capture.toml"), text).unwrap();
    let plain = IngestOptions {
        precision: exr::Precision::Float,
        ..IngestOptions::default()
    };
    place.ingests("c", "out", plain);
    let image = exr::read_rgb(&place.path("out/lamp/Radiance-exr/sofa.exr")).unwrap();
    assert!(agreement(&image, &room(0).truth(), |_| true).psnr_pq_db > 45.0);
    fs::remove_file(place.path("c/x/p0_1.dng")).unwrap();
    assert_problems(&place, &[&["x/p0_1.dng: no such file"]]);
}

#[test]
fn a_stopped_run_goes_on_to_the_same_bits_with_any_threads() {
    let place = Place::new();
    place.capture("c", 3);
    let pool = |threads| {
        rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap()
    };
    pool(1).install(|| place.ingests("c", "whole", options()));
    let request = place.request("c", "parts", options());
    let stopped = pool(3).install(|| {
        ingest(&request, &mut |message| {
            if matches!(message, IngestProgress::Merging { done: 1, .. }) {
                request.stop.store(true, Ordering::Relaxed);
            }
        })
    });
    assert!(matches!(
        stopped,
        Err(IngestError::Stopped { done: 1, total: 3 })
    ));
    let summary = pool(2).install(|| place.ingests("c", "parts", options()));
    assert_eq!(summary.num_kept, 1);
    for file in summary
        .outputs
        .iter()
        .filter(|file| file.starts_with("Radiance-exr"))
    {
        let read = |out: &str| fs::read(place.path(out).join(file)).unwrap();
        assert_eq!(read("whole"), read("parts"), "{}", file.display());
    }
    // Other options do not fit what is there; another stack joins it if the scale is given.
    let (outcome, _) = place.ingest(
        "c",
        "parts",
        IngestOptions {
            clip_margin: 0.1,
            ..options()
        },
    );
    assert!(matches!(outcome, Err(IngestError::Stale { .. })));
    fs::remove_file(place.path("whole/shard-1-of-1.record.json")).unwrap();
    let (outcome, _) = place.ingest("c", "whole", options());
    assert!(matches!(outcome, Err(IngestError::Exists { .. })));
}

#[test]
fn damaged_files_are_errors_and_no_panics() {
    let place = Place::new();
    place.capture("c", 1);
    let path = place.file("c", 0, 0);
    let bytes = fs::read(&path).unwrap();
    let mut num_refused = 0;
    let mut try_with = |damaged: &[u8]| {
        fs::write(&path, damaged).unwrap();
        if let Err(error) = eagpt_ingest::raw::read(&path) {
            num_refused += 1;
            let text = error.to_string();
            assert!(
                text.contains("p0_0.dng: ") && !text.contains('\n'),
                "{text}"
            );
        }
    };
    for_each_damage(&bytes, 0..60, &mut try_with);
    for_each_truncation(&bytes, 20, &mut try_with);
    assert!(num_refused >= 30, "{num_refused}");
}
