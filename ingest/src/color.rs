//! From the camera's colours to linear Rec.709.
//!
//! Follows the DNG specification (1.7, chapter 6) for files without a forward matrix: the colour
//! matrix maps the camera's neutral to XYZ, which gives the white of the scene; from there, the
//! linear Bradford transform adapts to D65, the white of Rec.709. Matrices for two illuminants are
//! interpolated by the inverse of the white's colour temperature.

use crate::raw::CameraColor;
use eagpt_scene::color::bradford;
use glam::{DMat3, DVec3};
use serde::{Deserialize, Serialize};
use std::fmt;

/// XYZ of Rec.709 primaries with their white D65, columns R, G, B (IEC 61966-2-1).
const XYZ_FROM_REC709: DMat3 = DMat3::from_cols(
    DVec3::new(0.412_456_4, 0.212_672_9, 0.019_333_9),
    DVec3::new(0.357_576_1, 0.715_152_2, 0.119_192_0),
    DVec3::new(0.180_437_5, 0.072_175_0, 0.950_304_1),
);
/// EXIF's number of the illuminant D65.
const D65: u16 = 21;
/// Iterations for white point and mixture together; after ten the result no longer changes in f32.
const MIXTURE_ROUNDS: usize = 20;

/// Colour transform of a whole capture.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ColorTransform {
    /// Factors of R, G, B of the camera; green is 1.
    pub white_balance: [f32; 3],
    /// Linear Rec.709 from balanced camera colours, row by row; a neutral surface stays neutral.
    pub rec709_from_camera: [[f32; 3]; 3],
    /// CIE xy of the scene's white as the camera saw it; `None` without a colour matrix.
    pub white_xy: Option<[f64; 2]>,
}

impl ColorTransform {
    /// For files that are linear Rec.709 already.
    pub const IDENTITY: Self = Self {
        white_balance: [1.0; 3],
        rec709_from_camera: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        white_xy: None,
    };

    /// The transform for factors of white balance. Without a colour matrix, colours stay those of
    /// the camera.
    pub(crate) fn new(color: &CameraColor, white_balance: [f32; 3]) -> Self {
        let [r, g, b] = white_balance.map(f64::from);
        let neutral = DVec3::new(g / r, 1.0, g / b);
        let balanced = Self {
            white_balance: [(r / g) as f32, 1.0, (b / g) as f32],
            ..Self::IDENTITY
        };
        let Some((xyz_from_camera, white)) = xyz_from_camera(color, neutral) else {
            return balanced;
        };
        let d65 = XYZ_FROM_REC709 * DVec3::ONE;
        let adapted = bradford(white, d65);
        let matrix =
            XYZ_FROM_REC709.inverse() * adapted * xyz_from_camera * DMat3::from_diagonal(neutral);
        // White has luminance 1, so this leaves (1, 1, 1) as it is, up to rounding.
        let rows = [matrix.row(0), matrix.row(1), matrix.row(2)];
        let sum = white.element_sum();
        Self {
            rec709_from_camera: rows.map(|row| row.to_array().map(|v| v as f32)),
            white_xy: Some([white.x / sum, white.y / sum]),
            ..balanced
        }
    }

    /// Linear Rec.709 of a balanced camera colour.
    #[inline]
    pub fn apply(&self, camera: [f32; 3]) -> [f32; 3] {
        self.rec709_from_camera
            .map(|row| row[0] * camera[0] + row[1] * camera[1] + row[2] * camera[2])
    }
}

/// XYZ from camera, and the XYZ of the neutral with luminance 1; `None` if the file has no usable
/// matrix.
fn xyz_from_camera(color: &CameraColor, neutral: DVec3) -> Option<(DMat3, DVec3)> {
    let known = |(illuminant, rows): &(u16, [[f64; 3]; 3])| {
        let matrix = DMat3::from_cols_array_2d(rows).transpose();
        let usable = matrix.is_finite() && matrix.determinant().abs() > 1e-9;
        usable.then(|| (temperature(*illuminant), matrix))
    };
    let mut matrices: Vec<_> = color.matrices.iter().filter_map(known).collect();
    matrices.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (&(warm, first), &(cool, last)) = (matrices.first()?, matrices.last()?);
    // Luminance 1 also scales the matrix, so that the neutral gets it.
    let white_of = |camera_from_xyz: DMat3| {
        let white = camera_from_xyz.inverse() * neutral;
        (white.y > 0.0).then_some(white)
    };
    let mut matrix = last;
    if cool > warm {
        for _ in 0..MIXTURE_ROUNDS {
            let white = white_of(matrix)?;
            let kelvin = temperature_of(white).clamp(warm, cool);
            let share = (1.0 / kelvin - 1.0 / cool) / (1.0 / warm - 1.0 / cool);
            matrix = first * share + last * (1.0 - share);
        }
    }
    let white = white_of(matrix)?;
    Some((matrix.inverse() * (1.0 / white.y), white / white.y))
}

