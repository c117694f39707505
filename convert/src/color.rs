//! Colour of sources: gains, primaries and a scale, to linear Rec.709.

use eagpt_scene::color::Chromaticities;
use glam::{DMat3, DVec3};
use serde::Serialize;

/// Primaries of linear light, with the white D65.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Primaries {
    /// ITU-R BT.709, those of sRGB: ours.
    #[default]
    Rec709,
    /// Those of digital cinema (SMPTE RP 431-2) with the white D65 (SMPTE EG 432-1), which displays
    /// have.
    ///
    /// Eyeful Tower says "DCI-P3" and names no white. Its white balance makes grey equal in R, G
    /// and B, which is the white of whatever space they are in; with the white of cinema
    /// projectors, adapted to D65, entries of the matrix would differ by up to 0.07.
    P3D65,
}

impl Primaries {
    /// The matrix that turns linear light of these primaries into that of Rec.709.
    pub(crate) fn rec709_from_rgb(self) -> DMat3 {
        let chromaticities = match self {
            Self::Rec709 => Chromaticities::REC709,
            Self::P3D65 => Chromaticities::P3_D65,
        };
        chromaticities
            .rec709_from_rgb()
            .expect("known primaries span colours")
    }
}

/// Transform from a source's linear values to ours: white balance in the source's space, then its
/// primaries, then a scale.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ColorTransform {
    /// Factors of R, G, B.
    pub gains: [f64; 3],
    /// Primaries of the source.
    pub(crate) primaries: Primaries,
    /// Factor of all.
    pub scale: f64,
}

impl Default for ColorTransform {
    fn default() -> Self {
        Self {
            gains: [1.0; 3],
            primaries: Primaries::Rec709,
            scale: 1.0,
        }
    }
}

impl ColorTransform {
    /// The matrix of all three.
    pub fn matrix(&self) -> DMat3 {
        let gains = DMat3::from_diagonal(DVec3::from(self.gains));
        self.primaries.rec709_from_rgb() * gains * self.scale
    }

    /// Whether values are unchanged.
    pub fn is_identity(&self) -> bool {
        *self == Self::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn p3_agrees_with_published_numbers_and_keeps_grey() {
        let matrix = Primaries::P3D65.rec709_from_rgb();
        // Apple's and the W3C's (CSS Color 4) linear display-p3 to linear sRGB, to six decimals.
        let expected = [
            [1.224_940, -0.224_940, 0.0],
            [-0.042_057, 1.042_057, 0.0],
            [-0.019_638, -0.078_636, 1.098_274],
        ];
        for (r, row) in expected.iter().enumerate() {
            for (c, value) in row.iter().enumerate() {
                let own = matrix.col(c)[r];
                assert!((own - value).abs() < 2e-6, "{r} {c}: {own} {value}");
            }
        }
        assert!((matrix * DVec3::ONE - DVec3::ONE).length() < 1e-12);
    }

    #[test]
    fn gains_come_before_primaries() {
        let color = ColorTransform {
            gains: [0.5, 1.0, 2.0],
            primaries: Primaries::P3D65,
            scale: 3.0,
        };
        let light = color.matrix() * DVec3::new(2.0, 1.0, 0.5);
        assert!((light - 3.0).length() < 1e-11, "{light}");
        assert!(!color.is_identity() && ColorTransform::default().is_identity());
    }
}
