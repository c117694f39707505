//! From the shots of a stack to an image of linear light.

use crate::color::ColorTransform;
use crate::demosaic::{Demosaic, interpolate};
use crate::merge::{CLIPPED, DARK, MergeCounts, merge};
use crate::noise::Noise;
use crate::raw::{Layout, RawFrame};
use crate::resample::{fitted, shrink, shrink_flags};
use crate::response::Response;
use crate::stack::Shot;
use crate::vignetting::Falloff;
use eagpt_scene::Image;
use eagpt_scene::lens::Undistortion;
use rayon::prelude::*;

/// Parameters shared by a whole capture.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Recipe {
    /// Response of the camera, for pictures for display.
    pub(crate) response: Option<Response>,
    pub(crate) color: ColorTransform,
    pub(crate) falloff: Option<Falloff>,
    /// Radiance of the range per exposure.
    pub(crate) scale: f64,
    pub(crate) clip: f32,
    pub(crate) demosaic: Demosaic,
    pub(crate) undistortion: Option<Undistortion>,
    pub(crate) long_side: Option<u32>,
}

/// A stack as an image.
#[derive(Debug, Clone)]
pub(crate) struct Developed {
    /// Linear Rec.709, not negative.
    pub(crate) image: Image<3>,
    /// [`CLIPPED`] and [`DARK`] for each pixel.
    pub(crate) flags: Vec<u8>,
    /// Samples that are clipped or dark in all shots.
    pub(crate) counts: MergeCounts,
    /// Samples of the sensor.
    pub(crate) num_samples: u64,
    /// Share of values that were below 0 and are 0 now: noise, and colours outside of Rec.709.
    pub(crate) negative_share: f64,
    /// Contrast of the finest detail, 0 to 1.
    pub(crate) sharpness: f64,
}

/// Rows that a thread takes at once, at least.
const BAND_ROWS: usize = 16;
/// Standard deviations of read noise where the scale of the interpolation becomes linear.
const FLOOR_SIGMAS: f32 = 4.0;

/// Develops shots sorted by exposure; `frames` are consumed, since they are most of the memory.
pub(crate) fn develop(
    frames: Vec<RawFrame>,
    exposures: &[f64],
    noise: &Noise,
    recipe: &Recipe,
) -> Developed {
    let shots: Vec<Shot<'_>> = frames
        .iter()
        .zip(exposures)
        .map(|(frame, &exposure)| Shot { frame, exposure })
        .collect();
    let mut merged = merge(&shots, noise, recipe.clip);
    let counts = merged.counts();
    let num_samples = merged.flags.len() as u64;
    let header = frames[0].header.clone();
    drop(shots);
    drop(frames);
    let (width, height, row_len) = (
        header.width as usize,
        header.height as usize,
        header.row_len(),
    );
    let per_pixel = row_len / width;
    let gains = recipe.color.white_balance;
    let falloff = recipe.falloff.as_ref();
    // Balanced before colours are interpolated: methods expect grey to be equal in all channels.
    merged
        .radiance
        .par_chunks_mut(row_len)
        .enumerate()
        .for_each(|(row, line)| {
            let factors = falloff.map(|falloff| falloff.row_factors(width, height, row));
            for (sample, value) in line.iter_mut().enumerate() {
                let channel = header.channel(row, sample);
                let factor = factors
                    .as_ref()
                    .map_or(1.0, |factors| factors[sample / per_pixel][channel]);
                *value *= gains[channel] * factor;
            }
        });
    let longest = exposures.last().copied().unwrap_or(1.0) as f32;
    let floor = FLOOR_SIGMAS * noise.read.sqrt() / longest;
    let mut pixels = interpolate(&header, &merged.radiance, recipe.demosaic, floor);
    let flags = pixel_flags(&merged.flags, width, height, &header.layout);
    drop(merged);
    // Above this, a clipped sample of one channel would meet unclipped ones of others: lamps would
    // turn magenta.
    let shortest = exposures.first().copied().unwrap_or(1.0) as f32;
    let neutral = gains.into_iter().fold(f32::INFINITY, f32::min) * recipe.clip / shortest;
    let scale = recipe.scale as f32;
    let negative: u64 = pixels
        .par_chunks_mut(width)
        .zip(flags.par_chunks(width))
        .enumerate()
        .with_min_len(BAND_ROWS)
        .map(|(row, (pixels, flags))| {
            let clipped = flags.iter().any(|flags| flags & CLIPPED != 0);
            let factors = falloff
                .filter(|_| clipped)
                .map(|f| f.row_factors(width, height, row));
            let mut negative = 0_u64;
            for (column, (pixel, flags)) in pixels.iter_mut().zip(flags).enumerate() {
                if flags & CLIPPED != 0 {
                    let factor = factors.as_ref().map_or(1.0, |factors| factors[column][1]);
                    *pixel = pixel.map(|value| value.min(neutral * factor));
                }
                *pixel = recipe.color.apply(*pixel).map(|value| value * scale);
                for value in pixel.iter_mut() {
                    negative += u64::from(*value < 0.0);
                    *value = value.max(0.0);
                }
            }
            negative
        })
        .sum();
    let negative_share = negative as f64 / (3 * pixels.len()) as f64;
    let mut image = Image::filled(0, 0, [0.0; 3]);
    if let Some(whole) = Image::from_pixels(header.width, header.height, pixels) {
        image = whole;
    }
    let mut flags = flags;
    let square = header.square_size();
    if square != image.size() {
        flags = shrink_flags(&flags, image.size(), square);
        image = shrink(&image, square);
    }
    let sharpness = sharpness(&image, floor * scale);
    if let Some(undistortion) = &recipe.undistortion {
        (image, flags) = undistorted(undistortion, image, flags);
    }
    if let Some(long_side) = recipe.long_side {
        let size = fitted(image.size(), long_side);
        flags = shrink_flags(&flags, image.size(), size);
        image = shrink(&image, size);
    }
    Developed {
        image,
        flags,
        counts,
        num_samples,
        negative_share,
        sharpness,
    }
}

