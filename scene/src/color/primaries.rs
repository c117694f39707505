//! Primaries of linear light, and the matrices between them.
//!
//! Matrices are derived from chromaticities: a colour space's XYZ of R, G and B are those of its
//! primaries, scaled so that their sum is that of its white (SMPTE RP 177). Where whites differ,
//! the linear Bradford transform adapts one to the other, so that grey stays grey.

use glam::{DMat3, DVec2, DVec3};

/// D65 (ITU-R BT.709, IEC 61966-2-1).
const D65: DVec2 = DVec2::new(0.3127, 0.3290);
/// Cone responses of Bradford from XYZ (Lam, 1985, as in the ICC specification).
const BRADFORD: DMat3 = DMat3::from_cols(
    DVec3::new(0.8951, -0.7502, 0.0389),
    DVec3::new(0.2664, 1.7135, -0.0685),
    DVec3::new(-0.1614, 0.0367, 1.0296),
);
/// Difference of coordinates that writers of the same primaries have: 0.3127 is 0.31271 elsewhere.
const SAME: f64 = 1e-4;

/// The CIE xy of primaries and white.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Chromaticities {
    /// Red, green and blue.
    pub primaries: [DVec2; 3],
    /// White.
    pub white: DVec2,
}

impl Chromaticities {
    /// ITU-R BT.709, those of sRGB: ours.
    pub const REC709: Self = Self {
        primaries: [
            DVec2::new(0.640, 0.330),
            DVec2::new(0.300, 0.600),
            DVec2::new(0.150, 0.060),
        ],
        white: D65,
    };
    /// Those of digital cinema (SMPTE RP 431-2) with the white D65 (SMPTE EG 432-1).
    pub const P3_D65: Self = Self {
        primaries: [
            DVec2::new(0.680, 0.320),
            DVec2::new(0.265, 0.690),
            DVec2::new(0.150, 0.060),
        ],
        white: D65,
    };

    /// The matrix that turns linear light of these primaries into XYZ, white with Y = 1.
    fn xyz_from_rgb(&self) -> DMat3 {
        let [r, g, b] = self.primaries.map(xyz);
        let primaries = DMat3::from_cols(r, g, b);
        primaries * DMat3::from_diagonal(primaries.inverse() * xyz(self.white))
    }

    /// The matrix that turns linear light of these primaries into that of Rec.709, white into
    /// white; `None` if they span no colours.
    pub fn rec709_from_rgb(&self) -> Option<DMat3> {
        if *self == Self::REC709 {
            return Some(DMat3::IDENTITY);
        }
        let xyz_from_rgb = self.xyz_from_rgb();
        let usable = xyz_from_rgb.is_finite()
            && xyz_from_rgb.determinant().abs() > 1e-9
            && self.white.y > 0.0;
        let rec709_from_xyz = Self::REC709.xyz_from_rgb().inverse();
        usable.then(|| match self.white == D65 {
            true => rec709_from_xyz * xyz_from_rgb,
            false => rec709_from_xyz * bradford(xyz(self.white), xyz(D65)) * xyz_from_rgb,
        })
    }

    /// Whether they are those of Rec.709, but for rounding.
    pub fn is_rec709(&self) -> bool {
        let near = |a: DVec2, b: DVec2| (a - b).abs().max_element() <= SAME;
        let mut pairs = self.primaries.into_iter().zip(Self::REC709.primaries);
        pairs.all(|(own, other)| near(own, other)) && near(self.white, D65)
    }
}

/// XYZ with Y = 1; imaginary primaries, as those of XYZ itself, may have no luminance.
fn xyz(xy: DVec2) -> DVec3 {
    let scale = if xy.y == 0.0 { 1.0 } else { xy.y };
    DVec3::new(xy.x, xy.y, 1.0 - xy.x - xy.y) / scale
}

/// The linear Bradford transform of XYZ that turns the white `from` into the white `to`.
pub fn bradford(from: DVec3, to: DVec3) -> DMat3 {
    BRADFORD.inverse() * DMat3::from_diagonal((BRADFORD * to) / (BRADFORD * from)) * BRADFORD
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn assert_rows(matrix: DMat3, rows: [[f64; 3]; 3], tolerance: f64) {
        for (r, row) in rows.iter().enumerate() {
            for (c, expected) in row.iter().enumerate() {
                let own = matrix.col(c)[r];
                assert!((own - expected).abs() < tolerance, "{r} {c}: {matrix}");
            }
        }
    }

    fn chromaticities(values: [f64; 8]) -> Chromaticities {
        let [rx, ry, gx, gy, bx, by, wx, wy] = values;
        Chromaticities {
            primaries: [DVec2::new(rx, ry), DVec2::new(gx, gy), DVec2::new(bx, by)],
            white: DVec2::new(wx, wy),
        }
    }

    #[test]
    fn aces_and_xyz_agree_with_published_numbers() {
        // ACEScg (AP1), adapted to D65 by Bradford: the matrix published with ACES's output
        // transforms, to four decimals.
        let ap1 = chromaticities([0.713, 0.293, 0.165, 0.830, 0.128, 0.044, 0.32168, 0.33767]);
        let rows = [
            [1.705_05, -0.621_79, -0.083_26],
            [-0.130_26, 1.140_80, -0.010_55],
            [-0.024_00, -0.128_97, 1.152_97],
        ];
        assert_rows(ap1.rec709_from_rgb().unwrap(), rows, 2e-4);
        // XYZ of the equal-energy white; where the white is D65, IEC 61966-2-1's matrix.
        let xyz = |x, y| chromaticities([1.0, 0.0, 0.0, 1.0, 0.0, 0.0, x, y]);
        let grey = xyz(1.0 / 3.0, 1.0 / 3.0).rec709_from_rgb().unwrap() * DVec3::ONE;
        assert!((grey - DVec3::ONE).length() < 1e-12, "{grey}");
        let rows = [
            [3.2406, -1.5372, -0.4986],
            [-0.9689, 1.8758, 0.0415],
            [0.0557, -0.2040, 1.0570],
        ];
        let d65 = DVec3::new(0.3127, 0.3290, 1.0 - 0.3127 - 0.3290) / 0.3290;
        let matrix = xyz(0.3127, 0.3290).rec709_from_rgb().unwrap();
        // Its (1, 1, 1) is the white, as in every space.
        assert_rows(matrix * DMat3::from_diagonal(d65).inverse(), rows, 5e-4);
    }

    #[test]
    fn what_is_rec709_changes_nothing_and_what_spans_nothing_is_none() {
        let rounded = chromaticities([0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.31271, 0.32902]);
        assert!(rounded.is_rec709() && !Chromaticities::P3_D65.is_rec709());
        let own = Chromaticities::REC709;
        assert_eq!(own.rec709_from_rgb(), Some(DMat3::IDENTITY));
        for values in [[0.0; 8], [0.3; 8], [f64::NAN; 8]] {
            assert_eq!(chromaticities(values).rec709_from_rgb(), None, "{values:?}");
        }
    }
}
