//! Names of lamps, by where they are.

use crate::shape::Shape;
use glam::Vec3;

/// A flat lamp that faces down by more than this (cosine) is a ceiling's; one that faces sideways
/// by more than this (sine) a wall's.
const FACING: f32 = 0.7;
/// Share of the height of what the cameras see above which a lamp that faces down is at the
/// ceiling.
const HIGH: f32 = 0.8;

/// Names for lamps, given in order; `lowest` and `highest` are heights along `up` between which
/// the room is.
pub(crate) fn names(shapes: &[Shape], up: Vec3, lowest: f32, highest: f32) -> Vec<String> {
    let mut counts = std::collections::BTreeMap::new();
    shapes
        .iter()
        .map(|shape| {
            let place = place(shape, up, lowest, highest);
            let count = counts.entry(place).or_insert(0);
            *count += 1;
            format!("{place}-{count}")
        })
        .collect()
}

fn place(shape: &Shape, up: Vec3, lowest: f32, highest: f32) -> &'static str {
    let share = (shape.centre().dot(up) - lowest) / (highest - lowest).max(f32::MIN_POSITIVE);
    match shape {
        Shape::Ball { .. } => "ball",
        Shape::Tube { .. } => "tube",
        Shape::Box { .. } => "box",
        Shape::Rectangle(flat) | Shape::Ellipse(flat) => {
            let facing = flat.normal().dot(up);
            if facing < -FACING && share > HIGH {
                "ceiling"
            } else if facing.abs() < FACING {
                "wall"
            } else {
                "panel"
            }
        }
    }
}
