//! Exposure alignment: metrics that do not depend on the overall brightness of renders.
//!
//! After an edit of the lighting the overall brightness depends on one number, the radiance given
//! to the new light. One factor for all views of a condition removes it; the remaining errors are
//! those of the distribution of light.

use crate::encode::{assert_comparable, pq_encoded, srgb_clipped};
use crate::error::Result;
use crate::flip::FlipOptions;
use crate::known::{KnownPixels, pack};
use crate::pair::{decibels, flip_hdr_known};
use crate::psnr::psnr;
use crate::scene_metrics::emits;
use eagpt_scene::Image;
use serde::{Deserialize, Serialize};

/// Finds the factor: the ratio of the sums of reference and test over the pixels that do not emit
/// and whose reference is at most 1 in every channel, the white of a display.
///
/// Emitters are left out because an edit sets them directly. Least squares would be biased: noise
/// adds to the squares in its denominator, so that noisier renders would be made darker. A sum has
/// no such bias, and the reference alone decides which pixels count.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ExposureFit {
    reference: [f64; 3],
    test: [f64; 3],
}

impl ExposureFit {
    /// Adds a view; all are linear Rec.709. `emission` marks emitters by values above
    /// 0.1.
    ///
    /// # Panics
    /// If the sizes differ or the images have no pixels.
    pub fn add(&mut self, reference: &Image<3>, test: &Image<3>, emission: Option<&Image<1>>) {
        assert_comparable(reference, test);
        let pairs = reference.pixels().iter().zip(test.pixels());
        for (i, (r, t)) in pairs.enumerate() {
            if !emits(emission, i) && r.iter().all(|value| *value <= 1.0) {
                for channel in 0..3 {
                    self.reference[channel] += f64::from(r[channel]);
                    self.test[channel] += f64::from(t[channel]);
                }
            }
        }
    }

    /// Factor of the test images, above 0; `None` if no pixel counts or one of the sums is black.
    pub fn scale(&self) -> Option<f64> {
        quotient(self.reference.iter().sum(), self.test.iter().sum())
    }

    /// Factor of each channel by itself; `None` if one of them has none.
    pub fn scale_of_channels(&self) -> Option<[f64; 3]> {
        let mut scales = [0.0; 3];
        for (scale, pair) in scales.iter_mut().zip(self.reference.iter().zip(&self.test)) {
            *scale = quotient(*pair.0, *pair.1)?;
        }
        Some(scales)
    }
}

fn quotient(reference: f64, test: f64) -> Option<f64> {
    (reference > 0.0 && test > 0.0).then(|| reference / test)
}

/// Image metrics of a test image multiplied by the factor of its condition.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct AlignedMetrics {
    /// See [`crate::psnr_srgb`]; infinite for equal images, which is `null` in JSON.
    #[serde(with = "decibels")]
    pub psnr_srgb_aligned_db: f64,
    /// See [`crate::psnr_pq`]; infinite for equal images, which is `null` in JSON.
    #[serde(with = "decibels")]
    pub psnr_pq_aligned_db: f64,
    /// Mean of [`crate::flip_hdr`]; 0 for equal images.
    pub flip_hdr_aligned: f64,
    /// The factor, that of all views.
    pub exposure_scale: f64,
}

