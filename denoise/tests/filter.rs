//! The filter on pictures whose light is known.

#![allow(
    clippy::unwrap_used,
    reason = "a test ends with its first surprise; helpers outside of test functions do as well"
)]

mod common;

use common::{HEIGHT, Known, LAMP, Noise, Pixel, WIDTH, picture, relative_rmse, room};
use eagpt_denoise::{DenoiseError, Denoiser, Frame};
use eagpt_scene::Image;

/// Relative RMSE on light without noise, all of it at the hard shadow; 0.055 as measured.
const MAX_BIAS: f64 = 0.08;
/// Factor by which the error falls at least; 5.4 as measured.
const LEAST_GAIN: f64 = 4.0;
/// Brightest pixel of a wall of 0.5 with a firefly of 5000 in it; 0.78 as measured, half of it
/// noise.
const MAX_AFTER_FIREFLY: f32 = 1.0;

fn filtered(frame: &Frame) -> Image<3> {
    Denoiser::filter().denoise(frame).unwrap()
}

fn wall(x: u32, y: u32) -> Pixel {
    Pixel {
        incoming: 1.0,
        albedo: [0.5; 3],
        normal: [0.0, 0.0, 1.0],
        position: [x as f32, y as f32, 0.0],
        coverage: 1.0,
        ..Pixel::default()
    }
}

fn mean_red(image: &Image<3>) -> f64 {
    let sum: f64 = image.pixels().iter().map(|p| f64::from(p[0])).sum();
    sum / image.pixels().len() as f64
}

#[test]
fn light_without_noise_stays() {
    let constant = picture(Noise::None, wall);
    for (pixel, truth) in filtered(&constant.frame)
        .pixels()
        .iter()
        .zip(constant.truth.pixels())
    {
        assert!((pixel[0] - truth[0]).abs() < 1e-4 * truth[0], "{pixel:?}");
    }
    let known = picture(Noise::None, room);
    let error = relative_rmse(&known, &filtered(&known.frame));
    assert!(error < MAX_BIAS, "{error}");
}

#[test]
fn noise_goes_and_energy_stays() {
    let known = picture(Noise::HeavyTailed, room);
    let before = relative_rmse(&known, &known.frame.noisy());
    let after = relative_rmse(&known, &filtered(&known.frame));
    assert!(after * LEAST_GAIN < before, "{before} to {after}");
    // Rare samples carry a fifth of this light: a filter that clamps them loses it.
    let known = picture(Noise::HeavyTailed, wall);
    let (noisy, clean) = (
        mean_red(&known.frame.noisy()),
        mean_red(&filtered(&known.frame)),
    );
    assert!((clean / noisy - 1.0).abs() < 0.02, "{noisy} to {clean}");
}

#[test]
fn an_edge_of_the_guides_stays_sharp() {
    // A fold: light differs by a factor of 5 from one side to the other, and only normals tell.
    let known = picture(Noise::HeavyTailed, |x, y| Pixel {
        incoming: if x < WIDTH / 2 { 1.0 } else { 0.2 },
        normal: if x < WIDTH / 2 {
            [0.0, 0.0, 1.0]
        } else {
            [1.0, 0.0, 0.0]
        },
        ..wall(x, y)
    });
    let clean = filtered(&known.frame);
    for (x, light) in [(WIDTH / 2 - 1, 0.5), (WIDTH / 2, 0.1)] {
        let column: f32 = (0..HEIGHT).map(|y| clean.get(x, y)[0]).sum();
        let mean = column / HEIGHT as f32;
        assert!((mean / light - 1.0).abs() < 0.1, "column {x}: {mean}");
    }
}

