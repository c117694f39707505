//! Metrics of the other channels of a render: albedo, normals, depth and emission against ground
//! truth.
//!
//! Each of these is `None` where no pixel can be compared, never NaN.

use crate::encode::assert_comparable;
use crate::psnr::mean_db;
use eagpt_scene::{Image, color::srgb_from_linear};
use serde::{Deserialize, Serialize};

/// A reference emission above this marks an emitter, whose albedo is undefined (τ_E of EAG-PT).
pub(crate) const EMITTER_THRESHOLD: f32 = 0.1;
/// Emission above this is an emitter for [`emission_overlap`]: the middle of a mask's range.
pub(crate) const IOU_THRESHOLD: f32 = 0.5;

/// PSNR of diffuse albedos.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct AlbedoPsnr {
    /// Mean over R, G, B of each channel's decibels, sRGB clipped to [0, 1]; infinite for equal
    /// albedos.
    pub srgb_db: f64,
    /// The same after the test was multiplied by `scale`.
    pub scaled_srgb_db: f64,
    /// The one factor that brings the test nearest to the reference: least squares over all
    /// channels, in linear.
    pub scale: f64,
}

/// Whether a pixel is above [`EMITTER_THRESHOLD`]; false where emission is unknown.
pub(crate) fn emits(emission: Option<&Image<1>>, pixel: usize) -> bool {
    emission.is_some_and(|emission| emission.pixels()[pixel][0] > EMITTER_THRESHOLD)
}

/// Compares linear albedos over the pixels whose reference emission is at most
/// [`EMITTER_THRESHOLD`]; over all pixels without one. The released code of EAG-PT sets emitters to
/// black in both images and averages over all pixels, which flatters images with large emitters.
///
/// # Panics
/// If the sizes differ or the images have no pixels.
pub(crate) fn albedo_psnr(
    reference: &Image<3>,
    test: &Image<3>,
    reference_emission: Option<&Image<1>>,
) -> Option<AlbedoPsnr> {
    assert_comparable(reference, test);
    if let Some(emission) = reference_emission {
        assert_comparable(reference, emission);
    }
    let pairs: Vec<([f32; 3], [f32; 3])> = reference
        .pixels()
        .iter()
        .zip(test.pixels())
        .enumerate()
        .filter(|(i, _)| !emits(reference_emission, *i))
        .map(|(_, (r, t))| (*r, *t))
        .collect();
    if pairs.is_empty() {
        return None;
    }
    let (mut cross, mut square) = (0.0, 0.0);
    for (r, t) in pairs.iter().flat_map(|(r, t)| r.iter().zip(t)) {
        cross += f64::from(*r) * f64::from(*t);
        square += f64::from(*t) * f64::from(*t);
    }
    // A black test stays black whatever the factor.
    let scale = if square > 0.0 { cross / square } else { 1.0 };
    Some(AlbedoPsnr {
        srgb_db: scaled_srgb_db(&pairs, 1.0),
        scaled_srgb_db: scaled_srgb_db(&pairs, scale),
        scale,
    })
}

fn scaled_srgb_db(pairs: &[([f32; 3], [f32; 3])], scale: f64) -> f64 {
    let shown = |linear: f32| f64::from(srgb_from_linear(linear.clamp(0.0, 1.0)));
    let mut squared = [0.0; 3];
    for (reference, test) in pairs {
        for (c, squared) in squared.iter_mut().enumerate() {
            let scaled = (f64::from(test[c]) * scale) as f32;
            *squared += (shown(scaled) - shown(reference[c])).powi(2);
        }
    }
    mean_db(squared.map(|sum| sum / pairs.len() as f64))
}

/// Mean angle between world-space normals, in degrees, over the pixels where both are not zero.
/// Lengths do not matter.
///
/// # Panics
/// If the sizes differ or the images have no pixels.
pub(crate) fn normal_mean_deg(reference: &Image<3>, test: &Image<3>) -> Option<f64> {
    assert_comparable(reference, test);
    let angles = reference
        .pixels()
        .iter()
        .zip(test.pixels())
        .filter(|(r, t)| **r != [0.0; 3] && **t != [0.0; 3])
        .map(|(r, t)| {
            let r = glam::Vec3::from_array(*r).as_dvec3();
            let t = glam::Vec3::from_array(*t).as_dvec3();
            // Unlike the arc cosine exact for small angles.
            r.cross(t).length().atan2(r.dot(t)).to_degrees()
        });
    mean(angles)
}

/// Mean absolute error of depths along the optical axis, in scene units, over the pixels where that
/// of the reference is known: finite and above 0. A test depth that is not finite counts as 0, like
/// one where nothing was hit.
///
/// # Panics
/// If the sizes differ or the images have no pixels.
pub(crate) fn depth_mae(reference: &Image<1>, test: &Image<1>) -> Option<f64> {
    assert_comparable(reference, test);
    let errors = reference
        .values()
        .iter()
        .zip(test.values())
        .filter(|(r, _)| r.is_finite() && **r > 0.0)
        .map(|(r, t)| {
            let test = if t.is_finite() { *t } else { 0.0 };
            (f64::from(test) - f64::from(*r)).abs()
        });
    mean(errors)
}

/// Overlap of two sets of pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub(crate) struct Overlap {
    /// Pixels in both.
    pub num_both: u64,
    /// Pixels in one or both.
    pub num_either: u64,
}

