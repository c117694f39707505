//! Intersections of rays and shapes.

use super::{Ball, Block, Crossing, Drum, Ends, Quad};
use glam::{Vec2, Vec3};
use std::f32::consts::TAU;

impl Quad {
    /// A quad from a corner and its two edges, which are not parallel.
    pub(crate) fn new(corner: Vec3, edges: [Vec3; 2]) -> Self {
        let across = edges[0].cross(edges[1]);
        let square = across.length_squared();
        Self {
            corner,
            edges,
            duals: [
                edges[1].cross(across) / square,
                across.cross(edges[0]) / square,
            ],
            normal: across / square.sqrt(),
        }
    }

    pub(super) fn meet(&self, origin: Vec3, direction: Vec3, range: [f32; 2]) -> Option<Crossing> {
        let slope = direction.dot(self.normal);
        let distance = (self.corner - origin).dot(self.normal) / slope;
        // A ray within the plane gives infinity or NaN, which no range contains.
        if !(distance > range[0] && distance < range[1]) {
            return None;
        }
        let offset = origin + direction * distance - self.corner;
        let st = Vec2::new(offset.dot(self.duals[0]), offset.dot(self.duals[1]));
        let inside = st.min_element() >= 0.0 && st.max_element() <= 1.0;
        let front = slope < 0.0;
        inside.then_some(Crossing {
            distance,
            face: u32::from(!front),
            st,
            normal: if front { self.normal } else { -self.normal },
        })
    }
}

impl Block {
    /// The two axes that span the faces of `axis`, the upright one second where there is one.
    pub(super) const SPAN: [[usize; 2]; 3] = [[1, 2], [0, 2], [0, 1]];

    pub(super) fn meet(&self, origin: Vec3, direction: Vec3, range: [f32; 2]) -> Option<Crossing> {
        let local_origin = self.axes.transpose() * (origin - self.centre);
        let local = self.axes.transpose() * direction;
        let inverse = local.recip();
        let a = (-self.half - local_origin) * inverse;
        let b = (self.half - local_origin) * inverse;
        let (near, far) = (a.min(b), a.max(b));
        let (enter, leave) = (near.max_element(), far.min_element());
        if enter.is_nan() || leave.is_nan() || enter > leave {
            return None;
        }
        let (distance, by_axis) = if enter > range[0] {
            (enter, near)
        } else {
            (leave, far)
        };
        if !(distance > range[0] && distance < range[1]) {
            return None;
        }
        let axis = (0..3).find(|&axis| by_axis[axis] == distance).unwrap_or(0);
        let at = local_origin + local * distance;
        let positive = at[axis] > 0.0;
        let outwards = self.axes.col(axis) * if positive { 1.0 } else { -1.0 };
        let st = |i: usize| {
            let along = Self::SPAN[axis][i];
            (0.5 * (at[along] / self.half[along] + 1.0)).clamp(0.0, 1.0)
        };
        Some(Crossing {
            distance,
            face: 2 * axis as u32 + u32::from(positive),
            st: Vec2::new(st(0), st(1)),
            normal: outwards,
        })
    }
}

impl Ball {
    pub(super) fn meet(&self, origin: Vec3, direction: Vec3, range: [f32; 2]) -> Option<Crossing> {
        let offset = self.centre - origin;
        let along = offset.dot(direction);
        // The squared distance of the ray's line from the middle, from a difference of vectors: of
        // squares it would lose digits.
        let aside = (offset - direction * along).length_squared();
        let square = self.radius * self.radius - aside;
        if square < 0.0 {
            return None;
        }
        let half = square.sqrt();
        let within = |t: &f32| *t > range[0] && *t < range[1];
        let distance = [along - half, along + half].into_iter().find(within)?;
        let normal = (origin + direction * distance - self.centre).normalize();
        Some(Crossing {
            distance,
            face: 0,
            st: Vec2::new(turn(normal.x, normal.y), 0.5 * (normal.z + 1.0)),
            normal,
        })
    }
}

impl Drum {
    pub(super) fn meet(&self, origin: Vec3, direction: Vec3, range: [f32; 2]) -> Option<Crossing> {
        let o = self.axes.transpose() * (origin - self.base);
        let d = self.axes.transpose() * direction;
        let mut best = None;
        let mut range = range;
        let mut extend_range = |crossing: Option<Crossing>, range: &mut [f32; 2]| {
            if let Some(found) = crossing {
                range[1] = found.distance;
                best = Some(found);
            }
        };
        extend_range(self.meet_side(o, d, range), &mut range);
        if self.ends == Ends::Closed {
            extend_range(self.meet_disc(o, d, range, End::Base), &mut range);
            extend_range(self.meet_disc(o, d, range, End::Top), &mut range);
        }
        best
    }

    pub(super) fn slope(&self) -> f32 {
        (self.radii[1] - self.radii[0]) / self.height
    }

    fn meet_side(&self, o: Vec3, d: Vec3, range: [f32; 2]) -> Option<Crossing> {
        let slope = self.slope();
        let radius = self.radii[0] + slope * o.z;
        let a = d.x * d.x + d.y * d.y - slope * slope * d.z * d.z;
        let half_b = o.x * d.x + o.y * d.y - slope * d.z * radius;
        let c = o.x * o.x + o.y * o.y - radius * radius;
        let square = half_b * half_b - a * c;
        if square < 0.0 {
            return None;
        }
        // The stable pair of roots; one of them is infinite where a ray runs along the mantle.
        let q = -(half_b + square.sqrt().copysign(half_b));
        let roots = [q / a, c / q];
        let height = self.height;
        let fits = |t: &f32| {
            let z = o.z + t * d.z;
            *t > range[0] && *t < range[1] && (0.0..=height).contains(&z)
        };
        let distance = roots.into_iter().filter(fits).reduce(f32::min)?;
        let at = o + d * distance;
        let local = Vec3::new(at.x, at.y, -slope * (self.radii[0] + slope * at.z)).normalize();
        let outwards = self.axes * local;
        let inside = local.dot(d) > 0.0;
        Some(Crossing {
            distance,
            face: u32::from(inside),
            st: Vec2::new(turn(at.x, at.y), (at.z / self.height).clamp(0.0, 1.0)),
            normal: outwards,
        })
    }

    fn meet_disc(&self, o: Vec3, d: Vec3, range: [f32; 2], end: End) -> Option<Crossing> {
        let (z, radius, side) = match end {
            End::Base => (0.0, self.radii[0], -1.0),
            End::Top => (self.height, self.radii[1], 1.0),
        };
        let distance = (z - o.z) / d.z;
        if !(distance > range[0] && distance < range[1]) {
            return None;
        }
        let at = (o + d * distance).truncate();
        (at.length_squared() <= radius * radius).then(|| Crossing {
            distance,
            face: if side < 0.0 { 2 } else { 3 },
            st: Vec2::new(turn(at.x, at.y), at.length_squared() / (radius * radius)),
            normal: self.axes.z_axis * side,
        })
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum End {
    Base,
    Top,
}

/// The angle of (x, y) in turns, 0 to 1.
fn turn(x: f32, y: f32) -> f32 {
    (y.atan2(x) / TAU).rem_euclid(1.0).min(1.0)
}
