//! Metrics of gloss against ground truth, over pixels that do not emit.
//!
//! Each of these is `None` where no pixel can be compared, never NaN.

use crate::encode::assert_comparable;
use crate::scene_metrics::{emits, mean};
use eagpt_scene::Image;

/// A surface of a mean F0 above this is glossy: half of that of water.
const LEAST_SPECULAR: f32 = 0.02;

/// Specular reflectance at normal incidence, and perceptual roughness.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Coat<'a> {
    pub(crate) specular: &'a Image<3>,
    pub(crate) roughness: &'a Image<1>,
}

fn is_glossy(specular: &[f32; 3]) -> bool {
    specular.iter().sum::<f32>() / 3.0 > LEAST_SPECULAR
}

/// Pixels that do not emit, of the reference and of the test.
fn reflecting<'a>(
    reference: &'a Image<3>,
    test: &'a Image<3>,
    emission: Option<&'a Image<1>>,
) -> impl Iterator<Item = (usize, &'a [f32; 3], &'a [f32; 3])> {
    assert_comparable(reference, test);
    let pairs = reference.pixels().iter().zip(test.pixels()).enumerate();
    let pairs = pairs.filter(move |(i, _)| !emits(emission, *i));
    pairs.map(|(i, (r, t))| (i, r, t))
}

/// Mean absolute error of F0 over channels and pixels that do not emit.
///
/// # Panics
/// If the sizes differ.
pub(crate) fn specular_mae(
    reference: &Image<3>,
    test: &Image<3>,
    emission: Option<&Image<1>>,
) -> Option<f64> {
    let pixels = reflecting(reference, test, emission);
    let errors = pixels.flat_map(|(_, r, t)| [0, 1, 2].map(|c| f64::from((r[c] - t[c]).abs())));
    mean(errors)
}

/// Share of the pixels that do not emit which are glossy in the test alone.
///
/// # Panics
/// If the sizes differ.
pub(crate) fn false_gloss(
    reference: &Image<3>,
    test: &Image<3>,
    emission: Option<&Image<1>>,
) -> Option<f64> {
    let pixels = reflecting(reference, test, emission);
    mean(pixels.map(|(_, r, t)| f64::from(u8::from(is_glossy(t) && !is_glossy(r)))))
}

/// Mean absolute error of roughness, over the pixels that do not emit and are glossy in both.
///
/// # Panics
/// If the sizes differ.
pub(crate) fn roughness_mae(
    (reference, test): (Coat<'_>, Coat<'_>),
    emission: Option<&Image<1>>,
) -> Option<f64> {
    let pixels = reflecting(reference.specular, test.specular, emission);
    let glossy = pixels.filter(|(_, r, t)| is_glossy(r) && is_glossy(t));
    let value = |of: Coat<'_>, i: usize| of.roughness.pixels()[i][0];
    mean(glossy.map(|(i, ..)| f64::from((value(reference, i) - value(test, i)).abs())))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image<const C: usize>(pixels: &[[f32; C]]) -> Image<C> {
        Image::from_pixels(pixels.len() as u32, 1, pixels.to_vec()).unwrap()
    }

    /// Glossy in both, in the test alone, in the reference alone, an emitter, diffuse.
    #[test]
    fn gloss_is_compared_where_nothing_emits() {
        let reference = image(&[[0.5; 3], [0.0; 3], [0.04; 3], [0.0; 3], [0.0; 3]]);
        let test = image(&[[0.4, 0.5, 0.6], [0.03; 3], [0.0; 3], [1.0; 3], [0.01; 3]]);
        let emission = image(&[[0.0], [0.0], [0.1], [1.0], [0.0]]);
        let mae = specular_mae(&reference, &test, Some(&emission)).unwrap();
        assert!(
            (mae - (0.2 / 3.0 + 0.03 + 0.04 + 0.01) / 4.0).abs() < 1e-7,
            "{mae}"
        );
        assert_eq!(false_gloss(&reference, &test, Some(&emission)), Some(0.25));
        assert_eq!(false_gloss(&reference, &test, None), Some(0.4));
        let roughness = [[[0.3]; 5], [[0.5]; 5]].map(|pixels| image(&pixels));
        let coat = |specular, of: usize| Coat {
            specular,
            roughness: &roughness[of],
        };
        let pair = (coat(&reference, 0), coat(&test, 1));
        let mae = roughness_mae(pair, Some(&emission)).unwrap();
        assert!((mae - 0.2).abs() < 1e-7, "{mae}");
        let none = image(&[[0.0; 3]; 5]);
        assert_eq!(roughness_mae((coat(&none, 0), coat(&test, 1)), None), None);
        assert_eq!(specular_mae(&none, &test, Some(&image(&[[1.0]; 5]))), None);
    }
}
