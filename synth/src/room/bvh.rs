//! A small bounding-volume hierarchy.

use super::shape::{Crossing, Shape};
use glam::Vec3;

/// Shapes in a leaf, at most.
const LEAF: usize = 2;
/// From this depth on shapes are halved, whatever it costs: 2^32 of them are done after as many
/// levels again.
const HALVE_FROM: usize = 32;
/// Deepest tree.
const MAX_DEPTH: usize = 2 * HALVE_FROM;

/// A tree over shapes, which it refers to by their index.
#[derive(Debug, Clone)]
pub(crate) struct Bvh {
    nodes: Vec<Node>,
    order: Vec<u32>,
}

#[derive(Debug, Clone, Copy)]
struct Node {
    low: Vec3,
    high: Vec3,
    /// First shape of a leaf, or the second child; the first child follows its parent.
    next: u32,
    /// Shapes in a leaf; 0 for inner nodes.
    num: u32,
}

impl Bvh {
    /// Builds the tree: splits are where the surface area heuristic is cheapest, over all places
    /// along all axes.
    pub(crate) fn new(shapes: &[Shape]) -> Self {
        let bounds: Vec<[Vec3; 2]> = shapes.iter().map(Shape::bounds).collect();
        let mut order: Vec<u32> = (0..shapes.len() as u32).collect();
        let mut nodes = Vec::with_capacity(2 * shapes.len());
        build(
            &bounds,
            &mut order,
            Place { first: 0, depth: 0 },
            &mut nodes,
        );
        Self { nodes, order }
    }

    /// The nearest crossing within `range`, and the index of its shape.
    pub(crate) fn nearest(
        &self,
        shapes: &[Shape],
        origin: Vec3,
        direction: Vec3,
        mut range: [f32; 2],
    ) -> Option<(u32, Crossing)> {
        let mut best = None;
        self.visit(origin, direction, range[1], |index, reach| {
            if let Some(crossing) = shapes[index as usize].meet(origin, direction, range) {
                range[1] = crossing.distance;
                *reach = crossing.distance;
                best = Some((index, crossing));
            }
            true
        });
        best
    }

    /// Whether nothing is met within `range`.
    pub(crate) fn is_free(
        &self,
        shapes: &[Shape],
        origin: Vec3,
        direction: Vec3,
        range: [f32; 2],
    ) -> bool {
        let mut free = true;
        self.visit(origin, direction, range[1], |index, _| {
            free = shapes[index as usize]
                .meet(origin, direction, range)
                .is_none();
            free
        });
        free
    }

    /// Calls `shape` with all shapes whose leaves the ray passes through, the nearer children
    /// first, until it returns false. It may shorten the reach.
    #[inline]
    fn visit(
        &self,
        origin: Vec3,
        direction: Vec3,
        mut reach: f32,
        mut shape: impl FnMut(u32, &mut f32) -> bool,
    ) {
        let inverse = direction.recip();
        let mut stack = [0_u32; MAX_DEPTH];
        let mut height = 0;
        let mut at = 0_u32;
        if self.nodes.is_empty() || self.nodes[0].enter(origin, inverse, reach).is_none() {
            return;
        }
        loop {
            let node = &self.nodes[at as usize];
            if node.num > 0 {
                for slot in node.next..node.next + node.num {
                    if !shape(self.order[slot as usize], &mut reach) {
                        return;
                    }
                }
            } else {
                let (left, right) = (at + 1, node.next);
                let enter = |child: u32| self.nodes[child as usize].enter(origin, inverse, reach);
                match (enter(left), enter(right)) {
                    (Some(a), Some(b)) => {
                        let (near, far) = if a <= b { (left, right) } else { (right, left) };
                        stack[height] = far;
                        height += 1;
                        at = near;
                        continue;
                    }
                    (Some(_), None) => {
                        at = left;
                        continue;
                    }
                    (None, Some(_)) => {
                        at = right;
                        continue;
                    }
                    (None, None) => {}
                }
            }
            // A waiting node may be behind a hit that was found since.
            loop {
                if height == 0 {
                    return;
                }
                height -= 1;
                at = stack[height];
                if self.nodes[at as usize]
                    .enter(origin, inverse, reach)
                    .is_some()
                {
                    break;
                }
            }
        }
    }
}

impl Node {
    /// Distance at which the ray enters, if it does before `reach`.
    #[inline]
    fn enter(&self, origin: Vec3, inverse: Vec3, reach: f32) -> Option<f32> {
        let a = (self.low - origin) * inverse;
        let b = (self.high - origin) * inverse;
        let enter = a.min(b).max_element().max(0.0);
        let leave = a.max(b).min_element().min(reach);
        (enter <= leave).then_some(enter)
    }
}

/// Place of a node in the tree.
#[derive(Clone, Copy)]
struct Place {
    /// Its first shape in the order.
    first: usize,
    depth: usize,
}

fn build(bounds: &[[Vec3; 2]], order: &mut [u32], place: Place, nodes: &mut Vec<Node>) {
    let Some([low, high]) = union(bounds, order) else {
        return;
    };
    let at = nodes.len();
    // Flat shapes have flat boxes, in whose plane a ray may run: a little air on all sides.
    let air = Vec3::splat(1e-4);
    nodes.push(Node {
        low: low - air,
        high: high + air,
        next: place.first as u32,
        num: order.len() as u32,
    });
    if order.len() <= LEAF {
        return;
    }
    let split = if place.depth < HALVE_FROM {
        best_split(bounds, order)
    } else {
        order.len() / 2
    };
    let (left, right) = order.split_at_mut(split);
    let depth = place.depth + 1;
    let child = |first| Place { first, depth };
    build(bounds, left, child(place.first), nodes);
    nodes[at].next = nodes.len() as u32;
    nodes[at].num = 0;
    build(bounds, right, child(place.first + split), nodes);
}

fn union(bounds: &[[Vec3; 2]], order: &[u32]) -> Option<[Vec3; 2]> {
    let boxes = order.iter().map(|&index| bounds[index as usize]);
    boxes.reduce(|[low, high], [l, h]| [low.min(l), high.max(h)])
}

/// Sorts `order` along the best axis and returns how many come first.
fn best_split(bounds: &[[Vec3; 2]], order: &mut [u32]) -> usize {
    let sort = |order: &mut [u32], axis: usize| {
        let middle =
            |index: &u32| bounds[*index as usize][0][axis] + bounds[*index as usize][1][axis];
        order.sort_by(|a, b| middle(a).total_cmp(&middle(b)).then(a.cmp(b)));
    };
    let (mut best, mut cheapest) = ((0, order.len() / 2), f32::INFINITY);
    for axis in 0..3 {
        sort(order, axis);
        let left = areas(bounds, order.iter());
        let right = areas(bounds, order.iter().rev());
        for split in 1..order.len() {
            let rest = order.len() - split;
            let cost = left[split - 1] * split as f32 + right[rest - 1] * rest as f32;
            if cost < cheapest {
                (best, cheapest) = ((axis, split), cost);
            }
        }
    }
    sort(order, best.0);
    best.1
}

/// Areas of the boxes around the first shapes, for any number of them.
fn areas<'a>(bounds: &[[Vec3; 2]], order: impl Iterator<Item = &'a u32>) -> Vec<f32> {
    let mut around = [Vec3::INFINITY, Vec3::NEG_INFINITY];
    order
        .map(|&index| {
            let [low, high] = bounds[index as usize];
            around = [around[0].min(low), around[1].max(high)];
            let size = around[1] - around[0];
            size.x * size.y + size.y * size.z + size.z * size.x
        })
        .collect()
}
