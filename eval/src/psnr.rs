//! Peak signal-to-noise ratio as EAG-PT reports it: the mean over R, G, B of each channel's own
//! decibels.
//!
//! This differs from the ratio of the error pooled over channels; by Jensen's inequality it is
//! never smaller. The peak is 1 in every space. Equal images give [`f64::INFINITY`]; one equal
//! channel is enough. JSON has no infinity, so outputs hold `null` there and tables print `inf`.

use crate::encode::{assert_comparable, pq_encoded, srgb_clipped};
use eagpt_scene::Image;
use rayon::prelude::*;

/// Decibels between two images in whatever encoding they have, peak 1.
///
/// # Panics
/// If the sizes differ or the images have no pixels.
pub fn psnr(reference: &Image<3>, test: &Image<3>) -> f64 {
    assert_comparable(reference, test);
    let squared = squared_error_sums(reference, test);
    let num_pixels = reference.pixels().len() as f64;
    mean_db(squared.map(|sum| sum / num_pixels))
}

/// Decibels in sRGB clipped to [0, 1], from linear images.
///
/// # Panics
/// As [`psnr`].
pub fn psnr_srgb(reference: &Image<3>, test: &Image<3>) -> f64 {
    psnr(&srgb_clipped(reference), &srgb_clipped(test))
}

/// Decibels in linear light, unclipped: bright lamps dominate.
///
/// # Panics
/// As [`psnr`].
pub fn psnr_linear(reference: &Image<3>, test: &Image<3>) -> f64 {
    psnr(reference, test)
}

/// Decibels in PQ (SMPTE ST 2084, linear 1.0 = 100 nit), from linear images.
///
/// # Panics
/// As [`psnr`].
pub fn psnr_pq(reference: &Image<3>, test: &Image<3>) -> f64 {
    psnr(&pq_encoded(reference), &pq_encoded(test))
}

/// Mean over channels of the decibels of each mean squared error.
pub(crate) fn mean_db(mean_squared: [f64; 3]) -> f64 {
    mean_squared
        .iter()
        .map(|mse| -10.0 * mse.log10())
        .sum::<f64>()
        / 3.0
}

/// Sum of squared differences of each channel: rows in parallel, added up in their order.
fn squared_error_sums(reference: &Image<3>, test: &Image<3>) -> [f64; 3] {
    let width = reference.width() as usize;
    let rows: Vec<[f64; 3]> = reference
        .pixels()
        .par_chunks(width)
        .zip(test.pixels().par_chunks(width))
        .map(|(reference, test)| {
            let mut sums = [0.0; 3];
            for (r, t) in reference.iter().zip(test) {
                for (sum, (r, t)) in sums.iter_mut().zip(r.iter().zip(t)) {
                    let difference = f64::from(*t) - f64::from(*r);
                    *sum += difference * difference;
                }
            }
            sums
        })
        .collect();
    rows.iter()
        .fold([0.0; 3], |a, b| std::array::from_fn(|c| a[c] + b[c]))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(pixels: Vec<[f32; 3]>) -> Image<3> {
        Image::from_pixels(pixels.len() as u32, 1, pixels).unwrap()
    }

    #[test]
    fn each_channel_counts_in_decibels() {
        // Mean squared errors 0.01, 0.0001 and 1: 20, 40 and 0 dB, mean 20. Pooled over channels it
        // would be 4.7 dB.
        let reference = image(vec![[0.5, 0.5, 1.0], [0.5, 0.5, 1.0]]);
        let test = image(vec![[0.6, 0.51, 0.0], [0.4, 0.49, 2.0]]);
        assert!((psnr(&reference, &test) - 20.0).abs() < 1e-4);
        assert!((psnr_linear(&reference, &test) - 20.0).abs() < 1e-4);
    }

    #[test]
    fn srgb_ignores_what_a_display_clips_and_the_others_do_not() {
        let reference = image(vec![[3.0, 3.0, 3.0]]);
        let test = image(vec![[5.0, 5.0, 5.0]]);
        assert_eq!(psnr_srgb(&reference, &test), f64::INFINITY);
        // Error 2 in each channel: -20 log10(2).
        assert!((psnr_linear(&reference, &test) + 6.020_599_9).abs() < 1e-6);
        assert!(psnr_pq(&reference, &test).is_finite());
    }

    #[test]
    fn srgb_of_black_against_half_is_that_of_the_encoded_half() {
        let reference = image(vec![[0.0; 3]]);
        let test = image(vec![[0.214_041_14; 3]]);
        assert!((psnr_srgb(&reference, &test) - 6.020_599_9).abs() < 1e-4);
    }

    #[test]
    fn pq_of_black_against_100_nit() {
        // PQ(1.0) = 0.508078, PQ(floor of 1e-6, that is 0.01 nit) = 0.044 from the curve's own
        // definition in f64.
        let y: f64 = 1e-6_f64.powf(1305.0 / 8192.0);
        let floor =
            ((107.0 / 128.0 + 2413.0 / 128.0 * y) / (1.0 + 2392.0 / 128.0 * y)).powf(2523.0 / 32.0);
        let expected = -20.0 * (0.508_078_421_517_399 - floor).log10();
        let found = psnr_pq(&image(vec![[0.0; 3]]), &image(vec![[1.0; 3]]));
        assert!((found - expected).abs() < 1e-4, "{found} {expected}");
    }

    #[test]
    fn equal_images_are_infinitely_close() {
        let a = image(vec![[0.1, 0.2, 0.3], [9.0, 0.0, 1.0]]);
        for metric in [psnr_srgb, psnr_linear, psnr_pq] {
            assert_eq!(metric(&a, &a), f64::INFINITY);
        }
    }
}
