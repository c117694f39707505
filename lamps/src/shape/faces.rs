//! Flat faces of lamps, which may touch what they are mounted on.

use crate::shape::{Flat, Shape};
use eagpt_scene::lamps::{Lamp, LampShape};
use eagpt_scene::rotation;
use glam::{Mat3, Quat, Vec3};
use std::f32::consts::PI;

/// Sine of the angle over its plane from which on a camera sees a face.
const SINE: f32 = 0.17;
/// Share of a camera's distance by which discs near a lamp are in the wrong place.
const BLUR: f32 = 0.2;
/// Least number of cameras that see a face, among those that show its lamp.
const MIN_EYES: usize = 2;

/// A flat face of a lamp, or the opposite of one, which lies on a mount.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Face {
    /// Place and size; the normal points to where the lamp stands out of its mount.
    pub(crate) flat: Flat,
    /// Whether it may be mounted on a surface in its plane.
    pub(crate) is_mount: bool,
    /// Whether its lamp shines along the normal, to where cameras see it.
    pub(crate) shines: bool,
    /// Size of the lamp along the normal, scene units; 0 of a panel.
    pub(crate) depth: f32,
    /// Distance by which training may have discs near it in the wrong place, scene units: a share
    /// of that of the nearest camera.
    pub(crate) blur: f32,
}

/// A lamp that may have flat faces.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Solid {
    pub(crate) kind: LampShape,
    pub(crate) centre: Vec3,
    pub(crate) rotation: Quat,
    pub(crate) size: Vec3,
}

impl Solid {
    pub(crate) fn of_shape(shape: &Shape) -> Self {
        Self {
            kind: shape.kind(),
            centre: shape.centre(),
            rotation: shape.rotation(),
            size: shape.size(),
        }
    }

    /// Sum of the unit vectors to `eyes`.
    pub(crate) fn towards(&self, eyes: &[Vec3]) -> Vec3 {
        let directions = eyes.iter().map(|eye| *eye - self.centre);
        directions.map(Vec3::normalize_or_zero).sum()
    }

    /// `None` where something real stands before the lamp.
    pub(crate) fn of_lamp(lamp: &Lamp) -> Option<Self> {
        let is_free = !lamp.bars && (lamp.shape != LampShape::Panel || lamp.one_sided);
        is_free.then(|| Self {
            kind: lamp.shape,
            centre: lamp.centre(),
            rotation: lamp.world_from_lamp(),
            size: Vec3::from(lamp.size),
        })
    }
}

/// Faces of a lamp that cameras at `eyes` see, and the opposite ones.
pub(crate) fn of(solid: &Solid, eyes: &[Vec3]) -> Vec<Face> {
    let Solid {
        kind,
        centre,
        rotation,
        size,
    } = *solid;
    let distances = eyes.iter().map(|eye| eye.distance(centre));
    let blur = distances
        .reduce(f32::min)
        .map_or(0.0, |nearest| BLUR * nearest);
    let axes = match kind {
        LampShape::Panel => {
            let flat = Flat {
                centre,
                rotation,
                size: [size.x, size.y],
            };
            return vec![Face {
                flat,
                is_mount: true,
                shines: true,
                depth: 0.0,
                blur,
            }];
        }
        LampShape::Tube => 2..3,
        LampShape::Box => 0..3,
        LampShape::Ball | LampShape::Other => return Vec::new(),
    };
    let frame = Mat3::from_quat(rotation);
    // The side of an axis seen along or against it.
    let side = |axis: usize, side: f32, normal: f32| {
        let [x, y] = [(axis + 1) % 3, (axis + 2) % 3];
        let [u, v, w] = [
            frame.col(x),
            frame.col(y) * normal,
            frame.col(axis) * normal,
        ];
        Flat {
            centre: centre + frame.col(axis) * (0.5 * side * size[axis]),
            rotation: rotation::unit(Quat::from_mat3(&Mat3::from_cols(u, v, w))),
            size: [size[x], size[y]],
        }
    };
    // Of two faces that cameras hardly see, the one away from most of them is at the mount.
    let towards_eyes = solid.towards(eyes);
    axes.flat_map(|axis| {
        let towards = towards_eyes.dot(frame.col(axis));
        let shines = match [-1.0, 1.0].map(|sign| is_seen(&side(axis, sign, sign), eyes)) {
            [false, false] => [towards < 0.0, towards > 0.0],
            seen => seen,
        };
        [(-1.0, shines[0]), (1.0, shines[1])].map(|(sign, shines)| Face {
            flat: side(axis, sign, if shines { sign } else { -sign }),
            is_mount: !shines,
            shines,
            depth: size[axis],
            blur,
        })
    })
    .collect()
}

