//! Directions towards emitters, and the density with which they are chosen.
//!
//! Cosine sampling alone hits small emitters rarely. Here a share of the directions goes to
//! points on emissive Gaussians instead, chosen by power and, on the Gaussian, by its own
//! footprint. Directions of both kinds come from one mixture `q(ω) = (1 − c)·cos θ/π + c·p(ω)`, and
//! each is weighted by `(cos θ/π) / q` (one-sample multiple importance sampling with the balance
//! heuristic, Veach 1997, section 9.2.4). The radiance of a direction is still found by tracing it,
//! so the mean is that of cosine sampling, for soft emitters, too; no weight exceeds `1/(1 − c)`.
//!
//! Paths on the CPU choose by what emitters may give to where they are, too
//! ([`light_list`](super::light_list)); those on devices by power.

use crate::cpu::bvh::{Bvh, RayScratch, Reach};
use crate::ray::Ray;
use crate::surfel::{Surfel, SurfelSet};
use crate::transport::start::Surface;
use crate::transport::{EMISSION_THRESHOLD, sampling};
use eagpt_scene::color::luminance;
use eagpt_scene::{Gaussian, Gaussians};
use glam::{Mat3, Vec3};
use std::cell::RefCell;
use std::f32::consts::{FRAC_1_PI, TAU};

thread_local! {
    static SCRATCH: RefCell<RayScratch> = RefCell::default();
}

/// The emissive Gaussians of a scene.
#[derive(Debug, Clone)]
pub struct Lights {
    emitters: Vec<Emitter>,
    /// Probability that one of the emitters up to this one is chosen, `[n]`, rising to 1.
    cumulative: Vec<f32>,
    set: SurfelSet,
    bvh: Bvh,
}

#[derive(Debug, Clone)]
struct Emitter {
    position: Vec3,
    /// In-plane axes times scales, scene units.
    axis_u: Vec3,
    axis_v: Vec3,
    /// `1 − exp(−cut²/2)`: the part of the footprint inside the cut.
    inside: f32,
    /// Probability of the emitter over `2π s_u s_v · inside`: times the footprint's exponential,
    /// its density over area.
    density: f32,
}

/// An emissive Gaussian with its chances.
#[cfg(feature = "gpu")]
pub(crate) struct Footprint<'a> {
    pub(crate) surfel: &'a Surfel,
    /// Probability that one up to this one is chosen.
    pub(crate) cumulative: f32,
    /// Part of the footprint inside the cut.
    pub(crate) inside: f32,
    /// Its probability over the area of the footprint.
    pub(crate) density: f32,
}

/// Weight by which emitters are chosen: emitted luminance times area.
pub fn power(g: &Gaussian) -> f64 {
    let area = TAU * g.scale.x * g.scale.y;
    f64::from(luminance(g.radiance.to_array()) * area * g.opacity * g.emission)
}

/// The Gaussians that emit.
pub(crate) fn emissive(gaussians: &Gaussians) -> Gaussians {
    (0..gaussians.len())
        .filter(|&i| gaussians.emissions[i] > EMISSION_THRESHOLD)
        .map(|i| gaussians.get(i))
        .filter(|g| crate::model::cut_radius_squared(g.opacity) > 0.0 && power(g) > 0.0)
        .collect()
}

impl Lights {
    /// The lights among `gaussians`, or `None` if nothing emits.
    pub fn new(gaussians: &Gaussians) -> Option<Self> {
        let emissive = emissive(gaussians);
        let total: f64 = emissive.iter().map(|g| power(&g)).sum();
        if emissive.is_empty() || !total.is_normal() {
            return None;
        }
        // On one thread: a scene makes its lights when they are first needed, perhaps by one of
        // many threads, and the others wait for it.
        let set = SurfelSet {
            surfels: emissive.iter().map(|g| Surfel::new(&g)).collect(),
            ..SurfelSet::default()
        };
        let mut sum = 0.0;
        let (mut emitters, mut cumulative) = (Vec::new(), Vec::new());
        for (g, surfel) in emissive.iter().zip(&set.surfels) {
            let share = power(&g) / total;
            sum += share;
            let frame = Mat3::from_quat(g.rotation);
            let inside = 1.0 - (-0.5 * surfel.cut2).exp();
            emitters.push(Emitter {
                position: g.position,
                axis_u: frame.x_axis * g.scale.x,
                axis_v: frame.y_axis * g.scale.y,
                inside,
                density: share as f32 / (TAU * g.scale.x * g.scale.y * inside),
            });
            cumulative.push(sum as f32);
        }
        let bvh = Bvh::new(&set);
        Some(Self {
            emitters,
            cumulative,
            set,
            bvh,
        })
    }

