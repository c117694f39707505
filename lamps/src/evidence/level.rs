//! Radiances of lamps in photographs, and whether two are of one lamp.

use eagpt_masks::Region;
use eagpt_scene::Image;
use eagpt_scene::median::median;
use glam::Vec3;
use std::collections::HashMap;

/// Least step between the hues of lamps at one place, and from which on one may be told to be
/// brighter: that of one differs less with the direction.
const UNLIKE: f32 = 0.33;
/// Least step of radiance between lamps of one hue at one place: what lets light through, or is lit
/// by it, before a window or beside it, is nearer to its radiance.
const DIMMER: f32 = 0.6;
/// Share of the pixels inside a region that have to be alike for all to be known.
const SHARE_ALIKE: f32 = 0.8;
/// Share of the pixels inside a region that are no brighter than its lamp is anywhere, though they
/// are not alike, as a shade is brightest beside its bulb.
const SHARE_DIMMER: f32 = 0.9;

/// Radiance of a region of lit pixels.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Level {
    /// The median of the pixels inside, or else the brightest one.
    pub(crate) radiance: Vec3,
    /// Whether pixels inside, which show the lamp alone, have it: else it may be brighter, or is a
    /// window's, which differ with the view.
    pub(crate) is_known: bool,
    /// The brightest channel of nearly all pixels inside, if there are any.
    inside: Option<f32>,
}

impl Level {
    /// That of a region of a photograph, `region_of` whose pixels it is by its `number`.
    pub(crate) fn of(
        number: u32,
        region: &Region,
        region_of: &HashMap<[u32; 2], u32>,
        radiance: &Image<3>,
    ) -> Self {
        let is_own = |place: &[u32; 2]| region_of.get(place) == Some(&number);
        let of_pixel = |&[x, y]: &[u32; 2]| Vec3::from(radiance.get(x, y));
        let inside = region
            .pixels
            .iter()
            .filter(|pixel| neighbourhood(**pixel).iter().all(is_own));
        let inside: Vec<Vec3> = inside.map(of_pixel).collect();
        let brighter = |a: Vec3, b: Vec3| {
            if b.max_element() > a.max_element() {
                b
            } else {
                a
            }
        };
        if inside.is_empty() {
            let radiance = region
                .pixels
                .iter()
                .map(of_pixel)
                .fold(Vec3::ZERO, brighter);
            return Self {
                radiance,
                is_known: false,
                inside: None,
            };
        }
        let radiance = median(&inside.iter().copied());
        let alike = inside.iter().filter(|own| step(**own, radiance) <= UNLIKE);
        let is_known = alike.count() as f32 >= SHARE_ALIKE * inside.len() as f32;
        let mut values: Vec<f32> = inside.iter().map(|own| own.max_element()).collect();
        values.sort_unstable_by(f32::total_cmp);
        Self {
            radiance,
            is_known,
            inside: Some(values[((values.len() - 1) as f32 * SHARE_DIMMER) as usize]),
        }
    }

    /// Whether two regions cannot be of one lamp.
    pub(crate) fn is_unlike(&self, other: &Self) -> bool {
        is_other_hue(self.radiance, other.radiance)
            || match (self.is_known, other.is_known) {
                (true, true) => self.is_dimmer(other) || other.is_dimmer(self),
                (true, false) => self.is_dimmer(other) || other.is_below(self.radiance),
                (false, true) => other.is_dimmer(self) || self.is_below(other.radiance),
                (false, false) => false,
            }
    }

    /// Whether no lamp of it can be as bright as a `radiance`, though it differs within its pixels.
    fn is_below(&self, radiance: Vec3) -> bool {
        let limit = (1.0 - DIMMER) * radiance.max_element();
        self.inside.is_some_and(|most| most < limit)
    }

