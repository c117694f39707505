//! One step of Adam (Kingma and Ba 2015) for all parameters: its sizes, and gradients that are not
//! finite.

use super::state::ParameterState;
use super::{
    ALBEDO, CLASSES, EMISSION, NUM_PARAMETERS, RADIANCE, Raw, harmonics_gradient, raw_gradient,
};
use crate::options::{HarmonicsOptions, LearningRates};
use eagpt_scene::Gaussians;
use eagpt_scene::harmonics::{NUM_COEFFICIENTS, functions_from, num_functions};
use eagpt_trace::blend::LocalGradient;
use glam::Vec3;
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Adam's step sizes; 0 keeps a parameter as it is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StepSizes {
    /// Of every raw parameter.
    pub raw: Raw,
    /// Of every coefficient of the harmonics.
    pub harmonics: [f32; NUM_COEFFICIENTS],
    /// Decoupled weight decay of coefficients, relative to the step size (Loshchilov and Hutter
    /// 2019).
    pub harmonics_decay: f32,
}

impl StepSizes {
    /// Steps of stage 0 when `progress` (0 to 1) of it is done; harmonics stay. `extent`: see
    /// [`LearningRates::position`].
    pub fn radiance(rates: &LearningRates, extent: f32, progress: f32) -> Self {
        let decay = rates.share_at(progress);
        let mut sizes = [0.0; NUM_PARAMETERS];
        let of_class = [
            rates.position * extent,
            rates.scale,
            rates.rotation,
            rates.opacity,
            rates.radiance,
            rates.emission,
            0.0,
        ];
        for ((_, range), rate) in CLASSES.into_iter().zip(of_class) {
            sizes[range].fill(rate * decay);
        }
        Self {
            raw: sizes,
            harmonics: [0.0; NUM_COEFFICIENTS],
            harmonics_decay: 0.0,
        }
    }

    /// With steps of harmonics: `share` of the rate that they begin with.
    pub fn with_harmonics(mut self, options: &HarmonicsOptions, share: f32) -> Self {
        self.harmonics[..3 * num_functions(options.degree)].fill(options.rate * share);
        self.harmonics_decay = options.decay;
        self
    }

    /// Whether anything moves beside light and material: radiance, emission, albedo.
    pub fn move_geometry(&self) -> bool {
        self.raw[..RADIANCE].iter().any(|&size| size != 0.0)
    }

    /// Whether harmonics move.
    pub fn move_harmonics(&self) -> bool {
        self.harmonics.iter().any(|&size| size != 0.0)
    }

    /// How many Gaussians move, of `num_gaussians` of which `num_fixed` are fixed: those that are
    /// fixed take part where the albedo alone moves.
    pub(crate) fn num_moving(&self, num_gaussians: usize, num_fixed: usize) -> usize {
        let albedo_alone =
            self.raw[..ALBEDO].iter().all(|&size| size == 0.0) && !self.move_harmonics();
        match albedo_alone {
            true => num_gaussians,
            false => num_gaussians - num_fixed,
        }
    }

    /// Steps of stage 1: albedo only.
    pub fn albedo(rate: f32) -> Self {
        let mut sizes = [0.0; NUM_PARAMETERS];
        sizes[ALBEDO..].fill(rate);
        Self {
            raw: sizes,
            harmonics: [0.0; NUM_COEFFICIENTS],
            harmonics_decay: 0.0,
        }
    }
}

impl ParameterState {
    /// One step of Adam along `gradients` (`[n]`), which belong to `gaussians` (`[n]`, the
    /// activated values) as seen from `eye`. Gaussians that are fixed stay to the bit, but for
    /// their albedos where these alone move. Nothing changes if a gradient is not finite: then the
    /// class of the parameter, the index of the Gaussian and the value are returned.
    pub fn step(
        &mut self,
        gaussians: &Gaussians,
        eye: Vec3,
        gradients: &[LocalGradient],
        sizes: &StepSizes,
    ) -> Result<(), BadGradient> {
        let first_bad = AtomicUsize::new(usize::MAX);
        let num_moving = match self.lights.num() {
            1 => sizes.num_moving(self.len(), self.num_fixed),
            // The radiance of fixed ones that do not shine moves.
            _ => self.len(),
        };
        let first_fixed = sizes.num_moving(self.len(), self.num_fixed);
        let moves_harmonics = !self.harmonics.is_empty() && sizes.move_harmonics();
        let raw: Vec<Raw> = self.raw.values[..num_moving]
            .par_iter()
            .zip(gradients)
            .with_min_len(1024)
            .enumerate()
            .map(|(i, (value, local))| {
                // Most Gaussians of a room are not in the view.
                if *local == LocalGradient::default() {
                    return [0.0; NUM_PARAMETERS];
                }
                let mut g = gaussians.get(i);
                g.radiance = gaussians.seen_radiance(i, eye);
                let raw = raw_gradient(value, &g, local);
                // A sum is not finite if one of its terms is not.
                if !raw.iter().sum::<f32>().is_finite() {
                    first_bad.fetch_min(i, Ordering::Relaxed);
                }
                match i < first_fixed {
                    true => raw,
                    false => self.of_fixed(i, &raw),
                }
            })
            .collect();
        let suspects = first_bad.into_inner().min(raw.len());
        for (index, gradient) in raw.iter().enumerate().skip(suspects) {
            if let Some(bad) = BadGradient::find(index, gradient) {
                return Err(bad);
            }
        }
        (self.raw).step(num_moving, (&sizes.raw, 0.0), |i| raw[i]);
        if moves_harmonics {
            let gradient = |i: usize| match raw[i][RADIANCE..EMISSION] == [0.0; 3] {
                true => [0.0; NUM_COEFFICIENTS],
                false => harmonics_gradient(&raw[i], &functions_from(eye, gaussians.positions[i])),
            };
            let sizes = (&sizes.harmonics, sizes.harmonics_decay);
            self.harmonics.step(num_moving, sizes, gradient);
        }
        Ok(())
    }
}

