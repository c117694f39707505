//! The PQ curve (SMPTE ST 2084), where linear 1.0 is 100 nit: exact, and as cubic pieces for those
//! who encode a picture at every step.

use std::sync::LazyLock;

/// Nits that linear 1.0 stands for in the PQ space of the paper.
const PQ_NITS_OF_ONE: f64 = 100.0;
/// Peak of the PQ curve in nits (SMPTE ST 2084).
const PQ_PEAK_NITS: f64 = 10_000.0;
/// Lower clamp of the normalised luminance, as in the reference: keeps the slope at black finite.
const PQ_FLOOR: f64 = 1e-6;
const PQ_M1: f64 = 1305.0 / 8192.0;
const PQ_M2: f64 = 2523.0 / 32.0;
const PQ_C1: f64 = 107.0 / 128.0;
const PQ_C2: f64 = 2413.0 / 128.0;
const PQ_C3: f64 = 2392.0 / 128.0;

/// The constants of the curve by their names, for kernels: scale of linear light, floor, and those
/// of SMPTE ST 2084.
pub const PQ_CONSTANTS: [(&str, f64); 7] = [
    ("PQ_SCALE", PQ_NITS_OF_ONE / PQ_PEAK_NITS),
    ("PQ_FLOOR", PQ_FLOOR),
    ("PQ_M1", PQ_M1),
    ("PQ_M2", PQ_M2),
    ("PQ_C1", PQ_C1),
    ("PQ_C2", PQ_C2),
    ("PQ_C3", PQ_C3),
];

/// PQ encoding of linear light; the normalised value is clamped below at 1e-6.
pub fn pq_from_linear(linear: f32) -> f32 {
    pq_and_slope(f64::from(linear)).0 as f32
}

/// PQ encoding and its derivative with respect to the linear value, within a few units in the last
/// place of single precision; the derivative is 0 where the floor clamps.
pub fn pq_from_linear_with_slope(linear: f32) -> (f32, f32) {
    if linear >= Pieces::END {
        let (value, slope) = pq_and_slope(f64::from(linear));
        return (value as f32, slope as f32);
    }
    PIECES.value_and_slope(linear)
}

/// The oracle of everything here.
fn pq_and_slope(linear: f64) -> (f64, f64) {
    let y = linear * PQ_NITS_OF_ONE / PQ_PEAK_NITS;
    if y <= PQ_FLOOR || y.is_nan() {
        (curve(PQ_FLOOR * PQ_PEAK_NITS / PQ_NITS_OF_ONE).0, 0.0)
    } else {
        curve(linear)
    }
}

/// The curve without its floor, and its derivative.
fn curve(linear: f64) -> (f64, f64) {
    let scale = PQ_NITS_OF_ONE / PQ_PEAK_NITS;
    let y = linear * scale;
    let power = y.powf(PQ_M1);
    let numerator = PQ_C1 + PQ_C2 * power;
    let denominator = 1.0 + PQ_C3 * power;
    let ratio = numerator / denominator;
    let value = ratio.powf(PQ_M2);
    let d_power = PQ_M1 * power / y;
    let d_ratio = (PQ_C2 * denominator - PQ_C3 * numerator) / (denominator * denominator) * d_power;
    (value, PQ_M2 * value / ratio * d_ratio * scale)
}

static PIECES: LazyLock<Pieces> = LazyLock::new(Pieces::new);

/// The curve from its floor up to [`Pieces::END`] in cubic Hermite pieces, [`Pieces::PER_OCTAVE`]
/// to every doubling of the light. A piece is a 64th of its place on the axis: `h⁴ f⁗ / 384` is
/// below 1e-9, far under a rounding.
struct Pieces {
    /// Coefficients by powers of the place within the piece, 0 to 1.
    coefficients: Vec<[f32; 4]>,
    /// Encoded value of the floor.
    floor: f32,
}

impl Pieces {
    /// Bits of the mantissa that choose a piece.
    const BITS: u32 = 6;
    const PER_OCTAVE: u32 = 1 << Self::BITS;
    /// Bits of the mantissa that are left for the place within it.
    const PLACE_BITS: u32 = f32::MANTISSA_DIGITS - 1 - Self::BITS;
    /// Light whose normalised value is [`PQ_FLOOR`].
    const FLOOR: f32 = (PQ_FLOOR * PQ_PEAK_NITS / PQ_NITS_OF_ONE) as f32;
    /// End of the pieces, above any value of a picture.
    const END: f32 = 16_384.0;

