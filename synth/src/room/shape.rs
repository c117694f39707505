//! Shapes in closed form: where a ray meets them, and points on them.
//!
//! A surface point is known by its face and two coordinates `st` from 0 to 1 on it. All lengths are
//! metres.

mod meet;

use glam::{Mat3, Vec2, Vec3};
use std::f32::consts::{PI, TAU};

/// A quadrilateral, a parallelogram. Face 0 is the side that its normal `edges[0] × edges[1]`
/// points to, face 1 the other.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Quad {
    corner: Vec3,
    edges: [Vec3; 2],
    /// `(p − corner) · duals[i]` is coordinate i of p.
    duals: [Vec3; 2],
    normal: Vec3,
}

/// A box. Faces 0 to 5 look along −x, +x, −y, +y, −z, +z of its own axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Block {
    /// Middle.
    pub(crate) centre: Vec3,
    /// Half the lengths of the edges.
    pub(crate) half: Vec3,
    /// Its axes as columns; orthonormal.
    pub(crate) axes: Mat3,
}

/// A sphere, one face.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Ball {
    /// Middle.
    pub(crate) centre: Vec3,
    /// Radius.
    pub(crate) radius: f32,
}

/// A cylinder or frustum of a cone. Faces: 0 outside, 1 inside, 2 the disc at its base, 3 the disc
/// on top.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Drum {
    /// Middle of the base.
    pub(crate) base: Vec3,
    /// Its axes as columns, the third along the drum; orthonormal.
    pub(crate) axes: Mat3,
    /// Length along the axis.
    pub(crate) height: f32,
    /// Radius at the base and on top.
    pub(crate) radii: [f32; 2],
    /// Whether there are discs at the ends.
    pub(crate) ends: Ends,
}

/// Whether a [`Drum`] is closed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Ends {
    /// A can.
    Closed,
    /// A tube, as a lamp shade.
    Open,
}

/// A shape.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Shape {
    /// A parallelogram.
    Quad(Quad),
    /// A box.
    Block(Block),
    /// A sphere.
    Ball(Ball),
    /// A cylinder or frustum.
    Drum(Drum),
}

/// Intersection of a ray and a shape.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Crossing {
    /// Distance along the ray.
    pub(crate) distance: f32,
    /// Face.
    pub(crate) face: u32,
    /// Coordinates on the face, 0 to 1.
    pub(crate) st: Vec2,
    /// Unit normal of the face, outwards.
    pub(crate) normal: Vec3,
}

/// A point of a shape.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SurfacePoint {
    /// World position.
    pub(crate) position: Vec3,
    /// Unit normal of the face, outwards.
    pub(crate) normal: Vec3,
}

impl Shape {
    /// The first crossing with the ray whose distance lies strictly within `range`. `direction` is
    /// of unit length.
    #[inline]
    pub(crate) fn meet(&self, origin: Vec3, direction: Vec3, range: [f32; 2]) -> Option<Crossing> {
        match self {
            Self::Quad(quad) => quad.meet(origin, direction, range),
            Self::Block(block) => block.meet(origin, direction, range),
            Self::Ball(ball) => ball.meet(origin, direction, range),
            Self::Drum(drum) => drum.meet(origin, direction, range),
        }
    }

    /// Number of faces.
    pub(crate) fn num_faces(&self) -> u32 {
        match self {
            Self::Quad(_) => 2,
            Self::Block(_) => 6,
            Self::Ball(_) => 1,
            Self::Drum(_) => 4,
        }
    }

    /// Whether the inside cannot be seen.
    pub(crate) fn is_closed(&self) -> bool {
        match self {
            Self::Quad(_) => false,
            Self::Block(_) | Self::Ball(_) => true,
            Self::Drum(drum) => drum.ends == Ends::Closed,
        }
    }

    /// Lengths of a face along its two coordinates, about; what patterns and grids are laid out by.
    pub(crate) fn extent(&self, face: u32) -> Vec2 {
        match self {
            Self::Quad(quad) => Vec2::new(quad.edges[0].length(), quad.edges[1].length()),
            Self::Block(block) => {
                let [s, t] = Block::SPAN[face as usize / 2];
                2.0 * Vec2::new(block.half[s], block.half[t])
            }
            Self::Ball(ball) => Vec2::new(TAU * ball.radius, PI * ball.radius),
            Self::Drum(drum) => {
                let [base, top] = drum.radii;
                match face {
                    2 => Vec2::new(PI * base, base),
                    3 => Vec2::new(PI * top, top),
                    _ => Vec2::new(PI * (base + top), drum.height),
                }
            }
        }
    }

