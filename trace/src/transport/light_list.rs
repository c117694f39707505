//! Emitters of a scene as the receivers of the transport matrix choose among them.
//!
//! A direction of the matrix meets one realization of the scene, in which emitters are opaque discs
//! of known size. Light samples go to points spread evenly over the discs that are there, so that
//! each finds light where nothing is in its way. Discs are grouped into clusters, at most
//! `MAX_CLUSTERS`, of what lies close together. A receiver weighs each cluster by what it may get
//! from there, luminance · area · cosines over the squared distance (light lists and cuts: Walter
//! et al. 2005, "Lightcuts"); within a cluster, discs are chosen by luminance · area. One
//! stratified number picks cluster and disc in the order of the list, in which neighbours in space
//! follow each other: every lamp gets its share of the samples, from all over it.
//!
//! Paths choose among the same clusters, those on blended rays by their footprints (`footprints`).

mod clusters;
mod disc;
mod footprints;

use crate::cpu::bvh::{Bvh, DiscTree, DiscTreeBuilder, RayScratch};
use crate::ray::Ray;
use crate::surfel::{Surfel, SurfelSet};
use crate::transport::EMISSION_THRESHOLD;
use crate::transport::start::Surface;
pub(crate) use clusters::{Cluster, MAX_CLUSTERS};
pub(crate) use disc::Disc;
use disc::REALIZATIONS;
use eagpt_scene::color::luminance;
use glam::Vec3;
use std::cell::RefCell;

thread_local! {
    static SCRATCH: RefCell<RayScratch> = RefCell::default();
}

/// The emissive Gaussians of a scene, in clusters.
#[derive(Debug, Clone)]
pub struct LightList {
    clusters: Vec<Cluster>,
    /// Powers of the clusters in each realization, and of their footprints: in rows, of which sums
    /// are quick.
    powers: Vec<Powers>,
    discs: Vec<Disc>,
    /// Those of `discs`, as large as the largest of all realizations.
    set: SurfelSet,
    /// Over the discs of each realization.
    trees: Vec<DiscTree>,
    /// Over the footprints.
    footprints: Bvh,
}

/// Power of each cluster; of those that are not there, none.
type Powers = [f32; MAX_CLUSTERS];

/// Row of the powers of footprints, behind those of the realizations.
const FOOTPRINTS: usize = REALIZATIONS;

/// Light that a receiver may get of each cluster, relative to its luminance times area.
pub type Importances = [f32; MAX_CLUSTERS];

impl Disc {
    /// Density over solid angle, up to a factor, of a direction that meets the disc's plane at the
    /// distance `t` by that cosine.
    fn weight(&self, importances: &Importances, t: f32, cosine: f32) -> f32 {
        importances[self.cluster as usize] * self.luminance * t * t / cosine.abs()
    }
}

impl LightList {
    /// The emitters of `set`, or `None` if there are none that shine.
    pub fn new(set: &SurfelSet) -> Option<Self> {
        let mut emitters: Vec<(Disc, Surfel)> = (0..)
            .zip(set.surfels.iter().zip(&set.attributes))
            .filter(|(_, (_, attributes))| attributes.emission() > EMISSION_THRESHOLD)
            .map(|(i, (surfel, attributes))| {
                let light = luminance(attributes.radiance().to_array());
                let disc = Disc::new(i, surfel, light);
                let largest = disc.radii.iter().fold(-1.0_f32, |most, &r| most.max(r));
                let surfel = Surfel {
                    cut2: largest,
                    ..*surfel
                };
                (disc, surfel)
            })
            .filter(|(disc, surfel)| disc.luminance > 0.0 && surfel.cut2 > 0.0)
            .collect();
        if emitters.is_empty() {
            return None;
        }
        let mut clusters = clusters::divide(&mut emitters);
        for (number, cluster) in (0..).zip(&mut clusters) {
            let mut sums = [0.0; REALIZATIONS];
            let mut footprints = 0.0;
            for (disc, surfel) in &mut emitters[cluster.range()] {
                disc.cluster = number;
                footprints += disc.footprint_power(surfel);
                disc.cumulative_footprint = footprints;
                for (realization, sum) in sums.iter_mut().enumerate() {
                    *sum += disc.power(surfel, realization);
                }
                disc.cumulative = sums;
            }
            cluster.powers = sums;
            cluster.footprint_power = footprints;
        }
        let footprint = |(disc, surfel): &(Disc, Surfel)| Surfel {
            cut2: disc.cut2,
            ..*surfel
        };
        let footprints = Bvh::new(&SurfelSet {
            surfels: emitters.iter().map(footprint).collect(),
            ..SurfelSet::default()
        });
        let (discs, surfels): (Vec<Disc>, Vec<Surfel>) = emitters.into_iter().unzip();
        // On one thread: a scene makes its list when it is first needed, perhaps by one of many
        // threads, and the others wait for it.
        let set = SurfelSet {
            surfels,
            ..SurfelSet::default()
        };
        let mut powers = vec![[0.0; MAX_CLUSTERS]; REALIZATIONS + 1];
        for (number, cluster) in clusters.iter().enumerate() {
            for (row, power) in powers.iter_mut().zip(cluster.powers) {
                row[number] = power;
            }
            powers[FOOTPRINTS][number] = cluster.footprint_power;
        }
        let builder = DiscTreeBuilder::new(&set);
        let tree = |realization: usize| builder.build(|i| discs[i as usize].radii[realization]);
        Some(Self {
            trees: (0..REALIZATIONS).map(tree).collect(),
            clusters,
            powers,
            discs,
            footprints,
            set,
        })
    }

