//! Planes of a scene, in which mirrors hang.

use crate::evidence::Seen;
use eagpt_scene::plane::{FittedPlane, Plane};
use eagpt_scene::rng::RandomKey;
use eagpt_trace::Ray;
use glam::{Vec2, Vec3};
use rayon::prelude::*;

/// Surfaces that planes are compared with, about.
const MAX_COMPARED: usize = 8000;
/// Planes that are tried for each that is found.
const NUM_TRIED: u32 = 256;
/// Most planes.
const MAX_PLANES: usize = 40;
/// Share of all surfaces seen that a plane has, at least.
const LEAST_SHARE: f32 = 0.004;
/// Points that make a plane, at least.
const LEAST_POINTS: usize = 12;
/// Cosine between the normal of a plane and that of a surface in it, at least: 15 degrees.
const LEAST_COSINE: f32 = 0.966;
/// Rounds in which a plane is fitted to what is near it.
const FITS: usize = 3;
/// Sine of the slope from which on a plane has an upward axis.
const LEAST_RISE: f32 = 0.3;

/// The ray that a mirror in a `plane` reflects of one from `origin`, which meets it at a `distance`,
/// from a `height` above the plane on.
pub(crate) fn reflected(
    plane: Plane,
    (origin, direction): (Vec3, Vec3),
    distance: f32,
    height: f32,
) -> Ray {
    let mirrored = plane.mirrored(direction);
    let start = origin + direction * distance + mirrored * (height / plane.normal.dot(mirrored));
    Ray::free(start.to_array(), mirrored.to_array())
}

/// Unit axes u and v in a plane of this unit `normal`, u × v being the normal: level, and as far
/// `up` as may be.
pub(crate) fn axes(normal: Vec3, up: Vec3) -> [Vec3; 2] {
    let rising = up.reject_from_normalized(normal);
    let v = match rising.length() >= LEAST_RISE {
        true => rising.normalize(),
        false => normal.any_orthonormal_vector(),
    };
    [v.cross(normal), v]
}

/// A plane, moved by `by` along its normal and turned by small `angles` about the two `axes`
/// through a `point` of it, radians.
pub(crate) fn moved(
    plane: Plane,
    (by, angles): (f32, Vec2),
    axes: [Vec3; 2],
    point: Vec3,
) -> Plane {
    let normal = (plane.normal + angles.x * axes[0] + angles.y * axes[1]).normalize();
    Plane {
        normal,
        offset: normal.dot(point) + by,
    }
}

/// Planes with many of the surfaces `seen`, those with most first; surfaces up to `near` from a
/// plane are in it.
pub(crate) fn planes(seen: &[Seen], near: f32, key: RandomKey) -> Vec<Plane> {
    let surfaces: Vec<(Vec3, Vec3)> = (seen.iter())
        .filter(|seen| seen.normal != Vec3::ZERO)
        .map(|seen| (seen.position(), seen.normal))
        .collect();
    let step = surfaces.len().div_ceil(MAX_COMPARED).max(1);
    let mut left: Vec<(Vec3, Vec3)> = surfaces.into_iter().step_by(step).collect();
    let least = ((LEAST_SHARE * left.len() as f32) as usize).max(LEAST_POINTS);
    let is_of = |plane: Plane, (position, normal): (Vec3, Vec3)| {
        plane.height(position).abs() <= near && plane.normal.dot(normal) >= LEAST_COSINE
    };
    let mut found = Vec::new();
    while found.len() < MAX_PLANES && left.len() >= least {
        let of = |number: u32| {
            let word = key.stream(number, found.len() as u32).next_words()[0];
            let (position, normal) = left[word as usize % left.len()];
            let mut plane = Plane {
                normal,
                offset: normal.dot(position),
            };
            for _ in 0..FITS {
                let own = left.iter().filter(|at| is_of(plane, **at));
                plane = fitted(own.map(|at| at.0), plane);
            }
            let num = left.iter().filter(|at| is_of(plane, **at)).count();
            (num, plane)
        };
        let tried: Vec<(usize, Plane)> = (0..NUM_TRIED).into_par_iter().map(of).collect();
        // The first of those with most.
        let Some(&(num, plane)) = tried.iter().rev().max_by_key(|(num, _)| *num) else {
            break;
        };
        if num < least {
            break;
        }
        found.push(plane);
        left.retain(|at| !is_of(plane, *at));
    }
    found
}

/// The plane through points, least squares; `before` where they are too few.
pub(crate) fn fitted(points: impl Iterator<Item = Vec3> + Clone, before: Plane) -> Plane {
    let num = points.clone().count();
    let through = FittedPlane::through(points.clone());
    let Some(normal) = through.normal.filter(|_| num >= LEAST_POINTS) else {
        return before;
    };
    let normal = normal * normal.dot(before.normal).signum();
    Plane {
        normal,
        offset: points.map(|point| normal.dot(point)).sum::<f32>() / num as f32,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(position: Vec3, normal: Vec3) -> Seen {
        let origin = position + normal + 0.3 * normal.any_orthonormal_vector();
        Seen {
            view: 0,
            origin,
            direction: (position - origin).normalize(),
            radiance: Vec3::ONE,
            distance: position.distance(origin),
            normal,
        }
    }

    /// A wall, and a tilted board of a fifth of its points that lies before it.
    #[test]
    fn planes_are_found_largest_first_and_face_the_cameras() {
        let grid = |num: u16| {
            let at = move |k: u16| f32::from(k) / f32::from(num) * 2.0 - 1.0;
            (0..num).flat_map(move |y| (0..num).map(move |x| Vec2::new(at(x), at(y))))
        };
        let normal = Vec3::new(0.6, 0.0, 0.8);
        let [u, v] = [normal.cross(Vec3::Y).normalize(), Vec3::Y];
        let wall = grid(40).map(|at| {
            let noise = 0.002 * (91.0 * at.x + 57.0 * at.y).sin();
            seen(Vec3::new(at.x, at.y, 3.0 + noise), Vec3::NEG_Z)
        });
        let board = grid(18).map(|at| seen(-2.0 * normal + 0.3 * (u * at.x + v * at.y), normal));
        let all: Vec<Seen> = wall.chain(board).collect();
        let key = RandomKey::new(3, eagpt_scene::rng::Purpose::Align, 0);
        let found = planes(&all, 0.01, key);
        assert_eq!(found.len(), 2);
        let wanted = [(Vec3::NEG_Z, -3.0), (normal, -2.0)];
        for (found, (normal, offset)) in found.iter().zip(wanted) {
            assert!(found.normal.dot(normal) > 0.9999, "{found:?}");
            assert!((found.offset - offset).abs() < 1e-3, "{found:?}");
        }
        let [u, v] = axes(found[0].normal, Vec3::Y);
        assert!(v.dot(Vec3::Y) > 0.999 && u.cross(v).dot(Vec3::NEG_Z) > 0.999);
    }
}
