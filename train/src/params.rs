//! Raw parameters of a Gaussian, their activations, and the chain rule back to them.
//!
//! Activations keep values in their range: scales and radiance are exponentials (the reference's
//! `sigmoid` and `100·sigmoid` cap a scale at one scene unit and radiance at 100; the exponentials
//! have the same slope where the reference works and no cap), opacity, emission and albedo are
//! sigmoids, quaternions are normalised.

mod edit;
mod learned;
mod lights;
mod state;
mod step;
mod stored;

pub use learned::Learned;
#[cfg(feature = "gpu")]
pub(crate) use learned::{Adam, BETA_1, BETA_2, EPSILON};
pub use state::ParameterState;
pub use step::{BadGradient, StepSizes};
pub use stored::{LightParameters, Lights, NUM_OF_LIGHT};

use eagpt_scene::gaussians::MAX_ALBEDO;
use eagpt_scene::harmonics::{NUM_COEFFICIENTS, NUM_FUNCTIONS};
use eagpt_scene::{Gaussian, Gloss, Harmonics, rotation};
use eagpt_trace::blend::{LocalGradient, grad_lane};
use glam::{Mat3, Quat, Vec2, Vec3};

/// Raw parameters of one Gaussian.
pub const NUM_PARAMETERS: usize = 17;

/// One number for each raw parameter: x y z, ln s_u, ln s_v, quaternion w x y z, logit σ, ln r (3),
/// logit e, logit ρ (3).
pub type Raw = [f32; NUM_PARAMETERS];

const POSITION: usize = 0;
const SCALE: usize = 3;
const ROTATION: usize = 5;
const OPACITY: usize = 9;
pub(crate) const RADIANCE: usize = 10;
pub(crate) const EMISSION: usize = 13;
const ALBEDO: usize = 14;

/// The classes of parameters, with the raw parameters of each.
pub const CLASSES: [(&str, std::ops::Range<usize>); 7] = [
    ("position", POSITION..SCALE),
    ("scale", SCALE..ROTATION),
    ("rotation", ROTATION..OPACITY),
    ("opacity", OPACITY..RADIANCE),
    ("radiance", RADIANCE..EMISSION),
    ("emission", EMISSION..ALBEDO),
    ("albedo", ALBEDO..NUM_PARAMETERS),
];

/// Radiance below this is stored as this, so that its logarithm exists; far below the darkest value
/// PQ tells from black.
const MIN_RADIANCE: f32 = 1e-6;
/// Sigmoid parameters start at least this far from their ends.
const SIGMOID_MARGIN: f32 = 1e-4;

fn sigmoid(x: f32) -> f32 {
    1.0 / (1.0 + (-x).exp())
}

fn logit(p: f32) -> f32 {
    let p = p.clamp(SIGMOID_MARGIN, 1.0 - SIGMOID_MARGIN);
    (p / (1.0 - p)).ln()
}

/// An albedo of its raw parameter, and back.
fn albedo_of(raw: f32) -> f32 {
    MAX_ALBEDO * sigmoid(raw)
}

fn raw_of_albedo(albedo: f32) -> f32 {
    logit(albedo / MAX_ALBEDO)
}

/// Raw parameters of a Gaussian.
pub fn raw_from_gaussian(g: &Gaussian) -> Raw {
    let mut raw = [0.0; NUM_PARAMETERS];
    raw[POSITION..SCALE].copy_from_slice(&g.position.to_array());
    raw[SCALE..ROTATION].copy_from_slice(&[g.scale.x.ln(), g.scale.y.ln()]);
    raw[ROTATION..OPACITY].copy_from_slice(&[
        g.rotation.w,
        g.rotation.x,
        g.rotation.y,
        g.rotation.z,
    ]);
    raw[OPACITY] = logit(g.opacity);
    raw[RADIANCE..EMISSION]
        .copy_from_slice(&g.radiance.to_array().map(|r| r.max(MIN_RADIANCE).ln()));
    raw[EMISSION] = logit(g.emission);
    raw[ALBEDO..].copy_from_slice(&g.albedo.to_array().map(raw_of_albedo));
    raw
}

