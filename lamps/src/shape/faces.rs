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

    /// The face on one side of an axis, −1 or 1, whose normal points along the axis or against it,
    /// 1 or −1.
    fn side(&self, axis: usize, side: f32, normal: f32) -> Flat {
        let frame = Mat3::from_quat(self.rotation);
        let [x, y] = [(axis + 1) % 3, (axis + 2) % 3];
        let [u, v, w] = [
            frame.col(x),
            frame.col(y) * normal,
            frame.col(axis) * normal,
        ];
        Flat {
            centre: self.centre + frame.col(axis) * (0.5 * side * self.size[axis]),
            rotation: rotation::unit(Quat::from_mat3(&Mat3::from_cols(u, v, w))),
            size: [self.size[x], self.size[y]],
        }
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
    // Of two faces that cameras hardly see, the one away from most of them is at the mount.
    let (frame, towards_eyes) = (Mat3::from_quat(rotation), solid.towards(eyes));
    axes.flat_map(|axis| {
        let towards = towards_eyes.dot(frame.col(axis));
        let shines = match [-1.0, 1.0].map(|sign| is_seen(&solid.side(axis, sign, sign), eyes)) {
            [false, false] => [towards < 0.0, towards > 0.0],
            seen => seen,
        };
        [(-1.0, shines[0]), (1.0, shines[1])].map(|(sign, shines)| Face {
            flat: solid.side(axis, sign, if shines { sign } else { -sign }),
            is_mount: !shines,
            shines,
            depth: size[axis],
            blur,
        })
    })
    .collect()
}

/// Of what `eyes` see of a shape, the share that is its flat face they see most of, 0 to 1.
pub(crate) fn largest_seen(shape: &Shape, eyes: &[Vec3]) -> f32 {
    let solid = Solid::of_shape(shape);
    let (axes, filled, round) = match solid.kind {
        LampShape::Panel => return 1.0,
        LampShape::Ball | LampShape::Other => return 0.0,
        LampShape::Tube => (2..3, 0.25 * PI, solid.size.x * solid.size.z),
        LampShape::Box => (0..3, 1.0, 0.0),
    };
    let of_face = |flat: Flat| -> f32 {
        let solid_angles = eyes.iter().map(|eye| {
            let off = *eye - flat.centre;
            off.dot(flat.normal()).max(0.0) / off.length().powi(3)
        });
        filled * flat.size[0] * flat.size[1] * solid_angles.sum::<f32>()
    };
    let faces = axes.flat_map(|axis| [-1.0, 1.0].map(|sign| solid.side(axis, sign, sign)));
    let (largest, all) = faces
        .map(of_face)
        .fold((0.0_f32, 0.0), |(largest, all), seen| {
            (largest.max(seen), all + seen)
        });
    // The round side of a tube is a rectangle across the line of sight.
    let axis = solid.rotation * Vec3::Z;
    let of_side = eyes.iter().map(|eye| {
        let off = *eye - solid.centre;
        off.cross(axis).length() / off.length().powi(3)
    });
    largest / (all + round * of_side.sum::<f32>())
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
            largest_seen(shape, &[eye])
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
            is_open: false,
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
