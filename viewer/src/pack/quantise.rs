//! Codes of quantities, and back.

use eagpt_scene::gaussians::MAX_ALBEDO;
use eagpt_scene::{Gaussians, morton};
use eagpt_trace::model::MIN_ALPHA;
use glam::{Quat, Vec3};
use serde::Serialize;

/// Steps of the logarithms (base 2) of scales: at most 0.27 % off.
const SCALE_STEP: f32 = 1.0 / 128.0;
/// Steps of those of radiances: at most 0.27 % off.
const RADIANCE_STEP: f32 = 1.0 / 128.0;
/// Less light than 2 to this power is none.
const RADIANCE_LOW: f32 = -20.0;
/// Steps of opacities.
const OPACITY_STEP: f32 = 1.0 / 4095.0;
/// Steps of the coefficients of harmonics, which are exponents: each is at most 0.01 off.
const HARMONIC_STEP: f32 = 0.02;
/// Largest code of an albedo's square root: an albedo `a` is at most 0.0079 √a off.
const ALBEDO_CODES: f32 = 255.0;
/// Largest code of a component of a quaternion, 12 bits.
const ROTATION_CODES: f32 = 4095.0;

/// Sizes of the steps of quantities.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Steps {
    low: Vec3,
    position: Vec3,
    scale_low: f32,
}

/// As the page has them.
#[derive(Debug, Serialize)]
pub(crate) struct StepsOnPage {
    position: OfPosition,
    scale: OfLogarithm,
    opacity: Step,
    radiance: OfLogarithm,
    albedo: OfRoot,
    harmonic: Step,
}

#[derive(Debug, Serialize)]
struct OfPosition {
    low: Vec3,
    step: Vec3,
}

#[derive(Debug, Serialize)]
struct OfLogarithm {
    low: f32,
    step: f32,
}

#[derive(Debug, Serialize)]
struct OfRoot {
    /// Of the largest code.
    max: f32,
}

#[derive(Debug, Serialize)]
struct Step {
    step: f32,
}

impl Steps {
    /// For the Gaussians that a ray can hit; `None` if there are none.
    pub(super) fn of(gaussians: &Gaussians) -> Option<Self> {
        let visible: Gaussians = gaussians.iter().filter(|g| is_visible(g.opacity)).collect();
        let (low, high) = visible.bounds()?;
        let scales = visible.scales.iter().map(|scale| scale.min_element());
        let codes = f32::from(u16::MAX);
        Some(Self {
            low,
            position: ((high - low) / codes).max(Vec3::splat(f32::MIN_POSITIVE)),
            scale_low: scales.fold(f32::INFINITY, f32::min).log2(),
        })
    }

    pub(crate) fn on_page(&self) -> StepsOnPage {
        StepsOnPage {
            position: OfPosition {
                low: self.low,
                step: self.position,
            },
            scale: OfLogarithm {
                low: self.scale_low,
                step: SCALE_STEP,
            },
            opacity: Step { step: OPACITY_STEP },
            radiance: OfLogarithm {
                low: RADIANCE_LOW,
                step: RADIANCE_STEP,
            },
            albedo: OfRoot { max: MAX_ALBEDO },
            harmonic: Step {
                step: HARMONIC_STEP,
            },
        }
    }

    // Conversions to integers saturate: what is out of range gets the nearest code.

    pub(super) fn position_code(&self, axis: usize, value: f32) -> u16 {
        ((value - self.low[axis]) / self.position[axis]).round() as u16
    }

    pub(super) fn position(&self, axis: usize, code: u16) -> f32 {
        self.low[axis] + self.position[axis] * f32::from(code)
    }

    pub(super) fn scale_code(&self, value: f32) -> u16 {
        ((value.log2() - self.scale_low) / SCALE_STEP).round() as u16
    }

    pub(super) fn scale(&self, code: u16) -> f32 {
        (self.scale_low + SCALE_STEP * f32::from(code)).exp2()
    }

    pub(super) fn opacity_code(&self, value: f32) -> u16 {
        (value / OPACITY_STEP).round() as u16
    }

    pub(super) fn opacity(&self, code: u16) -> f32 {
        f32::from(code) * OPACITY_STEP
    }

    pub(super) fn albedo_code(value: f32) -> u8 {
        ((value / MAX_ALBEDO).sqrt() * ALBEDO_CODES).round() as u8
    }

