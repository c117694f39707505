//! Surfaces beside lamps that masks show as lit.
//!
//! A wall right behind a bulb, or the shelf that candles stand on, is brighter than other lamps of
//! the room. It is no lamp of its own if the others send it that light: a surface may be as bright
//! as a white one is in it. What is in between is not looked at; whether each of its Gaussians
//! emits is decided later, by all light that it gets (`eagpt_light::luminous`).

use crate::candidates::Candidate;
use crate::fit::shape_search::Fit;
use crate::pixels::silhouette::Gaps;
use crate::shape::{Flat, Shape, mean_projection};
use eagpt_scene::Lamp;
use eagpt_scene::color::luminance;
use glam::{Quat, Vec3};
use std::f32::consts::PI;

/// Radiance over that of a white surface in the light of others, at most: lit surfaces beside it add
/// to that.
const EXCESS: f32 = 1.5;
/// Places across a flat shape, along each of its sides.
const GRID: usize = 6;
/// Parts of a lamp along each of its axes, at most.
const MOST_PARTS: f32 = 8.0;

/// Flat lamps that others, or `known` ones, light as brightly as they are: their shape explains
/// nothing. Known ones shine in the first light.
pub(crate) fn leave_reflecting(lamps: &mut [Candidate], known: &[Lamp]) {
    let clean = lamps.iter().filter(|lamp| lamp.is_clean);
    let of_clean = clean.map(|lamp| (lamp.light, Source::of_candidate(lamp)));
    let of_known = known.iter().map(|lamp| (0, Source::of_lamp(lamp)));
    let sources: Vec<(usize, Source)> = of_clean.chain(of_known).collect();
    for lamp in lamps {
        let Fit { shape, gaps, .. } = &lamp.fit;
        let Some(flat) = shape.flat().filter(|_| *gaps == Gaps::Seen) else {
            continue;
        };
        let own = luminance(lamp.measured.radiance.to_array());
        let brighter = sources
            .iter()
            .filter(|(light, source)| *light == lamp.light && source.luminance > own);
        let white: f32 = brighter.map(|(_, source)| source.white(flat)).sum();
        lamp.is_clean &= EXCESS * white < own;
    }
}

/// A lamp that lights others.
struct Source {
    /// Of its radiance.
    luminance: f32,
    /// Middles of parts of it that are about as long as wide, world space.
    parts: Vec<Vec3>,
    /// Mean area of the projection of each of these in directions from which it shines, scene
    /// units².
    projection: f32,
    /// Of a flat lamp, the unit normal.
    normal: Option<Vec3>,
}

impl Source {
    fn of_candidate(lamp: &Candidate) -> Self {
        Self::of_shape(&lamp.fit.shape, lamp.measured.radiance)
    }

    fn of_shape(shape: &Shape, radiance: Vec3) -> Self {
        let frame = (shape.centre(), shape.rotation(), shape.size());
        let normal = shape.flat().map(Flat::normal);
        Self::new(frame, (shape.area(), radiance), normal)
    }

    fn of_lamp(lamp: &Lamp) -> Self {
        let rotation = lamp.world_from_lamp();
        let frame = (lamp.centre(), rotation, Vec3::from(lamp.size));
        let normal = lamp.one_sided.then(|| rotation * Vec3::Z);
        Self::new(frame, (lamp.area, Vec3::from(lamp.radiance)), normal)
    }

    /// A lamp in a box of this middle, rotation and size, of whose `area` the `radiance` leaves, to
    /// the side of the `normal` if it is flat.
    fn new(frame: (Vec3, Quat, Vec3), (area, radiance): (f32, Vec3), normal: Option<Vec3>) -> Self {
        let parts = parts(frame);
        Self {
            luminance: luminance(radiance.to_array()),
            projection: mean_projection(area, normal.is_some()) / parts.len() as f32,
            parts,
            normal,
        }
    }

