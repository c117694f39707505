//! Trees over opaque discs: the nearest along a ray, and all of them.

use super::nodes::{self, EMPTY, Node, Stack, WIDTH, visit_leaves};
use super::widen::{BinaryTree, Topology};
use super::{RayScratch, bounds_of};
use crate::cpu::lanes::Lanes;
use crate::model::{MIN_COSINE, OWN_COSINE};
use crate::ray::Ray;
use crate::surfel::{Surfel, SurfelSet};
use glam::Vec3;
use multiversion::multiversion;
use obvhs::aabb::Aabb;

/// Up to eight discs as struct of arrays; unused lanes have axes of NaN, which no ray meets.
#[derive(Debug, Clone)]
#[repr(align(64))]
struct DiscLeaf {
    position: [[f32; WIDTH]; 3],
    /// Axes in the plane over the disc's half axes squared: their dot products with an offset from
    /// the centre are 1 at the rim.
    axis_u: [[f32; WIDTH]; 3],
    axis_v: [[f32; WIDTH]; 3],
    index: [u32; WIDTH],
}

/// A tree over discs, elliptic in general, all of one surface and without holes.
#[derive(Debug, Clone)]
pub(crate) struct DiscTree {
    nodes: Vec<Node>,
    leaves: Vec<DiscLeaf>,
}

/// Makes trees over the same discs of several sizes.
pub(crate) struct DiscTreeBuilder<'a> {
    set: &'a SurfelSet,
    tree: BinaryTree,
}

impl<'a> DiscTreeBuilder<'a> {
    /// Groups the Gaussians of `set` by their discs of typical size.
    pub(crate) fn new(set: &'a SurfelSet) -> Self {
        let counted: Vec<u32> = (0..set.len() as u32)
            .filter(|&i| set.surfels[i as usize].cut2 >= 0.0)
            .collect();
        let boxes: Vec<Aabb> = counted
            .iter()
            .map(|&i| {
                let surfel = &set.surfels[i as usize];
                // The mean over all realizations: ∫ 2 ln(σ/u) du = 2σ.
                bounds_of(surfel, (2.0 * surfel.opacity).min(surfel.cut2))
            })
            .collect();
        // How many of neighbours are there differs: leaves are filled in each tree.
        let tree = BinaryTree::new(counted, &boxes, 1);
        Self { set, tree }
    }

    /// The tree in which every disc has its size: `radius_squared` in standard deviations, negative
    /// for a disc that is not there.
    pub(crate) fn build(&self, radius_squared: impl Fn(u32) -> f32) -> DiscTree {
        let radii: Vec<f32> = (0..self.set.len() as u32).map(radius_squared).collect();
        let surfel = |i: u32| &self.set.surfels[i as usize];
        let bounds = |i: u32| {
            let radius_squared = radii[i as usize];
            (radius_squared > 0.0).then(|| bounds_of(surfel(i), radius_squared))
        };
        let Topology { mut nodes, leaves } = self.tree.widened(bounds);
        nodes::refit(&mut nodes, |leaf| {
            let discs = leaves[leaf].into_iter().filter(|&i| i != EMPTY);
            (discs.filter_map(bounds)).fold(Aabb::INVALID, |all, disc| all.union(&disc))
        });
        let disc = |i: u32| (i != EMPTY).then(|| (i, surfel(i), radii[i as usize]));
        let leaves = leaves.into_iter().map(|leaf| DiscLeaf::new(leaf.map(disc)));
        DiscTree {
            nodes,
            leaves: leaves.collect(),
        }
    }
}

impl DiscTree {
    /// Index and distance of the nearest disc along `ray`, ties by index.
    pub(crate) fn nearest(&self, ray: &Ray, scratch: &mut RayScratch) -> Option<(u32, f32)> {
        find_nearest(&self.nodes, &self.leaves, ray, &mut scratch.stack)
    }

    /// Indices of all discs along `ray`, ascending; edge-on ones, too.
    pub(crate) fn all<'a>(&self, ray: &Ray, scratch: &'a mut RayScratch) -> &'a [u32] {
        let RayScratch { discs, stack, .. } = scratch;
        discs.clear();
        find_all(&self.nodes, &self.leaves, ray, stack, discs);
        discs.sort_unstable();
        discs
    }
}