    pub(super) fn albedo(code: u8) -> f32 {
        MAX_ALBEDO * (f32::from(code) / ALBEDO_CODES).powi(2)
    }

    /// 0 for no light.
    pub(super) fn radiance_code(&self, value: f32) -> i32 {
        let code = 1.0 + ((value.log2() - RADIANCE_LOW) / RADIANCE_STEP).round();
        // The differences of two codes fit 16 bits with a sign.
        if code < 1.0 {
            0
        } else {
            code.min(f32::from(i16::MAX)) as i32
        }
    }

    pub(super) fn radiance(&self, code: i32) -> f32 {
        if code <= 0 {
            return 0.0;
        }
        (RADIANCE_LOW + RADIANCE_STEP * (code - 1) as f32).exp2()
    }

    pub(super) fn harmonic_code(&self, value: f32) -> i16 {
        (value / HARMONIC_STEP).round() as i16
    }

    pub(super) fn harmonic(&self, code: i16) -> f32 {
        f32::from(code) * HARMONIC_STEP
    }
}

/// 0, −1, 1, −2, … as 0, 1, 2, 3, …: small numbers of either sign have a high byte of 0.
pub(super) fn signed_to_code(value: i16) -> u16 {
    ((value << 1) ^ (value >> 15)).cast_unsigned()
}

pub(super) fn signed_from_code(code: u16) -> i16 {
    (code >> 1).cast_signed() ^ -(code & 1).cast_signed()
}

/// A rotation in five bytes: the low bytes of three components, then their high bits, above those
/// of the last which component is left out: the largest, which follows from unit length.
#[derive(Debug, Clone, Copy)]
pub(super) struct RotationCode(pub(super) [u8; 5]);

impl RotationCode {
    pub(super) fn new(rotation: Quat) -> Self {
        let q = [rotation.w, rotation.x, rotation.y, rotation.z];
        let largest = (0..4).fold(
            0,
            |best, k| if q[k].abs() > q[best].abs() { k } else { best },
        );
        // A quaternion and its negative are the same rotation.
        let sign = q[largest].signum() * std::f32::consts::FRAC_1_SQRT_2;
        let mut kept = (0..4).filter(|&k| k != largest).map(|k| {
            let fraction = q[k] * sign + 0.5;
            (fraction.clamp(0.0, 1.0) * ROTATION_CODES).round() as u16
        });
        let [a, b, c] = std::array::from_fn(|_| kept.next().unwrap_or_default());
        let high = |code: u16| (code >> 8) as u8;
        let which = largest as u8;
        Self([
            a as u8,
            b as u8,
            c as u8,
            high(a) | high(b) << 4,
            high(c) | which << 4,
        ])
    }

    pub(super) fn rotation(self) -> Quat {
        let [a, b, c, high_ab, high_c] = self.0;
        let code = |low: u8, high: u8| u16::from_le_bytes([low, high & 15]);
        let codes = [code(a, high_ab), code(b, high_ab >> 4), code(c, high_c)];
        let value = |code| (f32::from(code) / ROTATION_CODES - 0.5) * std::f32::consts::SQRT_2;
        let kept = codes.map(value);
        let rest = 1.0 - kept.iter().map(|v| v * v).sum::<f32>();
        let largest = usize::from(high_c >> 4);
        let mut q = [0.0; 4];
        for (k, value) in (0..4).filter(|&k| k != largest).zip(kept) {
            q[k] = value;
        }
        q[largest.min(3)] = rest.max(0.0).sqrt();
        let [w, x, y, z] = q;
        Quat::from_xyzw(x, y, z, w)
    }
}

/// Whether some ray can hit the Gaussian.
fn is_visible(opacity: f32) -> bool {
    opacity >= MIN_ALPHA
}

/// Indices of the Gaussians that a ray can hit, along a Z-order curve through space; of equal
/// places in their order.
pub(super) fn morton_order(gaussians: &Gaussians, steps: &Steps) -> Vec<u32> {
    let mut keyed: Vec<(u64, u32)> = (0..gaussians.len())
        .filter(|&i| is_visible(gaussians.opacities[i]))
        .map(|i| {
            let p = gaussians.positions[i];
            let codes = [0, 1, 2].map(|axis| u32::from(steps.position_code(axis, p[axis])));
            (morton::code(codes), i as u32)
        })
        .collect();
    keyed.sort_unstable();
    keyed.into_iter().map(|(_, index)| index).collect()
}
