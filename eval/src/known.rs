//! Comparison of images with unknown pixels.
//!
//! Per-pixel metrics are computed over the known pixels, packed into an image of one row. SSIM and
//! FLIP depend on neighbourhoods and need the whole image: SSIM counts the windows without unknown
//! pixels, and FLIP replaces the render by the reference where that is unknown, and is averaged
//! over known pixels.

use crate::window::RADIUS;
use eagpt_scene::Image;
use std::borrow::Cow;

/// Which pixels of an image are known.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct KnownPixels {
    width: usize,
    flags: Vec<bool>,
    num: usize,
}

/// Which windows of SSIM count.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Windows {
    pub(crate) counts: Vec<bool>,
    pub(crate) num: usize,
}

impl Windows {
    /// Number of windows that count.
    pub fn num(&self) -> usize {
        self.num
    }

    /// Whether the window around a pixel counts, by its index in rows.
    pub fn has(&self, pixel: usize) -> bool {
        self.counts[pixel]
    }
}

impl KnownPixels {
    /// The pixels that are not 0 in a mask of known pixels.
    pub fn new(valid: &Image<1>) -> Self {
        Self::of_flags(
            valid.width() as usize,
            valid.values().iter().map(|value| *value > 0.0).collect(),
        )
    }

    /// The pixels known in each of some masks of one size; `None` if there is no mask.
    pub(crate) fn in_all<'a>(masks: impl IntoIterator<Item = &'a Image<1>>) -> Option<Self> {
        let known = masks.into_iter().map(Self::new);
        known.reduce(|a, b| {
            let both = a.flags.iter().zip(&b.flags).map(|(a, b)| *a && *b);
            Self::of_flags(a.width, both.collect())
        })
    }

    fn of_flags(width: usize, flags: Vec<bool>) -> Self {
        let num = flags.iter().filter(|known| **known).count();
        Self { width, flags, num }
    }

    /// Number of known pixels.
    pub fn num(&self) -> usize {
        self.num
    }

    /// Whether a pixel is known, by its index in rows.
    pub fn has(&self, pixel: usize) -> bool {
        self.flags[pixel]
    }

    /// The known pixels of `image`, of the size of the mask, as one row; `None` if there are none.
    pub fn of<const C: usize>(&self, image: &Image<C>) -> Option<Image<C>> {
        let pixels = image.pixels().iter().zip(&self.flags);
        let pixels: Vec<[f32; C]> = pixels.filter(|(_, k)| **k).map(|(p, _)| *p).collect();
        if pixels.is_empty() {
            return None;
        }
        Image::from_pixels(pixels.len() as u32, 1, pixels)
    }

    /// `test` where the pixels are known, `reference` where they are not.
    pub fn with_reference<const C: usize>(
        &self,
        reference: &Image<C>,
        test: &Image<C>,
    ) -> Image<C> {
        let mut image = test.clone();
        let pairs = image.pixels_mut().iter_mut().zip(reference.pixels());
        for ((own, reference), known) in pairs.zip(&self.flags) {
            if !known {
                *own = *reference;
            }
        }
        image
    }

    /// The windows of SSIM that touch no unknown pixel.
    pub fn windows(&self) -> Windows {
        let height = self.flags.len() / self.width;
        let across: Vec<bool> = self
            .flags
            .chunks_exact(self.width)
            .flat_map(|row| all_around(row.len(), |x| row[x]))
            .collect();
        let mut counts = vec![false; self.flags.len()];
        for x in 0..self.width {
            let column = all_around(height, |y| across[y * self.width + x]);
            for (y, all) in column.enumerate() {
                counts[y * self.width + x] = all;
            }
        }
        let num = counts.iter().filter(|counts| **counts).count();
        Windows { counts, num }
    }
}

/// For each of `num` places whether all within [`RADIUS`] are set; places beyond the ends count as
/// set.
fn all_around(num: usize, is_set: impl Fn(usize) -> bool) -> impl Iterator<Item = bool> {
    // One past the last place before each that is not set: 0 if there is none.
    let mut last = 0;
    let upto: Vec<usize> = (0..num)
        .map(|i| {
            if !is_set(i) {
                last = i + 1;
            }
            last
        })
        .collect();
    (0..num).map(move |i| upto[(i + RADIUS).min(num - 1)] <= i.saturating_sub(RADIUS))
}

/// The known pixels of an image, or the whole image without a mask.
///
/// # Panics
/// If none is known.
pub(crate) fn pack<'a, const C: usize>(
    known: Option<&KnownPixels>,
    image: &'a Image<C>,
) -> Cow<'a, Image<C>> {
    match known {
        None => Cow::Borrowed(image),
        Some(known) => Cow::Owned(known.of(image).expect("some pixels are known")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mask(width: u32, height: u32, unknown: &[(u32, u32)]) -> Image<1> {
        let mut mask = Image::filled(width, height, [1.0]);
        for (x, y) in unknown {
            mask.pixels_mut()[(y * width + x) as usize] = [0.0];
        }
        mask
    }

    #[test]
    fn windows_that_touch_an_unknown_pixel_do_not_count() {
        let (width, height) = (30, 20);
        let unknown = [(9, 3), (29, 19)];
        let windows = KnownPixels::new(&mask(width, height, &unknown)).windows();
        let mut num = 0;
        for y in 0..height {
            for x in 0..width {
                let touches = |(a, b): &(u32, u32)| a.abs_diff(x) <= 5 && b.abs_diff(y) <= 5;
                let counts = !unknown.iter().any(touches);
                num += usize::from(counts);
                assert_eq!(windows.counts[(y * width + x) as usize], counts, "{x} {y}");
            }
        }
        assert_eq!(windows.num, num);
        let all = KnownPixels::new(&mask(width, height, &[])).windows();
        assert_eq!(all.num, 600);
    }

    #[test]
    fn known_pixels_are_packed_and_others_replaced() {
        let known = KnownPixels::new(&mask(3, 1, &[(1, 0)]));
        let image =
            |values: [f32; 3]| Image::from_pixels(3, 1, values.map(|v| [v]).into()).unwrap();
        let (a, b) = (image([1.0, 2.0, 3.0]), image([4.0, 5.0, 6.0]));
        assert_eq!(known.of(&a).unwrap().values(), [1.0, 3.0]);
        assert_eq!(known.with_reference(&a, &b).values(), [4.0, 2.0, 6.0]);
        let both = KnownPixels::in_all([&mask(3, 1, &[(1, 0)]), &mask(3, 1, &[(0, 0), (2, 0)])]);
        let both = both.unwrap();
        assert_eq!((both.num(), both.of(&a)), (0, None));
        assert_eq!(KnownPixels::in_all([]), None);
    }
}