    /// The clusters, and the discs in their order, for kernels.
    #[cfg(feature = "gpu")]
    pub(crate) fn parts(&self) -> (&[Cluster], impl Iterator<Item = (&Disc, &Surfel)>) {
        (&self.clusters, self.discs.iter().zip(&self.set.surfels))
    }

    /// Light that a receiver may get of each cluster.
    pub fn importances(&self, receiver: &Surface) -> Importances {
        let mut importances = [0.0; MAX_CLUSTERS];
        for (importance, cluster) in importances.iter_mut().zip(&self.clusters) {
            *importance = cluster.importance(receiver);
        }
        importances
    }

    /// Sum over the clusters of importance times power, of a row of powers.
    fn total(&self, importances: &Importances, row: usize) -> f32 {
        // Several sums beside each other: each addition waits for the one before.
        let mut sums = [0.0; 8];
        let (powers, _) = self.powers[row].as_chunks::<8>();
        let (importances, _) = importances.as_chunks::<8>();
        for (importances, powers) in importances.iter().zip(powers) {
            for k in 0..8 {
                sums[k] += importances[k] * powers[k];
            }
        }
        sums.iter().sum()
    }

    /// An emitter by importance times power, by `pick` in [0, 1), of a row of powers; `cumulative`
    /// is that of the discs of its cluster up to one. `None` if nothing shines.
    fn choose(
        &self,
        importances: &Importances,
        pick: f32,
        row: usize,
        cumulative: impl Fn(&Disc) -> f32,
    ) -> Option<(&Disc, &Surfel)> {
        let mut left = pick * self.total(importances, row);
        let mut chosen = None;
        let shares = importances.iter().zip(&self.powers[row]);
        for (number, (importance, power)) in shares.enumerate() {
            let share = importance * power;
            if share > 0.0 {
                // Rounding may leave a little at the end.
                chosen = Some((number, left));
                if left < share {
                    break;
                }
            }
            left -= share;
        }
        let (number, left) = chosen?;
        let left = left / importances[number];
        let cluster = &self.clusters[number];
        let discs = &self.discs[cluster.range()];
        let number = discs
            .partition_point(|disc| cumulative(disc) <= left)
            .min(discs.len() - 1);
        let surfel = &self.set.surfels[cluster.first as usize + number];
        Some((&discs[number], surfel))
    }

    /// A unit direction from `origin` to a random point of a random emitter in `realization`;
    /// `None` if nothing shines that it may see. `pick` chooses the emitter, `a` and `b` the point;
    /// all in [0, 1).
    pub fn sample(
        &self,
        importances: &Importances,
        realization: u32,
        origin: Vec3,
        [pick, a, b]: [f32; 3],
    ) -> Option<Vec3> {
        let realization = realization as usize;
        let cumulative = |disc: &Disc| disc.cumulative[realization];
        let (disc, surfel) = self.choose(importances, pick, realization, cumulative)?;
        let radius = (a * disc.radii[realization].max(0.0)).sqrt();
        (disc.point(surfel, radius, b) - origin).try_normalize()
    }

    /// Density over solid angle with which [`Self::sample`] chooses unit `direction`: every emitter
    /// along the ray could have been the one.
    pub fn density(
        &self,
        importances: &Importances,
        realization: u32,
        origin: Vec3,
        direction: Vec3,
    ) -> f32 {
        let realization = realization as usize;
        let ray = Ray::free(origin.to_array(), direction.to_array());
        let sum: f32 = SCRATCH.with_borrow_mut(|scratch| {
            let met = self.trees[realization].all(&ray, scratch).iter();
            met.map(|&i| {
                let disc = &self.discs[i as usize];
                let mut seen = self.set.surfels[i as usize].seen_from(ray.origin);
                // That the disc is met the tree knows, as that of the scene does. Other roundings
                // at its rim would give what a BSDF sample has met there the density 0, and with it
                // the weight of a light that no light sample finds.
                seen.cut2 = f32::INFINITY;
                let hit = seen.meet(ray.direction);
                if seen.counts(&hit) {
                    disc.weight(importances, hit.t, hit.cosine)
                } else {
                    0.0
                }
            })
            .sum()
        });
        if sum > 0.0 {
            sum / self.total(importances, realization)
        } else {
            0.0
        }
    }
}

#[cfg(test)]
mod tests;
