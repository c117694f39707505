//! Colour: display encodings of linear Rec.709 light, and primaries.

mod pq;
mod primaries;

pub use pq::{PQ_CONSTANTS, pq_from_linear, pq_from_linear_with_slope};
pub use primaries::{Chromaticities, bradford};

/// Rec.709 luminance weights for linear R, G, B.
const LUMINANCE_REC709: [f32; 3] = [0.2126, 0.7152, 0.0722];

/// Luminance of a linear Rec.709 colour.
pub fn luminance(rgb: [f32; 3]) -> f32 {
    rgb[0] * LUMINANCE_REC709[0] + rgb[1] * LUMINANCE_REC709[1] + rgb[2] * LUMINANCE_REC709[2]
}

/// sRGB encoding (IEC 61966-2-1) of linear light; values above 1 are encoded by the same curve,
/// negative ones give 0.
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
}
