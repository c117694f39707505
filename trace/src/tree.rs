//! Binary trees of boxes, of which the engines make their own.

use glam::Vec3A;
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::{Bvh2, builder::build_bvh2};
use std::time::Duration;

/// Largest growth of boxes, relative to their coordinates.
const SPREAD: f32 = 4e-6;

/// A tree over `boxes` whose leaves hold at most `leaf_size` of them, each once. Boxes of nodes
/// hold those below, with a small margin.
///
/// The library joins pairs of neighbours each of which is the best for the other. Among equal boxes
/// hardly a pair is, and thousands of them would take a time that grows with the square of their
/// number: every box grows by a little of its own.
pub(crate) fn binary_tree(boxes: &[Aabb], leaf_size: u32) -> Bvh2 {
    let mut params = BvhBuildParams::slow_build();
    // A Gaussian in two leaves would be hit twice.
    params.pre_split = false;
    params.max_prims_per_leaf = leaf_size;
    let grown: Vec<Aabb> = (0..).zip(boxes).map(|(i, of)| grown(of, i)).collect();
    build_bvh2(&grown, params, &mut Duration::default())
}

/// Number of the level of the deepest leaf at or below `node`, from which levels are counted.
#[cfg(any(test, feature = "gpu"))]
pub(crate) fn deepest_below(tree: &Bvh2, node: u32) -> u32 {
    let (mut deepest, mut left) = (0, vec![(node, 0)]);
    while let Some((node, level)) = left.pop() {
        deepest = deepest.max(level);
        let node = &tree.nodes[node as usize];
        if node.prim_count == 0 {
            left.extend([0, 1].map(|child| (node.first_index + child, level + 1)));
        }
    }
    deepest
}

fn grown(of: &Aabb, i: u32) -> Aabb {
    // Multiplicative hashing: neighbours get numbers far apart.
    let share = |factor: u32| (i.wrapping_mul(factor) >> 24) as f32 / 256.0;
    let shares = Vec3A::new(share(0x9e37_79b9), share(0x85eb_ca6b), share(0xc2b2_ae35));
    let margin = of.min.abs().max(of.max.abs()) * shares * SPREAD;
    Aabb::new(of.min - margin, of.max + margin)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_boxes_make_a_balanced_tree_that_holds_them() {
        let one = Aabb::new(Vec3A::new(1.0, 1.0, -2.0), Vec3A::new(1.1, 1.2, -1.9));
        let tree = binary_tree(&vec![one; 5000], 8);
        // A chain would have hundreds of levels.
        let deepest = deepest_below(&tree, 0);
        assert!(deepest < 64, "{deepest}");
        let root = tree.nodes[0].aabb();
        assert!(root.min.cmple(one.min).all() && root.max.cmpge(one.max).all());
        let mut held = tree.primitive_indices.clone();
        held.sort_unstable();
        assert!(held.into_iter().eq(0..5000));
    }
}
