//! Resampling an image through a map of positions.
//!
//! Catmull-Rom where pixels keep their size or grow, means of such samples where they shrink. A
//! bicubic filter rings around a lamp that is a thousand times brighter than the wall behind it;
//! each sample is therefore kept between the least and the greatest of the four pixels around it.
//! Light does not become negative, and masks stay within 0 and 1.

use crate::image::Image;
use glam::DVec2;
use rayon::prelude::*;

/// Samples along an axis of a pixel that covers more of the source than this many pixels are no
/// closer together.
const MAX_SAMPLES: u32 = 8;
/// Source pixels that a target pixel may cover, along an axis, before more than one sample is
/// taken: up to there the filter is soft enough.
const MAX_SHRINK: f64 = 1.25;

/// A resampled image and where it is known.
#[derive(Debug, Clone, PartialEq)]
pub struct Remapped<const C: usize> {
    /// The image; 0 where nothing is known.
    pub image: Image<C>,
    /// 1 where the source has the pixel's centre, 0 elsewhere.
    pub valid: Image<1>,
}

impl<const C: usize> Remapped<C> {
    /// Number of pixels that the source does not show.
    pub fn num_unknown(&self) -> usize {
        self.valid.values().iter().filter(|&&v| v == 0.0).count()
    }
}

/// An image of `size` pixels (width, height) whose position p shows what `source` has at
/// `source_from_target(p)`.
///
/// Positions are continuous with pixel centres at +0.5. A position that has no source, or one
/// outside of it, is unknown.
pub fn remap<const C: usize>(
    source: &Image<C>,
    size: (u32, u32),
    source_from_target: impl Fn(DVec2) -> Option<DVec2> + Sync,
) -> Remapped<C> {
    let mut image = Image::filled(size.0, size.1, [0.0; C]);
    let mut valid = Image::filled(size.0, size.1, [0.0]);
    let row_length = size.0.max(1) as usize;
    let rows = image
        .pixels_mut()
        .par_chunks_mut(row_length)
        .zip(valid.pixels_mut().par_chunks_mut(row_length));
    rows.enumerate().for_each(|(y, (row, valid_row))| {
        for (x, (pixel, valid)) in row.iter_mut().zip(valid_row).enumerate() {
            let corner = DVec2::new(x as f64, y as f64);
            if let Some(value) = pixel_value(source, corner, &source_from_target) {
                *pixel = value;
                *valid = [1.0];
            }
        }
    });
    Remapped { image, valid }
}

/// The value of the pixel whose upper left corner is at `corner`.
fn pixel_value<const C: usize>(
    source: &Image<C>,
    corner: DVec2,
    source_from_target: &(impl Fn(DVec2) -> Option<DVec2> + Sync),
) -> Option<[f32; C]> {
    let centre = corner + 0.5;
    let at = source_from_target(centre).filter(|at| is_inside(source, *at))?;
    let extent = |step: DVec2| {
        let beside = source_from_target(centre + step);
        beside.map_or(1.0, |beside| 2.0 * (beside - at).length())
    };
    let [num_x, num_y] = [DVec2::new(0.5, 0.0), DVec2::new(0.0, 0.5)].map(|step| {
        let extent = extent(step);
        if extent <= MAX_SHRINK {
            1
        } else {
            (extent.ceil() as u32).min(MAX_SAMPLES)
        }
    });
    if (num_x, num_y) == (1, 1) {
        return Some(sample(source, at));
    }
    let mut sum = [0.0_f64; C];
    let mut num_samples = 0_u32;
    for j in 0..num_y {
        for i in 0..num_x {
            let within = DVec2::new(
                (f64::from(i) + 0.5) / f64::from(num_x),
                (f64::from(j) + 0.5) / f64::from(num_y),
            );
            let at = source_from_target(corner + within).filter(|at| is_inside(source, *at));
            if let Some(at) = at {
                for (sum, value) in sum.iter_mut().zip(sample(source, at)) {
                    *sum += f64::from(value);
                }
                num_samples += 1;
            }
        }
    }
    if num_samples == 0 {
        return Some(sample(source, at));
    }
    Some(sum.map(|sum| (sum / f64::from(num_samples)) as f32))
}

fn is_inside<const C: usize>(source: &Image<C>, at: DVec2) -> bool {
    let (width, height) = source.size();
    at.x >= 0.0 && at.y >= 0.0 && at.x <= f64::from(width) && at.y <= f64::from(height)
}

