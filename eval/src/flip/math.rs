//! Powers without branches or calls, so that loops over them become vector instructions: the same
//! bits on every machine.

/// Bits of √½: mantissas are taken from there up to √2, where the logarithm's series converges
/// fastest.
const SQRT_HALF_BITS: u32 = 0x3f35_04f3;
/// Added to and subtracted from a number below 2^22, 1.5 · 2^23 rounds it to an integer, which its
/// low bits then hold.
const ROUNDER: f32 = 12_582_912.0;
/// A third of the exponent's bias, less what makes the first guess of a cube root best: within 3.5
/// %.
const CBRT_GUESS: u32 = 0x2a51_37a0;

/// Cube root of a normal number above 0. Two of Halley's steps leave an error of two units in the
/// last place.
#[inline(always)]
pub(super) fn cbrt(x: f32) -> f32 {
    let mut root = f32::from_bits(x.to_bits() / 3 + CBRT_GUESS);
    for _ in 0..2 {
        let cube = root * root * root;
        root += root * ((x - cube) / ((cube + cube) + x));
    }
    root
}

/// `base` to the power of `exponent`, both of 0 and more, as far as the result is between 2^-125
/// and 2^127; smaller ones end there, and 0 has its own powers, 0 or 1. The relative error is below
/// 1e-6 for bases from 1e-6 to 1e6 and exponents of at most 2.4.
#[inline(always)]
pub(super) fn pow(base: f32, exponent: f32) -> f32 {
    let result = exp2(exponent * log2(base.max(f32::MIN_POSITIVE)));
    let of_zero = if exponent > 0.0 { 0.0 } else { 1.0 };
    if base > 0.0 { result } else { of_zero }
}

/// Logarithm of a normal number above 0: that of its mantissa m is 2 atanh((m − 1)/(m + 1)), a
/// series in odd powers.
#[inline(always)]
fn log2(x: f32) -> f32 {
    const TERM: [f32; 5] = {
        let two_over_ln_2 = 2.0 * std::f32::consts::LOG2_E;
        [
            two_over_ln_2,
            two_over_ln_2 / 3.0,
            two_over_ln_2 / 5.0,
            two_over_ln_2 / 7.0,
            two_over_ln_2 / 9.0,
        ]
    };
    let above = x.to_bits().wrapping_sub(SQRT_HALF_BITS);
    let exponent = above.cast_signed() >> 23;
    let mantissa = f32::from_bits((above & 0x007f_ffff) + SQRT_HALF_BITS);
    let s = (mantissa - 1.0) / (mantissa + 1.0);
    let square = s * s;
    let series =
        TERM[0] + square * (TERM[1] + square * (TERM[2] + square * (TERM[3] + square * TERM[4])));
    exponent as f32 + s * series
}

/// 2 to the power of `x`, cut to −125 and 127: Taylor's series about the nearest integer.
#[inline(always)]
fn exp2(x: f32) -> f32 {
    // (ln 2)^n / n!: the first that is missing is below 1e-8 at a half.
    const TERM: [f32; 7] = [
        std::f32::consts::LN_2,
        0.240_226_5,
        0.055_504_11,
        0.009_618_129,
        0.001_333_355_8,
        1.540_353e-4,
        1.525_273_4e-5,
    ];
    let x = x.clamp(-125.0, 127.0);
    let rounded = x + ROUNDER;
    let f = x - (rounded - ROUNDER);
    let power = rounded.to_bits().wrapping_sub(ROUNDER.to_bits());
    let series = TERM[3] + f * (TERM[4] + f * (TERM[5] + f * TERM[6]));
    let series = 1.0 + f * (TERM[0] + f * (TERM[1] + f * (TERM[2] + f * series)));
    f32::from_bits(series.to_bits().wrapping_add(power << 23))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers from 1e-6 to 1e6, no two with one mantissa.
    fn numbers() -> impl Iterator<Item = f32> {
        (0..=12_000).map(|i| 10.0_f32.powf(i as f32 / 1000.0 - 6.0))
    }

    #[test]
    fn cube_roots_are_those_of_double_precision() {
        let errors = numbers().map(|x| (f64::from(cbrt(x)) / f64::from(x).cbrt() - 1.0).abs());
        let largest = errors.fold(0.0, f64::max);
        // Two units in the last place.
        assert!(largest < 2.4e-7, "{largest}");
    }

    #[test]
    fn powers_are_those_of_double_precision() {
        let mut largest = 0.0_f64;
        for x in numbers() {
            for exponent in [0.0_f32, 0.013, 0.5, 0.7, 1.0, 2.4] {
                let exact = f64::from(x).powf(f64::from(exponent));
                largest = largest.max((f64::from(pow(x, exponent)) / exact - 1.0).abs());
            }
        }
        // Twenty powers of two times 2.4, rounded to single precision.
        assert!(largest < 3e-6, "{largest}");
    }

    #[test]
    fn powers_of_nothing_and_of_one() {
        assert_eq!(pow(0.0, 0.7), 0.0);
        assert_eq!(pow(0.0, 0.0), 1.0);
        assert_eq!(pow(1.0, 0.3), 1.0);
        assert_eq!(pow(0.25, 0.5), 0.5);
        assert!(pow(1e-38, 2.0) < 1e-37);
    }
}
