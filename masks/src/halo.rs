//! Surfaces that a lamp close by lights as brightly as a dim lamp shines.
//!
//! One level serves a whole scene. Where one lamp is dim, the ceiling above a bright tube may be
//! brighter. The ceiling's light falls off with the distance from the tube; a lamp ends at an edge.
//! A strip of wall between a tube and a mirror ends at edges, too, but is no brighter than the tube
//! can make it.

use crate::mask::{Mask, Region};
use eagpt_scene::Image;
use std::collections::HashSet;
use std::f32::consts::{PI, SQRT_2};

/// A diffuse surface beside a lamp has less of its radiance: it sees no more of the lamp than half
/// of its sky, has an albedo below 0.8, and the lamp's brightest pixel may be a little brighter
/// than the others.
const MAX_SHARE: f32 = 1.0 / 3.0;
/// Least number of places where a surface is compared.
const MIN_PLACES: usize = 4;
/// Rim of what is beside a lamp: the light of a tube fades by up to 4.5 within three pixels on a
/// ceiling 4 cm above it, in pixels of 2 cm.
const BESIDE: Rim = Rim {
    edge: 5.0,
    soft_share: 0.5,
};
/// … and of what has no lamp in it, as a pool of light on a wall, which a shade before it may cut:
/// at most .05 of the rims of lamps of nine rooms fade, unless they glow, and .43 to .76 of those of
/// pools around a floor lamp.
const ALONE: Rim = Rim {
    edge: 1.5,
    soft_share: 0.4,
};
/// So do the brighter parts of it, .25 to .9 of their rims; of a lamp amid its glow some part has a
/// rim of which .14 at most fades.
const PART: Rim = Rim {
    edge: 1.5,
    soft_share: 0.18,
};
/// Ratio of the radiances from which on parts are looked at.
const STEP: f32 = SQRT_2;
/// Share of the light that would arrive if a surface and the lamp faced each other that it reflects:
/// its albedo times the mean of both cosines. Of eleven rooms nine tenths of the pixels of each lit
/// surface are below 0.42, the median of each at most 0.28.
const REFLECTED: f32 = 0.35;
/// Share of the pixels of a surface that a lamp can make as bright as they are, from which on it
/// has.
const LIT_SHARE: f32 = 0.8;
/// Pixels of a lamp that are farther than this from one count nothing for it.
const REACH: u32 = 16;

/// The rim of a lit surface, which fades where a lamp has an edge.
struct Rim {
    /// Ratio of the radiances within and outside of an edge, three pixels apart.
    edge: f32,
    /// Share of the rim, more than that, which is no edge.
    soft_share: f32,
}

/// Takes out of a mask of pixels by their `values` what lamps light.
pub(crate) fn remove(mask: &mut Mask, values: &Image<1>) {
    let (width, height) = values.size();
    let mut dim = Mask::empty(width, height);
    let mut alone = Vec::new();
    for region in mask.regions() {
        if fades_throughout(&region, mask, values) {
            alone.push(region);
            continue;
        }
        let (_, pixels) = divided(&region, values);
        dim.add(&Mask::of(&Region { pixels }, [width, height]));
    }
    // Surfaces of two regions do not touch.
    for surface in dim.regions() {
        for lamp in lamps_behind(&surface, values) {
            dim.remove(&lamp);
        }
    }
    let mut surfaces = dim.regions();
    let mut lamps = mask.clone();
    lamps.subtract(&dim);
    surfaces.retain(|surface| {
        BESIDE.fades(&surface.pixels, mask, values) || is_lit(surface, &lamps, values)
    });
    for surface in surfaces.iter().chain(&alone) {
        mask.remove(surface);
    }
}

/// The pixels of a region that are as bright as a lamp is where its brightest one is of one, and
/// those that surfaces beside it may be.
fn divided(region: &Region, values: &Image<1>) -> (Vec<[u32; 2]>, Vec<[u32; 2]>) {
    let value = |&[x, y]: &[u32; 2]| values.get(x, y)[0];
    let brightest = region.pixels.iter().map(value).fold(0.0, f32::max);
    let pixels = region.pixels.iter().copied();
    pixels.partition(|pixel| value(pixel) >= MAX_SHARE * brightest)
}