/// A gradient that is not a number.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("gradient of {class} of Gaussian {index} is {value}")]
pub struct BadGradient {
    /// Class of the parameter, see [`CLASSES`].
    pub class: &'static str,
    /// Index of the Gaussian.
    pub index: usize,
    /// The value.
    pub value: f32,
}

impl BadGradient {
    /// The first value of `gradient`, that of Gaussian `index`, that is not finite.
    pub(crate) fn find(index: usize, gradient: &Raw) -> Option<Self> {
        let at = gradient.iter().position(|x| !x.is_finite())?;
        Some(Self {
            class: class_of(at),
            index,
            value: gradient[at],
        })
    }
}

fn class_of(at: usize) -> &'static str {
    CLASSES
        .iter()
        .find(|(_, range)| range.contains(&at))
        .map_or("unknown", |(name, _)| name)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::params::{OPACITY, tests::sample};
    use eagpt_scene::Harmonics;
    use eagpt_trace::blend::grad_lane;

    #[test]
    fn adam_walks_downhill_and_refuses_nan() {
        let gaussians: Gaussians = [sample()].into_iter().collect();
        let mut state = ParameterState::new(&gaussians);
        let before = state.clone();
        let everything = StepSizes {
            raw: [0.1; NUM_PARAMETERS],
            ..StepSizes::albedo(0.1)
        };
        let mut gradient = LocalGradient::default();
        gradient.0[grad_lane::OPACITY] = 1.0;
        state
            .step(&gaussians, Vec3::ZERO, &[gradient], &everything)
            .unwrap();
        // The first step of Adam has the length of the rate, against the gradient.
        assert!(
            (state.raw.values[0][OPACITY] - (before.raw.values[0][OPACITY] - 0.1)).abs() < 1e-6
        );
        assert_eq!(
            state.raw.values[0][RADIANCE..],
            before.raw.values[0][RADIANCE..]
        );

        let kept = state.clone();
        gradient.0[grad_lane::EMISSION] = f32::NAN;
        let bad = state
            .step(&gaussians, Vec3::ZERO, &[gradient], &everything)
            .unwrap_err();
        assert_eq!((bad.class, bad.index), ("emission", 0));
        assert_eq!(state, kept);
    }

    #[test]
    fn harmonics_move_up_to_their_degree_and_go_with_their_gaussian() {
        let mut gaussians: Gaussians = [sample(), sample()].into_iter().collect();
        gaussians.positions[1] = Vec3::new(0.3, -1.0, 2.5);
        gaussians.harmonics = vec![Harmonics([0.25; NUM_COEFFICIENTS]); 2];
        let mut state = ParameterState::new(&gaussians);
        let mut gradient = LocalGradient::default();
        gradient.0[grad_lane::RADIANCE] = 1.0;
        let options = HarmonicsOptions {
            degree: 1,
            from: 0.0,
            rate: 0.1,
            decay: 0.5,
        };
        let sizes = StepSizes::albedo(0.1).with_harmonics(&options, 0.5);
        let eye = Vec3::new(2.0, 1.0, 0.0);
        let gradients = [gradient, LocalGradient::default()];
        state.step(&gaussians, eye, &gradients, &sizes).unwrap();
        let [moved, unseen] = [0, 1].map(|i| state.harmonics.values[i]);
        let functions = functions_from(eye, gaussians.positions[0]);
        for k in 0..NUM_COEFFICIENTS {
            // Half of the rate, a twentieth: decay takes half of a twentieth of a quarter; the
            // first step has the length of the rate.
            let wanted = match k {
                9.. => 0.25,
                _ if k % 3 == 0 => 0.25 * 0.975 - 0.05 * functions[k / 3].signum(),
                _ => 0.25 * 0.975,
            };
            assert!((moved[k] - wanted).abs() < 1e-6, "{k}: {}", moved[k]);
        }
        assert!((unseen[0] - 0.25 * 0.975).abs() < 1e-6 && unseen[9] == 0.25);
        state.split(0, 2, 0, Vec3::X * 0.1, 0.7);
        assert_eq!(state.gaussians().harmonics.len(), 3);
        assert_eq!(state.gaussians().get(2).harmonics.0, moved);
        state.sort_in_space();
        let found = state
            .gaussians()
            .iter()
            .filter(|g| g.harmonics.0 == moved)
            .count();
        assert_eq!(found, 2);
    }
}
