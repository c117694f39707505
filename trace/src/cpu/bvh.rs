//! An 8-wide BVH over the discs of Gaussians, for single rays in any direction.
//!
//! The binary tree comes from `obvhs`; it is widened here to nodes whose eight boxes are tested at once, over leaves of
//! up to eight Gaussians tested at once. Moved Gaussians are followed by a refit, until the tree has become so loose that
//! building it again is the better choice.

use crate::blend::{Blender, Hit, Offered, sort_hits};
use crate::model::{MIN_TRANSMITTANCE, MIN_WEIGHT};
use crate::ray::Ray;
use crate::sums::Sums;
use crate::surfel::{Surfel, SurfelSet, exp_of_negative};
use glam::{Vec3, Vec3A};
use multiversion::multiversion;
use obvhs::{BvhBuildParams, aabb::Aabb, bvh2::Bvh2, bvh2::builder::build_bvh2};
use std::time::Duration;

/// Children of a node and Gaussians of a leaf: the lanes of an AVX register.
const WIDTH: usize = 8;
/// Child that does not exist.
const EMPTY: u32 = u32::MAX;
/// Marks children that are leaves; the other bits are the leaf's index.
const LEAF: u32 = 1 << 31;

/// A tree is built again when the expected cost of a ray has grown by this factor over refits. Measured on drifting
/// Gaussians a rebuild pays for itself within one frame from about this growth on.
const REBUILD_GROWTH: f32 = 1.5;

/// Growth of boxes, relative to the coordinates' size: covers the rounding of the hit formula (a few units in the last
/// place of 6e-8), so that no hit near a disc's rim is lost by the search.
const BOX_MARGIN: f32 = 4e-7;

/// Number of hits after which a ray is checked for having become opaque.
const FIRST_PRUNE: usize = 24;

#[derive(Debug, Clone)]
struct Node {
    min: [[f32; WIDTH]; 3],
    max: [[f32; WIDTH]; 3],
    child: [u32; WIDTH],
}

/// Up to eight Gaussians as struct of arrays; unused lanes have a negative `cut2`.
#[derive(Debug, Clone)]
struct Leaf {
    position: [[f32; WIDTH]; 3],
    axis_u: [[f32; WIDTH]; 3],
    axis_v: [[f32; WIDTH]; 3],
    normal: [[f32; WIDTH]; 3],
    opacity: [f32; WIDTH],
    cut2: [f32; WIDTH],
    index: [u32; WIDTH],
}

/// The acceleration structure.
#[derive(Debug, Clone)]
pub struct Bvh {
    /// Parents come before their children; the root is the first.
    nodes: Vec<Node>,
    leaves: Vec<Leaf>,
    cost_when_built: f32,
}

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
    /// Builds the tree.
    pub fn new(set: &SurfelSet) -> Self {
        let mut bvh = Self {
            nodes: Vec::new(),
            leaves: Vec::new(),
            cost_when_built: 0.0,
        };
        bvh.rebuild(set);
        bvh
    }

    /// Follows moved Gaussians: refits the boxes, and builds anew where the tree has become loose or the number of Gaussians
    /// that count has changed. Returns whether it was built anew.
    pub fn update(&mut self, set: &SurfelSet) -> bool {
        let held: usize = self
            .leaves
            .iter()
            .map(|leaf| leaf.index.iter().filter(|&&i| i != EMPTY).count())
            .sum();
        let fits =
            held == set.surfels.iter().filter(|s| s.cut2 >= 0.0).count()
                && self.leaves.iter().flat_map(|leaf| leaf.index).all(|i| {
                    i == EMPTY || set.surfels.get(i as usize).is_some_and(|s| s.cut2 >= 0.0)
                });
        if fits {
            self.refit(set);
            if self.cost() <= REBUILD_GROWTH * self.cost_when_built {
                return false;
            }
        }
        self.rebuild(set);
        true
    }

    /// Recomputes all boxes and leaves without changing the tree.
    pub fn refit(&mut self, set: &SurfelSet) {
        for leaf in &mut self.leaves {
            *leaf = Leaf::new(set, leaf.index);
        }
        let mut boxes = vec![Aabb::INVALID; self.nodes.len()];
        for at in (0..self.nodes.len()).rev() {
            let mut total = Aabb::INVALID;
            for lane in 0..WIDTH {
                let child = self.nodes[at].child[lane];
                if child == EMPTY {
                    continue;
                }
                let bounds = if child & LEAF != 0 {
                    leaf_bounds(&self.leaves[(child & !LEAF) as usize], set)
                } else {
                    boxes[child as usize]
                };
                self.nodes[at].set_box(lane, &bounds);
                total = total.union(&bounds);
            }
            boxes[at] = total;
        }
    }

    fn rebuild(&mut self, set: &SurfelSet) {
        self.nodes.clear();
        self.leaves.clear();
        let counted: Vec<u32> = (0..set.len() as u32)
            .filter(|&i| set.surfels[i as usize].cut2 >= 0.0)
            .collect();
        if counted.is_empty() {
            self.cost_when_built = 0.0;
            return;
        }
        let boxes: Vec<Aabb> = counted
            .iter()
            .map(|&i| disc_bounds(&set.surfels[i as usize]))
            .collect();
        let mut params = BvhBuildParams::slow_build();
        // A Gaussian in two leaves would be hit twice.
        params.pre_split = false;
        params.max_prims_per_leaf = WIDTH as u32;
        let tree = build_bvh2(&boxes, params, &mut Duration::default());
        let mut widener = Widener {
            tree: &tree,
            counted: &counted,
            set,
            bvh: self,
        };
        widener.add_node(0);
        self.refit(set);
        self.cost_when_built = self.cost();
    }

    /// Expected number of boxes and leaves that a random ray touches (surface area heuristic), relative to the root.
    fn cost(&self) -> f32 {
        let mut total = 0.0;
        let mut root = 0.0_f32;
        for (at, node) in self.nodes.iter().enumerate() {
            for lane in 0..WIDTH {
                if node.child[lane] != EMPTY {
                    let extent = Vec3::from(node.max.map(|m| m[lane]))
                        - Vec3::from(node.min.map(|m| m[lane]));
                    let area = extent.x * extent.y + extent.y * extent.z + extent.z * extent.x;
                    total += area;
                    if at == 0 {
                        root += area;
                    }
                }
            }
        }
        total / root.max(f32::MIN_POSITIVE)
    }

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

