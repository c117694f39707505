//! Parameters with Adam's moments, and the Gaussians that follow from them.

use super::learned::Learned;
use super::stored::Lights;
use super::{
    ALBEDO, NUM_PARAMETERS, POSITION, Raw, SCALE, albedo_of, gaussian_from_raw, raw_from_gaussian,
    raw_of_albedo,
};
use crate::order;
use eagpt_scene::harmonics::NUM_COEFFICIENTS;
use eagpt_scene::{Gaussians, Harmonics};
use glam::Vec3;
use rayon::prelude::*;

/// Raw parameters with Adam's moments: the whole state of an optimisation.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ParameterState {
    /// Raw parameters, `[n]`.
    pub raw: Learned<NUM_PARAMETERS>,
    /// Coefficients of [`Harmonics`], `[n]`; empty where radiance does not differ with the
    /// direction.
    pub harmonics: Learned<NUM_COEFFICIENTS>,
    /// So many Gaussians, the last ones, stay as they are in stage 0. In stage 1 their albedos move
    /// as all others do.
    pub num_fixed: usize,
    /// Several lights of the scene; only albedo and geometry are the same in all.
    pub lights: Lights,
}

impl ParameterState {
    /// The state at the start: the given Gaussians, no moments.
    pub fn new(gaussians: &Gaussians) -> Self {
        Self {
            raw: Learned::new(gaussians.iter().map(|g| raw_from_gaussian(&g)).collect()),
            harmonics: Learned::new(gaussians.harmonics.iter().map(|h| h.0).collect()),
            num_fixed: 0,
            lights: Lights::default(),
        }
    }

    /// Coefficients of harmonics, all zero, where there are none yet.
    pub fn begin_harmonics(&mut self) {
        if self.harmonics.is_empty() {
            self.harmonics = Learned::new(vec![[0.0; NUM_COEFFICIENTS]; self.len()]);
            for stored in &mut self.lights.stored {
                stored.harmonics = self.harmonics.clone();
            }
        }
    }

    /// Resets the moments: a new stage begins.
    pub fn reset_moments(&mut self) {
        self.raw.reset_moments();
        self.harmonics.reset_moments();
        (self.lights).for_each(Learned::reset_moments, Learned::reset_moments);
    }

    /// Sets the albedos, `[n]`, each 0 to [`eagpt_scene::gaussians::MAX_ALBEDO`].
    pub fn set_albedos(&mut self, albedos: &[Vec3]) {
        for (raw, albedo) in self.raw.values.iter_mut().zip(albedos) {
            raw[ALBEDO..].copy_from_slice(&albedo.to_array().map(raw_of_albedo));
        }
    }

    /// Puts one half of a Gaussian at `place` (another Gaussian, which is lost, or the end: see
    /// [`Self::put_fixed_last`]) and makes itself the other: both with the scale of `axis` times
    /// `shrink`, `step` (scene units) to either side of where it was. The halves know its second
    /// moments, so that their first steps are not longer than its own; the direction they find out.
    pub(crate) fn split(
        &mut self,
        parent: usize,
        place: usize,
        axis: usize,
        step: Vec3,
        shrink: f32,
    ) {
        let mut half = self.raw.values[parent];
        half[SCALE + axis] += shrink.ln();
        let moved = |by: Vec3| {
            let mut raw = half;
            for (coordinate, by) in raw[POSITION..SCALE].iter_mut().zip(by.to_array()) {
                *coordinate += by;
            }
            raw
        };
        self.raw.split(parent, place, [moved(step), moved(-step)]);
        if let Some(&coefficients) = self.harmonics.values.get(parent) {
            self.harmonics.split(parent, place, [coefficients; 2]);
        }
        self.lights.for_each(
            |rows| rows.split(parent, place, [rows.values[parent]; 2]),
            |rows| rows.split(parent, place, [rows.values[parent]; 2]),
        );
    }

    /// Puts Gaussians that are close in space close together in memory; those that are fixed stay
    /// at the end, in order.
    pub fn sort_in_space(&mut self) {
        let position = |raw: &Raw| Vec3::from_slice(&raw[POSITION..SCALE]);
        let moving = &self.raw.values[..self.num_moving()];
        let mut order = order::along_curve(&moving.iter().map(position).collect::<Vec<_>>());
        order.extend(self.num_moving() as u32..self.len() as u32);
        self.reorder(&order);
    }

    /// Puts those that are fixed at the end again, after [`Self::split`] has put halves there:
    /// `first_fixed` is the first of them.
    pub(crate) fn put_fixed_last(&mut self, first_fixed: usize) {
        if self.num_fixed > 0 {
            let mut order: Vec<u32> = (0..self.len() as u32).collect();
            order[first_fixed..].rotate_left(self.num_fixed);
            self.reorder(&order);
        }
    }

    fn reorder(&mut self, order: &[u32]) {
        self.raw.reorder(order);
        if !self.harmonics.is_empty() {
            self.harmonics.reorder(order);
        }
        (self.lights).for_each(|rows| rows.reorder(order), |rows| rows.reorder(order));
    }

    /// Number of Gaussians.
    pub fn len(&self) -> usize {
        self.raw.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.raw.is_empty()
    }

    /// The Gaussians of the raw values.
    pub fn gaussians(&self) -> Gaussians {
        let mut gaussians: Gaussians = self.raw.values.iter().map(gaussian_from_raw).collect();
        self.write_harmonics(&mut gaussians);
        gaussians
    }

    fn write_harmonics(&self, gaussians: &mut Gaussians) {
        let coefficients = self.harmonics.values.par_iter().with_min_len(1024);
        coefficients
            .map(|row| Harmonics(*row))
            .collect_into_vec(&mut gaussians.harmonics);
    }

    /// Writes the Gaussians of the raw values over `gaussians`, `[n]`.
    pub fn write_gaussians(&self, gaussians: &mut Gaussians) {
        self.write_harmonics(gaussians);
        (
            &self.raw.values,
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
        (&self.raw.values, albedos)
            .into_par_iter()
            .with_min_len(1024)
            .for_each(|(raw, albedo)| {
                *albedo = Vec3::new(raw[ALBEDO], raw[ALBEDO + 1], raw[ALBEDO + 2]).map(albedo_of);
            });
    }
}
