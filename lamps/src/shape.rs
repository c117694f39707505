//! Surfaces that lamps can have, as few numbers.

mod change;
pub(crate) mod faces;
pub(crate) mod meet;
pub(crate) mod names;
pub(crate) mod search;

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
    /// A cylinder, or a cone without its tip; a flat ring is one of hardly any length whose ends
    /// are open, the narrow one in front.
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
        /// Whether its side alone shines: its ends are open and show the inside, which does not.
        is_open: bool,
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

    /// The shape that is `factor` times as far from `eye` and looks the same from there.
    pub(crate) fn farther(&self, eye: Vec3, factor: f32) -> Self {
        let centre = eye + (self.centre() - eye) * factor;
        self.placed(centre, self.rotation(), Vec3::splat(factor))
    }

    /// The shape about another `centre`, with its own axes turned to `rotation`, and `by` times as
    /// long along each of these.
    pub(crate) fn placed(&self, centre: Vec3, rotation: Quat, by: Vec3) -> Self {
        let flat = |flat: Flat| Flat {
            centre,
            rotation,
            size: [flat.size[0] * by.x, flat.size[1] * by.y],
        };
        match *self {
            Self::Rectangle(of) => Self::Rectangle(flat(of)),
            Self::Ellipse(of) => Self::Ellipse(flat(of)),
            Self::Ball { radius, .. } => Self::Ball {
                centre,
                radius: radius * by.x,
            },
            Self::Tube {
                radius,
                length,
                taper,
                is_open,
                ..
            } => Self::Tube {
                centre,
                rotation,
                radius: radius * by.x,
                length: length * by.z,
                taper,
                is_open,
            },
            Self::Box { size, .. } => Self::Box {
                centre,
                rotation,
                size: size * by,
            },
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
                is_open,
                ..
            } => {
                let slant = slant(radius, length, taper);
                let share = if is_open { 0.0 } else { 1.0 + taper * taper };
                let ends = radius * radius * share;
                2.0 * PI * (radius * slant + ends)
            }
            Self::Box { size, .. } => 2.0 * size.dot(Vec3::new(size.y, size.z, size.x)),
        }
    }

    /// Mean area of the projections in directions from which it shines, scene units².
    pub fn mean_projection(&self) -> f32 {
        mean_projection(self.area(), self.flat().is_some())
    }

    /// The same with open ends, of a tube that has closed ones.
    pub(crate) fn opened(&self) -> Option<Self> {
        let mut opened = *self;
        match &mut opened {
            Self::Tube { is_open, .. } if !*is_open => *is_open = true,
            _ => return None,
        }
        Some(opened)
    }

    /// Smallest whole length that is not 0, scene units; along the side of an open tube, which may
    /// be a flat ring.
    pub fn thinnest(&self) -> f32 {
        let size = self.size();
        if let Self::Tube {
            radius,
            length,
            taper,
            is_open: true,
            ..
        } = *self
        {
            size.x.min(slant(radius, length, taper))
        } else if size.z > 0.0 {
            size.min_element()
        } else {
            size.x.min(size.y)
        }
    }
}

/// Length of the side of a tube from end to end, scene units.
fn slant(radius: f32, length: f32, taper: f32) -> f32 {
    length.hypot(2.0 * radius * taper)
}

/// Mean area of the projections of what shines in directions from which it does, scene units²: of a
/// flat `area` half, of one on a convex body a quarter (Cauchy 1841).
pub(crate) fn mean_projection(area: f32, is_flat: bool) -> f32 {
    let share = if is_flat { 0.5 } else { 0.25 };
    share * area
}