/// Turns the binary tree into wide nodes, depth first.
struct Widener<'a> {
    tree: &'a Bvh2,
    counted: &'a [u32],
    set: &'a SurfelSet,
    bvh: &'a mut Bvh,
}

impl Widener<'_> {
    /// Adds the wide node of binary node `root` and everything below; returns its index.
    fn add_node(&mut self, root: usize) -> u32 {
        let at = self.bvh.nodes.len();
        self.bvh.nodes.push(Node::EMPTY);
        // Open the child of the largest surface until eight are found: it is the one most rays would open anyway.
        let mut open = vec![root];
        while open.len() < WIDTH {
            let widest = (0..open.len())
                .filter(|&i| !self.tree.nodes[open[i]].is_leaf())
                .max_by(|&a, &b| self.half_area(open[a]).total_cmp(&self.half_area(open[b])));
            let Some(widest) = widest else { break };
            let first = self.tree.nodes[open[widest]].first_index as usize;
            open[widest] = first;
            open.push(first + 1);
        }
        for (lane, binary) in open.into_iter().enumerate() {
            let child = if self.tree.nodes[binary].is_leaf() {
                self.add_leaf(binary)
            } else {
                self.add_node(binary)
            };
            self.bvh.nodes[at].child[lane] = child;
        }
        at as u32
    }

    fn half_area(&self, binary: usize) -> f32 {
        self.tree.nodes[binary].aabb().half_area()
    }

    fn add_leaf(&mut self, binary: usize) -> u32 {
        let node = &self.tree.nodes[binary];
        let first = node.first_index as usize;
        let mut index = [EMPTY; WIDTH];
        let held = &self.tree.primitive_indices[first..first + node.prim_count as usize];
        for (lane, &primitive) in index.iter_mut().zip(held) {
            *lane = self.counted[primitive as usize];
        }
        self.bvh.leaves.push(Leaf::new(self.set, index));
        LEAF | (self.bvh.leaves.len() - 1) as u32
    }
}

impl Node {
    const EMPTY: Self = Self {
        min: [[f32::INFINITY; WIDTH]; 3],
        max: [[f32::NEG_INFINITY; WIDTH]; 3],
        child: [EMPTY; WIDTH],
    };

    fn set_box(&mut self, lane: usize, bounds: &Aabb) {
        for axis in 0..3 {
            self.min[axis][lane] = bounds.min[axis];
            self.max[axis][lane] = bounds.max[axis];
        }
    }
}

impl Leaf {
    fn new(set: &SurfelSet, index: [u32; WIDTH]) -> Self {
        let mut leaf = Self {
            position: [[0.0; WIDTH]; 3],
            axis_u: [[0.0; WIDTH]; 3],
            axis_v: [[0.0; WIDTH]; 3],
            normal: [[0.0; WIDTH]; 3],
            opacity: [0.0; WIDTH],
            cut2: [-1.0; WIDTH],
            index,
        };
        for (lane, &i) in index.iter().enumerate() {
            if i == EMPTY {
                continue;
            }
            let s = &set.surfels[i as usize];
            for axis in 0..3 {
                leaf.position[axis][lane] = s.position[axis];
                leaf.axis_u[axis][lane] = s.axis_u[axis];
                leaf.axis_v[axis][lane] = s.axis_v[axis];
                leaf.normal[axis][lane] = s.normal[axis];
            }
            leaf.opacity[lane] = s.opacity;
            leaf.cut2[lane] = s.cut2;
        }
        leaf
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

fn disc_bounds(surfel: &Surfel) -> Aabb {
    let [a, b] = surfel.extents();
    let center = Vec3::from(surfel.position);
    let half = (a * a + b * b).map(f32::sqrt) + (center.abs() + a.abs() + b.abs()) * BOX_MARGIN;
    Aabb::new(Vec3A::from(center - half), Vec3A::from(center + half))
}

fn leaf_bounds(leaf: &Leaf, set: &SurfelSet) -> Aabb {
    leaf.index
        .iter()
        .filter(|&&i| i != EMPTY)
        .fold(Aabb::INVALID, |bounds, &i| {
            bounds.union(&disc_bounds(&set.surfels[i as usize]))
        })
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
