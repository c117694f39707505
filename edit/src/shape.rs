//! Regions of space.

use glam::{Quat, Vec3};

/// A closed region; a point on its surface lies in it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Shape {
    /// A box.
    Box {
        /// Middle, scene units.
        centre: Vec3,
        /// Half the edge lengths, scene units, positive.
        half: Vec3,
        /// World from the box's own axes.
        rotation: Quat,
    },
    /// A ball.
    Sphere {
        /// Middle, scene units.
        centre: Vec3,
        /// Radius, scene units, positive.
        radius: f32,
    },
    /// Everything on the side of a plane that its normal points to.
    HalfSpace {
        /// A point of the plane, scene units.
        point: Vec3,
        /// Unit normal.
        normal: Vec3,
    },
    /// A cylinder with flat ends.
    Cylinder {
        /// Middle of one end, scene units.
        from: Vec3,
        /// Middle of the other end, scene units.
        to: Vec3,
        /// Radius, scene units, positive.
        radius: f32,
    },
}

impl Shape {
    /// Whether a point lies in the region.
    pub(crate) fn contains(&self, point: Vec3) -> bool {
        match *self {
            Self::Box {
                centre,
                half,
                rotation,
            } => {
                let local = rotation.conjugate() * (point - centre);
                local.abs().cmple(half).all()
            }
            Self::Sphere { centre, radius } => point.distance_squared(centre) <= radius * radius,
            Self::HalfSpace {
                point: origin,
                normal,
            } => (point - origin).dot(normal) >= 0.0,
            Self::Cylinder { from, to, radius } => {
                let axis = to - from;
                let along = (point - from).dot(axis) / axis.length_squared();
                (0.0..=1.0).contains(&along)
                    && (point - from - axis * along).length_squared() <= radius * radius
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_points() {
        let turned = Shape::Box {
            centre: Vec3::X,
            half: Vec3::new(2.0, 0.5, 0.5),
            rotation: Quat::from_rotation_z(std::f32::consts::FRAC_PI_2),
        };
        let slanted = Shape::HalfSpace {
            point: Vec3::new(0.0, 0.0, 1.0),
            normal: Vec3::new(0.6, 0.0, 0.8),
        };
        let cylinder = Shape::Cylinder {
            from: Vec3::ZERO,
            to: Vec3::new(0.0, 2.0, 0.0),
            radius: 0.5,
        };
        let sphere = Shape::Sphere {
            centre: Vec3::ONE,
            radius: 0.5,
        };
        for (shape, inside, outside) in [
            (turned, Vec3::new(1.4, 1.9, 0.0), Vec3::new(1.9, 0.4, 0.0)),
            (slanted, Vec3::new(1.0, 9.0, 0.5), Vec3::new(1.0, 9.0, 0.2)),
            (cylinder, Vec3::new(0.3, 2.0, 0.4), Vec3::new(0.4, 1.0, 0.4)),
            (
                cylinder,
                Vec3::new(0.0, 0.0, 0.5),
                Vec3::new(0.0, -0.01, 0.0),
            ),
            (sphere, Vec3::new(1.0, 1.5, 1.0), Vec3::new(1.3, 1.3, 1.3)),
        ] {
            assert!(shape.contains(inside), "{shape:?} {inside}");
            assert!(!shape.contains(outside), "{shape:?} {outside}");
        }
    }
}
