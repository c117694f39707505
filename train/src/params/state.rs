//! What Adam moves and remembers, and one step of it (Kingma and Ba 2015).

use super::{
    ALBEDO, CLASSES, NUM_PARAMETERS, POSITION, RADIANCE, Raw, SCALE, gaussian_from_raw, logit,
    raw_from_gaussian, raw_gradient, sigmoid,
};
use crate::options::LearningRates;
use crate::order;
use eagpt_scene::Gaussians;
use eagpt_trace::blend::LocalGradient;
use glam::Vec3;
use multiversion::multiversion;
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Adam's moment decays and divisor guard (Kingma and Ba 2015; the guard is that of 3DGS).
pub(crate) const BETA_1: f32 = 0.9;
pub(crate) const BETA_2: f32 = 0.999;
pub(crate) const EPSILON: f32 = 1e-15;

/// Raw parameters with Adam's moments: the whole state of an optimisation.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ParameterState {
    /// Raw values, `[n]`.
    pub values: Vec<Raw>,
    /// First moments, `[n]`.
    pub first: Vec<Raw>,
    /// Second moments, `[n]`.
    pub second: Vec<Raw>,
    /// Steps taken since the moments were zero.
    pub num_steps: u32,
}

/// Adam's step size for every raw parameter; 0 keeps a parameter as it is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StepSizes(pub Raw);

impl StepSizes {
    /// Steps of stage 0 when `progress` (0 to 1) of it is done. `extent`: see [`LearningRates::position`].
    pub fn radiance(rates: &LearningRates, extent: f32, progress: f32) -> Self {
        let decay = rates.final_share.powf(progress);
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
        Self(sizes)
    }

    /// Whether anything moves beside light and material: radiance, emission, albedo.
    pub fn move_geometry(&self) -> bool {
        self.0[..RADIANCE].iter().any(|&size| size != 0.0)
    }

    /// Steps of stage 1: albedo only.
    pub fn albedo(rate: f32) -> Self {
        let mut sizes = [0.0; NUM_PARAMETERS];
        sizes[ALBEDO..].fill(rate);
        Self(sizes)
    }
}

impl ParameterState {
    /// The state at the start: the given Gaussians, no moments.
    pub fn new(gaussians: &Gaussians) -> Self {
        let values: Vec<Raw> = gaussians.iter().map(|g| raw_from_gaussian(&g)).collect();
        let zeros = vec![[0.0; NUM_PARAMETERS]; values.len()];
        Self {
            values,
            first: zeros.clone(),
            second: zeros,
            num_steps: 0,
        }
    }

    /// Forgets the moments: a new stage begins.
    pub fn reset_moments(&mut self) {
        self.first.fill([0.0; NUM_PARAMETERS]);
        self.second.fill([0.0; NUM_PARAMETERS]);
        self.num_steps = 0;
    }

    /// Sets the albedos, `[n]`, each 0 to 1.
    pub fn set_albedos(&mut self, albedos: &[Vec3]) {
        for (raw, albedo) in self.values.iter_mut().zip(albedos) {
            raw[ALBEDO..].copy_from_slice(&albedo.to_array().map(logit));
        }
    }

    /// Puts one half of a Gaussian at `place` (another Gaussian, which is lost, or the end) and makes itself the other: both with the scale
    /// of `axis` times `shrink`, `step` (scene units) to either side of where it was. The halves know its second moments, so that their first
    /// steps are not longer than its own; the direction they find out.
    pub fn split(&mut self, parent: usize, place: usize, axis: usize, step: Vec3, shrink: f32) {
        let mut half = self.values[parent];
        half[SCALE + axis] += shrink.ln();
        let moved = |by: Vec3| {
            let mut raw = half;
            for (coordinate, by) in raw[POSITION..SCALE].iter_mut().zip(by.to_array()) {
                *coordinate += by;
            }
            raw
        };
        let (one, other) = (moved(step), moved(-step));
        let second = self.second[parent];
        if place == self.values.len() {
            self.values.push(other);
            self.first.push([0.0; NUM_PARAMETERS]);
            self.second.push(second);
        } else {
            self.values[place] = other;
            self.first[place] = [0.0; NUM_PARAMETERS];
            self.second[place] = second;
        }
        self.values[parent] = one;
        self.first[parent] = [0.0; NUM_PARAMETERS];
    }

    /// Puts Gaussians that are close in space close together in memory.
    pub fn sort_in_space(&mut self) {
        let position = |raw: &Raw| Vec3::from_slice(&raw[POSITION..SCALE]);
        let order = order::along_curve(&self.values.iter().map(position).collect::<Vec<_>>());
        for of in [&mut self.values, &mut self.first, &mut self.second] {
            *of = order.iter().map(|&i| of[i as usize]).collect();
        }
    }