/// Colour temperature in kelvin of EXIF's illuminants.
fn temperature(illuminant: u16) -> f64 {
    match illuminant {
        3 | 17 => 2856.0,
        24 => 3200.0,
        2 | 14 => 4150.0,
        13 | 23 => 5000.0,
        4 | 20 => 5500.0,
        12 => 6430.0,
        10 | 19 => 6800.0,
        11 | 22 => 7500.0,
        15 => 3525.0,
        18 => 4874.0,
        D65 => 6504.0,
        _ => 5500.0,
    }
}

/// Correlated colour temperature in kelvin (McCamy, Color Research and Application 17, 1992).
fn temperature_of(white: DVec3) -> f64 {
    let sum = white.element_sum();
    let (x, y) = (white.x / sum, white.y / sum);
    let n = (x - 0.3320) / (0.1858 - y);
    437.0 * n.powi(3) + 3601.0 * n.powi(2) + 6861.0 * n + 5517.0
}

/// Source of the white balance factors.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum WhiteBalance {
    /// Those that the camera chose for the first shot of the capture.
    #[default]
    AsShot,
    /// As given: R, G, B.
    Factors([f32; 3]),
    /// Those that make a rectangle of a stack neutral.
    GreyCard {
        /// Name of the stack, `position` or `condition/position`.
        stack: String,
        /// Left, top, width and height in pixels of the sensor's image.
        rectangle: [u32; 4],
    },
}

impl fmt::Display for WhiteBalance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::AsShot => f.write_str("as-shot"),
            Self::Factors([r, g, b]) => write!(f, "{r},{g},{b}"),
            Self::GreyCard { stack, rectangle } => {
                let [left, top, width, height] = rectangle;
                write!(f, "{stack}@{left},{top},{width},{height}")
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A real camera's matrix for D65.
    const CAMERA_FROM_XYZ: [[f64; 3]; 3] = [
        [0.7374, -0.2389, -0.0551],
        [-0.5435, 1.3162, 0.2519],
        [-0.1006, 0.1795, 0.6552],
    ];

    fn camera(matrices: Vec<(u16, [[f64; 3]; 3])>) -> CameraColor {
        CameraColor {
            as_shot: None,
            matrices,
        }
    }

    #[track_caller]
    fn assert_color(found: [f32; 3], expected: [f32; 3]) {
        for channel in 0..3 {
            assert!(
                (found[channel] - expected[channel]).abs() < 2e-5,
                "{found:?}, expected {expected:?}"
            );
        }
    }

    #[test]
    fn under_d65_the_matrix_alone_gives_colours_back() {
        let camera_from_rec709 =
            DMat3::from_cols_array_2d(&CAMERA_FROM_XYZ).transpose() * XYZ_FROM_REC709;
        let neutral = camera_from_rec709 * DVec3::ONE;
        let factors = (DVec3::splat(neutral.y) / neutral).as_vec3().to_array();
        let transform = ColorTransform::new(&camera(vec![(D65, CAMERA_FROM_XYZ)]), factors);
        let [x, y] = transform.white_xy.unwrap();
        // The white point of Rec.709.
        assert!(
            (x - 0.3127).abs() < 1e-4 && (y - 0.3290).abs() < 1e-4,
            "{x} {y}"
        );
        for color in [[0.8, 0.2, 0.1], [0.1, 0.6, 0.3], [0.05, 0.1, 0.9]] {
            let seen = camera_from_rec709 * DVec3::from_array(color) / neutral.y;
            let balanced = [0, 1, 2].map(|c| seen[c] as f32 * factors[c]);
            assert_color(transform.apply(balanced), color.map(|v| v as f32));
        }
    }

    #[test]
    fn neutral_stays_neutral_under_any_light() {
        let warm = [[0.9, -0.3, -0.1], [-0.45, 1.25, 0.22], [-0.05, 0.2, 0.5]];
        let both = camera(vec![(17, warm), (D65, CAMERA_FROM_XYZ)]);
        for factors in [[1.3, 1.0, 2.9], [2.0, 1.0, 1.8], [2.7, 1.0, 1.3]] {
            assert_color(
                ColorTransform::new(&both, factors).apply([0.4; 3]),
                [0.4; 3],
            );
        }
        // Without a matrix, colours stay those of the camera.
        let plain = ColorTransform::new(&camera(Vec::new()), [4.0, 2.0, 3.0]);
        assert_eq!(plain.white_balance, [2.0, 1.0, 1.5]);
        assert_color(plain.apply([0.3, 0.2, 0.1]), [0.3, 0.2, 0.1]);
    }
}
