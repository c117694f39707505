//! Nodes of a wide tree: how they follow moved boxes, and are walked along a ray.

use super::{EMPTY, LEAF, WIDTH};
use crate::cpu::lanes::Lanes;
use crate::ray::Ray;
use obvhs::aabb::Aabb;

/// Eight boxes and what is in them. A child that does not exist has a box that no ray enters.
#[derive(Debug, Clone)]
#[repr(align(64))]
pub(in crate::cpu) struct Node {
    /// Lower ends along x, y, z, and upper ends.
    planes: [[[f32; WIDTH]; 3]; 2],
    child: [u32; WIDTH],
}

/// A ray as boxes want it.
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

/// Calls `visit` with the leaves along `ray`, nearer ones mostly first, and with the distance
/// beyond which nothing matters any more, which `visit` may lower.
#[inline(always)]
pub(super) fn visit_leaves(
    nodes: &[Node],
    ray: &Ray,
    stack: &mut Vec<Entered>,
    mut visit: impl FnMut(usize, &mut f32),
) {
    stack.clear();
    if nodes.is_empty() {
        return;
    }
    let ray = SlabRay::new(ray);
    let mut t_max = f32::INFINITY;
    let mut child = 0;
    loop {
        if child & LEAF != 0 {
            visit((child & !LEAF) as usize, &mut t_max);
        } else {
            let node = &nodes[child as usize];
            let (near, mask) = node_distances(node, &ray, t_max);
            if let Some(nearest) = push_sorted(stack, node, &near, mask) {
                child = nearest;
                continue;
            }
        }
        child = loop {
            match stack.pop() {
                Some(entered) if entered.near() <= t_max => break entered.child(),
                Some(_) => (),
                None => return,
            }
        };
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

/// A child that a ray enters; children order by distance.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(in crate::cpu) struct Entered(u64);

impl Entered {
    #[inline(always)]
    fn new(near: f32, child: u32) -> Self {
        // Distances are not negative, so their bits order like they do.
        Self(u64::from(near.to_bits()) << 32 | u64::from(child))
    }

    #[inline(always)]
    fn near(self) -> f32 {
        f32::from_bits((self.0 >> 32) as u32)
    }

    #[inline(always)]
    fn child(self) -> u32 {
        self.0 as u32
    }
}

/// Pushes the `entered` children but the nearest, which is returned, the next one last.
#[inline(always)]
fn push_sorted(
    stack: &mut Vec<Entered>,
    node: &Node,
    near: &[f32; WIDTH],
    mut entered: Lanes,
) -> Option<u32> {
    let child = |lane: usize| Entered::new(near[lane], node.child[lane]);
    let mut nearest = child(entered.next()?);
    let mut others = [Entered(0); WIDTH];
    let mut num = 0;
    for lane in entered {
        let farther = nearest.max(child(lane));
        nearest = nearest.min(child(lane));
        let mut at = num;
        while at > 0 && others[at - 1] < farther {
            others[at] = others[at - 1];
            at -= 1;
        }
        others[at] = farther;
        num += 1;
    }
    stack.extend_from_slice(&others[..num]);
    Some(nearest.child())
}
