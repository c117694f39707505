//! Placements: rotations, uniform scales and moves of Gaussians.

use eagpt_scene::{Gaussian, rotation};
use glam::{Quat, Vec3};

/// A placement as a script gives it, relative to the bounds of the Gaussians that are placed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Placement {
    /// Factor on all lengths, positive.
    pub scale: f32,
    /// Rotation, unit.
    pub rotation: Quat,
    /// Fixed point of scaling and rotating.
    pub pivot: Pivot,
    /// Target of the pivot.
    pub goal: Goal,
}

/// The fixed point of a placement.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) enum Pivot {
    /// The middle of the bounds.
    #[default]
    Centre,
    /// The middle of the lower face of the bounds.
    Base,
    /// A point of the world, scene units.
    Point(Vec3),
}

/// Target of the pivot of a placement.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Goal {
    /// By this much, scene units.
    By(Vec3),
    /// To this point, scene units.
    To(Vec3),
}

impl Placement {
    /// A mere move.
    pub(crate) fn by(offset: Vec3) -> Self {
        Self {
            scale: 1.0,
            rotation: Quat::IDENTITY,
            pivot: Pivot::Centre,
            goal: Goal::By(offset),
        }
    }

    /// The similarity for Gaussians whose centres have the bounds `low` to `high`, in a world where
    /// `up` (a unit axis, either sign) is up.
    pub(crate) fn resolve(&self, (low, high): (Vec3, Vec3), up: Vec3) -> Similarity {
        let middle = 0.5 * (low + high);
        let from = match self.pivot {
            Pivot::Centre => middle,
            Pivot::Base => middle - up * (0.5 * (high - low)).dot(up.abs()),
            Pivot::Point(point) => point,
        };
        Similarity {
            scale: self.scale,
            rotation: self.rotation,
            from,
            to: match self.goal {
                Goal::By(offset) => from + offset,
                Goal::To(point) => point,
            },
        }
    }
}

/// `x ↦ to + scale · rotation · (x − from)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Similarity {
    /// Factor on all lengths, positive.
    pub scale: f32,
    /// Rotation, unit.
    pub rotation: Quat,
    /// The pivot before.
    pub from: Vec3,
    /// The pivot after.
    pub to: Vec3,
}

impl Similarity {
    /// Moves a point.
    pub(crate) fn point(&self, point: Vec3) -> Vec3 {
        if self.rotation == Quat::IDENTITY && self.scale == 1.0 {
            // A mere move does not round twice.
            return point + (self.to - self.from);
        }
        self.to + self.rotation * ((point - self.from) * self.scale)
    }

    /// The Gaussian with its centre, in-plane axes and scales moved along, and the directions of
    /// its light; light and material stay.
    pub(crate) fn gaussian(&self, g: &Gaussian) -> Gaussian {
        let moved = Gaussian {
            position: self.point(g.position),
            scale: g.scale * self.scale,
            ..*g
        };
        if self.rotation == Quat::IDENTITY {
            return moved;
        }
        Gaussian {
            rotation: rotation::unit(self.rotation * g.rotation),
            harmonics: g.harmonics.rotated(self.rotation),
            ..moved
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use eagpt_scene::{Gloss, Harmonics};
    use glam::Vec2;
    use std::f32::consts::FRAC_PI_2;

    const BOUNDS: (Vec3, Vec3) = (Vec3::new(0.0, 0.0, 1.0), Vec3::new(2.0, 4.0, 3.0));

    fn disc() -> Gaussian {
        Gaussian {
            position: Vec3::new(2.0, 2.0, 2.0),
            scale: Vec2::new(0.1, 0.2),
            rotation: Quat::IDENTITY,
            opacity: 0.5,
            radiance: Vec3::ONE,
            harmonics: Harmonics::NONE,
            gloss: Gloss::NONE,
            emission: 0.0,
            albedo: Vec3::splat(0.5),
        }
    }

    #[test]
    fn pivots_follow_the_bounds_and_the_up_axis() {
        for (pivot, up, expected) in [
            (Pivot::Centre, Vec3::Z, Vec3::new(1.0, 2.0, 2.0)),
            (Pivot::Base, Vec3::Z, Vec3::new(1.0, 2.0, 1.0)),
            (Pivot::Base, Vec3::NEG_Y, Vec3::new(1.0, 4.0, 2.0)),
            (Pivot::Point(Vec3::X), Vec3::Z, Vec3::X),
        ] {
            let placement = Placement {
                pivot,
                goal: Goal::To(Vec3::ZERO),
                ..Placement::by(Vec3::ZERO)
            };
            let similarity = placement.resolve(BOUNDS, up);
            assert_eq!(similarity.from, expected);
            assert_eq!(similarity.point(expected), Vec3::ZERO);
        }
    }

    #[test]
    fn a_rotation_turns_axes_and_normal_and_a_scale_widens() {
        let placement = Placement {
            scale: 2.0,
            rotation: Quat::from_rotation_y(FRAC_PI_2),
            ..Placement::by(Vec3::new(0.0, 0.0, 10.0))
        };
        let mut disc = disc();
        // Brighter the more it is seen along −y, and along x.
        (disc.harmonics.0[0], disc.harmonics.0[6]) = (0.5, -0.25);
        let moved = placement.resolve(BOUNDS, Vec3::Z).gaussian(&disc);
        let mut turned = Harmonics::NONE;
        (turned.0[0], turned.0[3]) = (0.5, -0.25);
        let off = (turned.0.iter().zip(moved.harmonics.0)).map(|(a, b)| (a - b).abs());
        assert!(off.fold(0.0, f32::max) < 1e-6, "{:?}", moved.harmonics);
        // One unit right of the centre goes two units down.
        let error = moved.position - Vec3::new(1.0, 2.0, 10.0);
        assert!(error.length() < 1e-5, "{error}");
        assert_eq!(moved.scale, Vec2::new(0.2, 0.4));
        for (before, after) in [
            (Vec3::X, Vec3::NEG_Z),
            (Vec3::Y, Vec3::Y),
            (Vec3::Z, Vec3::X),
        ] {
            assert!((moved.rotation * before - after).length() < 1e-6);
        }
        assert_eq!((moved.opacity, moved.albedo), (0.5, Vec3::splat(0.5)));
    }

    #[test]
    fn a_move_changes_nothing_but_the_centre() {
        let offset = Vec3::new(0.5, -0.25, 1.0);
        let moved = Placement::by(offset).resolve(BOUNDS, Vec3::Z);
        let expected = Gaussian {
            position: disc().position + offset,
            ..disc()
        };
        assert_eq!(moved.gaussian(&disc()), expected);
    }
}