/// The image of the pinhole camera; a pixel has the flags of all pixels it was resampled from.
fn undistorted(
    undistortion: &Undistortion,
    image: Image<3>,
    flags: Vec<u8>,
) -> (Image<3>, Vec<u8>) {
    let (width, height) = image.size();
    let share = |flags: u8, flag: u8| f32::from(u8::from(flags & flag != 0));
    let shares = flags.iter().map(|&f| [share(f, CLIPPED), share(f, DARK)]);
    let shares = Image::from_pixels(width, height, shares.collect());
    // The sizes are those that the lens was made for.
    let (Ok(moved), Some(Ok(shares))) = (
        undistortion.apply(&image),
        shares.map(|shares| undistortion.apply(&shares)),
    ) else {
        return (image, flags);
    };
    let flag = |share: f32, flag: u8| if share > 1e-3 { flag } else { 0 };
    let flags = shares.image.pixels().iter();
    let flags = flags
        .map(|[clipped, dark]| flag(*clipped, CLIPPED) | flag(*dark, DARK))
        .collect();
    (
        moved.image.map(|pixel| pixel.map(|value| value.max(0.0))),
        flags,
    )
}

/// Flags of pixels: those of their samples, and clipped where a neighbour is clipped, since colours
/// are interpolated from it.
fn pixel_flags(flags: &[u8], width: usize, height: usize, layout: &Layout) -> Vec<u8> {
    if *layout == Layout::Rgb {
        return flags
            .chunks_exact(3)
            .map(|all| all[0] | all[1] | all[2])
            .collect();
    }
    let mut out = flags.to_vec();
    out.par_chunks_mut(width)
        .enumerate()
        .for_each(|(row, line)| {
            let rows = row.saturating_sub(1)..(row + 2).min(height);
            for near in rows.map(|row| &flags[row * width..][..width]) {
                // Most rows have no clipped samples.
                if near.iter().all(|flags| flags & CLIPPED == 0) {
                    continue;
                }
                for (column, flags) in line.iter_mut().enumerate() {
                    let columns = column.saturating_sub(1)..(column + 2).min(width);
                    *flags |= near[columns].iter().fold(0, |all, flags| all | flags) & CLIPPED;
                }
            }
        });
    out
}

/// Contrast of the finest detail: in squares of 32 pixels, the largest second difference of
/// luminance along rows over the light around it; of these, the value that a tenth of the squares
/// exceeds. Squares at the noise floor are left out.
fn sharpness(image: &Image<3>, floor: f32) -> f64 {
    const SIDE: usize = 32;
    let (width, height) = (image.width() as usize, image.height() as usize);
    let columns = width / SIDE;
    let mut contrasts: Vec<f32> = (0..height / SIDE)
        .into_par_iter()
        .flat_map_iter(|square_row| {
            let mut largest = vec![0.0_f32; columns];
            for row in square_row * SIDE..(square_row + 1) * SIDE {
                let line = &image.pixels()[row * width..][..width];
                for column in 1..columns * SIDE - 1 {
                    let [left, middle, right] =
                        [-1_isize, 0, 1].map(|d| line[column.saturating_add_signed(d)][1]);
                    let light = left + 2.0 * middle + right;
                    if light > 40.0 * floor {
                        let contrast = (left - 2.0 * middle + right).abs() / light;
                        let square = &mut largest[column / SIDE];
                        *square = square.max(contrast);
                    }
                }
            }
            largest.into_iter().filter(|v| *v > 0.0)
        })
        .collect();
    if contrasts.is_empty() {
        return 0.0;
    }
    let place = (contrasts.len() * 9 / 10).min(contrasts.len() - 1);
    f64::from(*contrasts.select_nth_unstable_by(place, f32::total_cmp).1)
}
