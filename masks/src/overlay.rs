//! Overlays of masks on photographs.

use crate::consistency::Verdict;
use crate::error::Result;
use crate::mask::{Mask, Region};
use eagpt_scene::color::srgb8_from_linear;
use eagpt_scene::tonemap::{Display, ToneMap};
use eagpt_scene::{Image, png};
use std::path::Path;

/// Longest side of a picture, pixels.
const MAX_SIDE: u32 = 1080;
/// Colour of masked regions, sRGB.
const MASKED: [u8; 3] = [40, 220, 90];
/// Colour of regions that other views do not confirm.
const INCONSISTENT: [u8; 3] = [255, 50, 60];
/// Opacity of the tint inside a region, so that the emitter stays visible.
const INSIDE: f32 = 0.3;

/// Writes the photograph of a view with its regions tinted by their verdicts.
pub(crate) fn write(
    path: &Path,
    radiance: &Image<3>,
    regions: &[(Region, Option<Verdict>)],
    stops: f32,
) -> Result<()> {
    let (width, height) = radiance.size();
    let factor = width.max(height).div_ceil(MAX_SIDE);
    let display = Display {
        stops,
        tone_map: ToneMap::Reinhard,
    };
    let shown = display.shown(&radiance.averaged(factor));
    let mut bytes: Vec<u8> = shown
        .values()
        .iter()
        .map(|&light| srgb8_from_linear(light))
        .collect();
    for (region, verdict) in regions {
        let colour = match verdict {
            Some(Verdict::Inconsistent) => INCONSISTENT,
            _ => MASKED,
        };
        tint(
            &mut bytes,
            shown.size(),
            &mask_of(region, factor, shown.size()),
            colour,
        );
    }
    Ok(png::write_rgb8(
        path,
        shown.width(),
        shown.height(),
        &bytes,
    )?)
}

/// The pixels of an overlay, `factor` times smaller than the view, that show a region.
fn mask_of(region: &Region, factor: u32, (width, height): (u32, u32)) -> Mask {
    let mut pixels = vec![false; width as usize * height as usize];
    for [x, y] in region
        .pixels
        .iter()
        .map(|pixel| pixel.map(|at| at / factor))
    {
        // The last row and column may have no whole square of their own.
        if x < width && y < height {
            pixels[(y * width + x) as usize] = true;
        }
    }
    Mask::from_fn(width, height, |x, y| pixels[(y * width + x) as usize])
}

fn tint(bytes: &mut [u8], (width, height): (u32, u32), mask: &Mask, colour: [u8; 3]) {
    for y in 0..height {
        for x in (0..width).filter(|&x| mask.has(x, y)) {
            let neighbours = [
                (x.wrapping_sub(1), y),
                (x + 1, y),
                (x, y.wrapping_sub(1)),
                (x, y + 1),
            ];
            let is_outline = neighbours.iter().any(|&(x, y)| !mask.has(x, y));
            let share = if is_outline { 1.0 } else { INSIDE };
            let at = 3 * (y * width + x) as usize;
            for (byte, colour) in bytes[at..at + 3].iter_mut().zip(colour) {
                let mixed = (1.0 - share) * f32::from(*byte) + share * f32::from(colour);
                *byte = mixed.round() as u8;
            }
        }
    }
}
