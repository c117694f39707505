//! Boxes, and drums, that a search for a lamp's shape begins with, where no simpler one explains its
//! silhouettes.

use crate::fit::starts::{axes, first_flat, range};
use crate::group::points::Point;
use crate::shape::Shape;
use eagpt_scene::median::median;
use eagpt_scene::rotation;
use glam::{Mat3, Quat, Vec3};
use std::f32::consts::PI;

/// Thickness of a flat lamp that may be a box, in sizes of its narrow side.
const THICKNESS: f32 = 0.2;

/// Length of an ellipse that may be a drum, at most, in its width.
const ROUND: f32 = 2.0;

/// Length of a box that may be a tube, in its mean width.
const LONG: f32 = 4.0;

/// Boxes about the `points` of a lamp and about the best shapes without edges, and whether they
/// keep their z axis, which is then `up`, the unit vector upwards.
pub(crate) fn starts(points: &[Point], best: &[Shape], up: Vec3) -> Vec<(Shape, bool)> {
    let centre = median(&points.iter().map(|p| p.position));
    let pixel = points.iter().map(|p| p.width).fold(f32::INFINITY, f32::min);
    let mut found: Vec<(Shape, bool)> = (best.iter().map(|shape| around(shape, up)))
        .flat_map(|around| [(around, false), (upright(&around, up), true)])
        .collect();
    let boxed = |rotation: Quat, size: Vec3| Shape::Box {
        centre,
        rotation,
        size,
    };
    for axis in axes(points).into_iter().chain([up]) {
        // The box of least area around the points as seen along the axis, and as long as they are.
        let flat = first_flat(points, centre, axis, pixel);
        let [x, y] = flat.size;
        let size = Vec3::new(x, y, along(points, centre, axis) + pixel);
        found.push((boxed(flat.rotation, size), false));
        // One that is level along the axis, or across it.
        let rotation = level(axis, up);
        let frame = Mat3::from_quat(rotation);
        let size = [0, 1, 2].map(|k| along(points, centre, frame.col(k)) + pixel);
        found.push((boxed(rotation, size.into()), true));
    }
    found
}

/// Length of points along an axis.
fn along(points: &[Point], centre: Vec3, axis: Vec3) -> f32 {
    range(points.iter().map(|p| (p.position - centre).dot(axis)))
}

/// A box as long and as wide as another one from above, and as high.
fn upright(of: &Shape, up: Vec3) -> Shape {
    let frame = Mat3::from_quat(of.rotation());
    let size = of.size();
    let long = (0..3).max_by(|&a, &b| {
        let across = |k: usize| size[k] * frame.col(k).cross(up).length();
        across(a).total_cmp(&across(b))
    });
    let rotation = level(frame.col(long.unwrap_or(0)), up);
    let own = Mat3::from_quat(rotation);
    let spread = |axis: Vec3| -> f32 {
        let squares = (0..3).map(|k| (size[k] * frame.col(k).dot(axis)).powi(2));
        squares.sum::<f32>().sqrt()
    };
    Shape::Box {
        centre: of.centre(),
        rotation,
        size: Vec3::from_array([0, 1, 2].map(|k| spread(own.col(k)))),
    }
}

/// The box around a shape; that of a ball is level.
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
            let across = 0.25 * PI;
            (*rotation, size * Vec3::new(across, across, 1.0))
        }
        Shape::Box { rotation, .. } => (*rotation, size),
    };
    Shape::Box {
        centre: shape.centre(),
        rotation,
        size,
    }
}

/// The flat drum about `up` in place of an ellipse, as views from below show it.
pub(crate) fn drum(of: &Shape, up: Vec3) -> Option<Shape> {
    let Shape::Ellipse(flat) = of else {
        return None;
    };
    let [a, b] = flat.size;
    let width = 0.5 * (a + b);
    (a.max(b) < ROUND * a.min(b)).then(|| Shape::Tube {
        centre: flat.centre,
        rotation: rotation::from_z_to(up),
        radius: 0.5 * width,
        length: THICKNESS * width,
        taper: 0.0,
        is_open: false,
    })
}

/// The tube in place of a box that is long.
pub(crate) fn tube(of: &Shape) -> Option<Shape> {
    let size = of.size();
    let long = (0..3).max_by(|&a, &b| size[a].total_cmp(&size[b]))?;
    let across = 0.5 * (size.element_sum() - size[long]);
    (size[long] > LONG * across).then(|| Shape::Tube {
        centre: of.centre(),
        rotation: rotation::from_z_to(Mat3::from_quat(of.rotation()).col(long)),
        // As wide as the box looks in the mean over directions across it.
        radius: 2.0 * across / PI,
        length: size[long],
        taper: 0.0,
        is_open: false,
    })
}

/// The level bar, as wide as high, in place of a tube or a box that is long.
pub(crate) fn bar(of: &Shape, up: Vec3) -> Option<Shape> {
    let tube = match *of {
        Shape::Tube { radius, length, .. } => (length > 2.0 * LONG * radius).then_some(*of),
        Shape::Box { .. } => tube(of),
        Shape::Rectangle(_) | Shape::Ellipse(_) | Shape::Ball { .. } => None,
    };
    Some(upright(&around(&tube?, up), up))
}

/// World from a frame whose z is `up` and whose x is along `axis` as far as it can be.
fn level(axis: Vec3, up: Vec3) -> Quat {
    let along = axis - up * axis.dot(up);
    let x = along.try_normalize().unwrap_or(up.any_orthonormal_vector());
    rotation::unit(Quat::from_mat3(&Mat3::from_cols(x, up.cross(x), up)))
}
