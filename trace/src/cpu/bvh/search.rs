//! Search along single rays: all hits, or one chosen by its weight.

use super::nodes::{Node, Stack, WIDTH, visit_leaves};
use super::{Bvh, Leaf};
use crate::blend::{BlendStatus, Blender, GlossBlend, Hit, sort_hits};
use crate::cpu::lanes::Lanes;
use crate::features::Features;
use crate::model::{FREE, MIN_TRANSMITTANCE, MIN_WEIGHT};
use crate::ray::Ray;
use crate::surfel::{Surfel, SurfelSet, exp_of_negative};
use eagpt_scene::Gloss;
use multiversion::multiversion;

/// Number of hits after which a ray is checked for having become opaque.
const FIRST_PRUNE: usize = 24;

/// Memory that a thread reuses from ray to ray.
#[derive(Debug, Default)]
pub struct RayScratch {
    hits: Vec<Hit>,
    /// Discs that the last search of a [`super::DiscTree`] has met.
    pub(super) discs: Vec<u32>,
    pub(super) stack: Stack,
}

/// How far a search goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reach {
    /// Up to where the ray is opaque.
    UntilOpaque,
    /// All the way, through everything.
    Everything,
}

impl RayScratch {
    /// Sorts the hits of the last search front to back.
    pub fn sort(&mut self) {
        sort_hits(&mut self.hits);
    }

    /// The hits of the last search, in no order unless sorted.
    pub fn hits(&self) -> &[Hit] {
        &self.hits
    }
}

impl Bvh {
    /// Finds all hits of `ray` within `reach`; see [`RayScratch::hits`].
    pub fn find_hits(&self, ray: &Ray, reach: Reach, scratch: &mut RayScratch) {
        find_hits(&self.nodes, &self.leaves, ray, reach, scratch);
    }

    /// One hit of `ray`, chosen with the weight it has in the blend; `None` with the probability of
    /// meeting nothing. Every hit is accepted with probability α, and the nearest accepted one is
    /// the choice (stochastic transparency, Enderton et al. 2010): no sorting, and the search ends
    /// where the ray does. `seed` makes the choice; rays with the same one make the same choices.
    pub fn sample_hit(&self, ray: &Ray, seed: u32, scratch: &mut RayScratch) -> Option<Hit> {
        find_accepted(&self.nodes, &self.leaves, ray, seed, &mut scratch.stack)
    }

    /// Whether more than half of the light passes along `ray` up to a `distance`: hits in any order,
    /// no further than that, and no more of them than it takes.
    pub fn is_free(&self, ray: &Ray, distance: f32, scratch: &mut RayScratch) -> bool {
        passes_half(
            &self.nodes,
            &self.leaves,
            (ray, distance),
            &mut scratch.stack,
        )
    }

    /// Composited features along `ray`.
    pub fn trace(&self, set: &SurfelSet, ray: &Ray, scratch: &mut RayScratch) -> Features {
        self.blend(set, ray, scratch, |_, _| {})
    }

    /// As [`Self::trace`], with the specular part of what is met, `set` being glossy.
    pub fn trace_glossy(
        &self,
        set: &SurfelSet,
        ray: &Ray,
        scratch: &mut RayScratch,
    ) -> (Features, Gloss) {
        let mut gloss = GlossBlend::default();
        let features = self.blend(set, ray, scratch, |index, weight| {
            gloss.add(weight, &set.gloss[index as usize]);
        });
        (features, gloss.finish(features.alpha()))
    }

    /// Composited features along `ray`; `blended` hears of the index and weight of each hit.
    #[inline(always)]
    fn blend(
        &self,
        set: &SurfelSet,
        ray: &Ray,
        scratch: &mut RayScratch,
        mut blended: impl FnMut(u32, f32),
    ) -> Features {
        self.find_hits(ray, Reach::UntilOpaque, scratch);
        scratch.sort();
        let mut blender = Blender::default();
        for hit in &scratch.hits {
            let attributes = &set.attributes[hit.index() as usize];
            let weight = blender.transmittance() * hit.alpha;
            let status = blender.accumulate(hit.t(), hit.alpha, attributes, ray.direction);
            if status != BlendStatus::Skipped {
                blended(hit.index(), weight);
            }
            if status == BlendStatus::Last {
                break;
            }
        }
        blender.finish()
    }
}

impl Leaf {
    #[inline(always)]
    fn surfel(&self, lane: usize) -> Surfel {
        let vector = |of: &[[f32; WIDTH]; 3]| [of[0][lane], of[1][lane], of[2][lane]];
        Surfel {
            position: vector(&self.position),
            opacity: self.opacity[lane],
            axis_u: vector(&self.axis_u),
            cut2: self.cut2[lane],
            axis_v: vector(&self.axis_v),
            size: 0.0,
            normal: vector(&self.normal),
            padding: 0.0,
        }
    }
}

