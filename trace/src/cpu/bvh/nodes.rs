//! Nodes of a wide tree: how they follow moved boxes, and are walked along a ray.

use crate::cpu::lanes::Lanes;
use crate::ray::Ray;
use obvhs::aabb::Aabb;

/// Children of a node and Gaussians of a leaf: the lanes of an AVX register.
pub(super) const WIDTH: usize = 8;
/// Child that does not exist.
pub(super) const EMPTY: u32 = u32::MAX;
/// Marks children that are leaves; the other bits are the leaf's index.
pub(super) const LEAF: u32 = 1 << 31;

/// Eight boxes and what is in them. A child that does not exist has a box that no ray enters.
#[derive(Debug, Clone)]
#[repr(align(64))]
pub(in crate::cpu) struct Node {
    /// Lower ends along x, y, z, and upper ends.
    planes: [[[f32; WIDTH]; 3]; 2],
    child: [u32; WIDTH],
}

/// A ray prepared for the slab test of boxes.
struct SlabRay {
    origin: [f32; 3],
    inverse: [f32; 3],
    /// Whether the ray meets the upper planes first, along x, y, z; it leaves through the others.
    is_backward: [bool; 3],
}

impl Node {
    pub(super) const EMPTY: Self = Self {
        planes: {
            let (low, high) = ([f32::INFINITY; WIDTH], [f32::NEG_INFINITY; WIDTH]);
            [[low, low, low], [high, high, high]]
        },
        child: [EMPTY; WIDTH],
    };

    pub(super) fn set_child(&mut self, lane: usize, child: u32) {
        self.child[lane] = child;
    }

    fn set_box(&mut self, lane: usize, bounds: &Aabb) {
        for axis in 0..3 {
            self.planes[0][axis][lane] = bounds.min[axis];
            self.planes[1][axis][lane] = bounds.max[axis];
        }
    }

    /// Half the surface of a child's box; 0 if it is empty.
    fn half_area(&self, lane: usize) -> f32 {
        let [x, y, z] = [0, 1, 2]
            .map(|axis| (self.planes[1][axis][lane] - self.planes[0][axis][lane]).max(0.0));
        x * y + y * z + z * x
    }
}

/// Sets all boxes from those of the leaves; an empty leaf has an [`Aabb::INVALID`] one.
pub(super) fn refit(nodes: &mut [Node], bounds_of_leaf: impl Fn(usize) -> Aabb) {
    let mut boxes = vec![Aabb::INVALID; nodes.len()];
    for at in (0..nodes.len()).rev() {
        let mut total = Aabb::INVALID;
        for lane in 0..WIDTH {
            let child = nodes[at].child[lane];
            if child == EMPTY {
                continue;
            }
            let bounds = if child & LEAF != 0 {
                bounds_of_leaf((child & !LEAF) as usize)
            } else {
                boxes[child as usize]
            };
            let is_empty = bounds.min.x > bounds.max.x;
            nodes[at].set_box(lane, if is_empty { &NEVER } else { &bounds });
            total = total.union(&bounds);
        }
        boxes[at] = total;
    }
}

/// A box that no ray enters, see [`Node::EMPTY`].
const NEVER: Aabb = Aabb {
    min: glam::Vec3A::INFINITY,
    max: glam::Vec3A::NEG_INFINITY,
};

/// Expected number of boxes and leaves that a random ray touches (surface area heuristic), relative
/// to the root.
pub(super) fn cost(nodes: &[Node]) -> f32 {
    let area = |node: &Node| -> f32 { (0..WIDTH).map(|lane| node.half_area(lane)).sum() };
    let root = nodes.first().map_or(0.0, area);
    nodes.iter().map(area).sum::<f32>() / root.max(f32::MIN_POSITIVE)
}

/// Calls `visit` with the leaves along `ray` up to a distance, nearer ones mostly first, and with
/// the distance beyond which nothing matters any more, which `visit` may lower.
#[inline(always)]
pub(super) fn visit_leaves(
    nodes: &[Node],
    (ray, distance): (&Ray, f32),
    stack: &mut Stack,
    mut visit: impl FnMut(usize, &mut f32),
) {
    stack.len = 0;
    if nodes.is_empty() {
        return;
    }
    let ray = SlabRay::new(ray);
    let mut t_max = distance;
    let mut next = Some(0);
    while let Some(child) = next {
        if child & LEAF != 0 {
            visit((child & !LEAF) as usize, &mut t_max);
        } else {
            let node = &nodes[child as usize];
            let (near, entered) = node_distances(node, &ray, t_max);
            next = stack.push(node, &near, entered);
            if next.is_some() {
                continue;
            }
        }
        next = stack.pop(t_max);
    }
}

