//! An 8-wide BVH over the discs of Gaussians, for single rays in any direction.
//!
//! The binary tree comes from `obvhs`; it is widened here to nodes whose eight boxes are tested at once, over leaves of
//! up to eight Gaussians tested at once. Moved Gaussians are followed by a refit, until the tree has become so loose that
//! building it again is the better choice.

mod search;

pub use search::{RayScratch, Reach};

use crate::surfel::{Surfel, SurfelSet};
use glam::{Vec3, Vec3A};
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
