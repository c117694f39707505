//! Highlights of glossy Gaussians by the light of each lamp.
//!
//! The light of a lamp that a glossy surface mirrors differs with the direction; harmonics hold it,
//! as a factor on the reflected radiance ([`crate::harmonics`]). Of a mix of lamps the factor
//! towards an eye is the mean of theirs, weighted by what is reflected of each. That is no harmonic
//! exponent: one is fitted, in the directions in which cameras of the bake see the Gaussian.

use crate::harmonics::fit::RatioFit;
use crate::harmonics::{Harmonics, NUM_COEFFICIENTS, functions};
use glam::Vec3;
use half::f16;
use half::slice::HalfFloatSliceExt;
use rayon::prelude::*;

/// Directions that are kept of a Gaussian, at most.
pub(super) const NUM_EYES: usize = 16;

/// Highlights of some Gaussians.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Highlights {
    /// The Gaussians, ascending.
    pub(super) gaussians: Vec<u32>,
    /// Unit vectors to eyes, `[m, NUM_EYES, 3]`; zero where there are fewer.
    pub(super) to_eyes: Vec<f16>,
    /// Coefficients in the light of each lamp alone, `[lights, m, 24]`.
    pub(super) harmonics: Vec<f16>,
}

impl Highlights {
    /// Those of `glossy` Gaussians, ascending, with unit vectors to eyes that see them; of more than
    /// [`NUM_EYES`], as many are kept. No light has any yet.
    pub(super) fn new(glossy: &[(u32, Vec<Vec3>)]) -> Self {
        let eyes = |(_, to_eyes): &(u32, Vec<Vec3>)| {
            let step = to_eyes.len().div_ceil(NUM_EYES).max(1);
            let mut kept = [Vec3::ZERO; NUM_EYES];
            for (eye, to_eye) in kept.iter_mut().zip(to_eyes.iter().step_by(step)) {
                *eye = *to_eye;
            }
            kept
        };
        let to_eyes = glossy.iter().flat_map(eyes).flat_map(|eye| eye.to_array());
        Self {
            gaussians: glossy.iter().map(|(gaussian, _)| *gaussian).collect(),
            to_eyes: to_eyes.map(f16::from_f32).collect(),
            harmonics: Vec::new(),
        }
    }

    /// Adds those of the next light, `[m]`.
    pub(super) fn push(&mut self, of_light: &[Harmonics]) {
        let coefficients = of_light.iter().flat_map(|one| one.0);
        self.harmonics.extend(coefficients.map(f16::from_f32));
    }

    /// Harmonics of number `m` in the light `light` alone.
    pub(super) fn alone(&self, m: usize, light: usize) -> Harmonics {
        let first = NUM_COEFFICIENTS * (light * self.gaussians.len() + m);
        let mut harmonics = Harmonics::NONE;
        self.harmonics[first..][..NUM_COEFFICIENTS].convert_to_f32_slice(&mut harmonics.0);
        harmonics
    }

    /// Harmonics of all, `[m]`, where each of `num_lights` adds `reflected(i, k)` to the light of
    /// Gaussian i.
    pub(super) fn mixed(
        &self,
        num_lights: usize,
        reflected: impl Fn(usize, usize) -> Vec3 + Sync,
    ) -> Vec<Harmonics> {
        let mixed = |m: usize| {
            let i = self.gaussians[m] as usize;
            let parts: Vec<(Vec3, Harmonics)> = (0..num_lights)
                .map(|k| (reflected(i, k), self.alone(m, k)))
                .filter(|(light, _)| *light != Vec3::ZERO)
                .collect();
            if let [(_, alone)] = parts[..] {
                return alone;
            }
            let total: Vec3 = parts.iter().map(|(light, _)| *light).sum();
            let mut fit = RatioFit::default();
            let (to_eyes, _) = self.to_eyes[3 * NUM_EYES * m..][..3 * NUM_EYES].as_chunks::<3>();
            for to_eye in to_eyes {
                let to_eye = Vec3::from(to_eye.map(f16::to_f32));
                if to_eye == Vec3::ZERO {
                    break;
                }
                let functions = functions(-to_eye.normalize());
                let seen = parts.iter().map(|(light, h)| *light * h.factor(&functions));
                let seen: Vec3 = seen.sum();
                // A channel without light has no ratio.
                let ratio = Vec3::select(total.cmpgt(Vec3::ZERO), seen / total, Vec3::ONE);
                fit.add(to_eye, ratio);
            }
            fit.fitted()
        };
        (0..self.gaussians.len())
            .into_par_iter()
            .map(mixed)
            .collect()
    }
}