/// Of what `eyes` see of a shape, the share that is its flat face they see most of, 0 to 1.
pub(crate) fn largest_seen(shape: &Shape, eyes: impl Iterator<Item = Vec3>) -> f32 {
    let frame = Mat3::from_quat(shape.rotation());
    let half = 0.5 * shape.size();
    // Of an area across an axis of the shape, on either side of its middle, and of what is round
    // about the z axis.
    let areas = match shape {
        Shape::Rectangle(_) | Shape::Ellipse(_) => return 1.0,
        Shape::Ball { .. } => return 0.0,
        Shape::Tube { .. } => Vec3::Z * (PI * half.x * half.y),
        Shape::Box { .. } => 4.0 * Vec3::new(half.y * half.z, half.z * half.x, half.x * half.y),
    };
    let side = match shape {
        Shape::Tube { .. } => 4.0 * half.x * half.z,
        _ => 0.0,
    };
    let mut faces = [[0.0; 2]; 3];
    let mut round = 0.0;
    for eye in eyes {
        let from_centre = frame.transpose() * (eye - shape.centre());
        for axis in 0..3 {
            for (k, sign) in [-1.0, 1.0].into_iter().enumerate() {
                let own = Vec3::AXES[axis] * (sign * half[axis]);
                let off = from_centre - own;
                let height = (sign * off[axis]).max(0.0);
                faces[axis][k] += areas[axis] * height / off.length().powi(3);
            }
        }
        round += side * from_centre.truncate().length() / from_centre.length().powi(3);
    }
    let faces = faces.as_flattened();
    let all = faces.iter().sum::<f32>() + round;
    faces.iter().copied().fold(0.0, f32::max) / all
}

fn is_seen(flat: &Flat, eyes: &[Vec3]) -> bool {
    let normal = flat.normal();
    let seen = eyes
        .iter()
        .filter(|eye| (**eye - flat.centre).normalize_or_zero().dot(normal) > SINE);
    seen.count() >= MIN_EYES
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_eyes_see_of_a_shape_is_divided_among_its_faces() {
        let turned = Quat::from_rotation_x(0.5);
        let seen = |shape: &Shape, towards: Vec3| {
            // From afar, where all faces are equally far.
            let eye = shape.centre() + turned * (1e3 * towards.normalize());
            largest_seen(shape, [eye].into_iter())
        };
        let (centre, rotation) = (Vec3::ONE, turned);
        let bar = Shape::Box {
            centre,
            rotation,
            size: Vec3::new(1.0, 1.0, 0.25),
        };
        let drum = Shape::Tube {
            centre,
            rotation,
            radius: 0.5,
            length: 0.25,
            taper: 0.0,
        };
        let cases = [
            (&bar, Vec3::Z, 1.0),
            (&bar, Vec3::new(0.0, 1.0, 1.0), 0.8),
            (&bar, Vec3::NEG_X, 1.0),
            (&drum, Vec3::NEG_Z, 1.0),
            (&drum, Vec3::X, 0.0),
            // Areas of π / 4 and of 1 / 4 across the line of sight.
            (&drum, Vec3::new(0.0, 1.0, 1.0), PI / (PI + 1.0)),
        ];
        for (shape, towards, wanted) in cases {
            let share = seen(shape, towards);
            assert!((share - wanted).abs() < 0.01, "{share} {towards}");
        }
        let ball = Shape::Ball {
            centre,
            radius: 0.5,
        };
        assert_eq!(seen(&ball, Vec3::Z), 0.0);
    }
}