/// The Gaussian of raw parameters, whose light is the same in all directions.
pub fn gaussian_from_raw(raw: &Raw) -> Gaussian {
    let triple = |at: usize| Vec3::new(raw[at], raw[at + 1], raw[at + 2]);
    Gaussian {
        position: triple(POSITION),
        scale: Vec2::new(raw[SCALE].exp(), raw[SCALE + 1].exp()),
        rotation: rotation::unit(rotation_of(raw)),
        opacity: sigmoid(raw[OPACITY]),
        radiance: triple(RADIANCE).map(f32::exp),
        harmonics: Harmonics::NONE,
        gloss: Gloss::NONE,
        emission: sigmoid(raw[EMISSION]),
        albedo: triple(ALBEDO).map(albedo_of),
    }
}

fn rotation_of(raw: &Raw) -> Quat {
    Quat::from_xyzw(
        raw[ROTATION + 1],
        raw[ROTATION + 2],
        raw[ROTATION + 3],
        raw[ROTATION],
    )
}

/// Chain rule from the gradient in the Gaussian's frame to the raw parameters; `g` has the radiance
/// that was seen. That another position is seen from another direction is left out, as in 3D
/// Gaussian Splatting's own harmonics it hardly matters: directions change with the size of the
/// room, positions with that of a Gaussian.
pub fn raw_gradient(raw: &Raw, g: &Gaussian, local: &LocalGradient) -> Raw {
    let lanes = |at: usize| Vec3::new(local.0[at], local.0[at + 1], local.0[at + 2]);
    let mut out = [0.0; NUM_PARAMETERS];
    let position = Mat3::from_quat(g.rotation) * lanes(grad_lane::POSITION);
    out[POSITION..SCALE].copy_from_slice(&position.to_array());
    out[SCALE] = local.0[grad_lane::SCALE] * g.scale.x;
    out[SCALE + 1] = local.0[grad_lane::SCALE + 1] * g.scale.y;
    // A step δ of the unit quaternion turns the frame by 2·Im(q*δ) in its own axes; q⊗(0, g) is
    // tangent to the sphere, so that normalisation only divides by the length.
    let turn = lanes(grad_lane::ROTATION);
    let d_q = g.rotation * Quat::from_xyzw(turn.x, turn.y, turn.z, 0.0);
    let factor = 2.0 / rotation::length(rotation_of(raw));
    out[ROTATION..OPACITY].copy_from_slice(&[d_q.w, d_q.x, d_q.y, d_q.z].map(|c| c * factor));
    out[OPACITY] = local.0[grad_lane::OPACITY] * g.opacity * (1.0 - g.opacity);
    let d_radiance = lanes(grad_lane::RADIANCE) * g.radiance;
    out[RADIANCE..EMISSION].copy_from_slice(&d_radiance.to_array());
    out[EMISSION] = local.0[grad_lane::EMISSION] * g.emission * (1.0 - g.emission);
    let d_albedo = lanes(grad_lane::ALBEDO) * g.albedo * (Vec3::ONE - g.albedo / MAX_ALBEDO);
    out[ALBEDO..].copy_from_slice(&d_albedo.to_array());
    out
}