impl SlabRay {
    #[inline(always)]
    fn new(ray: &Ray) -> Self {
        // Axis-parallel rays: a huge finite reciprocal keeps 0·∞ out of the box test.
        let inverse = ray.direction.map(|d| {
            if d.abs() > 1e-20 {
                1.0 / d
            } else {
                1e20_f32.copysign(d)
            }
        });
        Self {
            origin: ray.origin,
            inverse,
            is_backward: inverse.map(|i| i < 0.0),
        }
    }
}

/// Distances at which the ray enters the eight boxes, and the lanes of those that it does enter.
#[inline(always)]
fn node_distances(node: &Node, ray: &SlabRay, t_max: f32) -> ([f32; WIDTH], Lanes) {
    // The axes are written out: compilers make no vectors of lanes that a loop carries on.
    let planes = |axis: usize| {
        let is_backward = ray.is_backward[axis];
        let at = |upper: bool| &node.planes[usize::from(upper)][axis];
        (at(is_backward), at(!is_backward))
    };
    let [(low_x, high_x), (low_y, high_y), (low_z, high_z)] = [planes(0), planes(1), planes(2)];
    let [x, y, z] = [0, 1, 2].map(|axis| {
        let (origin, inverse) = (ray.origin[axis], ray.inverse[axis]);
        move |plane: f32| (plane - origin) * inverse
    });
    // In this order, what is not a number leaves the other.
    let larger = |a: f32, b: f32| if a > b { a } else { b };
    let smaller = |a: f32, b: f32| if a < b { a } else { b };
    let mut near = [0.0; WIDTH];
    let mut far = [0.0; WIDTH];
    for i in 0..WIDTH {
        near[i] = larger(z(low_z[i]), larger(y(low_y[i]), larger(x(low_x[i]), 0.0)));
        far[i] = smaller(
            z(high_z[i]),
            smaller(y(high_y[i]), smaller(x(high_x[i]), t_max)),
        );
    }
    // Robust box test (Ize 2013): two roundings of 2⁻²⁴ on either side.
    let mut entered = [0_u8; WIDTH];
    for lane in 0..WIDTH {
        entered[lane] = u8::from(near[lane] <= far[lane] * 1.000_000_4);
    }
    (near, Lanes::new(entered))
}

/// A child that a ray enters, and the distance at which it does.
#[derive(Debug, Clone, Copy)]
struct Entered {
    near: f32,
    child: u32,
}

/// Children to visit later, the next one last. Memory is reused from ray to ray.
#[derive(Debug, Default)]
pub(in crate::cpu) struct Stack {
    /// Those from `len` on are left from before.
    entered: Vec<Entered>,
    len: usize,
}

impl Stack {
    /// Pushes the `entered` children of `node` but the nearest, which is returned; nearer ones are
    /// pushed later.
    #[inline(always)]
    fn push(&mut self, node: &Node, near: &[f32; WIDTH], mut entered: Lanes) -> Option<u32> {
        let child = |lane: usize| Entered {
            near: near[lane],
            child: node.child[lane],
        };
        let mut nearest = child(entered.next()?);
        // Room for all lanes at once: this is the innermost loop of paths, and a copy of unknown
        // length would be a call.
        let end = self.len + WIDTH;
        if self.entered.len() < end {
            self.entered.resize(2 * end, nearest);
        }
        let places = &mut self.entered[self.len..end];
        let mut num = 0;
        for lane in entered {
            let mut farther = child(lane);
            if farther.near < nearest.near {
                std::mem::swap(&mut farther, &mut nearest);
            }
            let mut at = num;
            while at > 0 && places[at - 1].near < farther.near {
                places[at] = places[at - 1];
                at -= 1;
            }
            places[at] = farther;
            num += 1;
        }
        self.len += num;
        Some(nearest.child)
    }

    /// Removes the last child that is entered within `t_max`, and those after it.
    #[inline(always)]
    fn pop(&mut self, t_max: f32) -> Option<u32> {
        while self.len > 0 {
            self.len -= 1;
            let Entered { near, child } = self.entered[self.len];
            if near <= t_max {
                return Some(child);
            }
        }
        None
    }
}
