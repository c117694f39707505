//! Boxes and drums that are no more than panels.
//!
//! A flat one and a panel look alike from where cameras are, but the one sends half of its light to
//! where none of them is.

use crate::shape::{Shape, faces};
use glam::Vec3;

/// Thickness of a box that is flat, in its narrower other side, …
const FLAT: f32 = 0.1;
/// … and of a box or a drum that is flat if it is thinner than so many widths of a pixel, too.
const RATHER_FLAT: f32 = 0.3;
const FLAT_PIXELS: f32 = 0.5;
/// Share of what cameras see of a flat one that one face has.
const ONE_FACE: f32 = 0.95;

/// Whether cameras at `eyes`, a pixel of which has this `width` at the shape, scene units, know no
/// more of it than one face.
pub(super) fn is_panel(shape: &Shape, eyes: &[Vec3], width: f32) -> bool {
    let flat = match shape {
        Shape::Rectangle(_)
        | Shape::Ellipse(_)
        | Shape::Ball { .. }
        | Shape::Tube { is_open: true, .. } => return false,
        Shape::Tube { .. } => 0.0,
        Shape::Box { .. } => FLAT,
    };
    let [thickness, side] = thickness_and_side(shape);
    let is_unseen = thickness < FLAT_PIXELS * width;
    thickness < flat * side
        || (is_unseen && thickness < RATHER_FLAT * side)
        || faces::largest_seen(shape, eyes) > ONE_FACE
}

/// Whether a tube is a drum not much thicker than a panel.
pub(super) fn is_rather_flat(tube: &Shape) -> bool {
    let [thickness, side] = thickness_and_side(tube);
    thickness < RATHER_FLAT * side
}

/// Length and width of a tube, or the shortest side of a box and the next one, scene units.
fn thickness_and_side(shape: &Shape) -> [f32; 2] {
    let mut size = shape.size().to_array();
    match shape {
        Shape::Box { .. } => {
            size.sort_by(f32::total_cmp);
            [size[0], size[1]]
        }
        _ => [size[2], size[0]],
    }
}