/// Catmull-Rom at a position inside of the image, kept between the four pixels around it. Beyond
/// the edge its pixels go on.
fn sample<const C: usize>(source: &Image<C>, at: DVec2) -> [f32; C] {
    let (width, height) = source.size();
    let (x, tx) = split(at.x, width);
    let (y, ty) = split(at.y, height);
    let (weights_x, weights_y) = (catmull_rom(tx), catmull_rom(ty));
    let mut sum = [0.0_f32; C];
    let mut low = [f32::INFINITY; C];
    let mut high = [f32::NEG_INFINITY; C];
    for (j, weight_y) in weights_y.iter().enumerate() {
        for (i, weight_x) in weights_x.iter().enumerate() {
            let value = source.get(x[i], y[j]);
            let is_near = (1..=2).contains(&i) && (1..=2).contains(&j);
            for channel in 0..C {
                sum[channel] += weight_x * weight_y * value[channel];
                if is_near {
                    low[channel] = low[channel].min(value[channel]);
                    high[channel] = high[channel].max(value[channel]);
                }
            }
        }
    }
    for channel in 0..C {
        sum[channel] = sum[channel].max(low[channel]).min(high[channel]);
    }
    sum
}

/// The four pixels around a position along an axis of `size` pixels, and how far it is from the
/// second to the third.
fn split(position: f64, size: u32) -> ([u32; 4], f32) {
    let from_centre = position - 0.5;
    let first = from_centre.floor();
    let last = i64::from(size) - 1;
    // Positions are inside of an image of at most 2³² pixels.
    let index = |offset: i64| (first as i64 + offset).clamp(0, last) as u32;
    ([-1, 0, 1, 2].map(index), (from_centre - first) as f32)
}

/// Weights of four neighbours at `t` between the second and the third (Keys' cubic, a = −1/2).
fn catmull_rom(t: f32) -> [f32; 4] {
    let (t2, t3) = (t * t, t * t * t);
    [
        0.5 * (-t3 + 2.0 * t2 - t),
        0.5 * (3.0 * t3 - 5.0 * t2 + 2.0),
        0.5 * (-3.0 * t3 + 4.0 * t2 + t),
        0.5 * (t3 - t2),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(width: u32, height: u32, f: impl Fn(f64, f64) -> f32) -> Image<1> {
        let pixels = (0..height)
            .flat_map(|y| (0..width).map(move |x| (f64::from(x) + 0.5, f64::from(y) + 0.5)))
            .map(|(x, y)| [f(x, y)])
            .collect();
        Image::from_pixels(width, height, pixels).unwrap()
    }

    #[test]
    fn whole_pixels_keep_their_bits() {
        let source = image(9, 7, |x, y| (x * 1.7 + y * y * 0.3) as f32);
        let moved = remap(&source, (9, 7), |p| Some(p + DVec2::new(2.0, 1.0)));
        for y in 0..7 {
            for x in 0..9 {
                let known = x + 2 < 9 && y + 1 < 7;
                assert_eq!(moved.valid.get(x, y), [f32::from(u8::from(known))]);
                let wanted = if known {
                    source.get(x + 2, y + 1)
                } else {
                    [0.0]
                };
                assert_eq!(moved.image.get(x, y), wanted);
            }
        }
        assert_eq!(moved.num_unknown(), 63 - 7 * 6);
    }

    #[test]
    fn a_ramp_is_reproduced_and_shrinking_takes_means() {
        let source = image(64, 48, |x, y| (0.25 * x + 0.5 * y) as f32);
        let shifted = remap(&source, (40, 30), |p| Some(p + DVec2::new(10.3, 5.6)));
        let small = remap(&source, (16, 12), |p| Some(p * 4.0));
        for (remapped, scale, offset) in [(shifted, 1.0, [10.3, 5.6]), (small, 4.0, [0.0, 0.0])] {
            let (width, height) = remapped.image.size();
            for y in 1..height - 1 {
                for x in 1..width - 1 {
                    let at = |n: u32, offset: f64| (f64::from(n) + 0.5) * scale + offset;
                    let wanted = 0.25 * at(x, offset[0]) + 0.5 * at(y, offset[1]);
                    let [got] = remapped.image.get(x, y);
                    // Single precision of values up to 40.
                    assert!(
                        (f64::from(got) - wanted).abs() < 2e-5,
                        "{x} {y}: {got} {wanted}"
                    );
                }
            }
        }
        // A checkerboard that is halved is grey, not one of its colours.
        let board = image(32, 32, |x, y| ((x.floor() + y.floor()) % 2.0) as f32);
        let half = remap(&board, (16, 16), |p| Some(p * 2.0));
        let inner = |v: u32| (1..15).contains(&v);
        for y in (0..16).filter(|&v| inner(v)) {
            for x in (0..16).filter(|&v| inner(v)) {
                assert!((half.image.get(x, y)[0] - 0.5).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn a_lamp_does_not_ring() {
        let source = image(20, 20, |x, y| if x > 10.0 && y > 10.0 { 1e4 } else { 0.1 });
        let moved = remap(&source, (19, 19), |p| Some(p + 0.37));
        let values = moved.image.values();
        assert!(values.iter().all(|v| (0.1..=1e4).contains(v)));
    }
}