    /// Mean luminance that a white surface at the place of `flat` would have in its light.
    fn white(&self, flat: &Flat) -> f32 {
        self.luminance * self.mean_solid_angle(flat) / PI
    }

    /// Its solid angle as `flat` sees it, weighted by the cosine to its normal, in the mean over
    /// its area, sr; each part of a solid lamp looks the same from all sides.
    fn mean_solid_angle(&self, flat: &Flat) -> f32 {
        let of_part = |place: Vec3, part: &Vec3| {
            let towards = *part - place;
            let (distance2, direction) = (towards.length_squared(), towards.normalize_or_zero());
            // A flat lamp sends as much to the side of its normal in all as one that is round.
            let sent = self
                .normal
                .map_or(1.0, |normal| 2.0 * (-direction).dot(normal).max(0.0));
            let cosine = direction.dot(flat.normal()).max(0.0);
            // Nearer than its own size it fills no more than half of what is seen.
            cosine * sent * self.projection / distance2.max(self.projection / (2.0 * PI))
        };
        let at = |i: usize, length: f32| ((i as f32 + 0.5) / GRID as f32 - 0.5) * length;
        let places = (0..GRID * GRID).map(|i| {
            let own = Vec3::new(at(i % GRID, flat.size[0]), at(i / GRID, flat.size[1]), 0.0);
            flat.centre + flat.rotation * own
        });
        let parts = || self.parts.iter();
        let seen = places.map(|place| parts().map(|part| of_part(place, part)).sum::<f32>());
        seen.sum::<f32>() / (GRID * GRID) as f32
    }
}

/// Middles of parts of a box that are about as long as its smallest length that is not 0.
fn parts((centre, rotation, size): (Vec3, Quat, Vec3)) -> Vec<Vec3> {
    let lengths = size.to_array().into_iter().filter(|length| *length > 0.0);
    let thinnest = lengths.fold(f32::INFINITY, f32::min);
    let num = |length: f32| (length / thinnest).round().clamp(1.0, MOST_PARTS);
    let nums = size.to_array().map(num);
    let at = |k: usize, i: usize| ((i as f32 + 0.5) / nums[k] - 0.5) * size[k];
    let [x, y, z] = nums.map(|num| num as usize);
    let own = (0..x * y * z).map(|i| Vec3::new(at(0, i % x), at(1, i / x % y), at(2, i / (x * y))));
    own.map(|own| centre + rotation * own).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use eagpt_scene::rotation;

    /// Of a small ball and a small panel over the middle of a square.
    #[test]
    fn the_light_of_small_lamps_on_a_square_is_that_of_closed_forms() {
        let seen_by =
            |flat: &Flat, lamp: &Shape| Source::of_shape(lamp, Vec3::ONE).mean_solid_angle(flat);
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
        let seen = seen_by(&square, &ball) * side * side;
        let wanted = ball.mean_projection() * square_angle;
        assert!((seen / wanted - 1.0).abs() < 0.02, "{seen} {wanted}");
        let panel = |normal: Vec3| {
            Shape::Ellipse(Flat {
                centre,
                rotation: rotation::from_z_to(normal),
                size: [0.02; 2],
            })
        };
        assert_eq!(seen_by(&square, &panel(Vec3::Y)), 0.0);
        // View factor of a small plate and a parallel rectangle with a corner below it, four times
        // (Hottel).
        let (a, b) = (half / height, half / height);
        let part = |a: f32, b: f32| a / (1.0 + a * a).sqrt() * (b / (1.0 + a * a).sqrt()).atan();
        let factor = 4.0 * (part(a, b) + part(b, a)) / (2.0 * PI);
        let seen = seen_by(&square, &panel(Vec3::NEG_Y)) * side * side;
        let wanted = PI * factor * 0.25 * PI * 0.02 * 0.02;
        assert!((seen / wanted - 1.0).abs() < 0.02, "{seen} {wanted}");
    }
}