impl Overlap {
    /// Intersection over union; `None` where both sets are empty.
    pub(crate) fn iou(&self) -> Option<f64> {
        (self.num_either > 0).then(|| self.num_both as f64 / self.num_either as f64)
    }

    /// The overlap in several images together.
    pub(crate) fn total(images: impl Iterator<Item = Self>) -> Self {
        images.fold(Self::default(), |sum, image| Self {
            num_both: sum.num_both + image.num_both,
            num_either: sum.num_either + image.num_either,
        })
    }
}

/// The overlap of the pixels above [`IOU_THRESHOLD`].
///
/// # Panics
/// If the sizes differ or the images have no pixels.
pub(crate) fn emission_overlap(reference: &Image<1>, test: &Image<1>) -> Overlap {
    assert_comparable(reference, test);
    let pairs = reference.values().iter().zip(test.values());
    Overlap::total(pairs.map(|(r, t)| {
        let (r, t) = (*r > IOU_THRESHOLD, *t > IOU_THRESHOLD);
        Overlap {
            num_both: u64::from(r && t),
            num_either: u64::from(r || t),
        }
    }))
}

/// Mean in the order given; `None` if empty.
pub(crate) fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, num) = values.fold((0.0, 0_u64), |(sum, num), value| (sum + value, num + 1));
    (num > 0).then(|| sum / num as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn single(values: &[f32]) -> Image<1> {
        let pixels = values.iter().map(|v| [*v]).collect();
        Image::from_pixels(values.len() as u32, 1, pixels).unwrap()
    }

    fn colour(pixels: &[[f32; 3]]) -> Image<3> {
        Image::from_pixels(pixels.len() as u32, 1, pixels.to_vec()).unwrap()
    }

    #[test]
    fn albedo_leaves_emitters_out_and_fits_one_scale() {
        let reference = colour(&[[0.4, 0.6, 0.8], [0.2, 0.3, 0.1], [1.0, 1.0, 1.0]]);
        let test = colour(&[[0.2, 0.3, 0.4], [0.1, 0.15, 0.05], [0.0, 0.0, 0.0]]);
        let emission = single(&[0.0, 0.1, 0.11]);
        let found = albedo_psnr(&reference, &test, Some(&emission)).unwrap();
        assert!((found.scale - 2.0).abs() < 1e-6);
        assert!(found.scaled_srgb_db > 120.0, "{found:?}");
        // By hand for red: sRGB 0.66519 and 0.48453, 0.48453 and 0.34919, mean squared error
        // 0.025478.
        let db = |a: [f32; 2], b: [f32; 2]| {
            let squared =
                |i: usize| f64::from(srgb_from_linear(a[i]) - srgb_from_linear(b[i])).powi(2);
            -10.0 * ((squared(0) + squared(1)) / 2.0).log10()
        };
        let red = db([0.4, 0.2], [0.2, 0.1]);
        assert!((red - 15.938).abs() < 0.01, "{red}");
        let expected = (red + db([0.6, 0.3], [0.3, 0.15]) + db([0.8, 0.1], [0.4, 0.05])) / 3.0;
        assert!((found.srgb_db - expected).abs() < 1e-4);
        // Without a mask the third pixel counts.
        let all = albedo_psnr(&reference, &test, None).unwrap();
        assert!(all.srgb_db < found.srgb_db - 5.0);
        assert_eq!(
            albedo_psnr(&reference, &test, Some(&single(&[1.0; 3]))),
            None
        );
        let black = albedo_psnr(&reference, &colour(&[[0.0; 3]; 3]), None).unwrap();
        assert_eq!(black.scale, 1.0);
        assert_eq!(black.srgb_db, black.scaled_srgb_db);
    }

    #[test]
    fn angles_between_known_normals() {
        let reference = colour(&[[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0; 3], [0.0, 1.0, 0.0]]);
        let test = colour(&[[0.0, 2.0, 2.0], [-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0; 3]]);
        let found = normal_mean_deg(&reference, &test).unwrap();
        assert!((found - (45.0 + 180.0) / 2.0).abs() < 1e-9, "{found}");
        assert_eq!(normal_mean_deg(&reference, &colour(&[[0.0; 3]; 4])), None);
    }

    #[test]
    fn depth_counts_where_the_reference_knows_it() {
        let reference = single(&[1.0, 2.0, 0.0, f32::INFINITY, 4.0]);
        let test = single(&[1.5, 1.0, 9.0, 9.0, f32::NAN]);
        // Errors 0.5, 1 and 4.
        let found = depth_mae(&reference, &test).unwrap();
        assert!((found - 5.5 / 3.0).abs() < 1e-9);
        assert_eq!(depth_mae(&single(&[0.0]), &single(&[1.0])), None);
    }

    #[test]
    fn emitters_overlap_by_a_third() {
        let reference = single(&[1.0, 0.9, 0.5, 0.0]);
        let test = single(&[0.6, 0.2, 0.7, 0.5]);
        let iou = |a: &Image<1>, b: &Image<1>| emission_overlap(a, b).iou();
        assert_eq!(iou(&reference, &test), Some(1.0 / 3.0));
        assert_eq!(iou(&single(&[0.0]), &single(&[0.5])), None);
        assert_eq!(iou(&single(&[0.0]), &single(&[0.51])), Some(0.0));
    }
}