    /// Number of Gaussians.
    pub fn len(&self) -> usize {
        self.values.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// The Gaussians of the raw values.
    pub fn gaussians(&self) -> Gaussians {
        self.values.iter().map(gaussian_from_raw).collect()
    }

    /// Writes the Gaussians of the raw values over `gaussians`, `[n]`.
    pub fn write_gaussians(&self, gaussians: &mut Gaussians) {
        (
            &self.values,
            &mut gaussians.positions,
            &mut gaussians.scales,
            &mut gaussians.rotations,
            &mut gaussians.opacities,
            &mut gaussians.radiances,
            &mut gaussians.emissions,
            &mut gaussians.albedos,
        )
            .into_par_iter()
            .with_min_len(1024)
            .for_each(
                |(raw, position, scale, rotation, opacity, radiance, emission, albedo)| {
                    let g = gaussian_from_raw(raw);
                    (*position, *scale, *rotation) = (g.position, g.scale, g.rotation);
                    (*opacity, *radiance) = (g.opacity, g.radiance);
                    (*emission, *albedo) = (g.emission, g.albedo);
                },
            );
    }

    /// Writes the albedos of the raw values alone over `albedos`, `[n]`.
    pub fn write_albedos(&self, albedos: &mut [Vec3]) {
        (&self.values, albedos)
            .into_par_iter()
            .with_min_len(1024)
            .for_each(|(raw, albedo)| {
                *albedo = Vec3::new(raw[ALBEDO], raw[ALBEDO + 1], raw[ALBEDO + 2]).map(sigmoid);
            });
    }

    /// One step of Adam along `gradients` (`[n]`), which belong to `gaussians` (`[n]`, the activated values). Nothing changes if a
    /// gradient is not finite: then the class of the parameter, the index of the Gaussian and the value are returned.
    pub fn step(
        &mut self,
        gaussians: &Gaussians,
        gradients: &[LocalGradient],
        sizes: &StepSizes,
    ) -> Result<(), BadGradient> {
        let first_bad = AtomicUsize::new(usize::MAX);
        let raw: Vec<Raw> = self
            .values
            .par_iter()
            .zip(gradients)
            .with_min_len(1024)
            .enumerate()
            .map(|(i, (value, local))| {
                let raw = raw_gradient(value, &gaussians.get(i), local);
                // A sum is not finite if one of its terms is not.
                if !raw.iter().sum::<f32>().is_finite() {
                    first_bad.fetch_min(i, Ordering::Relaxed);
                }
                raw
            })
            .collect();
        let suspects = first_bad.into_inner().min(raw.len());
        for (index, gradient) in raw.iter().enumerate().skip(suspects) {
            if let Some(bad) = BadGradient::find(index, gradient) {
                return Err(bad);
            }
        }
        self.num_steps += 1;
        let adam = Adam::new(*sizes, self.num_steps);
        self.values
            .par_chunks_mut(ADAM_CHUNK)
            .zip(self.first.par_chunks_mut(ADAM_CHUNK))
            .zip(self.second.par_chunks_mut(ADAM_CHUNK))
            .zip(raw.par_chunks(ADAM_CHUNK))
            .for_each(|(((values, first), second), gradients)| {
                adam_step(&adam, values, first, second, gradients);
            });
        Ok(())
    }
}

/// Gaussians updated at once by a thread.
const ADAM_CHUNK: usize = 1024;

/// One step's constants.
pub(crate) struct Adam {
    sizes: StepSizes,
    /// What first moments are to be multiplied with …
    pub(crate) correction_1: f32,
    /// … and second ones, since both started at zero.
    pub(crate) correction_2: f32,
}

impl Adam {
    /// Those of step `num_steps`, counted from 1.
    pub(crate) fn new(sizes: StepSizes, num_steps: u32) -> Self {
        Self {
            sizes,
            correction_1: 1.0 / (1.0 - BETA_1.powi(num_steps as i32)),
            correction_2: 1.0 / (1.0 - BETA_2.powi(num_steps as i32)),
        }
    }
}

#[multiversion(targets("x86_64+avx512f+avx512vl", "x86_64+avx2", "aarch64+neon"))]
fn adam_step(
    adam: &Adam,
    values: &mut [Raw],
    first: &mut [Raw],
    second: &mut [Raw],
    gradients: &[Raw],
) {
    let moments = first.iter_mut().zip(second);
    for ((value, gradient), (first, second)) in values.iter_mut().zip(gradients).zip(moments) {
        for k in 0..NUM_PARAMETERS {
            let g = gradient[k];
            first[k] = BETA_1 * first[k] + (1.0 - BETA_1) * g;
            second[k] = BETA_2 * second[k] + (1.0 - BETA_2) * g * g;
            let root = (second[k] * adam.correction_2).sqrt() + EPSILON;
            value[k] -= adam.sizes.0[k] * first[k] * adam.correction_1 / root;
        }
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
    use eagpt_trace::blend::grad_lane;

    #[test]
    fn adam_walks_downhill_and_refuses_nan() {
        let gaussians: Gaussians = [sample()].into_iter().collect();
        let mut state = ParameterState::new(&gaussians);
        let before = state.clone();
        let mut gradient = LocalGradient::default();
        gradient.0[grad_lane::OPACITY] = 1.0;
        state
            .step(&gaussians, &[gradient], &StepSizes([0.1; NUM_PARAMETERS]))
            .unwrap();
        // The first step of Adam has the length of the rate, against the gradient.
        assert!((state.values[0][OPACITY] - (before.values[0][OPACITY] - 0.1)).abs() < 1e-6);
        assert_eq!(state.values[0][RADIANCE..], before.values[0][RADIANCE..]);

        let kept = state.clone();
        gradient.0[grad_lane::EMISSION] = f32::NAN;
        let bad = state
            .step(&gaussians, &[gradient], &StepSizes([0.1; NUM_PARAMETERS]))
            .unwrap_err();
        assert_eq!((bad.class, bad.index), ("emission", 0));
        assert_eq!(state, kept);
    }
}