#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512dq+avx512vl",
    "x86_64+avx2",
    "aarch64+neon"
))]
fn find_hits(nodes: &[Node], leaves: &[Leaf], ray: &Ray, reach: Reach, scratch: &mut RayScratch) {
    let RayScratch { hits, stack, .. } = scratch;
    hits.clear();
    let mut prune_at = FIRST_PRUNE;
    visit_leaves(nodes, (ray, f32::INFINITY), stack, |leaf, t_max| {
        meet_leaf(&leaves[leaf], ray, *t_max, |hit| hits.push(hit));
        if reach == Reach::UntilOpaque && hits.len() >= prune_at {
            *t_max = prune(hits);
            prune_at = 2 * hits.len().max(FIRST_PRUNE / 2);
        }
    });
}

#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512dq+avx512vl",
    "x86_64+avx2",
    "aarch64+neon"
))]
fn find_accepted(
    nodes: &[Node],
    leaves: &[Leaf],
    ray: &Ray,
    seed: u32,
    stack: &mut Stack,
) -> Option<Hit> {
    let mut nearest: Option<Hit> = None;
    visit_leaves(nodes, (ray, f32::INFINITY), stack, |leaf, t_max| {
        meet_leaf(&leaves[leaf], ray, *t_max, |hit| {
            let is_nearer = nearest.is_none_or(|so_far| hit.is_before(&so_far));
            if is_nearer && uniform_of(seed, hit.index()) < hit.alpha {
                nearest = Some(hit);
                *t_max = hit.t();
            }
        });
    });
    nearest
}

#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512dq+avx512vl",
    "x86_64+avx2",
    "aarch64+neon"
))]
fn passes_half(nodes: &[Node], leaves: &[Leaf], to: (&Ray, f32), stack: &mut Stack) -> bool {
    let mut passed = 1.0;
    visit_leaves(nodes, to, stack, |leaf, t_max| {
        meet_leaf(&leaves[leaf], to.0, *t_max, |hit| passed *= 1.0 - hit.alpha);
        if passed <= FREE {
            *t_max = f32::NEG_INFINITY;
        }
    });
    passed > FREE
}

/// A number in [0, 1) for each Gaussian that a ray may meet: the order in which a search finds them
/// does not matter. The mixer is that of Wellons' hash prospector ("lowbias32").
#[inline(always)]
pub(in crate::cpu) fn uniform_of(seed: u32, index: u32) -> f32 {
    let mut x = seed ^ index.wrapping_mul(0x9e37_79b9);
    x = (x ^ (x >> 16)).wrapping_mul(0x7feb_352d);
    x = (x ^ (x >> 15)).wrapping_mul(0x846c_a68b);
    x ^= x >> 16;
    (x >> 8) as f32 * (1.0 / (1 << 24) as f32)
}

#[inline(always)]
fn meet_leaf(leaf: &Leaf, ray: &Ray, t_max: f32, mut found: impl FnMut(Hit)) {
    // Plain loops over arrays, with the lanes that count gathered afterwards: they become straight
    // SIMD code.
    let mut t = [0.0_f32; WIDTH];
    let mut exponent = [0.0_f32; WIDTH];
    let mut counted = [0_u8; WIDTH];
    for lane in 0..WIDTH {
        let seen = leaf.surfel(lane).seen_from(ray.origin);
        let met = seen.meet(ray.direction);
        t[lane] = met.t;
        exponent[lane] = -0.5 * (met.u * met.u + met.v * met.v);
        let counts = seen.counts(&met) & (met.t <= t_max) & !seen.is_own(&met, ray);
        counted[lane] = u8::from(counts);
    }
    for lane in Lanes::new(counted) {
        let alpha = leaf.opacity[lane] * exp_of_negative(exponent[lane]);
        found(Hit::new(t[lane], leaf.index[lane], alpha));
    }
}

/// Drops the hits behind the one where the ray ends, by the rules of [`Blender`], and returns its
/// distance.
fn prune(hits: &mut Vec<Hit>) -> f32 {
    sort_hits(hits);
    let mut transmittance = 1.0_f32;
    for (i, hit) in hits.iter().enumerate() {
        if transmittance * hit.alpha < MIN_WEIGHT {
            continue;
        }
        transmittance *= 1.0 - hit.alpha;
        if transmittance < MIN_TRANSMITTANCE {
            let t = hit.t();
            hits.truncate(i + 1);
            return t;
        }
    }
    f32::INFINITY
}
