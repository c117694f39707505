//! Light of each of several groups of emitters, all from the entries of one matrix: light is linear
//! in its causes, and one look at an entry serves all groups.

use super::{Directions, Tracing, TransportMatrix};
use glam::Vec3;
use rayon::prelude::*;

/// Emitters in groups.
#[derive(Debug, Clone, Copy)]
pub struct Groups<'a> {
    /// Number of groups.
    pub num: usize,
    /// Group of each Gaussian, `[n]`, below `num`; of those that do not emit it does not count.
    pub of: &'a [u32],
}

impl TransportMatrix {
    /// [`Self::direct`] of each group of emitters, `[receivers, groups]`, where all Gaussians have
    /// the light `radiances`, `[n]`. The sum over groups is what [`Self::relight`] gives, within
    /// rounding.
    pub fn direct_of_groups(
        &self,
        tracing: &Tracing<'_>,
        radiances: &[Vec3],
        groups: Groups<'_>,
    ) -> Vec<Vec3> {
        let mut direct = vec![Vec3::ZERO; tracing.receivers.len() * groups.num];
        let rows = direct.par_chunks_exact_mut(groups.num.max(1)).enumerate();
        rows.with_min_len(64).for_each(|(at, row)| {
            self.each_emitter(tracing, at, |emitter, weight| {
                row[groups.of[emitter] as usize] += radiances[emitter] * weight;
            });
        });
        direct
    }

    /// [`Self::from_others`] of each of `num` lights: `radiances` and the result are
    /// `[n, num]` and `[receivers, num]`.
    pub fn from_others_of_groups(
        &self,
        directions: Directions,
        radiances: &[Vec3],
        num: usize,
    ) -> Vec<Vec3> {
        let bsdf = directions.bsdf as usize;
        let mut light = vec![Vec3::ZERO; num * self.direct.len()];
        let rows = (
            light.par_chunks_exact_mut(num.max(1)),
            self.targets.par_chunks_exact(bsdf),
        );
        let rows = rows.into_par_iter().enumerate().with_min_len(256);
        rows.for_each(|(at, (row, targets))| {
            for &target in targets {
                // Neither `NOTHING` nor what has `EMITTER` is an index.
                let Some(met) = radiances
                    .get(target as usize * num..)
                    .filter(|r| r.len() >= num)
                else {
                    continue;
                };
                for (sum, radiance) in row.iter_mut().zip(met) {
                    *sum += *radiance;
                }
            }
            for sum in &mut *row {
                *sum /= bsdf as f32;
            }
            for &(met, weight) in self.bright.row(at) {
                let met = &radiances[met as usize * num..][..num];
                for (sum, radiance) in row.iter_mut().zip(met) {
                    *sum += *radiance * weight;
                }
            }
        });
        light
    }
}
