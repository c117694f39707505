//! Acceleration structure of single rays: binary trees of boxes in the memory of a device.
//!
//! Trees are built on the host by the library that the CPU engine uses. Which hits a ray has does
//! not depend on the shape of a tree. Kernels search with a stack of fixed size: where the
//! library's tree is deeper, what is too deep is halved by position instead.

use crate::surfel::Surfel;
use crate::tree::{binary_tree, deepest_below};
use glam::{Vec3, Vec3A};
use obvhs::aabb::Aabb;
use obvhs::bvh2::{Bvh2, node::Bvh2Node};

/// Stands for no node, and for no Gaussian.
pub(super) const NO_NODE: u32 = u32::MAX;

/// Nodes that a search can have before it. One that comes to a leaf of level n, counted from 0, has
/// at most n + 1: no tree has more levels.
pub(super) const STACK: u32 = 64;

/// Gaussians of a leaf, at most.
const LEAF_SIZE: u32 = 4;

/// Level from which on a tree is halved, if it would not end in time: what is halved has 32 levels
/// below its own at most, as numbers of Gaussians have 32 bits.
const HALVED_FROM: u32 = 31;
const _: () = assert!(HALVED_FROM + 1 + u32::BITS <= STACK);

/// Growth of boxes, relative to the coordinates' size: covers the rounding of the hit formula with
/// the imprecise division of GPUs (2.5 units in the last place), so that no hit near a disc's rim
/// is lost by the search.
const BOX_MARGIN: f32 = 1e-6;

/// Trees one after the other, as bvh.wgsl reads them.
#[derive(Debug, Default)]
pub(super) struct Trees {
    /// Two for each node: (min, first) and (max, count), the last ones as bits.
    pub(super) nodes: Vec<[f32; 4]>,
    /// Numbers of the Gaussians of leaves.
    pub(super) leaf_indices: Vec<u32>,
}

impl Trees {
    /// Adds the tree of `surfels` that can be hit; returns its root, [`NO_NODE`] if there are none.
    pub(super) fn add(&mut self, surfels: &[Surfel]) -> u32 {
        let counted: Vec<u32> = (0..surfels.len() as u32)
            .filter(|&i| surfels[i as usize].cut2 >= 0.0)
            .collect();
        if counted.is_empty() {
            return NO_NODE;
        }
        let boxes: Vec<Aabb> = counted
            .iter()
            .map(|&i| disc_bounds(&surfels[i as usize]))
            .collect();
        let mut tree = binary_tree(&boxes, LEAF_SIZE);
        cut_down(&mut tree, &boxes);
        let root = (self.nodes.len() / 2) as u32;
        let first_leaf = self.leaf_indices.len() as u32;
        for node in &tree.nodes {
            let first = match node.prim_count {
                0 => node.first_index + root,
                _ => node.first_index + first_leaf,
            };
            let bounds = node.aabb();
            let corner = |of: Vec3A, bits: u32| [of.x, of.y, of.z, f32::from_bits(bits)];
            self.nodes.push(corner(bounds.min, first));
            self.nodes.push(corner(bounds.max, node.prim_count));
        }
        let held = tree.primitive_indices.iter();
        self.leaf_indices
            .extend(held.map(|&primitive| counted[primitive as usize]));
        root
    }
}

/// Halves the parts of `tree` that no search could get to the end of. Such trees come of Gaussians
/// that lie in one another like dolls: whoever joins the two boxes that fit best makes a chain of
/// them.
fn cut_down(tree: &mut Bvh2, boxes: &[Aabb]) {
    if deepest_below(tree, 0) < STACK {
        return;
    }
    let mut left = vec![(0, 0)];
    while let Some((node, level)) = left.pop() {
        let Bvh2Node {
            prim_count,
            first_index,
            ..
        } = tree.nodes[node as usize];
        if prim_count > 0 {
            continue;
        }
        if level < HALVED_FROM {
            left.extend([0, 1].map(|child| (first_index + child, level + 1)));
        } else if level + deepest_below(tree, node) >= STACK {
            halve(tree, node, boxes);
        }
    }
}

/// Makes the part of `tree` below `node` anew: as many Gaussians on either side of every box, along
/// its longest edge.
fn halve(tree: &mut Bvh2, node: u32, boxes: &[Aabb]) {
    let (mut held, mut below) = (Vec::new(), vec![node]);
    while let Some(node) = below.pop() {
        let node = &tree.nodes[node as usize];
        let first = node.first_index as usize;
        if node.prim_count == 0 {
            below.extend([node.first_index, node.first_index + 1]);
        } else {
            held.extend_from_slice(&tree.primitive_indices[first..][..node.prim_count as usize]);
        }
    }
    // The old nodes are not read any more.
    let first = tree.primitive_indices.len();
    tree.primitive_indices.extend_from_slice(&held);
    let mut left = vec![(node, first..first + held.len())];
    while let Some((node, range)) = left.pop() {
        let some = &mut tree.primitive_indices[range.clone()];
        let mut bounds = boxes[some[0] as usize];
        for &primitive in some.iter() {
            bounds = bounds.union(&boxes[primitive as usize]);
        }
        if some.len() <= LEAF_SIZE as usize {
            tree.nodes[node as usize] =
                Bvh2Node::new(bounds, some.len() as u32, range.start as u32);
            continue;
        }
        let axis = bounds.largest_axis();
        // Twice the centre. Ties by number: the same tree in every run.
        let at = |primitive: u32| {
            let of = &boxes[primitive as usize];
            of.min[axis] + of.max[axis]
        };
        let half = some.len() / 2;
        some.select_nth_unstable_by(half, |&a, &b| at(a).total_cmp(&at(b)).then(a.cmp(&b)));
        let children = tree.nodes.len() as u32;
        tree.nodes[node as usize] = Bvh2Node::new(bounds, 0, children);
        let empty = Bvh2Node::new(bounds, 0, 0);
        tree.nodes.extend([empty, empty]);
        let middle = range.start + half;
        left.push((children, range.start..middle));
        left.push((children + 1, middle..range.end));
    }
}

