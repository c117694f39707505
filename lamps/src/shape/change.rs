//! Small changes of a shape, as searches make them.

use crate::shape::Shape;
use eagpt_scene::rotation;
use glam::{Quat, Vec3};

/// Most that the ends of a tube differ from its middle: not quite a tip.
const MAX_TAPER: f32 = 0.95;

/// Least and largest of [`Shape::changes_of`].
const MIN_CHANGE: f32 = 2e-3;
const MAX_CHANGE: f32 = 0.2;

/// Number of values that a shape can be changed by; see [`Shape::changed`].
pub(crate) const MAX_CHANGES: usize = 9;

impl Shape {
    /// Number of values of [`Self::changed`] that count.
    pub(crate) fn num_changes(&self) -> usize {
        match self {
            Self::Rectangle(_) | Self::Ellipse(_) => 8,
            Self::Ball { .. } => 4,
            Self::Tube { .. } => 8,
            Self::Box { .. } => 9,
        }
    }

    /// Number of these that keep the direction of its z axis.
    pub(crate) fn num_upright(&self) -> usize {
        match self {
            Self::Rectangle(_) | Self::Ellipse(_) | Self::Tube { .. } => 6,
            Self::Ball { .. } => 4,
            Self::Box { .. } => 7,
        }
    }

    /// The shape moved, sized and turned by small numbers: shifts along its axes in its own sizes,
    /// logarithms of the sizes, and angles in radians. The last ones tilt its z axis
    /// ([`Self::num_upright`]).
    pub(crate) fn changed(&self, by: &[f32; MAX_CHANGES]) -> Self {
        let size = match self {
            Self::Rectangle(flat) | Self::Ellipse(flat) => {
                let [x, y] = flat.size;
                Vec3::new(x, y, (x * y).sqrt())
            }
            Self::Tube { .. } => self.size().with_z(self.unit_along()),
            Self::Ball { .. } | Self::Box { .. } => self.size(),
        };
        let shift = self.rotation() * (Vec3::new(by[0], by[1], by[2]) * size);
        let [a, b, c] = [3, 4, 5].map(|k| by[k].exp());
        let (sizes, angles) = match self {
            Self::Rectangle(_) | Self::Ellipse(_) => {
                (Vec3::new(a, b, 1.0), Vec3::new(by[6], by[7], by[5]))
            }
            Self::Ball { .. } => (Vec3::splat(a), Vec3::ZERO),
            Self::Tube { .. } => (Vec3::new(a, a, b), Vec3::new(by[6], by[7], 0.0)),
            Self::Box { .. } => (Vec3::new(a, b, c), Vec3::new(by[7], by[8], by[6])),
        };
        let rotation = rotation::unit(self.rotation() * Quat::from_scaled_axis(angles));
        let mut changed = self.placed(self.centre() + shift, rotation, sizes);
        if let Self::Tube { taper, .. } = &mut changed {
            *taper = (*taper + by[5]).clamp(-MAX_TAPER, MAX_TAPER);
        }
        changed
    }

    /// Unit of shifts along the axis of a tube, scene units: its length, or the radius of a ring,
    /// which has hardly any.
    fn unit_along(&self) -> f32 {
        match *self {
            Self::Tube {
                radius,
                length,
                is_open: true,
                ..
            } => length.max(radius),
            _ => self.size().z,
        }
    }

    /// Values of [`Self::changed`] by each of which some edge of the shape moves by about `width`.
    pub(crate) fn changes_of(&self, width: f32) -> [f32; MAX_CHANGES] {
        let limited = |share: f32| share.clamp(MIN_CHANGE, MAX_CHANGE);
        let of = |length: f32| limited(width / length);
        let size = self.size();
        let [x, y, z] = size.to_array().map(of);
        let turn = |length: f32| limited(2.0 * width / length);
        match self {
            Self::Rectangle(flat) | Self::Ellipse(flat) => {
                let [a, b] = flat.size;
                let whole = of((a * b).sqrt());
                let across = turn(a.max(b));
                [
                    x,
                    y,
                    whole,
                    x,
                    y,
                    across,
                    across.max(turn(b)),
                    across.max(turn(a)),
                    0.0,
                ]
            }
            Self::Ball { .. } => [x, y, z, x, 0.0, 0.0, 0.0, 0.0, 0.0],
            Self::Tube { .. } => {
                let along = turn(size.z.max(size.x));
                [x, y, of(self.unit_along()), x, z, x, along, along, 0.0]
            }
            Self::Box { .. } => {
                let about = |a: f32, b: f32| turn(a.max(b));
                let [a, b, c] = [
                    about(size.y, size.z),
                    about(size.z, size.x),
                    about(size.x, size.y),
                ];
                [x, y, z, x, y, z, c, a, b]
            }
        }
    }

    /// First steps of a search among [`Self::changed`]: long shapes turn little.
    pub(crate) fn first_steps(&self) -> [f32; MAX_CHANGES] {
        let step = |ratio: f32| (0.5 * ratio).min(0.2);
        let across = |a: f32, b: f32| step(a.min(b) / a.max(b));
        let turns = match *self {
            Self::Rectangle(flat) | Self::Ellipse(flat) => {
                let [x, y] = flat.size;
                [across(x, y), 0.2, 0.2, 0.2]
            }
            Self::Ball { .. } => [0.2; 4],
            Self::Tube { radius, length, .. } => {
                let turn = step(2.0 * radius / length);
                [0.2, turn, turn, 0.2]
            }
            Self::Box { size, .. } => [
                0.2,
                across(size.x, size.y),
                across(size.y, size.z),
                across(size.z, size.x),
            ],
        };
        let [a, b, c, d] = turns;
        [0.2, 0.2, 0.2, 0.2, 0.2, a, b, c, d]
    }
}
