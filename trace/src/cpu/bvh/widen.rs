//! Wide trees made of a binary one.

use super::nodes::{EMPTY, LEAF, Node, WIDTH};
use crate::tree::binary_tree;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;

/// A binary tree over items, of which wide trees over some of them are made.
pub(super) struct BinaryTree {
    tree: Bvh2,
    /// Item of each primitive of the tree.
    items: Vec<u32>,
}

/// A tree over boxes: nodes, parents before their children and the root first, and the items in
/// each leaf, `EMPTY` where there is none.
#[derive(Default)]
pub(super) struct Topology {
    pub(super) nodes: Vec<Node>,
    pub(super) leaves: Vec<[u32; WIDTH]>,
}

/// A binary node in a wide tree that is being made.
#[derive(Debug, Clone, Copy)]
struct Content {
    /// Items with a box at or below the node.
    num_items: usize,
    bounds: Aabb,
}

impl BinaryTree {
    /// Groups items, at most `leaf_size` in a leaf: `items[i]` has box `boxes[i]`.
    pub(super) fn new(items: Vec<u32>, boxes: &[Aabb], leaf_size: usize) -> Self {
        let tree = match items.is_empty() {
            true => Bvh2::default(),
            false => binary_tree(boxes, leaf_size as u32),
        };
        Self { tree, items }
    }

    /// The wide tree over those of the items that have a box. The boxes of the nodes are not set
    /// yet: [`super::nodes::refit`].
    ///
    /// Leaves are as full as can be: all items of a leaf are tested at once, however many.
    pub(super) fn widened(&self, bounds_of: impl Fn(u32) -> Option<Aabb>) -> Topology {
        let mut topology = Topology::default();
        let mut contents = vec![Content::NOTHING; self.tree.nodes.len()];
        if !contents.is_empty() && self.count(0, &bounds_of, &mut contents).num_items > 0 {
            self.add_node(&mut topology, &contents, &bounds_of, 0);
        }
        topology
    }

    /// Sets the content of binary node `at` and of all below, and returns it.
    fn count(
        &self,
        at: usize,
        bounds_of: &impl Fn(u32) -> Option<Aabb>,
        contents: &mut [Content],
    ) -> Content {
        let content = match self.children(at) {
            Some([left, right]) => {
                let left = self.count(left, bounds_of, contents);
                left.and(self.count(right, bounds_of, contents))
            }
            None => (self.items_at(at).filter_map(bounds_of))
                .fold(Content::NOTHING, |content, bounds| {
                    content.and(Content::one(bounds))
                }),
        };
        contents[at] = content;
        content
    }

    /// Adds the wide node of binary node `root` and everything below; returns its index.
    fn add_node(
        &self,
        topology: &mut Topology,
        contents: &[Content],
        bounds_of: &impl Fn(u32) -> Option<Aabb>,
        root: usize,
    ) -> u32 {
        let at = topology.nodes.len();
        topology.nodes.push(Node::EMPTY);
        // Open the child of the largest surface until eight are found: it is the one most rays
        // would open anyway.
        let half_area = |binary: usize| contents[binary].bounds.half_area();
        let mut open = vec![root];
        while open.len() < WIDTH {
            let widest = (0..open.len())
                .filter(|&i| contents[open[i]].num_items > WIDTH)
                .max_by(|&a, &b| half_area(open[a]).total_cmp(&half_area(open[b])));
            let Some(widest) = widest else { break };
            let Some(children) = self.children(open[widest]) else {
                break;
            };
            open.swap_remove(widest);
            open.extend(
                children
                    .iter()
                    .filter(|&&child| contents[child].num_items > 0),
            );
        }
        for (lane, binary) in open.into_iter().enumerate() {
            let child = if contents[binary].num_items > WIDTH {
                self.add_node(topology, contents, bounds_of, binary)
            } else {
                let mut leaf = [EMPTY; WIDTH];
                let mut lanes = leaf.iter_mut();
                self.fill(&mut lanes, bounds_of, binary);
                topology.leaves.push(leaf);
                LEAF | (topology.leaves.len() - 1) as u32
            };
            topology.nodes[at].set_child(lane, child);
        }
        at as u32
    }

    /// Puts the items with a box at and below binary node `at` into the lanes of a leaf.
    fn fill<'a>(
        &self,
        lanes: &mut impl Iterator<Item = &'a mut u32>,
        bounds_of: &impl Fn(u32) -> Option<Aabb>,
        at: usize,
    ) {
        match self.children(at) {
            Some(children) => children
                .into_iter()
                .for_each(|child| self.fill(lanes, bounds_of, child)),
            None => {
                let items = self.items_at(at).filter(|&item| bounds_of(item).is_some());
                for (item, lane) in items.zip(lanes) {
                    *lane = item;
                }
            }
        }
    }

    /// Children of a binary node; `None` for a leaf.
    fn children(&self, at: usize) -> Option<[usize; 2]> {
        let node = &self.tree.nodes[at];
        let first = node.first_index as usize;
        (!node.is_leaf()).then_some([first, first + 1])
    }

    /// Items of a binary leaf.
    fn items_at(&self, leaf: usize) -> impl Iterator<Item = u32> {
        let node = &self.tree.nodes[leaf];
        let first = node.first_index as usize;
        let held = &self.tree.primitive_indices[first..first + node.prim_count as usize];
        held.iter().map(|&i| self.items[i as usize])
    }
}

impl Content {
    const NOTHING: Self = Self {
        num_items: 0,
        bounds: Aabb::INVALID,
    };

    fn one(bounds: Aabb) -> Self {
        Self {
            num_items: 1,
            bounds,
        }
    }

    fn and(self, other: Self) -> Self {
        Self {
            num_items: self.num_items + other.num_items,
            bounds: self.bounds.union(&other.bounds),
        }
    }
}
