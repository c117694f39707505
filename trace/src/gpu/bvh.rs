//! Acceleration structure of single rays: binary trees of boxes in the memory of a device.
//!
//! Trees are built on the host by the library that the CPU engine uses. Which hits a ray has does not depend on the shape of a tree.

use crate::surfel::Surfel;
use glam::{Vec3, Vec3A};
use obvhs::{BvhBuildParams, aabb::Aabb, bvh2::builder::build_bvh2};
use std::time::Duration;

/// Stands for no node, and for no Gaussian.
pub(super) const NO_NODE: u32 = u32::MAX;

/// Nodes that a search can have before it: no tree may be deeper.
pub(super) const STACK: u32 = 64;

/// Gaussians of a leaf, at most.
const LEAF_SIZE: u32 = 4;

/// Growth of boxes, relative to the coordinates' size: covers the rounding of the hit formula with the imprecise division of GPUs (2.5 units in
/// the last place), so that no hit near a disc's rim is lost by the search.
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
        let mut params = BvhBuildParams::slow_build();
        // A Gaussian in two leaves would be hit twice.
        params.pre_split = false;
        params.max_prims_per_leaf = LEAF_SIZE;
        let mut tree = build_bvh2(&boxes, params, &mut Duration::default());
        if tree.depth(0) >= STACK as usize {
            // Boxes that nothing tells apart, such as thousands in one place: a tree by position alone is never that deep.
            tree = build_bvh2(
                &boxes,
                BvhBuildParams::fastest_build(),
                &mut Duration::default(),
            );
        }
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

fn disc_bounds(surfel: &Surfel) -> Aabb {
    let [a, b] = surfel.extents();
    let center = Vec3::from(surfel.position);
    let half = (a * a + b * b).map(f32::sqrt) + (center.abs() + a.abs() + b.abs()) * BOX_MARGIN;
    Aabb::new(Vec3A::from(center - half), Vec3A::from(center + half))
}
