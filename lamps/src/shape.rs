//! Surfaces that lamps can have, as few numbers.

use crate::meet::ShapeFrom;
use eagpt_scene::lamps::LampShape;
use glam::{Quat, Vec3};
use std::f32::consts::PI;

/// A surface that shines alike everywhere.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Shape {
    /// A rectangle.
    Rectangle(Flat),
    /// An ellipse.
    Ellipse(Flat),
    /// A ball.
    Ball {
        /// Middle, world space.
        centre: Vec3,
        /// Radius, scene units.
        radius: f32,
    },
    /// A cylinder, or a cone without its tip, with flat ends.
    Tube {
        /// Middle, world space.
        centre: Vec3,
        /// World from its own axes; it lies along z.
        rotation: Quat,
        /// Mean radius, scene units.
        radius: f32,
        /// Length, scene units.
        length: f32,
        /// Radii of the ends, at +z and −z, differ from the mean by this share of it; −1 to 1.
        taper: f32,
    },
    /// A box.
    Box {
        /// Middle, world space.
        centre: Vec3,
        /// World from its own axes.
        rotation: Quat,
        /// Whole lengths along its axes, scene units.
        size: Vec3,
    },
}

/// Place and size of a flat shape.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Flat {
    /// Middle, world space.
    pub centre: Vec3,
    /// World from its own axes; z is the normal, towards where it shines.
    pub rotation: Quat,
    /// Whole lengths along x and y, scene units.
    pub size: [f32; 2],
}

impl Flat {
    /// The unit normal.
    pub fn normal(&self) -> Vec3 {
        self.rotation * Vec3::Z
    }
}

impl Shape {
    /// Its form, as a list of lamps has it.
    pub(crate) fn kind(&self) -> LampShape {
        match self {
            Self::Rectangle(_) | Self::Ellipse(_) => LampShape::Panel,
            Self::Ball { .. } => LampShape::Ball,
            Self::Tube { .. } => LampShape::Tube,
            Self::Box { .. } => LampShape::Box,
        }
    }

    /// Middle, world space.
    pub fn centre(&self) -> Vec3 {
        match self {
            Self::Rectangle(flat) | Self::Ellipse(flat) => flat.centre,
            Self::Ball { centre, .. } | Self::Tube { centre, .. } | Self::Box { centre, .. } => {
                *centre
            }
        }
    }

    /// World from the shape's own axes.
    pub fn rotation(&self) -> Quat {
        match self {
            Self::Rectangle(flat) | Self::Ellipse(flat) => flat.rotation,
            Self::Ball { .. } => Quat::IDENTITY,
            Self::Tube { rotation, .. } | Self::Box { rotation, .. } => *rotation,
        }
    }

    /// Whole lengths along its own axes, scene units.
    pub fn size(&self) -> Vec3 {
        match *self {
            Self::Rectangle(flat) | Self::Ellipse(flat) => {
                Vec3::new(flat.size[0], flat.size[1], 0.0)
            }
            Self::Ball { radius, .. } => Vec3::splat(2.0 * radius),
            Self::Tube {
                radius,
                length,
                taper,
                ..
            } => {
                let widest = 2.0 * radius * (1.0 + taper.abs());
                Vec3::new(widest, widest, length)
            }
            Self::Box { size, .. } => size,
        }
    }

    /// The flat shape, if it is one.
    pub fn flat(&self) -> Option<&Flat> {
        match self {
            Self::Rectangle(flat) | Self::Ellipse(flat) => Some(flat),
            Self::Ball { .. } | Self::Tube { .. } | Self::Box { .. } => None,
        }
    }

    /// Area that shines, scene units²; of a flat shape one side.
    pub fn area(&self) -> f32 {
        match *self {
            Self::Rectangle(flat) => flat.size[0] * flat.size[1],
            Self::Ellipse(flat) => 0.25 * PI * flat.size[0] * flat.size[1],
            Self::Ball { radius, .. } => 4.0 * PI * radius * radius,
            Self::Tube {
                radius,
                length,
                taper,
                ..
            } => {
                let slant = length.hypot(2.0 * radius * taper);
                let ends = radius * radius * (1.0 + taper * taper);
                2.0 * PI * (radius * slant + ends)
            }
            Self::Box { size, .. } => 2.0 * size.dot(Vec3::new(size.y, size.z, size.x)),
        }
    }

