//! Harmonics that explain light by direction, by least squares.

use super::{Harmonics, NUM_FUNCTIONS, functions};
use glam::Vec3;
use nalgebra::SMatrix;

/// Ratios are held within this and its inverse.
const MAX_RATIO: f32 = 20.0;
/// Squared coefficients count as much as this part of the squared errors.
const RIDGE: f32 = 0.005;
/// Power of the ratio that errors of its logarithm count by: 0 for relative errors, by which bright
/// light ends up too dark, 1 for absolute ones, by which dark light ends up too bright. Of 0, ¼, ½
/// and 0.9, it suits three rooms best.
const POWER: f32 = 0.25;

/// Normal equations of a fit to the logarithms of ratios of three channels, in which harmonics are
/// linear.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct RatioFit {
    weight: f32,
    functions: SMatrix<f32, NUM_FUNCTIONS, NUM_FUNCTIONS>,
    logs: SMatrix<f32, NUM_FUNCTIONS, 3>,
}

impl RatioFit {
    /// Adds the ratio, not negative, of the radiance towards an eye to the mean radiance; `to_eye`
    /// is the unit vector from the Gaussian to the eye.
    pub fn add(&mut self, to_eye: Vec3, ratio: Vec3) {
        let log = ratio.map(|r| r.clamp(MAX_RATIO.recip(), MAX_RATIO).ln());
        let functions = SMatrix::<f32, NUM_FUNCTIONS, 1>::from(functions(-to_eye));
        let weight = (POWER * log.element_sum() / 3.0).exp();
        self.weight += weight;
        self.functions += functions * functions.transpose() * weight;
        self.logs += functions * SMatrix::<f32, 1, 3>::from(log.to_array()) * weight;
    }

    /// Adds all that `other` was told, by `weight`.
    pub fn add_weighted(&mut self, other: &Self, weight: f32) {
        self.weight += other.weight * weight;
        self.functions += other.functions * weight;
        self.logs += other.logs * weight;
    }

    /// The harmonics with the least squared error.
    pub fn fitted(mut self) -> Harmonics {
        for k in 0..NUM_FUNCTIONS {
            self.functions[(k, k)] += RIDGE * self.weight;
        }
        let solved = self.functions.cholesky().map(|f| f.solve(&self.logs));
        solved.map_or(Harmonics::NONE, |c| {
            Harmonics(std::array::from_fn(|at| c[(at / 3, at % 3)]))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ratios_of_harmonics_are_explained() {
        let truth = Harmonics(std::array::from_fn(|k| 0.3 * (1.7 * k as f32).sin()));
        let mut fit = RatioFit::default();
        assert_eq!(fit.fitted(), Harmonics::NONE);
        let directions: Vec<Vec3> = (0..40)
            .map(|i| {
                let (z, angle) = ((i as f32 + 0.5) / 40.0, 2.4 * i as f32);
                let radius = (1.0 - z * z).sqrt();
                Vec3::new(radius * angle.cos(), radius * angle.sin(), z)
            })
            .collect();
        for &to_eye in &directions {
            fit.add(to_eye, truth.factor(&functions(-to_eye)));
        }
        let found = fit.fitted();
        for &to_eye in &directions {
            let [found, truth] = [found, truth].map(|h| h.factor(&functions(-to_eye)));
            // The ridge holds coefficients back by some percent.
            let off = ((found - truth) / truth).abs().max_element();
            assert!(off < 0.05, "{found} {truth}");
        }
    }
}
