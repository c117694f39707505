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

/// Radiance of a region of lit pixels.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Level {
    /// The median of the pixels inside, or else the brightest one.
    pub(crate) radiance: Vec3,
    /// Whether pixels inside, which show the lamp alone, have it: else it may be brighter, or is a
    /// window's, which differ with the view.
    pub(crate) is_known: bool,
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
            };
        }
        let radiance = median(&inside.iter().copied());
        let alike = inside.iter().filter(|own| step(**own, radiance) <= UNLIKE);
        Self {
            radiance,
            is_known: alike.count() as f32 >= SHARE_ALIKE * inside.len() as f32,
        }
    }

    /// Whether two regions cannot be of one lamp.
    pub(crate) fn is_unlike(&self, other: &Self) -> bool {
        is_other_hue(self.radiance, other.radiance)
            || match (self.is_known, other.is_known) {
                (true, true) => self.is_dimmer(other) || other.is_dimmer(self),
                (true, false) => self.is_dimmer(other),
                (false, true) => other.is_dimmer(self),
                (false, false) => false,
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
