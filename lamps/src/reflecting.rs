//! Surfaces beside lamps that masks show as lit.
//!
//! A wall right behind a bulb, or the shelf that candles stand on, is brighter than other lamps of
//! the room. It is no lamp of its own if the others send it that light: a surface may be as bright
//! as a white one is in it. What is in between is not looked at; whether each of its Gaussians
//! emits is decided later, by all light that it gets (`eagpt_light::luminous`).

use crate::candidates::Candidate;
use crate::pixels::silhouette::Gaps;
use crate::shape::{Flat, Shape};
use eagpt_scene::color::luminance;
use glam::Vec3;
use std::f32::consts::PI;

/// Places across a flat shape, along each of its sides.
const GRID: usize = 6;
/// Parts of a lamp along each of its axes, at most.
const MOST_PARTS: f32 = 8.0;

/// Flat lamps that others light as brightly as they are: their shape explains nothing.
pub(crate) fn leave_reflecting(lamps: &mut [Candidate]) {
    let is_lit = |lamp: &Candidate| {
        let Some(flat) = lamp
            .fit
            .shape
            .flat()
            .filter(|_| lamp.fit.gaps == Gaps::Seen)
        else {
            return false;
        };
        let own = luminance(lamp.measured.radiance.to_array());
        let others = lamps.iter().filter(|other| {
            let light = luminance(other.measured.radiance.to_array());
            other.is_clean && other.light == lamp.light && light > own
        });
        let white: f32 = others.map(|other| white(flat, other)).sum();
        white >= own
    };
    let are_lit: Vec<bool> = lamps.iter().map(is_lit).collect();
    for (lamp, is_lit) in lamps.iter_mut().zip(are_lit) {
        lamp.is_clean &= !is_lit;
    }
}

/// Mean luminance that a white surface at the place of `flat` would have in the light of a lamp.
fn white(flat: &Flat, lamp: &Candidate) -> f32 {
    let radiance = luminance(lamp.measured.radiance.to_array());
    radiance * mean_solid_angle(flat, &lamp.fit.shape) / PI
}

/// Solid angle of `lamp` as `flat` sees it, weighted by the cosine to its normal, in the mean over
/// its area, sr; of a lamp in parts each of which looks the same from all sides.
fn mean_solid_angle(flat: &Flat, lamp: &Shape) -> f32 {
    let parts = parts(lamp);
    let projection = lamp.mean_projection() / parts.len() as f32;
    let of_part = |place: Vec3, part: &Vec3| {
        let towards = *part - place;
        let (distance2, direction) = (towards.length_squared(), towards.normalize_or_zero());
        // A flat lamp sends as much to the side of its normal in all as one that is round.
        let sent = match lamp.flat() {
            Some(from) => 2.0 * (-direction).dot(from.normal()).max(0.0),
            None => 1.0,
        };
        let cosine = direction.dot(flat.normal()).max(0.0);
        // Nearer than its own size it fills no more than half of what is seen.
        cosine * sent * projection / distance2.max(projection / (2.0 * PI))
    };
    let at = |i: usize, length: f32| ((i as f32 + 0.5) / GRID as f32 - 0.5) * length;
    let places = (0..GRID * GRID).map(|i| {
        let own = Vec3::new(at(i % GRID, flat.size[0]), at(i / GRID, flat.size[1]), 0.0);
        flat.centre + flat.rotation * own
    });
    let seen = places.map(|place| parts.iter().map(|part| of_part(place, part)).sum::<f32>());
    seen.sum::<f32>() / (GRID * GRID) as f32
}

/// Middles of parts of a shape that are about as long as wide.
fn parts(shape: &Shape) -> Vec<Vec3> {
    let (size, thinnest) = (shape.size(), shape.thinnest());
    let nums = size
        .to_array()
        .map(|length| (length / thinnest).round().clamp(1.0, MOST_PARTS));
    let at = |k: usize, i: usize| ((i as f32 + 0.5) / nums[k] - 0.5) * size[k];
    let [x, y, z] = nums.map(|num| num as usize);
    let own = (0..x * y * z).map(|i| Vec3::new(at(0, i % x), at(1, i / x % y), at(2, i / (x * y))));
    own.map(|own| shape.centre() + shape.rotation() * own)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use eagpt_scene::rotation;

    /// Of a small ball and a small panel over the middle of a disc, against closed forms: a point
    /// source at height h over a disc of radius r fills 2 π (1 − h / √(h² + r²)) of its view, and
    /// the flux of a small Lambertian disc parallel to it is sin² of the half angle.
    #[test]
    fn the_light_of_small_lamps_on_a_square_is_that_of_closed_forms() {
        let (height, side) = (0.3_f32, 0.8_f32);
        let square = Flat {
            centre: Vec3::new(0.1, -0.2, 0.5),
            rotation: rotation::from_z_to(Vec3::Y),
            size: [side; 2],
        };
        let centre = square.centre + Vec3::Y * height;
        let ball = Shape::Ball {
            centre,
            radius: 0.01,
        };
        // Solid angle of a square from above its middle.
        let half = 0.5 * side;
        let square_angle =
            4.0 * (half * half / (height * (height * height + 2.0 * half * half).sqrt())).atan();
        let seen = mean_solid_angle(&square, &ball) * side * side;
        let wanted = ball.mean_projection() * square_angle;
        assert!((seen / wanted - 1.0).abs() < 0.02, "{seen} {wanted}");
        let panel = |normal: Vec3| {
            Shape::Ellipse(Flat {
                centre,
                rotation: rotation::from_z_to(normal),
                size: [0.02; 2],
            })
        };
        assert_eq!(mean_solid_angle(&square, &panel(Vec3::Y)), 0.0);
        // View factor from a small plate to a rectangle with a corner below it, four times (Hottel).
        let (a, b) = (half / height, half / height);
        let part = |a: f32, b: f32| a / (1.0 + a * a).sqrt() * (b / (1.0 + a * a).sqrt()).atan();
        let factor = 4.0 * (part(a, b) + part(b, a)) / (2.0 * PI);
        let seen = mean_solid_angle(&square, &panel(Vec3::NEG_Y)) * side * side;
        let wanted = PI * factor * 0.25 * PI * 0.02 * 0.02;
        assert!((seen / wanted - 1.0).abs() < 0.02, "{seen} {wanted}");
    }
}
