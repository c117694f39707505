//! Emitters of a list, as discs and as footprints.

use crate::cpu::realizations::{NUM_REALIZATIONS, SCENE_SEED, realized_radius_squared};
use crate::surfel::Surfel;
use glam::Vec3;
use std::f32::consts::{PI, TAU};

pub(super) const REALIZATIONS: usize = NUM_REALIZATIONS as usize;

/// An emitter.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Disc {
    pub(crate) luminance: f32,
    /// Number of its cluster.
    pub(crate) cluster: u32,
    /// In-plane axes times scales, scene units.
    pub(super) axis_u: Vec3,
    pub(super) axis_v: Vec3,
    /// Squared radius in standard deviations in each realization; negative where it is not there.
    pub(crate) radii: [f32; REALIZATIONS],
    /// Luminance times area of the discs of its cluster up to this one, in each realization.
    pub(crate) cumulative: [f32; REALIZATIONS],
    /// See [`Surfel::cut2`].
    pub(super) cut2: f32,
    /// `1 − exp(−cut²/2)`: the part of the footprint inside the cut.
    pub(super) inside: f32,
    /// Luminance times the integral of the opacity, of the footprints of its cluster up to this
    /// one.
    pub(super) cumulative_footprint: f32,
}

impl Disc {
    pub(super) fn new(index: u32, surfel: &Surfel, luminance: f32) -> Self {
        let along = |axis: [f32; 3]| Vec3::from(axis) / Vec3::from(axis).length_squared();
        Self {
            luminance,
            cluster: 0,
            axis_u: along(surfel.axis_u),
            axis_v: along(surfel.axis_v),
            radii: std::array::from_fn(|realization| {
                realized_radius_squared(surfel, index, SCENE_SEED, realization as u32)
            }),
            cumulative: [0.0; REALIZATIONS],
            cut2: surfel.cut2,
            inside: 1.0 - (-0.5 * surfel.cut2).exp(),
            cumulative_footprint: 0.0,
        }
    }

    /// Luminance times area in a realization.
    pub(super) fn power(&self, surfel: &Surfel, realization: usize) -> f32 {
        PI * self.radii[realization].max(0.0) * surfel.size * surfel.size * self.luminance
    }

    /// A point of the disc: `radius` from the centre, in standard deviations, and by part `turn` of
    /// a full turn.
    pub(super) fn point(&self, surfel: &Surfel, radius: f32, turn: f32) -> Vec3 {
        let (sin, cos) = (TAU * turn).sin_cos();
        Vec3::from(surfel.position) + self.axis_u * (radius * cos) + self.axis_v * (radius * sin)
    }

    /// Luminance times the integral of the opacity.
    pub(super) fn footprint_power(&self, surfel: &Surfel) -> f32 {
        TAU * self.inside * surfel.opacity * surfel.size * surfel.size * self.luminance
    }
}