    /// Number of emissive Gaussians.
    pub fn len(&self) -> usize {
        self.emitters.len()
    }

    /// Never: a scene without emitters has no [`Lights`].
    pub fn is_empty(&self) -> bool {
        self.emitters.is_empty()
    }

    /// The emissive Gaussians and the chances with which they are chosen, for kernels.
    #[cfg(feature = "gpu")]
    pub(crate) fn footprints(&self) -> impl Iterator<Item = Footprint<'_>> {
        let emitters = self.emitters.iter().zip(&self.cumulative);
        emitters
            .zip(&self.set.surfels)
            .map(|((emitter, &cumulative), surfel)| Footprint {
                surfel,
                cumulative,
                inside: emitter.inside,
                density: emitter.density,
            })
    }

    /// A unit direction from `origin` to a random point of a random emitter; `None` if the point is
    /// the origin. `pick` chooses the emitter, `a` and `b` the point; all in [0, 1).
    pub fn sample(&self, origin: Vec3, pick: f32, a: f32, b: f32) -> Option<Vec3> {
        let chosen = self
            .cumulative
            .partition_point(|&c| c <= pick)
            .min(self.emitters.len() - 1);
        let emitter = &self.emitters[chosen];
        // Inverse of the footprint's radial distribution, 1 − exp(−r²/2), cut at its rim.
        let radius = (-2.0 * (1.0 - a * emitter.inside).ln()).max(0.0).sqrt();
        let (sin, cos) = (TAU * b).sin_cos();
        let point =
            emitter.position + emitter.axis_u * (radius * cos) + emitter.axis_v * (radius * sin);
        (point - origin).try_normalize()
    }

    /// Density over solid angle with which [`Self::sample`] chooses unit `direction`: every emitter
    /// along the ray could have been the one.
    pub fn density(&self, origin: Vec3, direction: Vec3) -> f32 {
        let ray = Ray::free(origin.to_array(), direction.to_array());
        SCRATCH.with_borrow_mut(|scratch| {
            self.bvh.find_hits(&ray, Reach::Everything, scratch);
            // Any order would do for the sum; a fixed one gives the same bits for any shape of the
            // tree.
            scratch.sort();
            scratch
                .hits()
                .iter()
                .map(|hit| {
                    let i = hit.index() as usize;
                    let surfel = &self.set.surfels[i];
                    let footprint = hit.alpha / surfel.opacity;
                    let cosine = direction.dot(Vec3::from(surfel.normal)).abs();
                    self.emitters[i].density * footprint * hit.t() * hit.t() / cosine
                })
                .sum()
        })
    }
}

/// Chooses the directions of bounces.
#[derive(Debug, Clone, Copy)]
pub struct BounceSampler<'a> {
    lights: Option<&'a Lights>,
    share: f32,
}

/// A direction with its weight `(cos θ/π) / q`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Bounce {
    /// Unit direction above the surface.
    pub direction: Vec3,
    /// Weight of its radiance.
    pub weight: f32,
}

impl<'a> BounceSampler<'a> {
    /// A sampler that sends `share` (0 to below 1) of the directions to `lights`; without lights,
    /// none.
    pub fn new(lights: Option<&'a Lights>, share: f32) -> Self {
        let share = if lights.is_some() { share } else { 0.0 };
        Self {
            lights: lights.filter(|_| share > 0.0),
            share,
        }
    }