    /// Number of the piece that holds `linear`, counted from zero light.
    fn number(linear: f32) -> u32 {
        linear.to_bits() >> Self::PLACE_BITS
    }

    fn new() -> Self {
        let coefficients = (Self::number(Self::FLOOR)..Self::number(Self::END))
            .map(|piece| {
                let edge = |piece: u32| f64::from(f32::from_bits(piece << Self::PLACE_BITS));
                let (start, end) = (edge(piece), edge(piece + 1));
                let ((a, slope_a), (b, slope_b)) = (curve(start), curve(end));
                let (d_a, d_b) = (slope_a * (end - start), slope_b * (end - start));
                [
                    a,
                    d_a,
                    3.0 * (b - a) - 2.0 * d_a - d_b,
                    2.0 * (a - b) + d_a + d_b,
                ]
                .map(|c| c as f32)
            })
            .collect();
        Self {
            coefficients,
            floor: pq_and_slope(0.0).0 as f32,
        }
    }

    /// Of light below [`Self::END`].
    fn value_and_slope(&self, linear: f32) -> (f32, f32) {
        if linear <= Self::FLOOR || linear.is_nan() {
            return (self.floor, 0.0);
        }
        let bits = linear.to_bits();
        let [a, b, c, d] =
            self.coefficients[(Self::number(linear) - Self::number(Self::FLOOR)) as usize];
        let mask = (1 << Self::PLACE_BITS) - 1;
        let place = (bits & mask) as f32 / (1 << Self::PLACE_BITS) as f32;
        let value = a + place * (b + place * (c + place * d));
        let by_place = b + place * (2.0 * c + place * (3.0 * d));
        // Pieces of an octave are equally wide: its power of two over their number.
        let octave = f32::from_bits(bits & 0x7f80_0000);
        (value, by_place * (Self::PER_OCTAVE as f32 / octave))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pq_known_values() {
        // ST 2084: 100 nit is 0.508, 10,000 nit is 1.
        assert!((pq_from_linear(1.0) - 0.508_078_4).abs() < 1e-5);
        assert!((pq_from_linear(100.0) - 1.0).abs() < 1e-6);
        assert_eq!(pq_from_linear(-1.0), pq_from_linear(0.0));
    }

    #[test]
    fn pq_slope_matches_central_difference() {
        for x in [1e-3_f64, 0.02, 0.3, 1.0, 7.0, 60.0] {
            let h = x * 1e-6;
            let numeric = (pq_and_slope(x + h).0 - pq_and_slope(x - h).0) / (2.0 * h);
            let (_, slope) = pq_and_slope(x);
            assert!(
                (numeric - slope).abs() < 1e-7 * (1.0 + slope),
                "{x}: {numeric} {slope}"
            );
        }
        assert_eq!(pq_from_linear_with_slope(0.0).1, 0.0);
    }

    /// Values are rounded once (2⁻²⁵ of at most 1.2) and summed from four terms; slopes differ by
    /// `h³ f⁗ / 125`, 3e-7 of themselves, besides.
    #[test]
    fn pieces_follow_the_curve() {
        for i in 0..200_000 {
            let linear = (1e-5_f64 * (1e10_f64).powf(f64::from(i) / 200_000.0)) as f32;
            let (value, slope) = pq_from_linear_with_slope(linear);
            let (exact, exact_slope) = pq_and_slope(f64::from(linear));
            assert!(
                (f64::from(value) - exact).abs() < 1.5e-7,
                "{linear}: {value} {exact}"
            );
            assert!(
                (f64::from(slope) - exact_slope).abs() <= 2e-6 * exact_slope,
                "{linear}: {slope} {exact_slope}"
            );
        }
        assert_eq!(pq_from_linear_with_slope(f32::NAN).1, 0.0);
        assert_eq!(pq_from_linear_with_slope(1e6).0, pq_from_linear(1e6));
    }
}
