//! Colour: display encodings of linear Rec.709 light.

/// Rec.709 luminance weights for linear R, G, B.
pub const LUMINANCE_REC709: [f32; 3] = [0.2126, 0.7152, 0.0722];

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

/// The constants of the PQ curve by their names, for kernels: scale of linear light, floor, and those of SMPTE ST 2084.
pub const PQ_CONSTANTS: [(&str, f64); 7] = [
    ("PQ_SCALE", PQ_NITS_OF_ONE / PQ_PEAK_NITS),
    ("PQ_FLOOR", PQ_FLOOR),
    ("PQ_M1", PQ_M1),
    ("PQ_M2", PQ_M2),
    ("PQ_C1", PQ_C1),
    ("PQ_C2", PQ_C2),
    ("PQ_C3", PQ_C3),
];

/// Luminance of a linear Rec.709 colour.
pub fn luminance(rgb: [f32; 3]) -> f32 {
    rgb[0] * LUMINANCE_REC709[0] + rgb[1] * LUMINANCE_REC709[1] + rgb[2] * LUMINANCE_REC709[2]
}

/// sRGB encoding (IEC 61966-2-1) of linear light; values above 1 are encoded by the same curve, negative ones give 0.
pub fn srgb_from_linear(linear: f32) -> f32 {
    let linear = f64::from(linear).max(0.0);
    (if linear <= 0.003_130_8 {
        12.92 * linear
    } else {
        1.055 * linear.powf(1.0 / 2.4) - 0.055
    }) as f32
}

/// Linear light of an sRGB value; inverse of [`srgb_from_linear`] for values of 0 and more.
pub fn linear_from_srgb(srgb: f32) -> f32 {
    let srgb = f64::from(srgb);
    (if srgb <= 0.040_45 {
        srgb / 12.92
    } else {
        ((srgb + 0.055) / 1.055).powf(2.4)
    }) as f32
}

/// 8-bit sRGB value of linear light, clipped to the display's range.
pub fn srgb8_from_linear(linear: f32) -> u8 {
    (srgb_from_linear(linear.min(1.0)) * 255.0).round() as u8
}

/// PQ encoding (SMPTE ST 2084) of linear light where 1.0 is 100 nit; the normalised value is clamped below at 1e-6.
pub fn pq_from_linear(linear: f32) -> f32 {
    pq_and_slope(f64::from(linear)).0 as f32
}

/// PQ encoding and its derivative with respect to the linear value; the derivative is 0 where the floor clamps.
pub fn pq_from_linear_with_slope(linear: f32) -> (f32, f32) {
    let (value, slope) = pq_and_slope(f64::from(linear));
    (value as f32, slope as f32)
}

fn pq_and_slope(linear: f64) -> (f64, f64) {
    let scale = PQ_NITS_OF_ONE / PQ_PEAK_NITS;
    let y = linear * scale;
    let clamped = y <= PQ_FLOOR || y.is_nan();
    let y = if clamped { PQ_FLOOR } else { y };
    let power = y.powf(PQ_M1);
    let numerator = PQ_C1 + PQ_C2 * power;
    let denominator = 1.0 + PQ_C3 * power;
    let ratio = numerator / denominator;
    let value = ratio.powf(PQ_M2);
    if clamped {
        return (value, 0.0);
    }
    let d_power = PQ_M1 * power / y;
    let d_ratio = (PQ_C2 * denominator - PQ_C3 * numerator) / (denominator * denominator) * d_power;
    (value, PQ_M2 * value / ratio * d_ratio * scale)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn srgb_known_values_and_inverse() {
        assert_eq!(srgb_from_linear(0.0), 0.0);
        assert!((srgb_from_linear(1.0) - 1.0).abs() < 1e-6);
        // Mid grey of the standard: linear 0.214041 is sRGB 0.5.
        assert!((srgb_from_linear(0.214_041_14) - 0.5).abs() < 1e-6);
        for i in 0..=1000 {
            let x = i as f32 / 250.0;
            assert!((linear_from_srgb(srgb_from_linear(x)) - x).abs() < 1e-5 * (1.0 + x));
        }
    }

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
}