    /// A direction above `surface` from four uniform numbers; `None` where it would go below, which
    /// counts as no light.
    pub(crate) fn sample(&self, surface: &Surface, [a, b, pick, kind]: [f32; 4]) -> Option<Bounce> {
        let Some(lights) = self.lights else {
            return Some(Bounce {
                direction: sampling::cosine_direction(surface.normal, a, b),
                weight: 1.0,
            });
        };
        let direction = if kind < self.share {
            lights.sample(surface.position, pick, a, b)?
        } else {
            sampling::cosine_direction(surface.normal, a, b)
        };
        let bsdf = direction.dot(surface.normal) * FRAC_1_PI;
        if bsdf <= 0.0 {
            return None;
        }
        let mixture =
            (1.0 - self.share) * bsdf + self.share * lights.density(surface.position, direction);
        Some(Bounce {
            direction,
            weight: bsdf / mixture,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use eagpt_scene::rng::{Purpose, RandomKey};
    use eagpt_scene::{Gloss, Harmonics};
    use glam::{Quat, Vec2};

    fn lamps() -> Lights {
        let lamp = |position: Vec3, scale: Vec2, turn: f32, brightness: f32| Gaussian {
            position,
            scale,
            rotation: Quat::from_rotation_x(turn),
            opacity: 0.9,
            radiance: Vec3::splat(brightness),
            harmonics: Harmonics::NONE,
            gloss: Gloss::NONE,
            emission: 1.0,
            albedo: Vec3::ZERO,
        };
        let gaussians: Gaussians = [
            lamp(Vec3::new(0.0, 0.0, 2.0), Vec2::new(0.3, 0.1), 0.4, 5.0),
            lamp(Vec3::new(0.2, 0.1, 2.5), Vec2::new(0.2, 0.4), -0.2, 2.0),
            lamp(Vec3::new(1.5, -1.0, 0.5), Vec2::new(0.1, 0.1), 1.2, 9.0),
        ]
        .into_iter()
        .collect();
        Lights::new(&gaussians).unwrap()
    }

    /// The density integrates to one over the sphere, and sampled directions follow it: with `f =
    /// density`, the mean of `1/f` over samples is the solid angle where `f > 0`, and the mean of
    /// `g/f` for `g = f²` is `∫ f²`.
    #[test]
    fn density_is_that_of_the_samples() {
        let lights = lamps();
        let origin = Vec3::new(0.1, 0.3, 0.0);
        let num = 2_000_000_u32;
        let (mut integral, mut square) = (0.0_f64, 0.0_f64);
        for i in 0..num {
            let z = 1.0 - (2 * i + 1) as f32 / num as f32;
            let (sin, cos) = (i as f32 * 2.399_963_2 % TAU).sin_cos();
            let flat = (1.0 - z * z).sqrt();
            let f =
                f64::from(lights.density(origin, Vec3::new(flat * cos, flat * sin, z).normalize()));
            integral += f;
            square += f * f;
        }
        let cell = 4.0 * std::f64::consts::PI / f64::from(num);
        let (integral, square) = (integral * cell, square * cell);
        // Two million cells over footprints of some 0.05 sr.
        assert!((integral - 1.0).abs() < 5e-3, "{integral}");
        let key = RandomKey::new(3, Purpose::Render, 0);
        let samples = 200_000;
        let values: Vec<f64> = (0..samples)
            .map(|i| {
                let [a, b, pick, _] = key.stream(i, 0).next_uniforms();
                f64::from(lights.density(origin, lights.sample(origin, pick, a, b).unwrap()))
            })
            .collect();
        let mean = values.iter().sum::<f64>() / f64::from(samples);
        let sd =
            (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / f64::from(samples)).sqrt();
        let error = sd / f64::from(samples).sqrt();
        assert!(
            (mean - square).abs() < 4.0 * error + 5e-3 * square,
            "{mean} ± {error} instead of {square}"
        );
    }

    #[test]
    fn a_scene_without_emitters_has_no_lights() {
        assert!(Lights::new(&Gaussians::default()).is_none());
    }
}