    /// Area of a face; 0 for one that cannot be seen from outside.
    pub(crate) fn area(&self, face: u32) -> f32 {
        match self {
            Self::Quad(quad) => quad.edges[0].cross(quad.edges[1]).length(),
            Self::Block(_) => self.extent(face).element_product(),
            Self::Ball(ball) => 4.0 * PI * ball.radius * ball.radius,
            Self::Drum(drum) => {
                let [base, top] = drum.radii;
                let slant = drum.height.hypot(top - base);
                match (face, drum.ends) {
                    (0, _) | (1, Ends::Open) => PI * (base + top) * slant,
                    (2, Ends::Closed) => PI * base * base,
                    (3, Ends::Closed) => PI * top * top,
                    _ => 0.0,
                }
            }
        }
    }

    /// The point of a face with coordinates `st`.
    pub(crate) fn point(&self, face: u32, st: Vec2) -> SurfacePoint {
        match self {
            Self::Quad(quad) => SurfacePoint {
                position: quad.corner + quad.edges[0] * st.x + quad.edges[1] * st.y,
                normal: if face == 0 { quad.normal } else { -quad.normal },
            },
            Self::Block(block) => {
                let axis = face as usize / 2;
                let side = if face % 2 == 1 { 1.0 } else { -1.0 };
                let [s, t] = Block::SPAN[axis];
                let mut local = Vec3::ZERO;
                local[axis] = side * block.half[axis];
                local[s] = (2.0 * st.x - 1.0) * block.half[s];
                local[t] = (2.0 * st.y - 1.0) * block.half[t];
                SurfacePoint {
                    position: block.centre + block.axes * local,
                    normal: block.axes.col(axis) * side,
                }
            }
            Self::Ball(ball) => {
                let z = 2.0 * st.y - 1.0;
                let (sin, cos) = (TAU * st.x).sin_cos();
                let flat = (1.0 - z * z).max(0.0).sqrt();
                let normal = Vec3::new(flat * cos, flat * sin, z);
                SurfacePoint {
                    position: ball.centre + normal * ball.radius,
                    normal,
                }
            }
            Self::Drum(drum) => drum.point(face, st),
        }
    }

    /// `st` of a point that is uniform over the area of a face, for two uniform numbers.
    pub(crate) fn uniform_st(&self, face: u32, uniform: Vec2) -> Vec2 {
        let Self::Drum(drum) = self else {
            return uniform;
        };
        let [base, top] = drum.radii;
        if face >= 2 || base == top {
            return uniform;
        }
        // The radius grows linearly: its square is uniform between those of the ends.
        let square = base * base + uniform.y * (top * top - base * base);
        Vec2::new(uniform.x, (square.sqrt() - base) / (top - base))
    }

    /// Corners of the axis-aligned box around the shape.
    pub(crate) fn bounds(&self) -> [Vec3; 2] {
        match self {
            Self::Quad(quad) => {
                let far = quad.corner + quad.edges[0] + quad.edges[1];
                let others = [quad.corner + quad.edges[0], quad.corner + quad.edges[1]];
                let all = [quad.corner, far, others[0], others[1]];
                let low = all.into_iter().reduce(Vec3::min).unwrap_or(quad.corner);
                let high = all.into_iter().reduce(Vec3::max).unwrap_or(quad.corner);
                [low, high]
            }
            Self::Block(block) => {
                let axes = block.axes;
                let reach = axes.x_axis.abs() * block.half.x
                    + axes.y_axis.abs() * block.half.y
                    + axes.z_axis.abs() * block.half.z;
                [block.centre - reach, block.centre + reach]
            }
            Self::Ball(ball) => [ball.centre - ball.radius, ball.centre + ball.radius],
            Self::Drum(drum) => {
                let axis = drum.axes.z_axis;
                // A disc reaches √(1 − a²) of its radius along an axis that its normal has the
                // component a of.
                let flat = (Vec3::ONE - axis * axis).max(Vec3::ZERO).map(f32::sqrt);
                let top = drum.base + axis * drum.height;
                let [r0, r1] = drum.radii.map(|radius| flat * radius);
                [
                    (drum.base - r0).min(top - r1),
                    (drum.base + r0).max(top + r1),
                ]
            }
        }
    }
}

impl Drum {
    fn point(&self, face: u32, st: Vec2) -> SurfacePoint {
        let (sin, cos) = (TAU * st.x).sin_cos();
        let (local, normal) = match face {
            2 => (
                Vec3::new(cos, sin, 0.0) * (self.radii[0] * st.y.sqrt()),
                Vec3::NEG_Z,
            ),
            3 => (
                (Vec3::new(cos, sin, 0.0) * (self.radii[1] * st.y.sqrt())).with_z(self.height),
                Vec3::Z,
            ),
            _ => {
                let radius = self.radii[0] + (self.radii[1] - self.radii[0]) * st.y;
                let outwards = Vec3::new(cos, sin, -self.slope()).normalize();
                (
                    Vec3::new(radius * cos, radius * sin, st.y * self.height),
                    if face == 1 { -outwards } else { outwards },
                )
            }
        };
        SurfacePoint {
            position: self.base + self.axes * local,
            normal: self.axes * normal,
        }
    }
}

#[cfg(test)]
mod tests;
