//! Lamps thinner than a pixel: where the line of one goes from a row of pixels to the next, both
//! have a part of it, and a mask neither.

use eagpt_masks::{Mask, Region};
use eagpt_scene::Image;

/// Share of the radiance of a thin region's brightest pixel from which on a pixel beside it has a
/// part of the lamp. A white surface beside a lamp has less, unless it is lit from near by.
const MIN_SHARE: f32 = 0.25;

/// The pixels of `lit`, and those that complete the lines of thin lamps among them. `radiance` is
/// the photograph's; only pixels that `is_known` are added. What would make a line a patch, as a
/// bright surface beside it, is not added.
pub(crate) fn completed(
    lit: &Mask,
    radiance: &Image<3>,
    is_known: impl Fn(u32, u32) -> bool,
) -> Mask {
    let bright = |[x, y]: [u32; 2]| radiance.get(x, y).into_iter().fold(0.0, f32::max);
    let mut longer = lit.clone();
    for region in lit.regions().iter().filter(|region| is_thin(lit, region)) {
        let brightest = region
            .pixels
            .iter()
            .copied()
            .map(bright)
            .fold(0.0, f32::max);
        let mut ends = region.pixels.clone();
        while let Some(end) = ends.pop() {
            for [u, v] in lit.around(end, 1) {
                let is_part = is_known(u, v) && bright([u, v]) >= MIN_SHARE * brightest;
                if is_part && !longer.has(u, v) {
                    longer.set(u, v, true);
                    ends.push([u, v]);
                }
            }
        }
    }
    let patches = longer
        .regions()
        .into_iter()
        .filter(|region| !is_thin(&longer, region));
    let patches: Vec<Region> = patches.collect();
    for [x, y] in patches.into_iter().flat_map(|region| region.pixels) {
        if !lit.has(x, y) {
            longer.set(x, y, false);
        }
    }
    longer
}

/// Whether a region has no pixel with eight neighbours in it.
fn is_thin(mask: &Mask, region: &Region) -> bool {
    let around = [u32::MAX, 0, 1];
    let has_all = |[x, y]: &[u32; 2]| {
        let has = |dx: &u32, dy: &u32| mask.has(x.wrapping_add(*dx), y.wrapping_add(*dy));
        around.iter().all(|dy| around.iter().all(|dx| has(dx, dy)))
    };
    !region.pixels.iter().any(has_all)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test ends with its first surprise")]

    use super::*;

    /// A picture whose pixels have these digits, of ten, of the lamp's radiance, and where they are
    /// lit: from 6 on.
    fn picture(rows: &[&str]) -> (Image<3>, Mask) {
        let (width, height) = (rows[0].len() as u32, rows.len() as u32);
        let digit = |x: u32, y: u32| f32::from(rows[y as usize].as_bytes()[x as usize] - b'0');
        let pixels = (0..width * height).map(|i| [4.0 * digit(i % width, i / width); 3]);
        let radiance = Image::from_pixels(width, height, pixels.collect()).unwrap();
        let lit = Mask::from_fn(width, height, |x, y| digit(x, y) >= 6.0);
        (radiance, lit)
    }

    fn shown(mask: &Mask, (width, height): (u32, u32)) -> Vec<String> {
        let row = |y| {
            (0..width)
                .map(|x| if mask.has(x, y) { '#' } else { '.' })
                .collect()
        };
        (0..height).map(row).collect()
    }

    #[test]
    fn a_line_that_breaks_between_rows_is_one() {
        let (radiance, lit) = picture(&[
            "1111111111111",
            "1999975310111",
            "1001357999991",
            "1111111111111",
        ]);
        let whole = completed(&lit, &radiance, |_, _| true);
        assert_eq!(
            shown(&whole, radiance.size()),
            [
                ".............",
                ".#######.....",
                "....########.",
                "............."
            ]
        );
    }

    #[test]
    fn a_bright_surface_beside_a_line_is_none_of_it() {
        let (radiance, lit) = picture(&["444444", "999999", "444444", "444444"]);
        let same = completed(&lit, &radiance, |_, _| true);
        assert_eq!(shown(&same, radiance.size()), shown(&lit, radiance.size()));
    }

    #[test]
    fn what_is_not_known_is_not_added() {
        let (radiance, lit) = picture(&["0000000", "0995399", "0000000"]);
        let whole = completed(&lit, &radiance, |x, _| x != 4);
        assert_eq!(shown(&whole, radiance.size())[1], ".###.##");
    }
}
