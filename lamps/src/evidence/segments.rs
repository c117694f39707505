//! A lit region of a picture divided into lamps: one shines alike everywhere, so that where the
//! radiance steps one ends and another begins, as a bulb before a wide panel, or panels of two
//! colours side by side.
//!
//! Pixels that are like all their neighbours are seeds of lamps, each seed those that hang
//! together. What is brighter than the seeds around it is no mix of their light, and a lamp too
//! small to have a seed. All other pixels are mixes, and go to the lamp that they are most like.
//! How much is a step, the differences of neighbours in the region say: where light varies from
//! pixel to pixel, as in a window with a view, the region is one.

use crate::evidence::level::{are_unlike, step};
use eagpt_masks::Region;
use eagpt_scene::Image;
use eagpt_scene::median::{median, median_of};
use glam::Vec3;
use std::collections::{BTreeMap, HashMap, VecDeque};

/// A difference of so many median differences of neighbours is no noise: 4 standard deviations of a
/// normal distribution.
const NOISE: f32 = 6.0;
/// Least difference that is a step: a shade may vary as much from pixel to pixel.
const MIN_STEP: f32 = 0.1;
/// Least step to a lamp without a seed, of which no pixel may show the whole: twice as bright.
const MIN_SMALL_STEP: f32 = 0.5;
/// Pixels as far from a seed may have a part of its light: its own ones around it, and as many as
/// demosaicing and optics spread an edge over.
const REACH: u32 = 3;

/// The lamps of a region of lit pixels by the photograph's `radiance`, as regions, of each pixel
/// one.
pub(crate) fn divided(region: &Region, radiance: &Image<3>) -> Vec<Region> {
    let lit = LitPixels::new(region, radiance);
    let limit = lit.least_step();
    let is_flat = |i: usize| {
        let neighbours = lit.around(i, 1);
        neighbours.len() == 8 && neighbours.iter().all(|&j| lit.step(i, j) <= limit)
    };
    let flat: Vec<bool> = (0..lit.len()).map(is_flat).collect();
    let is_flat = |i: usize| flat[i];
    let (seeds, num_seeds) = lit.sets(is_flat, |i, j| lit.step(i, j) <= limit);
    if num_seeds == 0 {
        return vec![region.clone()];
    }
    let mut levels: Vec<Vec3> = (0..num_seeds)
        .map(|seed| {
            let of_seed = (0..lit.len()).filter(|&i| seeds[i] == Some(seed));
            median(&of_seed.map(|i| lit.radiances[i]))
        })
        .collect();
    let nearest = lit.spread(&seeds);
    let around: Vec<Vec<usize>> = (0..lit.len())
        .map(|i| lit.near(i, &seeds, nearest[i]))
        .collect();
    let least = |i: usize| {
        let of_seeds = around[i].iter().map(|&seed| levels[seed].max_element());
        of_seeds.fold(0.0, f32::max)
    };
    let is_brighter = |i: usize| {
        let (own, least) = (lit.radiances[i].max_element(), least(i));
        !flat[i] && own - least > limit.max(MIN_SMALL_STEP) * own
    };
    let (small, num_small) = lit.sets(is_brighter, |_, _| true);
    let mut brightest = vec![Vec3::ZERO; num_small];
    for (small, radiance) in small.iter().zip(&lit.radiances) {
        if let Some(lamp) = small
            && radiance.max_element() > brightest[*lamp].max_element()
        {
            brightest[*lamp] = *radiance;
        }
    }
    let mut lamps = seeds;
    for i in 0..lit.len() {
        if let Some(lamp) = small[i]
            && 2.0 * lit.radiances[i].max_element() >= least(i) + brightest[lamp].max_element()
        {
            lamps[i] = Some(num_seeds + lamp);
        }
    }
    levels.extend(brightest);
    let mixed = |i: usize| {
        let unlike = |lamp: &usize| (lit.radiances[i] - levels[*lamp]).abs().max_element();
        let near = lit.near(i, &lamps, nearest[i]).into_iter();
        near.min_by(|a, b| unlike(a).total_cmp(&unlike(b)))
    };
    let own: Vec<usize> = (0..lit.len())
        .map(|i| lamps[i].or_else(|| mixed(i)).unwrap_or(nearest[i]))
        .collect();
    // A thin lamp that lies across the rows of pixels has many seeds.
    let is_one = |i: usize, j: usize| !are_unlike(levels[own[i]], levels[own[j]]);
    let (parts, num_parts) = lit.sets(|_| true, is_one);
    // Mixes apart from the lamp that they are like are of one that they touch.
    let mut has_seed = vec![false; num_parts];
    for (part, lamp) in parts.iter().zip(&lamps) {
        has_seed[part.unwrap_or_default()] |= lamp.is_some();
    }
    let parts: Vec<Option<usize>> = (parts.into_iter())
        .map(|part| part.filter(|part| has_seed[*part]))
        .collect();
    let mut regions: BTreeMap<usize, Vec<[u32; 2]>> = BTreeMap::new();
    for (pixel, part) in region.pixels.iter().zip(lit.spread(&parts)) {
        regions.entry(part).or_default().push(*pixel);
    }
    let regions = regions.into_values();
    regions.map(|pixels| Region { pixels }).collect()
}

