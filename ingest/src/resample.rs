//! Downsampling: means over areas, which keep the light and cause no rims around lamps.

use eagpt_scene::Image;
use rayon::prelude::*;

/// The pixels of the larger image that a smaller one's pixel covers along one axis, with the shares
/// of it that they fill.
fn coverage(from: u32, to: u32) -> Vec<(usize, Vec<f32>)> {
    let step = f64::from(from) / f64::from(to);
    (0..to)
        .map(|index| {
            let (start, end) = (f64::from(index) * step, f64::from(index + 1) * step);
            let first = start.floor() as usize;
            let last = (end.ceil() as usize).clamp(first + 1, from as usize);
            let shares = (first..last).map(|pixel| {
                let overlap = end.min((pixel + 1) as f64) - start.max(pixel as f64);
                (overlap / step) as f32
            });
            (first, shares.collect())
        })
        .collect()
}

/// The size with the longer side at most `long_side`, and the shape of the image as near as pixels
/// allow.
pub(crate) fn fitted((width, height): (u32, u32), long_side: u32) -> (u32, u32) {
    let long = width.max(height);
    if long <= long_side {
        return (width, height);
    }
    let scaled = |side: u32| {
        let side = f64::from(side) * f64::from(long_side) / f64::from(long);
        (side.round() as u32).max(1)
    };
    (scaled(width), scaled(height))
}

/// An image of `size`, not larger than `image` in any direction, each pixel the mean over its area.
pub(crate) fn shrink(image: &Image<3>, size: (u32, u32)) -> Image<3> {
    if image.size() == size {
        return image.clone();
    }
    let (columns, rows) = (
        coverage(image.width(), size.0),
        coverage(image.height(), size.1),
    );
    let width = image.width() as usize;
    let mut pixels = vec![[0.0_f32; 3]; size.0 as usize * size.1 as usize];
    pixels
        .par_chunks_mut(size.0 as usize)
        .zip(&rows)
        .for_each(|(out, (first_row, row_shares))| {
            let mut line = vec![[0.0_f32; 3]; width];
            for (offset, share) in row_shares.iter().enumerate() {
                let row = &image.pixels()[(first_row + offset) * width..][..width];
                for (sum, pixel) in line.iter_mut().zip(row) {
                    for channel in 0..3 {
                        sum[channel] += share * pixel[channel];
                    }
                }
            }
            for (pixel, (first, shares)) in out.iter_mut().zip(&columns) {
                for (share, source) in shares.iter().zip(&line[*first..]) {
                    for channel in 0..3 {
                        pixel[channel] += share * source[channel];
                    }
                }
            }
        });
    let mut small = Image::filled(size.0, size.1, [0.0; 3]);
    small.pixels_mut().copy_from_slice(&pixels);
    small
}

/// As [`shrink`] for flags: a pixel has those of all pixels it covers any of.
pub(crate) fn shrink_flags(flags: &[u8], from: (u32, u32), to: (u32, u32)) -> Vec<u8> {
    if from == to {
        return flags.to_vec();
    }
    let (columns, rows) = (coverage(from.0, to.0), coverage(from.1, to.1));
    let width = from.0 as usize;
    let mut small = Vec::with_capacity(to.0 as usize * to.1 as usize);
    for (first_row, row_shares) in &rows {
        for (first, shares) in &columns {
            let mut all = 0;
            for row in *first_row..first_row + row_shares.len() {
                let part = &flags[row * width + first..][..shares.len()];
                all = part.iter().fold(all, |all, flags| all | flags);
            }
            small.push(all);
        }
    }
    small
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn areas_are_weighted_by_what_they_cover() {
        let pixels = [0.0, 3.0, 9.0].map(|v| [v, 2.0 * v, 1.0]).to_vec();
        let image = Image::from_pixels(3, 1, pixels).unwrap();
        let small = shrink(&image, (2, 1));
        // Pixels of 1.5: (0 + 3/2) / 1.5 and (3/2 + 9) / 1.5.
        let expected = [[1.0, 2.0, 1.0], [7.0, 14.0, 1.0]];
        for (pixel, expected) in small.pixels().iter().zip(expected) {
            for channel in 0..3 {
                assert!(
                    (pixel[channel] - expected[channel]).abs() < 1e-5,
                    "{pixel:?}"
                );
            }
        }
        assert_eq!(shrink_flags(&[0, 1, 2], (3, 1), (2, 1)), [1, 3]);
        assert_eq!(fitted((6000, 4000), 1200), (1200, 800));
        assert_eq!(fitted((300, 200), 1200), (300, 200));
    }
}
