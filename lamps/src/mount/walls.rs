//! The wall that a tube hangs before, on the far side from cameras. Its discs bulge towards the
//! tube, which gave its light to their pixels, and hide a part of it from the room.

use crate::shape::Flat;
use crate::shape::faces::{Face, Solid};
use eagpt_scene::lamps::{LampShape, emits};
use eagpt_scene::median::median;
use eagpt_scene::{Gaussians, rotation};
use glam::{Mat3, Quat, Vec3};

/// Distance from a tube within which there is its wall, in diameters.
const REACH: f32 = 4.0;
/// Least number of the wall's Gaussians; …
const MIN_NUM: usize = 8;
/// … cosine between the normal of one and that of the wall, at least; …
const COSINE: f32 = 0.7;
/// … and share of those near the tube.
const SHARE: f32 = 0.6;

/// The plane at the back of a tube, as a face that lies on its wall, where the first `num`
/// Gaussians have one; cameras at `eyes` see the tube. Other lamps have none.
pub(crate) fn behind(
    lamp: &Solid,
    eyes: &[Vec3],
    gaussians: &Gaussians,
    num: usize,
) -> Option<Face> {
    let (centre, size) = (lamp.centre, lamp.size);
    let axis = (lamp.kind == LampShape::Tube).then(|| lamp.rotation * Vec3::Z)?;
    let front = lamp.towards(eyes).reject_from_normalized(axis);
    let front = front.try_normalize()?;
    let reach = REACH * size.x;
    let is_behind = |position: Vec3| {
        let away = position - centre;
        let along = away.dot(axis).abs();
        let across = away.reject_from_normalized(axis);
        along <= 0.5 * size.z + reach && across.length() <= reach && across.dot(front) <= 0.0
    };
    let near =
        (0..num).filter(|&i| !emits(gaussians.emissions[i]) && is_behind(gaussians.positions[i]));
    let normals: Vec<Vec3> = near
        .map(|i| gaussians.rotations[i] * Vec3::Z)
        .map(|normal| normal * normal.dot(front).signum())
        .collect();
    let wall = median(&normals.iter().copied()).try_normalize()?;
    let num_along = normals.iter().filter(|n| n.dot(wall) > COSINE).count();
    if num_along < MIN_NUM || (num_along as f32) < SHARE * normals.len() as f32 {
        return None;
    }
    // A wall that the tube stands on is none that it hangs before.
    let normal = wall.reject_from_normalized(axis);
    if normal.length() < COSINE {
        return None;
    }
    let normal = normal.normalize();
    let frame = Mat3::from_cols(axis.cross(normal), axis, normal);
    Some(Face {
        flat: Flat {
            centre: centre - normal * (0.5 * size.x),
            rotation: rotation::unit(Quat::from_mat3(&frame)),
            size: [size.x, size.z],
        },
        is_mount: true,
        shines: false,
        depth: size.x,
        blur: 0.0,
    })
}
