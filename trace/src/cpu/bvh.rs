//! An 8-wide BVH over the discs of Gaussians, for single rays in any direction.
//!
//! The binary tree comes from `obvhs`; it is widened here to nodes whose eight boxes are tested at
//! once, over leaves of up to eight Gaussians tested at once. Moved Gaussians are followed by a
//! refit, until the tree has become so loose that building it again is the better choice.

mod discs;
mod nodes;
mod search;
mod widen;

pub(crate) use discs::{DiscTree, DiscTreeBuilder};
pub(super) use search::uniform_of;
pub use search::{RayScratch, Reach};

use crate::surfel::{Surfel, SurfelSet};
use glam::{Vec3, Vec3A};
use nodes::{EMPTY, Node, WIDTH};
use obvhs::aabb::Aabb;
use widen::{BinaryTree, Topology};

/// A tree is built again when the expected cost of a ray has grown by this factor over refits.
/// Measured on drifting Gaussians a rebuild pays for itself within one frame from about this growth
/// on.
const REBUILD_GROWTH: f32 = 1.5;

/// Growth of boxes, relative to the coordinates' size: covers the rounding of the hit formula (a
/// few units in the last place of 6e-8), so that no hit near a disc's rim is lost by the search.
const BOX_MARGIN: f32 = 4e-7;

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

    /// Follows moved Gaussians: refits the boxes, and builds anew where the tree has become loose
    /// or the number of Gaussians that count has changed. Returns whether it was built anew.
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
        let leaves = &self.leaves;
        nodes::refit(&mut self.nodes, |leaf| leaf_bounds(&leaves[leaf], set));
    }

    fn rebuild(&mut self, set: &SurfelSet) {
        let counted: Vec<u32> = (0..set.len() as u32)
            .filter(|&i| set.surfels[i as usize].cut2 >= 0.0)
            .collect();
        let boxes: Vec<Aabb> = counted
            .iter()
            .map(|&i| disc_bounds(&set.surfels[i as usize]))
            .collect();
        let bounds_of = |i: u32| Some(disc_bounds(&set.surfels[i as usize]));
        let Topology { nodes, leaves } = BinaryTree::new(counted, &boxes, WIDTH).widened(bounds_of);
        self.nodes = nodes;
        self.leaves = leaves.into_iter().map(|i| Leaf::new(set, i)).collect();
        self.refit(set);
        self.cost_when_built = self.cost();
    }

    fn cost(&self) -> f32 {
        nodes::cost(&self.nodes)
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

fn disc_bounds(surfel: &Surfel) -> Aabb {
    bounds_of(surfel, surfel.cut2)
}

/// Bounds of the part of a Gaussian inside `radius_squared`, in standard deviations.
fn bounds_of(surfel: &Surfel, radius_squared: f32) -> Aabb {
    let [a, b] = surfel.extents_within(radius_squared);
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