    /// Whether a pixel may be of the lamp of this region by its radiance, of which it shows nothing
    /// else if it `is_whole`: what is dark and has a part of it makes all channels darker alike.
    pub(crate) fn may_have(&self, radiance: Vec3, is_whole: bool) -> bool {
        match (self.is_known, is_whole) {
            (true, true) => !are_unlike(radiance, self.radiance),
            (true, false) => !is_other_hue(radiance, self.radiance) && !self.is_below(radiance),
            (false, _) => !self.is_below(radiance),
        }
    }

    fn is_dimmer(&self, other: &Self) -> bool {
        self.radiance.max_element() < (1.0 - DIMMER) * other.radiance.max_element()
    }

    /// Whether it is brighter than a lamp of the other one can be.
    pub(crate) fn outshines(&self, other: &Self) -> bool {
        let [own, other] = [self, other].map(|level| level.radiance.max_element());
        own * (1.0 - UNLIKE) > other
    }
}

/// Whether radiances cannot be of one lamp, even if something dims it.
pub(crate) fn are_unlike(a: Vec3, b: Vec3) -> bool {
    is_other_hue(a, b) || step(a, b) > DIMMER
}

/// Whether radiances differ by more than a factor: darkness that has a part of a pixel makes it as
/// much darker in all channels.
pub(crate) fn is_other_hue(a: Vec3, b: Vec3) -> bool {
    let hue = |radiance: Vec3| radiance / radiance.max_element();
    step(hue(a), hue(b)) > UNLIKE
}

/// How much two radiances differ, 0 to 1: the largest difference of a channel over the brightest.
pub(crate) fn step(a: Vec3, b: Vec3) -> f32 {
    let brightest = a.max_element().max(b.max_element());
    (a - b).abs().max_element() / brightest.max(f32::MIN_POSITIVE)
}

/// A pixel and its neighbours. Columns and rows before the first wrap around, and are outside of
/// every picture as well.
pub(crate) fn neighbourhood([x, y]: [u32; 2]) -> [[u32; 2]; 9] {
    let place = |k: u32| [(x + k % 3).wrapping_sub(1), (y + k / 3).wrapping_sub(1)];
    [0, 1, 2, 3, 4, 5, 6, 7, 8].map(place)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The level of a square region of 9 × 9 pixels of these brightnesses, row by row.
    fn level(brightness: impl Fn(u32) -> f32) -> Level {
        let places: Vec<[u32; 2]> = (0..81).map(|i| [1 + i % 9, 1 + i / 9]).collect();
        let region_of = places.iter().map(|place| (*place, 0)).collect();
        let values = (0..121).map(|i| [brightness(i / 11); 3]);
        let radiance = Image::from_pixels(11, 11, values.collect()).unwrap();
        Level::of(0, &Region { pixels: places }, &region_of, &radiance)
    }

    #[test]
    fn a_bulb_is_not_of_its_shade_though_that_is_brighter_beside_it() {
        let shade = level(|row| 1.6_f32.powf(row as f32));
        let [bulb, other_shade] = [400.0, 12.0].map(|radiance| level(|_| radiance));
        assert!(!shade.is_known && bulb.is_known && other_shade.is_known);
        assert!(shade.is_unlike(&bulb) && bulb.is_unlike(&shade));
        assert!(!shade.is_unlike(&other_shade) && !other_shade.is_unlike(&shade));
        // Something darker may have a part of a pixel, but no brighter lamp.
        for is_whole in [true, false] {
            assert!(!shade.may_have(Vec3::splat(400.0), is_whole));
            assert!(!other_shade.may_have(Vec3::splat(400.0), is_whole));
            assert!(shade.may_have(Vec3::splat(20.0), is_whole));
            // Nothing is known of a lamp of few pixels.
            assert!(Level::default().may_have(Vec3::splat(400.0), is_whole));
        }
        assert!(bulb.may_have(Vec3::splat(40.0), false));
        assert!(!Level::default().is_unlike(&bulb));
    }
}
