//! Realizations of a scene: Gaussians by chance turned into opaque discs, for rays of which the
//! mean alone matters.
//!
//! Of a blend, one hit can stand for all: accept each with probability α and take the nearest
//! accepted one (stochastic transparency, Enderton et al. 2010). It is then met with the weight
//! that it has in the blend. The number that decides, u, can be realized for each Gaussian before
//! any ray is known: where `α = σ·exp(−r²/2) > u`, the Gaussian is there, elsewhere it is not. That
//! is an opaque disc of radius `r = √(2 ln(σ/u))`, or nothing if `u ≥ σ`; its mean area is 2πσ in
//! standard deviations where the footprint that a blend has to search has up to 9π. A ray through a
//! realization is a search for the nearest of few small discs: no exponential, no sorting, no list.
//!
//! There are [`NUM_REALIZATIONS`] realizations, and rays take them in turn. The numbers of one
//! Gaussian are stratified over the realizations, those of different Gaussians independent, so that
//! a ray through a random realization has the mean of the blend. The realizations are the same for
//! all rays: what they get wrong for one pair of overlapping discs does not go away with more rays,
//! but with the number of discs that light comes from.

use super::bvh::{DiscTree, DiscTreeBuilder, RayScratch, uniform_of};
use crate::ray::Ray;
use crate::surfel::{Surfel, SurfelSet};
use std::panic::resume_unwind;

/// Number of realizations: a power of two. What is left of the noise of a single edge is a
/// sixteenth of a step at most; the trees of all realizations together take at most 1 KiB for each
/// Gaussian.
pub const NUM_REALIZATIONS: u32 = 16;

/// Seed of an engine's realizations: scenes of the same Gaussians have the same ones.
pub(crate) const SCENE_SEED: u32 = 0;

/// Keeps the numbers of realizations apart from others of the same hash.
const OFFSET_SEED: u32 = 0x5bd1_e995;

/// The hit that stands for all of a ray.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SampledHit {
    /// Index of the Gaussian.
    pub index: u32,
    /// Distance along the ray.
    pub t: f32,
}

/// Trees over the realizations of a scene.
#[derive(Debug, Clone)]
pub struct Realizations {
    seed: u32,
    trees: Vec<DiscTree>,
}

impl Realizations {
    /// Realizations from `set`; another `seed` gives other realizations.
    pub fn new(set: &SurfelSet, seed: u32) -> Self {
        let builder = DiscTreeBuilder::new(set);
        let tree = |&realization: &u32| {
            builder
                .build(|i| realized_radius_squared(&set.surfels[i as usize], i, seed, realization))
        };
        let realizations: Vec<u32> = (0..NUM_REALIZATIONS).collect();
        let for_each = realizations.len().div_ceil(rayon::current_num_threads());
        // Not on the threads of the pool: scenes make their realizations when the first ray asks
        // for one, perhaps on one of them while the others wait.
        let trees = std::thread::scope(|scope| {
            let threads: Vec<_> = (realizations.chunks(for_each))
                .map(|some| scope.spawn(|| some.iter().map(tree).collect::<Vec<_>>()))
                .collect();
            let built = (threads.into_iter())
                .map(|thread| thread.join().unwrap_or_else(|panic| resume_unwind(panic)));
            built.flatten().collect()
        });
        Self { seed, trees }
    }

    /// The first hit of `ray` in realization `realization` modulo [`NUM_REALIZATIONS`].
    pub fn nearest(
        &self,
        ray: &Ray,
        realization: u32,
        scratch: &mut RayScratch,
    ) -> Option<SampledHit> {
        let hit = self.trees[(realization % NUM_REALIZATIONS) as usize].nearest(ray, scratch)?;
        Some(SampledHit {
            index: hit.0,
            t: hit.1,
        })
    }

    /// Squared radius, in standard deviations, of Gaussian `i` of `set` in a realization; negative
    /// if it is not there.
    pub fn radius_squared(&self, set: &SurfelSet, i: u32, realization: u32) -> f32 {
        realized_radius_squared(
            &set.surfels[i as usize],
            i,
            self.seed,
            realization % NUM_REALIZATIONS,
        )
    }
}

/// Squared radius, in standard deviations, of Gaussian `i` in one of [`NUM_REALIZATIONS`]
/// realizations; negative if it is not there.
pub(crate) fn realized_radius_squared(surfel: &Surfel, i: u32, seed: u32, realization: u32) -> f32 {
    let offset = (uniform_of(seed ^ OFFSET_SEED, i) * NUM_REALIZATIONS as f32) as u32;
    let stratum = (realization + offset) % NUM_REALIZATIONS;
    let jitter = uniform_of(
        seed.wrapping_mul(NUM_REALIZATIONS)
            .wrapping_add(realization),
        i,
    );
    let u = (stratum as f32 + jitter) / NUM_REALIZATIONS as f32;
    if u < surfel.opacity {
        (2.0 * (surfel.opacity / u).ln()).min(surfel.cut2)
    } else {
        -1.0
    }
}