/// The pixels of a region.
struct LitPixels<'a> {
    pixels: &'a [[u32; 2]],
    radiances: Vec<Vec3>,
    index: HashMap<[u32; 2], usize>,
}

impl<'a> LitPixels<'a> {
    fn new(region: &'a Region, radiance: &Image<3>) -> Self {
        let pixels = region.pixels.as_slice();
        let of_pixel = |&[x, y]: &[u32; 2]| Vec3::from(radiance.get(x, y));
        Self {
            pixels,
            radiances: pixels.iter().map(of_pixel).collect(),
            index: (pixels.iter().enumerate()).map(|(i, p)| (*p, i)).collect(),
        }
    }

    fn len(&self) -> usize {
        self.pixels.len()
    }

    /// The other pixels as far from one along both axes as `reach`.
    fn around(&self, pixel: usize, reach: u32) -> Vec<usize> {
        let [x, y] = self.pixels[pixel];
        // Columns and rows before the first wrap around, and are outside as well.
        let places = (0..=2 * reach).flat_map(|v| (0..=2 * reach).map(move |u| [u, v]));
        places
            .map(|[u, v]| [(x + u).wrapping_sub(reach), (y + v).wrapping_sub(reach)])
            .filter_map(|place| self.index.get(&place).copied())
            .filter(|other| *other != pixel)
            .collect()
    }

    fn step(&self, a: usize, b: usize) -> f32 {
        step(self.radiances[a], self.radiances[b])
    }

    /// The least difference of neighbours that is a step.
    fn least_step(&self) -> f32 {
        let steps = (0..self.len()).flat_map(|i| {
            let others = self.around(i, 1).into_iter().filter(move |j| *j > i);
            others.map(move |j| self.step(i, j))
        });
        MIN_STEP.max(NOISE * median_of(steps))
    }

    /// Numbers sets of pixels that are `within`, of neighbours that are `alike`; returns the number
    /// of each, and how many there are.
    fn sets(
        &self,
        within: impl Fn(usize) -> bool,
        alike: impl Fn(usize, usize) -> bool,
    ) -> (Vec<Option<usize>>, usize) {
        let mut numbers = vec![None; self.len()];
        let mut num = 0;
        for first in 0..self.len() {
            if numbers[first].is_some() || !within(first) {
                continue;
            }
            numbers[first] = Some(num);
            let mut open = vec![first];
            while let Some(pixel) = open.pop() {
                for other in self.around(pixel, 1) {
                    if numbers[other].is_none() && within(other) && alike(pixel, other) {
                        numbers[other] = Some(num);
                        open.push(other);
                    }
                }
            }
            num += 1;
        }
        (numbers, num)
    }

    /// The number that is fewest pixels of the region away from each, where some have one.
    fn spread(&self, numbers: &[Option<usize>]) -> Vec<usize> {
        let mut nearest = numbers.to_vec();
        let mut open: VecDeque<usize> = (0..self.len()).filter(|&i| numbers[i].is_some()).collect();
        while let Some(pixel) = open.pop_front() {
            for other in self.around(pixel, 1) {
                if nearest[other].is_none() {
                    nearest[other] = nearest[pixel];
                    open.push_back(other);
                }
            }
        }
        nearest.into_iter().map(Option::unwrap_or_default).collect()
    }

    /// The numbers within [`REACH`] of a pixel, or else the `nearest` one.
    fn near(&self, pixel: usize, numbers: &[Option<usize>], nearest: usize) -> Vec<usize> {
        let others = self.around(pixel, REACH).into_iter();
        let mut near: Vec<usize> = others.filter_map(|other| numbers[other]).collect();
        if near.is_empty() {
            near.push(nearest);
        }
        near.sort_unstable();
        near.dedup();
        near
    }
}

#[cfg(test)]
mod tests;
