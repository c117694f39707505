//! Parts of emitters that a point sees: the arc of a drum, the cone of a ball.

use crate::room::shape::{Ball, Drum};
use glam::{Vec2, Vec3};
use std::f32::consts::{PI, TAU};

/// The part of a drum's mantle that faces a point. Where the drum is a cone a little of what it
/// leaves out may be seen, and a little of what it contains may not: the former is left to bounces.
pub(super) struct Arc {
    /// Its middle, in turns about the axis.
    pub(super) middle: f32,
    /// Its share of the mantle.
    pub(super) share: f32,
}

impl Arc {
    pub(super) fn of(drum: &Drum, position: Vec3) -> Self {
        let offset = position - drum.base;
        let (x, y) = (offset.dot(drum.axes.x_axis), offset.dot(drum.axes.y_axis));
        let distance = x.hypot(y);
        let [base, top] = drum.radii;
        Self {
            middle: y.atan2(x) / TAU,
            share: if distance > base.max(top) {
                (base.min(top) / distance).acos() / PI
            } else {
                1.0
            },
        }
    }

    /// Turns from 0 to 1, for a uniform number.
    pub(super) fn turn(&self, uniform: f32) -> f32 {
        (self.middle + (uniform - 0.5) * self.share).rem_euclid(1.0)
    }

    pub(super) fn contains(&self, turn: f32) -> bool {
        let from_middle = turn - self.middle;
        (from_middle - from_middle.round()).abs() <= 0.5 * self.share
    }
}

/// The cone in which a sphere is seen from outside.
pub(super) struct Cone {
    pub(super) axis: Vec3,
    /// Distance of the sphere's middle.
    pub(super) distance: f32,
    /// 1 − cosine of its half angle.
    pub(super) gap: f32,
}

impl Cone {
    pub(super) fn of(ball: &Ball, position: Vec3) -> Option<Self> {
        let offset = ball.centre - position;
        let distance = offset.length();
        let sin2 = (ball.radius / distance).powi(2);
        (sin2 < 1.0).then(|| Self {
            axis: offset / distance,
            distance,
            // 1 − cos = sin² / (1 + cos) keeps the digits of small angles.
            gap: sin2 / (1.0 + (1.0 - sin2).sqrt()),
        })
    }

    pub(super) fn pdf(&self) -> f32 {
        1.0 / (TAU * self.gap)
    }

    pub(super) fn direction(&self, uniform: Vec2) -> Vec3 {
        let cos = 1.0 - uniform.x * self.gap;
        let sin = (1.0 - cos * cos).max(0.0).sqrt();
        let (across, up) = (TAU * uniform.y).sin_cos();
        let (tangent, bitangent) = self.axis.any_orthonormal_pair();
        (tangent * (sin * up) + bitangent * (sin * across) + self.axis * cos).normalize()
    }

    /// Distance to the sphere along a direction of the cone.
    pub(super) fn distance(&self, direction: Vec3, radius: f32) -> f32 {
        let along = direction.dot(self.axis) * self.distance;
        let aside2 = self.distance * self.distance - along * along;
        along - (radius * radius - aside2).max(0.0).sqrt()
    }
}