#[test]
fn emitters_keep_their_bits_and_do_not_bleed() {
    let known = picture(Noise::HeavyTailed, room);
    let clean = filtered(&known.frame);
    let mut num = 0;
    for (i, [coverage]) in known.frame.coverage.pixels().iter().enumerate() {
        let (pixel, truth) = (clean.pixels()[i], known.truth.pixels()[i]);
        if *coverage == 0.0 {
            assert_eq!(pixel, [LAMP; 3]);
            num += 1;
        } else if *coverage < 1.0 {
            // The reflected part of such a pixel is less than 1: none of the lamp's light is lost
            // or doubled.
            assert!((pixel[0] - truth[0]).abs() < 1.0, "{pixel:?} {truth:?}");
        } else {
            assert!(pixel[0] < 3.0, "{pixel:?}");
        }
    }
    assert!(num > 100);
}

#[test]
fn a_firefly_does_not_smear() {
    let mut known = picture(Noise::HeavyTailed, wall);
    let before = filtered(&known.frame);
    let (x, y) = (WIDTH / 2, HEIGHT / 2);
    let i = (y * WIDTH + x) as usize;
    known.frame.reflected.pixels_mut()[i] = [5000.0; 3];
    // One of 16 samples was 160,000 times as bright as the others.
    known.frame.second_moment.pixels_mut()[i] = [1.6e5_f32.powi(2) / 16.0];
    let after = filtered(&known.frame);
    let brightest = after.pixels().iter().map(|p| p[0]).fold(0.0, f32::max);
    assert!(brightest < MAX_AFTER_FIREFLY, "{brightest}");
    assert!(mean_red(&after) < 1.5 * mean_red(&before));
}

#[test]
fn what_is_no_number_stays_where_it_is() {
    let mut known = picture(Noise::HeavyTailed, room);
    known.frame.reflected.pixels_mut()[700] = [f32::NAN; 3];
    known.frame.reflected.pixels_mut()[900] = [f32::INFINITY, 1.0, 1.0];
    known.frame.normal.pixels_mut()[1100] = [f32::NAN; 3];
    known.frame.second_moment.pixels_mut()[1300] = [f32::NAN];
    known.frame.position.pixels_mut()[1500] = [f32::NEG_INFINITY; 3];
    assert!(
        filtered(&known.frame)
            .values()
            .iter()
            .all(|v| v.is_finite())
    );
    // An empty frame: no surface, no light.
    let empty = picture(Noise::None, |_, _| Pixel::default());
    assert!(filtered(&empty.frame).values().iter().all(|v| *v == 0.0));
}

#[test]
fn the_number_of_threads_does_not_matter() {
    let known = picture(Noise::HeavyTailed, room);
    let one = common::with_threads(1, || filtered(&known.frame));
    let three = common::with_threads(3, || filtered(&known.frame));
    assert_eq!(one, three);
}

/// The same picture in other units of light and length.
#[test]
fn units_do_not_matter() {
    let known = picture(Noise::HeavyTailed, room);
    let plain = filtered(&known.frame);
    for (light, length) in [(1e4_f32, 1e3_f32), (1e-4, 1e-2)] {
        let mut frame = known.frame.clone();
        for image in [&mut frame.emitted, &mut frame.reflected] {
            *image = image.map(|p| p.map(|v| v * light));
        }
        frame.position = frame.position.map(|p| p.map(|v| v * length));
        frame.second_moment = frame.second_moment.map(|[m]| [m * light * light]);
        for (a, b) in plain.pixels().iter().zip(filtered(&frame).pixels()) {
            assert!((a[0] * light / b[0] - 1.0).abs() < 1e-2, "{a:?} {b:?}");
        }
    }
}

#[test]
fn images_of_other_sizes_are_refused() {
    let Known { mut frame, .. } = picture(Noise::None, wall);
    frame.albedo = Image::filled(3, 2, [0.0; 3]);
    let error = Denoiser::filter().denoise(&frame).unwrap_err();
    assert!(matches!(error, DenoiseError::Size { .. }));
    assert_eq!(error.to_string(), "albedo: 3x2 pixels instead of 96x64");
}