/// From the raw gradient to that of the coefficients, by the `functions` of the direction: both
/// logarithms of radiance.
pub fn harmonics_gradient(raw: &Raw, functions: &[f32; NUM_FUNCTIONS]) -> [f32; NUM_COEFFICIENTS] {
    let mut out = [0.0; NUM_COEFFICIENTS];
    for (row, value) in out.as_chunks_mut::<3>().0.iter_mut().zip(functions) {
        for (d, of_radiance) in row.iter_mut().zip(&raw[RADIANCE..EMISSION]) {
            *d = of_radiance * value;
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use eagpt_scene::harmonics::functions_from;

    pub(super) fn sample() -> Gaussian {
        Gaussian {
            position: Vec3::new(0.3, -1.0, 2.0),
            scale: Vec2::new(0.02, 0.5),
            rotation: Quat::from_xyzw(0.1, -0.7, 0.3, 0.6).normalize(),
            opacity: 0.7,
            radiance: Vec3::new(0.01, 1.5, 40.0),
            harmonics: Harmonics::NONE,
            gloss: Gloss::NONE,
            emission: 0.2,
            albedo: Vec3::new(0.1, 0.5, 0.9),
        }
    }

    fn close(a: &Gaussian, b: &Gaussian) -> bool {
        (a.position - b.position).length() < 1e-6
            && ((a.scale - b.scale) / a.scale).length() < 1e-5
            && a.rotation.dot(b.rotation).abs() > 1.0 - 1e-6
            && (a.opacity - b.opacity).abs() < 1e-5
            && ((a.radiance - b.radiance) / a.radiance).length() < 1e-5
            && (a.emission - b.emission).abs() < 1e-5
            && (a.albedo - b.albedo).length() < 1e-5
    }

    #[test]
    fn activation_inverts_the_raw_form() {
        let g = sample();
        assert!(close(&g, &gaussian_from_raw(&raw_from_gaussian(&g))));
    }

    /// A smooth function of all local quantities, whose local gradient is known: a linear form in
    /// the offsets of position, scale, rotation and the rest.
    #[test]
    fn chain_rule_matches_central_differences() {
        let g = sample();
        let mut raw = raw_from_gaussian(&g);
        raw[ROTATION..OPACITY].iter_mut().for_each(|c| *c *= 1.7);
        let weights: Vec<f32> = (0..16).map(|k| 0.3 + 0.1 * k as f32).collect();
        let frame = Mat3::from_quat(g.rotation);
        let value = |raw: &Raw| -> f64 {
            let h = gaussian_from_raw(raw);
            let local = frame.transpose() * (h.position - g.position);
            let turn = g.rotation.inverse() * h.rotation;
            let turn = Vec3::new(turn.x, turn.y, turn.z) * 2.0 * turn.w.signum();
            let lanes = [
                local.x,
                local.y,
                local.z,
                h.scale.x,
                h.scale.y,
                turn.x,
                turn.y,
                turn.z,
                h.opacity,
                h.radiance.x,
                h.radiance.y,
                h.radiance.z,
                h.emission,
                h.albedo.x,
                h.albedo.y,
                h.albedo.z,
            ];
            lanes
                .iter()
                .zip(&weights)
                .map(|(a, b)| f64::from(*a) * f64::from(*b))
                .sum()
        };
        let mut local = LocalGradient::default();
        local.0.copy_from_slice(&weights);
        let analytic = raw_gradient(&raw, &g, &local);
        for k in 0..NUM_PARAMETERS {
            let h = 1e-2;
            let (mut up, mut down) = (raw, raw);
            up[k] += h;
            down[k] -= h;
            let numeric = (value(&up) - value(&down)) / f64::from(up[k] - down[k]);
            // Single-precision values differenced over 1e-2: 1e-7·40/1e-2 absolute, plus the step's
            // own curvature of h²/6.
            let tolerance = 1e-3 * (1.0 + numeric.abs());
            assert!(
                (f64::from(analytic[k]) - numeric).abs() < tolerance,
                "{k}: {} {numeric}",
                analytic[k]
            );
        }
    }

    /// The logarithm of what is seen is linear in the coefficients.
    #[test]
    fn the_chain_rule_of_harmonics_matches_central_differences() {
        let mut g = sample();
        let (eye, step) = (Vec3::new(1.0, 2.0, -0.5), 1e-2);
        g.harmonics = Harmonics(std::array::from_fn(|k| 0.03 * k as f32 - 0.4));
        let functions = functions_from(eye, g.position);
        let mut local = LocalGradient::default();
        let weights = [0.7, -1.3, 0.2];
        local.0[grad_lane::RADIANCE..][..3].copy_from_slice(&weights);
        let seen = |harmonics: &Harmonics| g.radiance * harmonics.factor(&functions);
        let value = |harmonics: &Harmonics| seen(harmonics).dot(weights.into());
        let looked_at = Gaussian {
            radiance: seen(&g.harmonics),
            ..g
        };
        let raw = raw_gradient(&raw_from_gaussian(&g), &looked_at, &local);
        let analytic = harmonics_gradient(&raw, &functions);
        for k in 0..NUM_COEFFICIENTS {
            let (mut up, mut down) = (g.harmonics, g.harmonics);
            up.0[k] += step;
            down.0[k] -= step;
            let numeric = (value(&up) - value(&down)) / (2.0 * step);
            // Values of up to 60 in single precision, differenced over 2e-2.
            assert!(
                (analytic[k] - numeric).abs() < 1e-3 * (1.0 + numeric.abs()),
                "{k}"
            );
        }
    }
}
