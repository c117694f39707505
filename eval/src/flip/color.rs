//! The colour spaces of FLIP, all from linear Rec.709 and relative to its own white (D65).

use super::math::cbrt;

/// XYZ of linear Rec.709, the exact rational matrix, as FLIP has it.
const XYZ_FROM_RGB: [[f32; 3]; 3] = [
    [
        10_135_552.0 / 24_577_794.0,
        8_788_810.0 / 24_577_794.0,
        4_435_075.0 / 24_577_794.0,
    ],
    [
        2_613_072.0 / 12_288_897.0,
        8_788_810.0 / 12_288_897.0,
        887_015.0 / 12_288_897.0,
    ],
    [
        1_425_312.0 / 73_733_382.0,
        8_788_810.0 / 73_733_382.0,
        70_074_185.0 / 73_733_382.0,
    ],
];
/// Inverse of [`XYZ_FROM_RGB`].
const RGB_FROM_XYZ: [[f32; 3]; 3] = [
    [3.241_003_3, -1.537_399, -0.498_615_86],
    [-0.969_224_33, 1.875_930_1, 0.041_554_224],
    [0.055_639_423, -0.204_011_2, 1.057_148_9],
];
/// XYZ of white: the row sums of [`XYZ_FROM_RGB`].
const WHITE: [f32; 3] = [0.950_428_55, 1.0, 1.088_900_4];
const INVERSE_WHITE: [f32; 3] = [1.052_156_9, 1.0, 0.918_357_7];

#[inline(always)]
fn transform(matrix: &[[f32; 3]; 3], v: [f32; 3]) -> [f32; 3] {
    matrix.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

/// XYZ over that of white.
#[inline(always)]
fn relative_xyz(rgb: [f32; 3]) -> [f32; 3] {
    let xyz = transform(&XYZ_FROM_RGB, rgb);
    std::array::from_fn(|i| xyz[i] * INVERSE_WHITE[i])
}

/// The opponent space of contrast sensitivity: luminance, red-green, yellow-blue. Linear in the
/// colour.
#[inline(always)]
pub(super) fn ycxcz_from_rgb(rgb: [f32; 3]) -> [f32; 3] {
    let [x, y, z] = relative_xyz(rgb);
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

/// Inverse of [`ycxcz_from_rgb`], not clipped.
#[inline(always)]
pub(super) fn rgb_from_ycxcz([y, cx, cz]: [f32; 3]) -> [f32; 3] {
    let y = (y + 16.0) * (1.0 / 116.0);
    let relative = [y + cx * (1.0 / 500.0), y, y - cz * (1.0 / 200.0)];
    let xyz = std::array::from_fn(|i| relative[i] * WHITE[i]);
    transform(&RGB_FROM_XYZ, xyz)
}

/// CIELAB with a and b scaled by L/100 (Hunt effect: dim colours look less colourful).
#[inline(always)]
pub(super) fn hunt_lab_from_rgb(rgb: [f32; 3]) -> [f32; 3] {
    const DELTA: f32 = 6.0 / 29.0;
    const CUBE: f32 = DELTA * DELTA * DELTA;
    let [x, y, z] = relative_xyz(rgb).map(|v| {
        // Both, to avoid a branch.
        let (root, line) = (
            cbrt(v.max(CUBE)),
            v * (1.0 / (3.0 * DELTA * DELTA)) + 4.0 / 29.0,
        );
        if v > CUBE { root } else { line }
    });
    let lightness = 116.0 * y - 16.0;
    let hunt = 0.01 * lightness;
    [lightness, hunt * 500.0 * (x - y), hunt * 200.0 * (y - z)]
}

/// HyAB distance: city block in lightness, Euclidean in a and b.
#[inline(always)]
pub(super) fn hyab(p: [f32; 3], q: [f32; 3]) -> f32 {
    let (da, db) = (p[1] - q[1], p[2] - q[2]);
    (p[0] - q[0]).abs() + (da * da + db * db).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn white_and_known_colours() {
        let [l, a, b] = hunt_lab_from_rgb([1.0; 3]);
        assert!((l - 100.0).abs() < 1e-3 && a.abs() < 1e-3 && b.abs() < 1e-3);
        // CIELAB of sRGB green: L 87.735, a -86.183, b 83.180; Hunt scales a and b by 0.87735.
        let [l, a, b] = hunt_lab_from_rgb([0.0, 1.0, 0.0]);
        assert!((l - 87.735).abs() < 0.01, "{l}");
        assert!((a + 86.183 * 0.877_35).abs() < 0.02, "{a}");
        assert!((b - 83.180 * 0.877_35).abs() < 0.02, "{b}");
    }

    #[test]
    fn opponent_space_and_back() {
        for rgb in [[0.0; 3], [1.0; 3], [0.2, 0.7, 0.05], [0.9, 0.0, 0.3]] {
            let back = rgb_from_ycxcz(ycxcz_from_rgb(rgb));
            for (a, b) in rgb.iter().zip(back) {
                assert!((a - b).abs() < 2e-6, "{rgb:?} {back:?}");
            }
        }
    }

    #[test]
    fn distance_adds_lightness_to_chroma() {
        assert_eq!(hyab([10.0, 0.0, 1.0], [7.0, 3.0, 5.0]), 3.0 + 5.0);
    }
}