    /// Smallest whole length that is not 0, scene units.
    pub fn thinnest(&self) -> f32 {
        let size = self.size();
        if size.z > 0.0 {
            size.min_element()
        } else {
            size.x.min(size.y)
        }
    }

    /// Distance along a ray of unit `direction` to the shape's first point, if it is met; a flat
    /// shape only from the side of its normal.
    pub fn meet(&self, origin: Vec3, direction: Vec3) -> Option<f32> {
        ShapeFrom::new(self, origin).meet(direction)
    }

    /// Angle by which a ray of unit `direction` misses the shape, 0 if it is met; about the middle,
    /// less the angle that a ball as large as its smallest size is seen at.
    pub(crate) fn off(&self, origin: Vec3, direction: Vec3) -> f32 {
        if self.meet(origin, direction).is_some() {
            return 0.0;
        }
        let to_centre = self.centre() - origin;
        direction.angle_between(to_centre)
            - (0.5 * self.thinnest() / to_centre.length()).min(1.0).asin()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The mean projected area of a convex body over all directions is a quarter of its surface
    /// (Cauchy): of rays in random directions through a large ball as many meet it.
    #[test]
    fn as_many_rays_meet_a_shape_as_its_area_says() {
        let ball = Shape::Ball {
            centre: Vec3::new(0.1, -0.2, 0.3),
            radius: 0.5,
        };
        let tube = Shape::Tube {
            centre: Vec3::new(-0.1, 0.1, 0.0),
            rotation: Quat::from_scaled_axis(Vec3::new(0.4, -0.7, 0.2)),
            radius: 0.2,
            length: 1.1,
            taper: 0.4,
        };
        let flat = Flat {
            centre: Vec3::new(0.2, 0.0, -0.1),
            rotation: Quat::from_scaled_axis(Vec3::new(-0.3, 0.9, 0.5)),
            size: [0.8, 0.5],
        };
        let cuboid = Shape::Box {
            centre: Vec3::new(0.1, 0.05, -0.2),
            rotation: Quat::from_scaled_axis(Vec3::new(-0.2, 0.5, 0.9)),
            size: Vec3::new(0.3, 0.5, 0.9),
        };
        for shape in [
            ball,
            tube,
            cuboid,
            Shape::Rectangle(flat),
            Shape::Ellipse(flat),
        ] {
            let num = 200_000;
            let mut met = 0;
            for i in 0..num {
                // A spiral of directions, and for each a point of the disc of radius 1 across it.
                let z = 1.0 - (2 * i + 1) as f32 / num as f32;
                let angle =
                    (f64::from(i) * 2.399_963_229_728_653).rem_euclid(std::f64::consts::TAU);
                let (sin, cos) = (angle as f32).sin_cos();
                let flat = (1.0 - z * z).sqrt();
                let direction = Vec3::new(flat * cos, flat * sin, z);
                let (a, b) = direction.any_orthonormal_pair();
                let r = (f64::from(i) * 0.754_877_666_246_69).fract().sqrt() as f32;
                let turn = (f64::from(i) * 0.569_840_290_998_05).fract() as f32 * 2.0 * PI;
                let origin = a * (r * turn.cos()) + b * (r * turn.sin()) - direction * 3.0;
                met += u32::from(shape.meet(origin, direction).is_some());
            }
            let projected = met as f32 / num as f32 * PI;
            // A flat shape is met from one side alone: half of its area's quarter of both sides.
            let expected = 0.25 * shape.area();
            assert!(
                (projected / expected - 1.0).abs() < 0.02,
                "{shape:?}: {projected} instead of {expected}"
            );
        }
    }
}