/// Parts of a surface that end at edges within it, as a window behind a shade.
fn lamps_behind(surface: &Region, values: &Image<1>) -> Vec<Region> {
    let (bright, pixels) = divided(surface, values);
    let (width, height) = values.size();
    let rest = Mask::of(&Region { pixels }, [width, height]);
    let inside = Mask::from_fn(width, height, |x, y| !rest.has(x, y));
    let mut parts = Mask::of(&Region { pixels: bright }, [width, height]).regions();
    parts.retain(|part| {
        let softness = BESIDE.softness(&part.pixels, &inside, values);
        softness.is_some_and(|share| share <= BESIDE.soft_share)
    });
    parts
}

/// Whether a region of `mask` and all brighter parts of it fade at their rims.
fn fades_throughout(region: &Region, mask: &Mask, values: &Image<1>) -> bool {
    let (width, height) = values.size();
    if !ALONE.fades(&region.pixels, mask, values) {
        return false;
    }
    let value = |&[x, y]: &[u32; 2]| values.get(x, y)[0];
    let all = || region.pixels.iter().map(value);
    let brightest = all().fold(0.0, f32::max);
    let mut level = STEP * all().fold(f32::INFINITY, f32::min);
    while level <= brightest {
        let pixels = region.pixels.iter().copied();
        let pixels: Vec<[u32; 2]> = pixels.filter(|pixel| value(pixel) >= level).collect();
        let part = Region { pixels };
        let rim = PART.softness(&part.pixels, &Mask::of(&part, [width, height]), values);
        let is_soft = match rim {
            Some(share) => share > PART.soft_share,
            // The peak of what fades may be a few pixels.
            None => STEP * level > brightest,
        };
        if !is_soft {
            return false;
        }
        level *= STEP;
    }
    true
}

impl Rim {
    /// Whether the values of `pixels` of `mask` have no edge at their rim.
    fn fades(&self, pixels: &[[u32; 2]], mask: &Mask, values: &Image<1>) -> bool {
        let softness = self.softness(pixels, mask, values);
        softness.is_some_and(|share| share > self.soft_share)
    }

    /// Share of the rim of `pixels` of `mask` that is no edge; none where too little is seen of it.
    fn softness(&self, pixels: &[[u32; 2]], mask: &Mask, values: &Image<1>) -> Option<f32> {
        let own: HashSet<[u32; 2]> = pixels.iter().copied().collect();
        let (width, height) = values.size();
        let (mut num, mut num_soft) = (0_usize, 0_usize);
        for &[x, y] in pixels {
            // To the left, the right, upwards and downwards.
            for (dx, dy) in [(-1_i64, 0_i64), (1, 0), (0, -1), (0, 1)] {
                let at = |steps: i64| -> Option<[u32; 2]> {
                    let x = u32::try_from(i64::from(x) + steps * dx).ok()?;
                    let y = u32::try_from(i64::from(y) + steps * dy).ok()?;
                    (x < width && y < height).then_some([x, y])
                };
                let outside = [at(1), at(2)].map(|place| place.filter(|&[x, y]| !mask.has(x, y)));
                let inside = at(-1).filter(|place| own.contains(place));
                if let (Some(inside), [Some(_), Some([u, v])]) = (inside, outside) {
                    num += 1;
                    let [x, y] = inside;
                    num_soft += usize::from(values.get(x, y)[0] < self.edge * values.get(u, v)[0]);
                }
            }
        }
        (num >= MIN_PLACES).then(|| num_soft as f32 / num as f32)
    }
}