fn disc_bounds(surfel: &Surfel) -> Aabb {
    let [a, b] = surfel.extents();
    let center = Vec3::from(surfel.position);
    let half = (a * a + b * b).map(f32::sqrt) + (center.abs() + a.abs() + b.abs()) * BOX_MARGIN;
    Aabb::new(Vec3A::from(center - half), Vec3A::from(center + half))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surfel::SurfelSet;
    use eagpt_scene::{Gaussian, Gaussians, Gloss, Harmonics, random_cloud};
    use glam::{Quat, Vec2};

    fn disc(position: Vec3, scale: f32) -> Gaussian {
        Gaussian {
            position,
            scale: Vec2::splat(scale),
            rotation: Quat::from_rotation_x(0.3),
            opacity: 0.9,
            radiance: Vec3::ONE,
            harmonics: Harmonics::NONE,
            gloss: Gloss::NONE,
            emission: 0.0,
            albedo: Vec3::ONE,
        }
    }

    /// Levels of the tree from `root` on; checks that boxes are in one another and that leaves hold
    /// all of `surfels` once.
    fn check(trees: &Trees, root: u32, surfels: &[Surfel]) -> u32 {
        let node = |at: u32| {
            let [low, high] = [0, 1].map(|k| trees.nodes[2 * at as usize + k]);
            let [a, b] = [low, high].map(|of| Vec3::new(of[0], of[1], of[2]));
            (a, b, low[3].to_bits(), high[3].to_bits())
        };
        let (mut found, mut levels, mut left) = (vec![0; surfels.len()], 0, vec![(root, 1)]);
        while let Some((at, level)) = left.pop() {
            levels = levels.max(level);
            let (low, high, first, count) = node(at);
            let holds = |a: Vec3, b: Vec3| {
                assert!(a.cmpge(low).all() && b.cmple(high).all(), "node {at}");
            };
            if count == 0 {
                for child in [first, first + 1] {
                    let (a, b, ..) = node(child);
                    holds(a, b);
                    left.push((child, level + 1));
                }
                continue;
            }
            for &index in &trees.leaf_indices[first as usize..][..count as usize] {
                let bounds = disc_bounds(&surfels[index as usize]);
                holds(bounds.min.into(), bounds.max.into());
                found[index as usize] += 1;
            }
        }
        let counted = surfels.iter().map(|surfel| i32::from(surfel.cut2 >= 0.0));
        assert!(found.into_iter().eq(counted));
        levels
    }

    /// Levels with halving and without.
    fn levels(gaussians: impl IntoIterator<Item = Gaussian>) -> [u32; 2] {
        let all: Gaussians = gaussians.into_iter().collect();
        let surfels = SurfelSet::new(&all).surfels;
        let boxes: Vec<Aabb> = surfels.iter().map(disc_bounds).collect();
        let mut trees = Trees::default();
        // A tree before it, so that numbers do not begin at zero.
        trees.add(&surfels[..1]);
        let root = trees.add(&surfels);
        [
            check(&trees, root, &surfels),
            1 + deepest_below(&binary_tree(&boxes, LEAF_SIZE), 0),
        ]
    }

    #[test]
    fn no_tree_is_deeper_than_the_stack() {
        let doll = |center, i| disc(center, 1e-6 * 1.06_f32.powi(i));
        let [dolls, row, heap, mixed] = [
            levels((0..300).map(|i| doll(Vec3::ZERO, i))),
            levels((0..200).map(|i| disc(Vec3::X * 1e-15 * 1.5_f32.powi(i), 1e-17))),
            // Nothing tells them apart.
            levels((0..1000).map(|_| disc(Vec3::splat(0.7), 0.1))),
            // In a scene like others, the part that is like this is halved alone.
            levels((random_cloud(3000, 1).iter()).chain((0..300).map(|i| doll(Vec3::ONE, i)))),
        ];
        let found = format!("{dolls:?} {row:?} {heap:?} {mixed:?}");
        assert!(
            [dolls, row, heap, mixed].iter().all(|of| of[0] <= STACK),
            "{found}"
        );
        // The library's own trees would be too deep: this test is about something.
        assert!(dolls[1] > STACK && mixed[1] > STACK, "{found}");
    }

    #[test]
    fn usual_trees_are_left_as_they_are() {
        let surfels = SurfelSet::new(&random_cloud(3000, 2)).surfels;
        let mut trees = Trees::default();
        let root = trees.add(&surfels);
        assert!(check(&trees, root, &surfels) < HALVED_FROM);
        assert_eq!(trees.leaf_indices.len(), surfels.len());
    }
}
