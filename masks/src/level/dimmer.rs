//! Lamps that are little brighter than the brightest surfaces.
//!
//! With less smoothing they are peaks of the histogram, and so are shines around bright lamps. Of a
//! lamp there are regions that nothing brighter is part of.

use super::{BINS_PER_STOP, Histogram, Level, NUM_BINS, SMOOTHING, bin, radiance};
use crate::mask::Mask;
use eagpt_scene::Image;

/// Standard deviations of the smoothing, bins.
const LESS_SMOOTHING: [f64; 2] = [SMOOTHING / 2.0, SMOOTHING / 4.0];
/// A diffuse surface has at most a third of the radiance of the lamp beside it (see
/// [`crate::halo`]), bins.
const SURFACE_BELOW_LAMP: usize = BINS_PER_STOP + BINS_PER_STOP * 3 / 5;
/// Least share of the pixels of a dim peak that lie in regions of their own: in seven rooms lamps
/// have a third and more, the shine around brighter ones at most a ninth.
const MIN_OWN_SHARE: f64 = 0.2;

/// A peak below the level: a dim lamp, or a shine around bright ones.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Dimmer {
    /// The level if it is a lamp.
    pub(crate) level: Level,
    /// Linear radiance from which on a lamp may light surfaces as bright as the peak.
    end: f32,
    /// Pixels between the valley below the peak and there.
    num_pixels: u64,
    /// Pixels in regions of their own.
    num_own: u64,
}

impl Histogram {
    /// Peaks below a level, the dimmest first.
    pub(crate) fn dimmer(&self, level: Option<&Level>) -> Vec<Dimmer> {
        let highest = level.map_or(NUM_BINS, |level| bin(level.level));
        let mut found: Vec<(usize, Dimmer)> = Vec::new();
        for deviation in LESS_SMOOTHING {
            let (smooth, lamps) = self.lamps(deviation);
            for lamp in lamps.iter().filter(|lamp| lamp.peak < highest) {
                let is_known =
                    |(peak, _): &(usize, _)| peak.abs_diff(lamp.peak) < SMOOTHING as usize;
                if found.iter().any(is_known) {
                    continue;
                }
                let end = highest.min(lamp.peak + SURFACE_BELOW_LAMP);
                let dimmer = Dimmer {
                    level: self.level_below(lamp, &smooth),
                    end: radiance(end as f64),
                    num_pixels: self.counts[lamp.valley..end].iter().sum(),
                    num_own: 0,
                };
                found.push((lamp.peak, dimmer));
            }
        }
        found.sort_by_key(|(peak, _)| *peak);
        found.into_iter().map(|(_, dimmer)| dimmer).collect()
    }
}

impl Dimmer {
    /// Counts the pixels of an image's `values` in regions of at least `min_pixels` that reach the
    /// level but not the end.
    pub(crate) fn add(&mut self, values: &Image<1>, min_pixels: u32) {
        let value = |x: u32, y: u32| values.get(x, y)[0];
        let (width, height) = values.size();
        let mask = Mask::from_fn(width, height, |x, y| value(x, y) >= self.level.level);
        for region in mask.regions() {
            let is_own = region.pixels.iter().all(|&[x, y]| value(x, y) < self.end);
            if is_own && region.pixels.len() >= min_pixels as usize {
                self.num_own += region.pixels.len() as u64;
            }
        }
    }

    /// Whether the pixels of all views that were added show a lamp.
    pub(crate) fn is_lamp(&self) -> bool {
        self.num_own as f64 >= MIN_OWN_SHARE * self.num_pixels as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Radiances of a picture: surfaces up to 4, a tube of 40, and pixels of 7 that touch it or
    /// not.
    fn tube_and_dim_pixels(touch: bool) -> Image<1> {
        let value = |i: u32| match (i % 200, i / 200) {
            (20..40, 20..120) => 40.0,
            (40..60, 20..120) if touch => 7.0,
            (100..120, 20..120) if !touch => 7.0,
            _ => 0.05 * 80.0_f32.powf(i as f32 / 30_000.0),
        };
        Image::from_pixels(200, 150, (0..30_000).map(|i| [value(i)]).collect()).unwrap()
    }

    #[test]
    fn a_lamp_little_brighter_than_surfaces_has_regions_of_its_own() {
        for touch in [false, true] {
            let image = tube_and_dim_pixels(touch);
            let mut histogram = Histogram::default();
            histogram.add(image.pixels().iter().map(|&[value]| value));
            let level = histogram.level().unwrap();
            assert!((8.0..40.0).contains(&level.level), "{level:?}");
            let mut dimmer = histogram.dimmer(Some(&level));
            assert!(!dimmer.is_empty());
            dimmer.iter_mut().for_each(|peak| peak.add(&image, 4));
            let level = dimmer[0].level.level;
            assert!((4.0..7.0).contains(&level), "{level}");
            assert_eq!(dimmer[0].is_lamp(), !touch);
        }
    }

    #[test]
    fn the_brightest_bins_have_no_surface_above() {
        let mut histogram = Histogram::default();
        histogram.add([0.1; 900].into_iter().chain([1e30; 90]));
        let dimmer = histogram.dimmer(None);
        assert!(dimmer.iter().all(|peak| peak.end.is_finite()));
    }
}
