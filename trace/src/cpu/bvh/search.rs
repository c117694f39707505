//! Search along single rays: all hits, or one chosen by its weight.

use super::{Bvh, EMPTY, LEAF, Leaf, Node, WIDTH};
use crate::blend::{Blender, Hit, Offered, sort_hits};
use crate::model::{MIN_TRANSMITTANCE, MIN_WEIGHT};
use crate::ray::Ray;
use crate::sums::Sums;
use crate::surfel::{Surfel, SurfelSet, exp_of_negative};
use multiversion::multiversion;

/// Number of hits after which a ray is checked for having become opaque.
const FIRST_PRUNE: usize = 24;

/// Memory that a thread reuses from ray to ray.
#[derive(Debug, Default)]
pub struct RayScratch {
    hits: Vec<Hit>,
    stack: Vec<(f32, u32)>,
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

    /// One hit of `ray`, chosen with the weight it has in the blend; `None` with the probability of meeting nothing. Every hit is accepted
    /// with probability α, and the nearest accepted one is the choice (stochastic transparency, Enderton et al. 2010): no sorting, and the
    /// search ends where the ray does. `seed` makes the choice; rays with the same one share their luck.
    pub fn sample_hit(&self, ray: &Ray, seed: u32, scratch: &mut RayScratch) -> Option<Hit> {
        find_accepted(&self.nodes, &self.leaves, ray, seed, &mut scratch.stack)
    }

    /// Blended sums along `ray`.
    pub fn trace(&self, set: &SurfelSet, ray: &Ray, scratch: &mut RayScratch) -> Sums {
        self.find_hits(ray, Reach::UntilOpaque, scratch);
        scratch.sort();
        let mut blender = Blender::default();
        for hit in &scratch.hits {
            let payload = &set.payloads[hit.index() as usize];
            if blender.offer(hit.t(), hit.alpha, payload, ray.direction) == Offered::Last {
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
    let RayScratch { hits, stack } = scratch;
    hits.clear();
    let mut prune_at = FIRST_PRUNE;
    visit_leaves(nodes, ray, stack, |leaf, t_max| {
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
    stack: &mut Vec<(f32, u32)>,
) -> Option<Hit> {
    let mut nearest: Option<Hit> = None;
    visit_leaves(nodes, ray, stack, |leaf, t_max| {
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

/// A number in [0, 1) for each Gaussian that a ray may meet: the order in which a search finds them does not matter. The mixer is
/// that of Wellons' hash prospector ("lowbias32").
#[inline(always)]
fn uniform_of(seed: u32, index: u32) -> f32 {
    let mut x = seed ^ index.wrapping_mul(0x9e37_79b9);
    x = (x ^ (x >> 16)).wrapping_mul(0x7feb_352d);
    x = (x ^ (x >> 15)).wrapping_mul(0x846c_a68b);
    x ^= x >> 16;
    (x >> 8) as f32 * (1.0 / (1 << 24) as f32)
}

/// Calls `visit` with the leaves along `ray`, nearer ones mostly first, and with the distance beyond which nothing matters any more, which
/// `visit` may lower.
#[inline(always)]
fn visit_leaves(
    nodes: &[Node],
    ray: &Ray,
    stack: &mut Vec<(f32, u32)>,
    mut visit: impl FnMut(usize, &mut f32),
) {
    stack.clear();
    if nodes.is_empty() {
        return;
    }
    // Axis-parallel rays: a huge finite reciprocal keeps 0·∞ out of the slab test.
    let inverse = ray.direction.map(|d| {
        if d.abs() > 1e-20 {
            1.0 / d
        } else {
            1e20_f32.copysign(d)
        }
    });
    let mut t_max = f32::INFINITY;
    stack.push((0.0, 0));
    while let Some((near, child)) = stack.pop() {
        if near > t_max {
            continue;
        }
        if child & LEAF != 0 {
            visit((child & !LEAF) as usize, &mut t_max);
            continue;
        }
        let node = &nodes[child as usize];
        let near = node_distances(node, ray, inverse, t_max);
        push_sorted(stack, node, &near);
    }
}

/// Distances at which the ray enters the eight boxes; infinite where it misses.
#[inline(always)]
fn node_distances(node: &Node, ray: &Ray, inverse: [f32; 3], t_max: f32) -> [f32; WIDTH] {
    let mut near = [0.0; WIDTH];
    let mut far = [t_max; WIDTH];
    for axis in 0..3 {
        for lane in 0..WIDTH {
            let a = (node.min[axis][lane] - ray.origin[axis]) * inverse[axis];
            let b = (node.max[axis][lane] - ray.origin[axis]) * inverse[axis];
            let (low, high) = if a < b { (a, b) } else { (b, a) };
            near[lane] = if low > near[lane] { low } else { near[lane] };
            far[lane] = if high < far[lane] { high } else { far[lane] };
        }
    }
    // Robust slab test (Ize 2013): two roundings of 2⁻²⁴ on either side.
    for lane in 0..WIDTH {
        near[lane] = if near[lane] <= far[lane] * 1.000_000_4 {
            near[lane]
        } else {
            f32::INFINITY
        };
    }
    near
}

/// Pushes the hit children, the nearest last so that it is taken first.
#[inline(always)]
fn push_sorted(stack: &mut Vec<(f32, u32)>, node: &Node, near: &[f32; WIDTH]) {
    let start = stack.len();
    for lane in 0..WIDTH {
        if near[lane] < f32::INFINITY && node.child[lane] != EMPTY {
            let mut at = stack.len();
            stack.push((near[lane], node.child[lane]));
            while at > start && stack[at - 1].0 < near[lane] {
                stack.swap(at, at - 1);
                at -= 1;
            }
        }
    }
}

#[inline(always)]
fn meet_leaf(leaf: &Leaf, ray: &Ray, t_max: f32, mut found: impl FnMut(Hit)) {
    // Plain loops over arrays, with bits gathered afterwards: they become straight SIMD code.
    let mut t = [0.0_f32; WIDTH];
    let mut exponent = [0.0_f32; WIDTH];
    let mut bits = [0_u32; WIDTH];
    for lane in 0..WIDTH {
        let seen = leaf.surfel(lane).seen_from(ray.origin);
        let met = seen.meet(ray.direction);
        t[lane] = met.t;
        exponent[lane] = -0.5 * (met.u * met.u + met.v * met.v);
        let counts = seen.counts(&met) & (met.t <= t_max) & !seen.is_own(&met, ray);
        bits[lane] = u32::from(counts) << lane;
    }
    let mut mask = bits.iter().fold(0, |all, bit| all | bit);
    while mask != 0 {
        let lane = mask.trailing_zeros() as usize;
        mask &= mask - 1;
        let alpha = leaf.opacity[lane] * exp_of_negative(exponent[lane]);
        found(Hit::new(t[lane], leaf.index[lane], alpha));
    }
}

/// Drops the hits behind the one where the ray ends, by the rules of [`Blender`], and returns its distance.
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
