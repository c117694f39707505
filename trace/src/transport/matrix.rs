//! Sparse light-transport matrix: rays traced once, for light that is exchanged many times.
//!
//! The irradiance over π of a point is `1/π ∫ L cos θ dω`. The integral is split by what a
//! direction meets. Emitters are sampled by two kinds of directions, towards them with density p
//! (light samples) and about the normal with density q = cos θ/π (BSDF samples), combined by the
//! balance heuristic (Veach 1997, section 9.2). All other surfaces are met by BSDF samples alone,
//! but for bright ones ([`TransportMatrix::add_bright`]).
//! An entry of the matrix is the Gaussian that a direction meets first. Whatever light the
//! Gaussians carry, `E/π` is then the emitters' part plus the mean light of the entries: further
//! bounces, or other albedos, cost a look-up for each entry and no ray. Nor does other light of the
//! same emitters, whose entries are kept, too ([`TransportMatrix::relight`]), or the light of each
//! lamp alone ([`TransportMatrix::direct_of_groups`]).
//!
//! [`TransportMatrix::trace`] is the CPU's way; [`crate::Tracer::trace_transport`] is that of any
//! device.

mod backs;
mod bright;
mod groups;
mod relight;

use super::light_list::{Importances, LightList};
use super::points::{Points, RowPoints};
use super::sampling::cosine_direction;
use super::start::Surface;
use crate::cpu::realizations::NUM_REALIZATIONS;
use eagpt_scene::color::luminance;
use eagpt_scene::rng::RandomKey;
use glam::Vec3;
use rayon::prelude::*;
use std::f32::consts::FRAC_1_PI;

pub use backs::Front;
pub use bright::{BrightEntries, BrightSamples};
pub use groups::Groups;
pub use relight::Tracing;

/// Entry of a direction that meets nothing, or that was not traced. It is no index.
pub const NOTHING: u32 = 0x7f7f_ffff;

/// Set in entries of emitters, beside the index of the Gaussian.
pub const EMITTER: u32 = 1 << 31;

/// A Gaussian whose irradiance is gathered, and where.
pub type Receiver = (u32, Surface);

/// Numbers of directions traced for each receiver.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Directions {
    /// BSDF (cosine) samples, at least 1.
    pub bsdf: u32,
    /// Light samples.
    pub to_lights: u32,
}

impl Directions {
    /// `num` directions, at least 1, of which one in `every` (at least 2) is a light sample.
    pub fn divided(num: u32, every: u32) -> Self {
        let to_lights = num / every.max(2);
        Self {
            bsdf: (num - to_lights).max(1),
            to_lights,
        }
    }
}

/// Rows of a light-transport matrix, of some receivers.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct TransportMatrix {
    /// Irradiance over π that comes from emitters, `[receivers]`.
    pub direct: Vec<Vec3>,
    /// Squared luminance of the parts of [`Self::direct`] that the directions have found, summed,
    /// `[receivers]`: what its noise is told from.
    pub direct_squares: Vec<f32>,
    /// Entries of BSDF samples, `[receivers, directions.bsdf]`: index of the Gaussian met first,
    /// with [`EMITTER`] set if it emits, or [`NOTHING`].
    pub targets: Vec<u32>,
    /// Entries of light samples, `[receivers, directions.to_lights]`.
    pub light_targets: Vec<u32>,
    /// Entries of bright surfaces ([`Self::add_bright`]).
    pub bright: BrightEntries,
    /// Rays traced.
    pub num_rays: u64,
}

impl TransportMatrix {
    /// Adds those of more receivers, traced in as many directions, before those of bright surfaces.
    pub fn append(&mut self, mut more: Self) {
        self.direct.append(&mut more.direct);
        self.direct_squares.append(&mut more.direct_squares);
        self.targets.append(&mut more.targets);
        self.light_targets.append(&mut more.light_targets);
        self.num_rays += more.num_rays;
    }

    /// Irradiance over π that reaches each receiver from the others alone, of the light that all
    /// Gaussians carry: `radiances`, `[n]`; that of emitters does not count.
    pub fn from_others(&self, directions: Directions, radiances: &[Vec3]) -> Vec<Vec3> {
        let bsdf = directions.bsdf as usize;
        // Neither `NOTHING` nor what has `EMITTER` is an index.
        let light = |target: &u32| radiances.get(*target as usize).copied();
        (self.targets.par_chunks_exact(bsdf).enumerate())
            .with_min_len(1024)
            .map(|(at, targets)| {
                let mean = targets.iter().filter_map(light).sum::<Vec3>() / bsdf as f32;
                mean + self.bright.light(at, radiances)
            })
            .collect()
    }

