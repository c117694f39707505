//! Brackets by another program's writer, against the light that went into them.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a test fails by panicking, helpers outside of test functions included"
)]

mod common;

use common::{Place, agreement, options};
use eagpt_ingest::{ExposureRatios, IngestOptions};
use eagpt_scene::exr;
use std::io::Write;
use std::path::{Path, PathBuf};

fn data() -> Option<PathBuf> {
    let root = std::env::var_os("EAGPT_DATA").map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data"),
        PathBuf::from,
    );
    let path = root.join("raw");
    if path.is_dir() {
        return Some(path);
    }
    // Straight to the stream: what `eprintln!` writes is hidden unless the test fails.
    let notice = format!(
        "skipped: brackets_of_another_writer: no folder {}\n",
        path.display()
    );
    std::io::stderr().write_all(notice.as_bytes()).unwrap();
    None
}

#[test]
fn brackets_of_another_writer() {
    let Some(data) = data() else { return };
    let place = Place::new();
    let link = |folder: &str, name: &str, source: &str| {
        std::fs::create_dir_all(place.path(folder)).unwrap();
        std::fs::copy(data.join(source), place.path(folder).join(name)).unwrap();
    };
    for view in ["view_0000", "view_0016"] {
        for index in 0..5 {
            let file = format!("{view}_{index}.dng");
            link("plain", &file, &file);
            link("reverse", &format!("{view}_{}.dng", 4 - index), &file);
            link("wrong", &file, &file);
        }
        // The exposure time of the fourth shot, 4/25 s, becomes 30 % longer.
        let path = place.path("wrong").join(format!("{view}_3.dng"));
        let mut bytes = std::fs::read(&path).unwrap();
        let at = bytes
            .windows(8)
            .position(|w| w == [4, 0, 0, 0, 25, 0, 0, 0])
            .unwrap();
        bytes[at..at + 8].copy_from_slice(&[52, 0, 0, 0, 250, 0, 0, 0]);
        std::fs::write(&path, bytes).unwrap();
    }
    for (capture, ratios) in [
        ("plain", ExposureRatios::Metadata),
        ("reverse", ExposureRatios::Metadata),
        ("wrong", ExposureRatios::Estimate),
    ] {
        let out = format!("out-{capture}");
        let options = IngestOptions {
            exposure_ratios: ratios,
            ..options()
        };
        place.ingests(capture, &out, options);
        for view in ["view_0000", "view_0016"] {
            let image =
                exr::read_rgb(&place.path(&format!("{out}/Radiance-exr/{view}.exr"))).unwrap();
            let truth = exr::read_rgb(&data.join(format!("{view}_truth.exr"))).unwrap();
            let agreement = agreement(&image, &truth, |_| true);
            assert!(
                agreement.psnr_pq_db > 50.0,
                "{capture} {view}: {agreement:?}"
            );
            assert!(
                agreement.median_error < 0.012,
                "{capture} {view}: {agreement:?}"
            );
            for channel in agreement.channels {
                assert!(
                    (channel - 1.0).abs() < 0.003,
                    "{capture} {view}: {agreement:?}"
                );
            }
        }
    }
}