/// Whether the light of `lamps` explains the values of a surface, which is at least as far from
/// them as it looks. Pixels that touch a lamp may show a part of it.
fn is_lit(surface: &Region, lamps: &Mask, values: &Image<1>) -> bool {
    let touches = |pixel: [u32; 2]| lamps.around(pixel, 1).any(|[u, v]| lamps.has(u, v));
    let apart = surface.pixels.iter().copied();
    let apart: Vec<[u32; 2]> = apart.filter(|pixel| !touches(*pixel)).collect();
    let is_explained = |&&[x, y]: &&[u32; 2]| {
        let lamp = lamps.around([x, y], REACH);
        let lamp = lamp.filter(|&[u, v]| lamps.has(u, v));
        let arriving = lamp.map(|[u, v]| {
            let squared = u.abs_diff(x).pow(2) + v.abs_diff(y).pow(2);
            values.get(u, v)[0] / (PI * squared as f32)
        });
        values.get(x, y)[0] < REFLECTED * arriving.sum::<f32>()
    };
    let num = apart.iter().filter(is_explained).count();
    apart.len() >= MIN_PLACES && num as f32 > LIT_SHARE * apart.len() as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: u32 = 60;
    const LEVEL: f32 = 6.0;

    /// The mask of these values, by their place from the middle, without what lamps light.
    fn left(value: impl Fn(f32, f32) -> f32) -> Mask {
        let value = |x: u32, y: u32| value(x as f32 - 30.0, y as f32 - 30.0);
        let pixels = (0..SIZE * SIZE).map(|i| [value(i % SIZE, i / SIZE)]);
        let values = Image::from_pixels(SIZE, SIZE, pixels.collect()).unwrap();
        let mut mask = Mask::from_fn(SIZE, SIZE, |x, y| value(x, y) >= LEVEL);
        remove(&mut mask, &values);
        mask
    }

    /// The mask of a lamp of radiance 70 in columns 20 to 23 and rows 20 to 39, beside a surface of
    /// these values at a number of pixels from it.
    fn masked(beside: impl Fn(f32) -> f32) -> Mask {
        left(|x, y| {
            // Columns -10 to -7 and rows -10 to 9.
            let [dx, dy] = [(x + 8.5).abs() - 1.5, (y + 0.5).abs() - 9.5];
            if dx <= 0.0 && dy <= 0.0 {
                return 70.0;
            }
            beside(dx.max(0.0).hypot(dy.max(0.0))).max(0.5)
        })
    }

    #[test]
    fn what_a_lamp_lights_is_none_and_a_dim_lamp_before_it_is() {
        // A ceiling at a distance of six pixels: the light of a tube falls off with the angle.
        let ceiling = masked(|away| 13.0 / (1.0 + (away / 6.0).powi(2)));
        assert_eq!(ceiling.count(), 4 * 20);
        let panel = masked(|away| if away < 8.0 { 9.0 } else { 0.5 });
        assert!(panel.count() > 400, "{}", panel.count());
    }

    #[test]
    fn a_strip_between_a_lamp_and_an_edge_is_lit_by_it_if_it_is_no_brighter() {
        let strip = |radiance: f32| masked(move |away| if away < 3.5 { radiance } else { 0.1 });
        assert_eq!(strip(7.0).count(), 4 * 20);
        // As bright as a shade about a bulb.
        assert!(strip(22.0).count() > 200, "{}", strip(22.0).count());
    }

    /// Radiances of 7 to 12 in the middle of a picture, on 5 around it, or on 0.5.
    #[test]
    fn what_fades_all_around_is_no_lamp() {
        let left = |edge: f32, surroundings: f32| {
            let value = |x: f32, y: f32| {
                let fading = 12.0 / (1.0 + (x.hypot(y) / 20.0).powi(2));
                if x.hypot(y) < edge {
                    fading
                } else {
                    fading.min(surroundings)
                }
            };
            left(value).count()
        };
        assert_eq!(left(60.0, 12.0), 0);
        assert!(left(15.0, 0.5) > 600);
        // A lamp that glows about its own edge.
        assert!(left(15.0, 4.0) > 600);
    }

    /// The light of a bulb in a shade on the wall behind it, over the shade's edge in row 38.
    #[test]
    fn a_pool_of_light_is_no_lamp_though_a_shade_ends_it_below() {
        let pool = |x: f32, y: f32| 18.0 / (1.0 + (x.hypot(y - 8.0) / 12.0).powi(2));
        let mask = left(|x, y| if y < 8.0 { pool(x, y) } else { 0.2 });
        assert_eq!(mask.count(), 0);
        // A lamp amid as much light.
        let lamp = |x: f32, y: f32| x.hypot(y) < 5.0;
        let mask = left(|x, y| {
            if lamp(x, y) {
                30.0
            } else {
                pool(x, y + 8.0).min(9.0)
            }
        });
        assert!(mask.count() >= 69, "{}", mask.count());
    }

    #[test]
    fn a_window_behind_a_shade_stays() {
        let mask = left(|x, y| match (x, y) {
            _ if x.hypot(y) < 3.0 => 300.0,
            _ if x.hypot(y) < 14.0 => 7.0,
            _ if (8.0..25.0).contains(&x) && (0.0..20.0).contains(&y) => 90.0,
            _ => 2.0,
        });
        assert!(mask.has(30, 30) && mask.has(50, 40));
        assert!(!mask.has(30, 20) && !mask.has(22, 30));
    }

    #[test]
    fn an_edge_that_optics_spread_is_one() {
        // From nine to one tenth of it in 2.7 pixels.
        let spread = masked(|away| 9.0 / (1.0 + (1.6 * (away - 8.0)).exp()));
        assert!(spread.count() > 350, "{}", spread.count());
    }
}