impl DiscLeaf {
    /// Discs by index, shape and squared radius in standard deviations.
    fn new(discs: [Option<(u32, &Surfel, f32)>; WIDTH]) -> Self {
        let nowhere = [[f32::NAN; WIDTH]; 3];
        let mut leaf = Self {
            position: nowhere,
            axis_u: nowhere,
            axis_v: nowhere,
            index: [EMPTY; WIDTH],
        };
        for (lane, disc) in discs.into_iter().enumerate() {
            let Some((index, surfel, radius_squared)) = disc else {
                continue;
            };
            let inverse = 1.0 / radius_squared.sqrt();
            leaf.index[lane] = index;
            for axis in 0..3 {
                leaf.position[axis][lane] = surfel.position[axis];
                leaf.axis_u[axis][lane] = surfel.axis_u[axis] * inverse;
                leaf.axis_v[axis][lane] = surfel.axis_v[axis] * inverse;
            }
        }
        leaf
    }

    /// A normal of a disc, of no particular length.
    #[inline(always)]
    fn normal(&self, lane: usize) -> Vec3 {
        let vector = |of: &[[f32; WIDTH]; 3]| Vec3::new(of[0][lane], of[1][lane], of[2][lane]);
        vector(&self.axis_u).cross(vector(&self.axis_v))
    }

    /// Distances to the eight planes, and the lanes of the discs that lie within `t_max` along
    /// `ray`.
    #[inline(always)]
    fn meet(&self, ray: &Ray, t_max: f32) -> ([f32; WIDTH], Lanes) {
        let mut t = [0.0_f32; WIDTH];
        let mut met = [0_u8; WIDTH];
        let (o, d) = (ray.origin, ray.direction);
        let [px, py, pz] = &self.position;
        let [ux, uy, uz] = &self.axis_u;
        let [vx, vy, vz] = &self.axis_v;
        for i in 0..WIDTH {
            let (x, y, z) = (px[i] - o[0], py[i] - o[1], pz[i] - o[2]);
            let (nx, ny, nz) = (
                uy[i] * vz[i] - uz[i] * vy[i],
                uz[i] * vx[i] - ux[i] * vz[i],
                ux[i] * vy[i] - uy[i] * vx[i],
            );
            let plane = x * nx + y * ny + z * nz;
            let slope = d[0] * nx + d[1] * ny + d[2] * nz;
            t[i] = plane / slope;
            let u = (d[0] * ux[i] + d[1] * uy[i] + d[2] * uz[i]) * t[i]
                - (x * ux[i] + y * uy[i] + z * uz[i]);
            let v = (d[0] * vx[i] + d[1] * vy[i] + d[2] * vz[i]) * t[i]
                - (x * vx[i] + y * vy[i] + z * vz[i]);
            // Comparisons with the NaN of a degenerate or missing disc are false.
            let hit = (u * u + v * v <= 1.0) & (t[i] > 0.0) & (t[i] <= t_max);
            met[i] = u8::from(hit);
        }
        (t, Lanes::new(met))
    }
}

#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512dq+avx512vl",
    "x86_64+avx2",
    "aarch64+neon"
))]
fn find_nearest(
    nodes: &[Node],
    leaves: &[DiscLeaf],
    ray: &Ray,
    stack: &mut Stack,
) -> Option<(u32, f32)> {
    let mut nearest: Option<(u32, f32)> = None;
    let direction = Vec3::from(ray.direction);
    let own_normal = Vec3::from(ray.own_normal);
    visit_leaves(nodes, (ray, f32::INFINITY), stack, |leaf, t_max| {
        let leaf = &leaves[leaf];
        let (t, met) = leaf.meet(ray, *t_max);
        for lane in met {
            let (index, t) = (leaf.index[lane], t[lane]);
            if nearest.is_some_and(|(i, best)| t > best || (t == best && index > i)) {
                continue;
            }
            // The rules of a single hit for which the plane's normal is needed: edge-on, or of the
            // surface the ray leaves from.
            let normal = leaf.normal(lane).normalize_or_zero();
            let is_own = t <= ray.t_min && normal.dot(own_normal).abs() > OWN_COSINE;
            if is_own || normal.dot(direction).abs() <= MIN_COSINE {
                continue;
            }
            nearest = Some((index, t));
            *t_max = t;
        }
    });
    nearest
}

#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512dq+avx512vl",
    "x86_64+avx2",
    "aarch64+neon"
))]
fn find_all(
    nodes: &[Node],
    leaves: &[DiscLeaf],
    ray: &Ray,
    stack: &mut Stack,
    found: &mut Vec<u32>,
) {
    visit_leaves(nodes, (ray, f32::INFINITY), stack, |leaf, t_max| {
        let leaf = &leaves[leaf];
        let (_, met) = leaf.meet(ray, *t_max);
        found.extend(met.map(|lane| leaf.index[lane]));
    });
}
