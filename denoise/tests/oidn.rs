//! Open Image Denoise: the error where it is missing, and its results where it is installed.

#![allow(
    clippy::unwrap_used,
    reason = "a test ends with its first surprise; helpers outside of test functions do as well"
)]

mod common;

use common::{LAMP, Noise, picture, relative_rmse, room, with_threads};
use eagpt_denoise::Denoiser;
use std::io::Write;

/// The denoiser, or `None` and a line on the error stream where the machine has no library.
fn installed(test: &str) -> Option<Denoiser> {
    match Denoiser::oidn(None) {
        Ok(denoiser) => Some(denoiser),
        Err(error) => {
            // Straight to the stream: what `eprintln!` writes is hidden unless the test fails.
            let notice = format!("skipped: {test}: {error}\n");
            std::io::stderr().write_all(notice.as_bytes()).unwrap();
            None
        }
    }
}

#[test]
fn a_missing_library_is_named() {
    let dir = tempfile::tempdir().unwrap();
    let nowhere = dir.path().join("nowhere");
    for path in [dir.path(), &nowhere] {
        let said = Denoiser::oidn(Some(path)).unwrap_err().to_string();
        assert!(said.contains(path.to_str().unwrap()), "{said}");
        assert_eq!(said.lines().count(), 1, "{said}");
        // An explicitly named place must not be skipped silently.
        Denoiser::auto(Some(path)).unwrap_err();
    }
}

#[test]
fn a_file_that_is_no_library_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("libOpenImageDenoise.so.2");
    std::fs::write(&file, "not a library").unwrap();
    let said = Denoiser::oidn(Some(&file)).unwrap_err().to_string();
    assert!(said.contains(file.to_str().unwrap()), "{said}");
    assert_eq!(said.lines().count(), 1, "{said}");
}

#[test]
fn auto_always_finds_something() {
    let name = Denoiser::auto(None).unwrap().identity().name;
    assert!(["oidn", "filter"].contains(&name));
}

#[test]
fn oidn_removes_noise_and_leaves_the_lamp() {
    let Some(denoiser) = installed("oidn_removes_noise_and_leaves_the_lamp") else {
        return;
    };
    let identity = denoiser.identity();
    assert_eq!(identity.name, "oidn");
    assert!(identity.version.unwrap().starts_with("2."));
    let mut known = picture(Noise::HeavyTailed, room);
    let before = relative_rmse(&known, &known.frame.noisy());
    let clean = denoiser.denoise(&known.frame).unwrap();
    let after = relative_rmse(&known, &clean);
    assert!(after * 5.0 < before, "{before} to {after}");
    for (pixel, [coverage]) in clean.pixels().iter().zip(known.frame.coverage.pixels()) {
        if *coverage == 0.0 {
            assert_eq!(*pixel, [LAMP; 3]);
        } else if *coverage == 1.0 {
            // The lamp is 100,000; the brightest wall 1.6, and 4.2 as measured where a firefly was.
            assert!(pixel[0] < 8.0, "{pixel:?}");
        }
    }
    known.frame.reflected.pixels_mut()[700] = [f32::NAN; 3];
    let clean = denoiser.denoise(&known.frame).unwrap();
    assert!(clean.values().iter().all(|value| value.is_finite()));
}

#[test]
fn oidn_gives_the_same_bits_with_any_number_of_threads() {
    let Some(denoiser) = installed("oidn_gives_the_same_bits_with_any_number_of_threads") else {
        return;
    };
    let known = picture(Noise::HeavyTailed, room);
    let [one, two] =
        [1, 2].map(|threads| with_threads(threads, || denoiser.denoise(&known.frame).unwrap()));
    assert_eq!(one, two);
}
