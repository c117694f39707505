//! One view's mask: pixels, connected regions, and the operations that tidy them up.

#[cfg(test)]
pub(crate) mod tests;

use crate::options::MaskOptions;
use eagpt_scene::Image;
use image::{GrayImage, Luma};
use imageproc::distance_transform::Norm;
use imageproc::morphology;
use imageproc::region_labelling::{Connectivity, connected_components};

const ON: Luma<u8> = Luma([255]);
const OFF: Luma<u8> = Luma([0]);

/// A set of pixels.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Mask {
    pixels: GrayImage,
}

/// A connected part of a mask, diagonal neighbours included.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Region {
    /// Its pixels (column, row), row by row; never empty.
    pub pixels: Vec<[u32; 2]>,
}

impl Region {
    /// The mean of its pixels' centres, pixels from the image's corner.
    pub(crate) fn centre(&self) -> [f64; 2] {
        let sum = self.pixels.iter().fold([0.0; 2], |sum, pixel| {
            [0, 1].map(|axis: usize| sum[axis] + f64::from(pixel[axis]) + 0.5)
        });
        sum.map(|sum| sum / self.pixels.len() as f64)
    }
}

impl Mask {
    /// An empty mask.
    pub(crate) fn empty(width: u32, height: u32) -> Self {
        Self {
            pixels: GrayImage::new(width, height),
        }
    }

    /// The mask of the pixels (column, row) for which `is_in` is true.
    pub fn from_fn(width: u32, height: u32, is_in: impl Fn(u32, u32) -> bool) -> Self {
        let pixels = GrayImage::from_fn(width, height, |x, y| if is_in(x, y) { ON } else { OFF });
        Self { pixels }
    }

    /// The mask of the pixels of a region, of an image of this width and height.
    pub(crate) fn of(region: &Region, [width, height]: [u32; 2]) -> Self {
        let mut mask = Self::empty(width, height);
        for &[x, y] in &region.pixels {
            mask.set(x, y, true);
        }
        mask
    }

    /// Width in pixels.
    pub(crate) fn width(&self) -> u32 {
        self.pixels.width()
    }

    /// Height in pixels.
    pub(crate) fn height(&self) -> u32 {
        self.pixels.height()
    }

    /// Whether a pixel is in the mask; what is outside of the image is not.
    pub fn has(&self, x: u32, y: u32) -> bool {
        self.pixels.get_pixel_checked(x, y) == Some(&ON)
    }

    /// The pixels of the image as far from one along both axes as `reach`, itself among them, row by
    /// row.
    pub fn around(&self, [x, y]: [u32; 2], reach: u32) -> impl Iterator<Item = [u32; 2]> + use<> {
        let columns = x.saturating_sub(reach)..(x + reach + 1).min(self.width());
        let rows = y.saturating_sub(reach)..(y + reach + 1).min(self.height());
        rows.flat_map(move |y| columns.clone().map(move |x| [x, y]))
    }

    /// Puts a pixel of the image in the mask, or takes it out.
    ///
    /// # Panics
    /// If it is outside of the image.
    pub fn set(&mut self, x: u32, y: u32, is_in: bool) {
        self.pixels.put_pixel(x, y, if is_in { ON } else { OFF });
    }

    /// Number of pixels in the mask.
    pub(crate) fn count(&self) -> u64 {
        self.pixels.pixels().filter(|&&p| p == ON).count() as u64
    }

    /// Share of the image in the mask.
    pub(crate) fn coverage(&self) -> f64 {
        self.count() as f64 / (f64::from(self.width()) * f64::from(self.height()))
    }

    /// The mask as an image: 1 inside, 0 elsewhere.
    pub(crate) fn image(&self) -> Image<1> {
        let values = self.pixels.pixels().map(|&p| [f32::from(p == ON)]);
        Image::from_pixels(self.width(), self.height(), values.collect())
            .expect("one value for each pixel")
    }

    /// Adds the pixels of `other`.
    pub(crate) fn add(&mut self, other: &Self) {
        self.combine(other, |mine, its| mine | its);
    }

    /// Removes the pixels of `other`.
    pub(crate) fn subtract(&mut self, other: &Self) {
        self.combine(other, |mine, its| mine & !its);
    }

    fn combine(&mut self, other: &Self, f: impl Fn(u8, u8) -> u8) {
        debug_assert_eq!(self.pixels.dimensions(), other.pixels.dimensions());
        for (mine, its) in self.pixels.pixels_mut().zip(other.pixels.pixels()) {
            mine.0[0] = f(mine.0[0], its.0[0]);
        }
    }

    /// Removes the pixels of a region.
    pub(crate) fn remove(&mut self, region: &Region) {
        for &[x, y] in &region.pixels {
            self.set(x, y, false);
        }
    }

    /// Connected regions in the order of their first pixels.
    pub fn regions(&self) -> Vec<Region> {
        let labels = connected_components(&self.pixels, Connectivity::Eight, OFF);
        let mut regions: Vec<Region> = Vec::new();
        let mut index_of_label = Vec::new();
        for (x, y, &Luma([label])) in labels.enumerate_pixels() {
            let label = label as usize;
            if label == 0 {
                continue;
            }
            if index_of_label.len() <= label {
                index_of_label.resize(label + 1, None);
            }
            let index = *index_of_label[label].get_or_insert_with(|| {
                regions.push(Region { pixels: Vec::new() });
                regions.len() - 1
            });
            regions[index].pixels.push([x, y]);
        }
        regions
    }

    /// Closes gaps, drops small regions that have no pixel of `sure`, and grows what is left, as the
    /// options say.
    pub(crate) fn tidy(&mut self, options: &MaskOptions, sure: &Self) {
        if options.closing_radius > 0 {
            self.close(options.closing_radius);
        }
        if options.min_pixels > 1 {
            for region in self.regions() {
                let is_sure = || region.pixels.iter().any(|&[x, y]| sure.has(x, y));
                if region.pixels.len() < options.min_pixels as usize && !is_sure() {
                    self.remove(&region);
                }
            }
        }
        if options.grow_radius > 0 {
            morphology::dilate_mut(&mut self.pixels, Norm::L2, options.grow_radius);
        }
    }

    /// Fills gaps up to twice as wide as `radius`. The image is taken to go on beyond its edges as
    /// it is there.
    fn close(&mut self, radius: u8) {
        let pad = 2 * u32::from(radius);
        let (width, height) = self.pixels.dimensions();
        let nearest = |at: u32, size: u32| at.saturating_sub(pad).min(size - 1);
        let mut padded = GrayImage::from_fn(width + 2 * pad, height + 2 * pad, |x, y| {
            *self.pixels.get_pixel(nearest(x, width), nearest(y, height))
        });
        morphology::close_mut(&mut padded, Norm::L2, radius);
        for (x, y, pixel) in self.pixels.enumerate_pixels_mut() {
            *pixel = *padded.get_pixel(x + pad, y + pad);
        }
    }
}
