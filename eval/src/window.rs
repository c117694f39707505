//! The 11-tap Gaussian window of SSIM, as passes over contiguous rows that the compiler vectorises.

use multiversion::multiversion;

/// Taps on each side of the centre.
pub const RADIUS: usize = 5;
const NUM_TAPS: usize = 2 * RADIUS + 1;

/// exp(−i² / (2·1.5²)) for i = 0..=5 over the sum of all eleven: distance from the centre, then
/// weight.
pub const WEIGHTS: [f32; RADIUS + 1] = [
    0.266_011_72,
    0.213_005_53,
    0.109_360_69,
    0.036_000_773,
    0.007_598_758,
    0.001_028_38,
];

/// Blurs along x. `padded` holds the row between `RADIUS` values on each side, `out` has the length
/// of the row.
#[multiversion(targets("x86_64+avx512f+avx512vl", "x86_64+avx2", "aarch64+neon"))]
pub(crate) fn blur_row(padded: &[f32], out: &mut [f32]) {
    weighted_sum(std::array::from_fn(|tap| &padded[tap..]), out);
}

/// Blurs along y: `out` is the sum of the eleven rows that start at `rows` and lie `stride` values
/// apart.
#[multiversion(targets("x86_64+avx512f+avx512vl", "x86_64+avx2", "aarch64+neon"))]
pub(crate) fn blur_columns(rows: &[f32], stride: usize, out: &mut [f32]) {
    weighted_sum(std::array::from_fn(|tap| &rows[tap * stride..]), out);
}

#[inline(always)]
fn weighted_sum(taps: [&[f32]; NUM_TAPS], out: &mut [f32]) {
    let length = out.len();
    // Equal lengths known before the loop are what removes its bounds checks.
    let taps = taps.map(|tap| &tap[..length]);
    for i in 0..length {
        let mut sum = WEIGHTS[0] * taps[RADIUS][i];
        for distance in 1..=RADIUS {
            sum += WEIGHTS[distance] * (taps[RADIUS - distance][i] + taps[RADIUS + distance][i]);
        }
        out[i] = sum;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_are_the_normalised_gaussian() {
        let raw: Vec<f64> = (0..=RADIUS)
            .map(|i| (-((i * i) as f64) / (2.0 * 1.5 * 1.5)).exp())
            .collect();
        let total = raw[0] + 2.0 * raw[1..].iter().sum::<f64>();
        for (weight, raw) in WEIGHTS.iter().zip(&raw) {
            assert!((f64::from(*weight) - raw / total).abs() < 1e-8);
        }
    }

    #[test]
    fn rows_and_columns_spread_an_impulse_alike() {
        let mut padded = vec![0.0; 9 + 2 * RADIUS];
        padded[RADIUS + 3] = 1.0;
        let mut out = vec![0.0; 9];
        blur_row(&padded, &mut out);
        for (x, value) in out.iter().enumerate() {
            let expected = WEIGHTS.get(x.abs_diff(3)).copied().unwrap_or(0.0);
            assert_eq!(*value, expected);
        }
        let mut column = [0.0];
        blur_columns(&padded[2..], 1, &mut column);
        assert_eq!(column[0], WEIGHTS[1]);
    }
}
