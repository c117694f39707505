//! Boxes that a search for a lamp's shape begins with, where no simpler one explains its
//! silhouettes.

use crate::shape::Shape;
use crate::starts::{Point, axes, first_flat, range};
use eagpt_scene::median::median;
use eagpt_scene::rotation;
use glam::{Mat3, Quat, Vec3};

/// Thickness of a flat lamp that may be a box, in sizes of its narrow side.
const THICKNESS: f32 = 0.2;

/// Boxes about the `points` of a lamp, with edges along the axes that a tube may have and one that
/// is level if it can be, and about the `best` shape without edges; `up` is the unit vector up.
pub(crate) fn starts(points: &[Point], best: &Shape, up: Vec3) -> Vec<Shape> {
    let centre = median(&points.iter().map(|p| p.position));
    let pixel = points.iter().map(|p| p.width).fold(f32::INFINITY, f32::min);
    let mut found = vec![around(best, up)];
    let axes = axes(points).into_iter().chain([up]);
    for axis in axes {
        // The box of least area around the points as seen along the axis, and as long as they are.
        let flat = first_flat(points, centre, axis, pixel);
        let along = points.iter().map(|p| (p.position - centre).dot(axis));
        let length = range(along) + pixel;
        let size = Vec3::new(flat.size[0], flat.size[1], length);
        found.push(Shape::Box {
            centre,
            rotation: flat.rotation,
            size,
        });
        let upright = level(axis, up);
        found.push(Shape::Box {
            centre,
            rotation: upright,
            size,
        });
    }
    found
}

/// The box around a shape; a round one is turned to be level.
fn around(shape: &Shape, up: Vec3) -> Shape {
    let size = shape.size();
    let (rotation, size) = match shape {
        Shape::Rectangle(flat) | Shape::Ellipse(flat) => {
            let thickness = THICKNESS * size.x.min(size.y);
            (flat.rotation, size + Vec3::Z * thickness)
        }
        Shape::Ball { .. } => (level(up, up), 0.8 * size),
        // As wide as it looks in the mean over directions across it.
        Shape::Tube { rotation, .. } => {
            let across = 0.25 * std::f32::consts::PI;
            let size = size * Vec3::new(across, across, 1.0);
            (level(*rotation * Vec3::Z, up), size)
        }
        Shape::Box { rotation, .. } => (*rotation, size),
    };
    Shape::Box {
        centre: shape.centre(),
        rotation,
        size,
    }
}

/// World from a frame whose z is `axis` and whose x is level.
fn level(axis: Vec3, up: Vec3) -> Quat {
    let x = up.cross(axis).normalize_or(axis.any_orthonormal_vector());
    rotation::unit(Quat::from_mat3(&Mat3::from_cols(x, axis.cross(x), axis)))
}
