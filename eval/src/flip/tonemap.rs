//! The tone curves of HDR-FLIP.

use eagpt_scene::color::luminance;
use serde::{Deserialize, Serialize};

/// Share of the display's range that the automatic exposures aim at.
const TARGET: f32 = 0.85;
/// Exposed values are cut here: every tone curve is flat long before, and squares still fit in f32.
const BRIGHTEST: f32 = 1e15;

/// How HDR-FLIP maps light to the display.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ToneMapper {
    /// The rational fit to the ACES filmic curve, without its pre-exposure.
    #[default]
    Aces,
    /// The filmic curve of Hable.
    Hable,
    /// Reinhard's Y / (1 + Y), on luminance.
    Reinhard,
}

impl ToneMapper {
    /// The name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Aces => "aces",
            Self::Hable => "hable",
            Self::Reinhard => "reinhard",
        }
    }

    /// (a x² + b x + c) / (d x² + e x + f).
    fn coefficients(self) -> [f32; 6] {
        // ACES is published for light that was multiplied by 0.6 before.
        const PRE: f32 = 0.6;
        match self {
            Self::Aces => [
                PRE * PRE * 2.51,
                PRE * 0.03,
                0.0,
                PRE * PRE * 2.43,
                PRE * 0.59,
                0.14,
            ],
            Self::Hable => [0.231_683, 0.013_791, 0.0, 0.18, 0.3, 0.018],
            Self::Reinhard => [0.0, 1.0, 0.0, 0.0, 1.0, 1.0],
        }
    }

    /// Light that is shown as [`TARGET`].
    pub(super) fn light_at_target(self) -> f32 {
        let [a, b, c, d, e, f] = self.coefficients();
        let (a, b, c) = (a - TARGET * d, b - TARGET * e, c - TARGET * f);
        if a == 0.0 {
            return -c / b;
        }
        let half = -0.5 * (b / a);
        half + (half * half - c / a).sqrt()
    }

    /// What the display shows of exposed light, in [0, 1], linear.
    #[inline(always)]
    pub(super) fn shown(self, light: [f32; 3]) -> [f32; 3] {
        let light = light.map(|v| v.min(BRIGHTEST));
        let shown = if self == Self::Reinhard {
            let scale = 1.0 / (1.0 + luminance(light));
            light.map(|v| v * scale)
        } else {
            let [a, b, c, d, e, f] = self.coefficients();
            light.map(|v| (v * v * a + v * b + c) / (v * v * d + v * e + f))
        };
        shown.map(|v| v.clamp(0.0, 1.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_curve_shows_its_target_as_085() {
        for mapper in [ToneMapper::Aces, ToneMapper::Hable, ToneMapper::Reinhard] {
            let [shown, _, _] = mapper.shown([mapper.light_at_target(); 3]);
            assert!((shown - 0.85).abs() < 1e-5, "{mapper:?} {shown}");
            assert_eq!(mapper.shown([0.0; 3]), [0.0; 3]);
            assert!(mapper.shown([f32::MAX; 3])[0] > 0.99);
        }
        // Reinhard: x / (1 + x) = 0.85.
        assert!((ToneMapper::Reinhard.light_at_target() - 0.85 / 0.15).abs() < 1e-5);
    }
}