/// Measures a linear Rec.709 image, multiplied by `scale`, against its reference where that is
/// `known`.
///
/// # Errors
/// As [`crate::flip_hdr`].
///
/// # Panics
/// If the sizes differ or no pixel is known.
pub(crate) fn compare_aligned(
    reference: &Image<3>,
    test: &Image<3>,
    scale: f64,
    known: Option<&KnownPixels>,
    options: &FlipOptions,
) -> Result<AlignedMetrics> {
    let test = test.map(|pixel| pixel.map(|value| (f64::from(value) * scale) as f32));
    let test = match known {
        Some(known) => known.with_reference(reference, &test),
        None => test,
    };
    let (a, b) = (pack(known, reference), pack(known, &test));
    Ok(AlignedMetrics {
        psnr_srgb_aligned_db: psnr(&srgb_clipped(&a), &srgb_clipped(&b)),
        psnr_pq_aligned_db: psnr(&pq_encoded(&a), &pq_encoded(&b)),
        flip_hdr_aligned: flip_hdr_known(reference, &test, known, options)?.mean,
        exposure_scale: scale,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reference() -> Image<3> {
        let pixels = (0..192_u32).map(|i| {
            let value = (i * 31 % 97) as f32 / 100.0;
            [value, 0.5 * value + 0.1, 0.3]
        });
        Image::from_pixels(16, 12, pixels.collect()).unwrap()
    }

    fn fitted(reference: &Image<3>, test: &Image<3>, emission: Option<&Image<1>>) -> Option<f64> {
        let mut fit = ExposureFit::default();
        fit.add(reference, test, emission);
        fit.scale()
    }

    #[test]
    fn a_render_of_twice_the_light_is_perfect_when_aligned() {
        let reference = reference();
        let test = reference.map(|pixel| pixel.map(|v| 2.0 * v));
        let scale = fitted(&reference, &test, None).unwrap();
        assert_eq!(scale, 0.5);
        let found =
            compare_aligned(&reference, &test, scale, None, &FlipOptions::default()).unwrap();
        assert_eq!(found.psnr_srgb_aligned_db, f64::INFINITY);
        assert_eq!(found.psnr_pq_aligned_db, f64::INFINITY);
        assert_eq!(found.flip_hdr_aligned, 0.0);
        let at_one =
            compare_aligned(&reference, &test, 1.0, None, &FlipOptions::default()).unwrap();
        assert!(at_one.psnr_srgb_aligned_db < 20.0 && at_one.flip_hdr_aligned > 0.05);
    }

    #[test]
    fn emitters_and_what_a_display_clips_do_not_count() {
        let colours = |values: [f32; 4]| {
            Image::from_pixels(4, 1, values.map(|v| [v, v / 2.0, 0.0]).to_vec()).unwrap()
        };
        let reference = colours([0.5, 1.0, 0.9, 1.1]);
        let test = colours([0.25, 0.5, 9.0, 9.0]);
        let emission = Image::from_pixels(4, 1, vec![[0.0], [0.1], [0.11], [0.0]]).unwrap();
        assert_eq!(fitted(&reference, &test, Some(&emission)), Some(2.0));
        let unmasked = fitted(&reference, &test, None).unwrap();
        assert!((unmasked - 2.4 / 9.75).abs() < 1e-6, "{unmasked}");
    }

    #[test]
    fn channels_have_factors_of_their_own() {
        let test = reference();
        let tinted = test.map(|[r, g, b]| [2.0 * r, *g, 0.5 * b]);
        let mut fit = ExposureFit::default();
        fit.add(&tinted, &test, None);
        let found = fit.scale_of_channels().unwrap();
        for (found, wanted) in found.into_iter().zip([2.0, 1.0, 0.5]) {
            assert!((found - wanted).abs() < 0.02, "{found} {wanted}");
        }
        let black = test.map(|[r, g, _]| [*r, *g, 0.0]);
        let mut fit = ExposureFit::default();
        fit.add(&test, &black, None);
        assert_eq!(fit.scale_of_channels(), None);
        assert!(fit.scale().is_some());
    }

    #[test]
    fn noise_does_not_darken() {
        // Every other sample is black, the others have twice the light. Least squares would say
        // 0.5.
        let reference = Image::filled(8, 2, [0.25; 3]);
        let mut test = reference.clone();
        for (i, pixel) in test.pixels_mut().iter_mut().enumerate() {
            *pixel = [if i % 2 == 0 { 0.0 } else { 0.5 }; 3];
        }
        assert_eq!(fitted(&reference, &test, None), Some(1.0));
    }

    #[test]
    fn nothing_to_align_has_no_scale() {
        let black = Image::filled(2, 2, [0.0; 3]);
        let grey = Image::filled(2, 2, [0.5; 3]);
        let bright = Image::filled(2, 2, [1.5; 3]);
        assert_eq!(fitted(&black, &grey, None), None);
        assert_eq!(fitted(&grey, &black, None), None);
        assert_eq!(fitted(&bright, &grey, None), None);
        assert_eq!(ExposureFit::default().scale(), None);
    }
}
