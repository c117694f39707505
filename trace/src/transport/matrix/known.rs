//! TransportMatrix direction by direction, of which some are known.
//!
//! What a direction of a receiver is, follows from the receiver's surface, its random numbers and
//! the emitters that directions look for. What it meets changes only where something in its way has
//! changed; after a small edit most of it is known. Here the targets of all directions are kept,
//! those towards emitters too: the unknown ones are traced, and matrix follow from all of them as
//! [`TransportMatrix::trace`] would have it. Where emitters have changed their light alone, not a
//! ray is traced: directions that look for the emitters as they were are as good, with the weights
//! that go with them, as long as what is looked for is not far from what there is.

use super::{Directions, NOTHING, NUM_REALIZATIONS, Receiver, Sampler, TOGETHER, TransportMatrix};
use crate::ray::Ray;
use crate::tracer::{TraceError, Tracer};
use crate::transport::lights::Lights;
use eagpt_scene::rng::RandomKey;
use glam::Vec3;
use rayon::prelude::*;

/// Target of a direction that is to be traced.
pub const UNKNOWN: u32 = 0x7f7f_fffe;

/// All directions of receivers. The first [`Directions::plain`] of each are those about the normal;
/// [`Directions::to_lights`] follow.
#[derive(Debug, Clone, Copy)]
pub struct KnownDirections<'a> {
    sampler: Sampler<'a>,
}

impl<'a> KnownDirections<'a> {
    /// Directions that look for `lights`, with the random numbers of `key`.
    pub fn new(lights: Option<&'a Lights>, directions: Directions, key: RandomKey) -> Self {
        Self {
            sampler: Sampler {
                lights,
                directions,
                key,
            },
        }
    }

    /// Directions of one receiver.
    pub fn num(&self) -> usize {
        let Directions { plain, to_lights } = self.sampler.directions;
        (plain + to_lights) as usize
    }

    /// Makes those of the `targets` of `receivers`, `[receivers, directions]`, unknown of which
    /// `is_lost` says so, given the target and the ray.
    pub fn forget(
        &self,
        receivers: &[Receiver],
        targets: &mut [u32],
        is_lost: impl Fn(u32, &Ray) -> bool + Sync,
    ) {
        let rows = targets.par_chunks_exact_mut(self.num());
        rows.zip(receivers)
            .with_min_len(64)
            .for_each(|(row, receiver)| {
                for number in 0..row.len() as u32 {
                    let target = &mut row[number as usize];
                    if *target == UNKNOWN {
                        continue;
                    }
                    let direction = self.direction(receiver, number);
                    if direction.is_some_and(|d| is_lost(*target, &receiver.1.ray(d))) {
                        *target = UNKNOWN;
                    }
                }
            });
    }

    /// Traces the unknown ones of the `targets` of `receivers`, `[receivers, directions]`, through
    /// `scene`. Returns the number of rays, which are all in memory at once: many receivers are
    /// better traced in pieces.
    ///
    /// # Errors
    /// If the device of the `scene` gives up.
    pub fn trace(
        &self,
        scene: &dyn Tracer,
        receivers: &[Receiver],
        targets: &mut [u32],
    ) -> Result<u64, TraceError> {
        let num = self.num();
        let groups = receivers.par_chunks(TOGETHER).enumerate();
        let unknown: Vec<Vec<(usize, u32, Ray)>> = groups
            .map(|(group, receivers)| {
                let unknown = self
                    .in_order(receivers)
                    .filter_map(|(at, number, realization)| {
                        let place = (group * TOGETHER + at) * num + number as usize;
                        if targets[place] != UNKNOWN {
                            return None;
                        }
                        let direction = self.direction(&receivers[at], number)?;
                        Some((place, realization, receivers[at].1.ray(direction)))
                    });
                unknown.collect()
            })
            .collect();
        let unknown = unknown.concat();
        let rays: Vec<Ray> = unknown.iter().map(|(.., ray)| *ray).collect();
        let realizations: Vec<u32> = unknown
            .iter()
            .map(|(_, realization, _)| *realization)
            .collect();
        let hits = scene.realization_hits(&rays, &realizations)?;
        for ((place, ..), hit) in unknown.iter().zip(hits) {
            targets[*place] = hit;
        }
        // What is left has nowhere to go.
        for target in targets.iter_mut().filter(|target| **target == UNKNOWN) {
            *target = NOTHING;
        }
        Ok(rays.len() as u64)
    }

    /// The matrix of `receivers`, given all their `targets`, and what Gaussians emit, `None` for
    /// what reflects. No ray is counted. The `weights` of directions that meet emitters are found
    /// where they are 0, and kept for the next time: they are the same as long as receivers and
    /// directions are. Both `[receivers, directions]`.
    pub fn matrix(
        &self,
        receivers: &[Receiver],
        targets: &[u32],
        weights: &mut [f32],
        emitted: impl Fn(u32) -> Option<Vec3> + Sync,
    ) -> TransportMatrix {
        let plain = self.sampler.directions.plain as usize;
        let emitted = |target: u32| (target != NOTHING).then(|| emitted(target)).flatten();
        let rows = targets.par_chunks_exact(self.num());
        let direct = rows
            .clone()
            .zip(weights.par_chunks_exact_mut(self.num()))
            .zip(receivers)
            .with_min_len(64)
            .map(|((row, weights), receiver)| {
                let mut direct = Vec3::ZERO;
                for (_, number, _) in self.in_order(std::slice::from_ref(receiver)) {
                    let Some(light) = emitted(row[number as usize]) else {
                        continue;
                    };
                    let weight = &mut weights[number as usize];
                    if *weight == 0.0
                        && let Some(direction) = self.direction(receiver, number)
                    {
                        *weight = self.sampler.weight(&receiver.1, direction);
                    }
                    direct += light * *weight;
                }
                direct
            })
            .collect();
        let reflects = |&target: &u32| match emitted(target) {
            Some(_) => NOTHING,
            None => target,
        };
        TransportMatrix {
            direct,
            targets: rows
                .flat_map_iter(|row| row[..plain].iter().map(reflects))
                .collect(),
            num_rays: 0,
        }
    }

    /// All directions of `receivers`, in the order in which [`TransportMatrix::trace`] adds up
    /// their light: the place of the receiver, the number of the direction among its own, and the
    /// realization.
    fn in_order(&self, receivers: &[Receiver]) -> impl Iterator<Item = (usize, u32, u32)> {
        let Directions { plain, to_lights } = self.sampler.directions;
        (0..NUM_REALIZATIONS).flat_map(move |realization| {
            receivers
                .iter()
                .enumerate()
                .flat_map(move |(at, (element, _))| {
                    let points = self.sampler.points(*element);
                    let about_normal = Sampler::turn(&points, realization, plain);
                    let to_lights = Sampler::turn(&points, realization, to_lights);
                    about_normal
                        .chain(to_lights.map(move |sample| plain + sample))
                        .map(move |number| (at, number, realization))
                })
        })
    }

    /// One direction of a receiver.
    fn direction(&self, (element, surface): &Receiver, number: u32) -> Option<Vec3> {
        let points = self.sampler.points(*element);
        match number.checked_sub(self.sampler.directions.plain) {
            None => Some(self.sampler.plain(surface, &points, number)),
            Some(sample) => self.sampler.towards_light(surface, &points, sample),
        }
    }
}
