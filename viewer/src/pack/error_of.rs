//! The error of packing, measured.

use eagpt_scene::Gaussian;
use serde::Serialize;
use std::fmt;

/// Light below which a relative error says nothing: what is not shown even at 8 stops.
const DARK: f32 = 1e-5;

/// Largest differences of a packed scene to the one it was made of.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct PackError {
    /// Of a centre along an axis, scene units.
    pub position: f32,
    /// Of a scale, relative.
    pub scale: f32,
    /// Of a rotation, degrees.
    pub rotation_deg: f32,
    /// Of an opacity.
    pub opacity: f32,
    /// Of a radiance of more than 1e-5, relative.
    pub radiance: f32,
    /// Of a coefficient of the harmonics.
    pub harmonic: f32,
    /// Of an emission.
    pub emission: f32,
    /// Of an albedo.
    pub albedo: f32,
}

impl fmt::Display for PackError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let percent = |value: f32| 100.0 * value;
        write!(
            f,
            "centre {:.1e} units, scale {:.2} %, rotation {:.3}°, opacity {:.5}, radiance {:.2} %, \
             harmonics {:.3}, emission {:.4}, albedo {:.4}",
            self.position,
            percent(self.scale),
            self.rotation_deg,
            self.opacity,
            percent(self.radiance),
            self.harmonic,
            self.emission,
            self.albedo,
        )
    }
}

impl PackError {
    pub(super) fn between(
        original: impl Iterator<Item = Gaussian>,
        packed: impl Iterator<Item = Gaussian>,
    ) -> Self {
        let mut error = Self::default();
        let larger = |error: &mut f32, value: f32| *error = error.max(value);
        for (a, b) in original.zip(packed) {
            larger(
                &mut error.position,
                (a.position - b.position).abs().max_element(),
            );
            larger(
                &mut error.scale,
                (b.scale / a.scale - 1.0).abs().max_element(),
            );
            // Angles this small are lost in lengths that are off by a rounding.
            let [a_unit, b_unit] = [a, b].map(|g| g.rotation.as_dquat().normalize());
            let turn = a_unit.angle_between(b_unit);
            larger(&mut error.rotation_deg, turn.to_degrees() as f32);
            larger(&mut error.opacity, (a.opacity - b.opacity).abs());
            for (a, b) in a.radiance.to_array().into_iter().zip(b.radiance.to_array()) {
                if a > DARK {
                    larger(&mut error.radiance, (b / a - 1.0).abs());
                }
            }
            for (a, b) in a.harmonics.0.into_iter().zip(b.harmonics.0) {
                larger(&mut error.harmonic, (a - b).abs());
            }
            larger(&mut error.emission, (a.emission - b.emission).abs());
            larger(&mut error.albedo, (a.albedo - b.albedo).abs().max_element());
        }
        error
    }
}
