//! The order in which paths take a bounce.
//!
//! Rays of one realization follow each other, whose tree alone they need; among them those that
//! start in the same part of the room and go the same way, first by coarse places, then by
//! direction, then by finer places.

use super::seen::Seen;
use super::{Path, Paths};
use crate::transport::sampling::cosine_direction;
use eagpt_scene::morton;
use glam::{UVec3, Vec3};
use rayon::prelude::*;

/// Bits of each axis of a coarse place, of a direction, and of a place within a coarse one.
const COARSE: u32 = 2;
const DIRECTION: u32 = 4;
const FINE: u32 = 3;

/// Bounds of places.
#[derive(Debug, Clone, Copy)]
struct Bounds {
    low: Vec3,
    high: Vec3,
}

impl Paths<'_> {
    /// Puts paths in the order in which they take their next bounce.
    pub(super) fn put_in_order(&self, paths: &mut [Path], bounce: u32) {
        let none = Bounds {
            low: Vec3::INFINITY,
            high: Vec3::NEG_INFINITY,
        };
        let places = (paths.par_iter()).map(|path| path.vertex.surface.position);
        let bounds = places
            .map(|place| Bounds {
                low: place,
                high: place,
            })
            .reduce(
                || none,
                |a, b| Bounds {
                    low: a.low.min(b.low),
                    high: a.high.max(b.high),
                },
            );
        paths.par_sort_by_cached_key(|path| {
            let [a, b, _, choice] = self.numbers(path, bounce, 0);
            let direction = cosine_direction(path.vertex.surface.normal, a, b);
            let place = bounds.relative(path.vertex.surface.position);
            let realization = match self.seen(choice) {
                Seen::Blend => 0,
                Seen::Realization(number) => number,
            };
            place_in_order(realization, place, direction)
        });
    }
}

impl Bounds {
    /// A place within them, 0 to 1.
    fn relative(&self, place: Vec3) -> Vec3 {
        (place - self.low) / (self.high - self.low).max(Vec3::splat(f32::MIN_POSITIVE))
    }
}

/// The number by which paths are sorted, of a place and a unit direction.
fn place_in_order(realization: u32, place: Vec3, direction: Vec3) -> u32 {
    let place = cell(place, COARSE + FINE);
    let direction = cell(direction * 0.5 + 0.5, DIRECTION);
    let within = place & UVec3::splat((1 << FINE) - 1);
    let parts = [
        (place >> UVec3::splat(FINE), COARSE),
        (direction, DIRECTION),
        (within, FINE),
    ];
    parts.iter().fold(realization, |number, &(cell, bits)| {
        number << (3 * bits) | morton::code(cell.to_array()) as u32
    })
}

/// The cell of a point of the unit cube, divided into `2^bits` along each axis.
fn cell(point: Vec3, bits: u32) -> UVec3 {
    let num = (1 << bits) as f32;
    (point * num)
        .clamp(Vec3::ZERO, Vec3::splat(num - 1.0))
        .as_uvec3()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Realizations come before places, coarse places before directions, those before fine places.
    #[test]
    fn parts_of_the_order_come_one_after_the_other() {
        let of = |realization, x: f32, direction| {
            place_in_order(realization, Vec3::new(x, 0.3, 0.7), direction)
        };
        let (low, high) = (-Vec3::X, Vec3::X);
        let ascending = [
            of(0, 0.1, low),
            of(0, 0.2, low),
            of(0, 0.1, high),
            of(0, 0.3, low),
            of(0, 0.9, high),
            of(1, 0.1, low),
        ];
        assert!(ascending.is_sorted_by(|a, b| a < b), "{ascending:?}");
    }

    #[test]
    fn the_last_cell_ends_with_the_unit_cube() {
        assert_eq!(cell(Vec3::new(0.0, 0.49, 1.0), 1), UVec3::new(0, 0, 1));
    }
}