    /// Variance of the luminance of what [`Self::from_others`] gives for the same light, as far as
    /// the entries tell it.
    pub fn variance_from_others(&self, directions: Directions, radiances: &[Vec3]) -> Vec<f32> {
        let num = directions.bsdf as f32;
        let light = |target: &u32| {
            let radiance = radiances.get(*target as usize);
            radiance.map_or(0.0, |radiance| luminance(radiance.to_array()))
        };
        let rows = self.targets.par_chunks_exact(directions.bsdf as usize);
        rows.enumerate()
            .with_min_len(1024)
            .map(|(at, targets)| {
                let mean = targets.iter().map(light).sum::<f32>() / num;
                let squares = targets.iter().map(|target| (light(target) - mean).powi(2));
                squares.sum::<f32>() / (num * (num - 1.0).max(1.0))
                    + self.bright.variance(at, radiances)
            })
            .collect()
    }

    /// Variance of the luminance of [`Self::direct`], as far as the directions tell it.
    pub fn variance_of_direct(&self, directions: Directions) -> Vec<f32> {
        let num = (directions.bsdf + directions.to_lights) as f32;
        let variance = |(direct, squares): (&Vec3, &f32)| {
            let sum = luminance(direct.to_array());
            (squares - sum * sum / num).max(0.0)
        };
        let pairs = self.direct.iter().zip(&self.direct_squares);
        pairs.map(variance).collect()
    }
}

/// Number of a direction among those of its kind.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Sample {
    Bsdf(u32),
    Light(u32),
}

/// Chooses directions.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Sampler<'a> {
    pub(crate) lights: Option<&'a LightList>,
    pub(crate) directions: Directions,
    pub(crate) key: RandomKey,
}

impl<'a> Sampler<'a> {
    pub(crate) fn aim(&self, &(element, surface): &Receiver) -> Aim<'a> {
        let Directions { bsdf, to_lights } = self.directions;
        Aim {
            surface,
            points: [bsdf, to_lights].map(|num| RowPoints::new(self.key, element, num)),
            first_realization: Points::new(self.key, element).word(0),
            directions: self.directions,
            lights: (self.lights).map(|lights| (lights, lights.importances(&surface))),
        }
    }
}

/// Directions of a receiver, and weights of emitters that they meet.
#[derive(Debug, Clone)]
pub(crate) struct Aim<'a> {
    pub(crate) surface: Surface,
    /// Random numbers of BSDF samples, and of light samples.
    points: [RowPoints; 2],
    /// Realization that its first sample meets, modulo [`NUM_REALIZATIONS`].
    first_realization: u32,
    directions: Directions,
    lights: Option<(&'a LightList, Importances)>,
}

impl Aim<'_> {
    /// Samples that meet `realization`: they take turns in the realizations, and receivers begin
    /// with different ones.
    pub(crate) fn samples(&self, realization: u32) -> impl Iterator<Item = Sample> + use<> {
        let first = realization.wrapping_sub(self.first_realization) % NUM_REALIZATIONS;
        let turn = move |num: u32| (first..num).step_by(NUM_REALIZATIONS as usize);
        let Directions { bsdf, to_lights } = self.directions;
        (turn(bsdf).map(Sample::Bsdf)).chain(turn(to_lights).map(Sample::Light))
    }

    /// A direction; `None` for a light sample below the surface, or without lights.
    pub(crate) fn direction(&self, sample: Sample, realization: u32) -> Option<Vec3> {
        let Surface {
            position, normal, ..
        } = self.surface;
        match sample {
            Sample::Bsdf(i) => {
                let [a, b, ..] = self.points[0].block(i, 0);
                Some(cosine_direction(normal, a, b))
            }
            Sample::Light(i) => {
                let [pick, a, b, _] = self.points[1].block(i, 1);
                let (lights, importances) = self.lights.as_ref()?;
                lights
                    .sample(importances, realization, position, [pick, a, b])
                    .filter(|direction| direction.dot(normal) > 0.0)
            }
        }
    }

    /// Weight of an emitter's radiance that a direction found: q / (n q + m p), for n BSDF samples
    /// of density q and m light samples of density p.
    pub(crate) fn weight(&self, direction: Vec3, realization: u32) -> f32 {
        let q = direction.dot(self.surface.normal) * FRAC_1_PI;
        let p = self.lights.as_ref().map_or(0.0, |(lights, importances)| {
            lights.density(importances, realization, self.surface.position, direction)
        });
        q / (self.directions.bsdf as f32 * q + self.directions.to_lights as f32 * p)
    }
}
