//! Pixels as a display shows them.

use super::math::pow;
use eagpt_scene::tonemap::ToneMapper;

/// Mapping of pixels to linear display colours in [0, 1].
#[derive(Debug, Clone, Copy)]
pub(super) enum Shown {
    /// Linear light times a factor, through a tone curve; negative values and NaN are black.
    Exposed {
        /// Tone curve.
        tonemapper: ToneMapper,
        /// 2 to the power of the exposure.
        factor: f32,
    },
    /// sRGB, clipped to [0, 1]; NaN is black.
    Srgb,
}

/// [`Shown::Exposed`] of a pixel.
#[inline(always)]
pub(super) fn exposed(tonemapper: ToneMapper, factor: f32, pixel: [f32; 3]) -> [f32; 3] {
    tonemapper.shown(pixel.map(|v| v.max(0.0) * factor))
}

/// [`Shown::Srgb`] of a pixel.
#[inline(always)]
pub(super) fn of_srgb(pixel: [f32; 3]) -> [f32; 3] {
    // NaN fails the comparison and becomes black as well.
    pixel.map(|v| linear_from_srgb(if v > 0.0 { v.min(1.0) } else { 0.0 }))
}

/// [`eagpt_scene::color::linear_from_srgb`] in single precision and without a branch: twenty
/// million pixels go through it.
#[inline(always)]
fn linear_from_srgb(srgb: f32) -> f32 {
    let line = srgb * (1.0 / 12.92);
    let curve = pow((srgb + 0.055) * (1.0 / 1.055), 2.4);
    if srgb <= 0.040_45 { line } else { curve }
}

#[cfg(test)]
mod tests {
    use super::*;
    use eagpt_scene::color;

    #[test]
    fn srgb_is_decoded_as_everywhere_else() {
        for i in 0..=1000 {
            let srgb = i as f32 / 1000.0;
            let [found, ..] = of_srgb([srgb; 3]);
            // A few roundings of single precision.
            assert!(
                (found - color::linear_from_srgb(srgb)).abs() < 1e-6 * found + 1e-9,
                "{srgb}: {found}"
            );
        }
        assert_eq!(of_srgb([f32::NAN, -1.0, 0.0]), [0.0; 3]);
    }
}
