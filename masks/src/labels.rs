//! Label images: marks by a person or by a network such as SAM.
//!
//! A label of a view is the PNG `<view>.png` in a folder of labels, of any size; pixels neither
//! black nor transparent are marked. A folder may have labels for some views only; the others
//! remain unlabelled.

use crate::error::{MaskError, Result};
use crate::mask::Mask;
use eagpt_scene::{Dataset, SceneError, files};
use image::{DynamicImage, ImageFormat, ImageReader, Limits};
use std::io::Cursor;
use std::path::{Path, PathBuf};

/// Longest side of a label, pixels.
const MAX_SIDE: u32 = 1 << 16;
/// Most memory that decoding may take, bytes.
const MAX_BYTES: u64 = 4 << 30;
/// Subsamples a side of a pixel of the view at which the label is sampled.
const SUBPIXELS: u32 = 4;

/// The label images of a folder.
#[derive(Debug, Clone)]
pub(crate) struct Labels {
    /// For each view of the dataset, its label if there is one.
    pub files: Vec<Option<PathBuf>>,
    /// PNG files whose names match no view.
    pub strangers: Vec<PathBuf>,
}

impl Labels {
    /// The label of the view of this index in the dataset.
    pub(crate) fn of(&self, index: usize) -> Option<&Path> {
        self.files[index].as_deref()
    }
}

/// Finds the labels of a dataset's views in a folder.
///
/// # Errors
/// [`MaskError::NoLabels`] if no file is named like a view, or an I/O error of the folder.
pub(crate) fn find(folder: &Path, dataset: &Dataset) -> Result<Labels> {
    let labels: Vec<Option<PathBuf>> = dataset
        .frames()
        .iter()
        .map(|frame| {
            let path = folder.join(format!("{}.png", frame.name));
            path.is_file().then_some(path)
        })
        .collect();
    let mut strangers = files::list(folder)?;
    if labels.iter().all(Option::is_none) {
        return Err(MaskError::NoLabels {
            path: folder.to_owned(),
            num_views: dataset.len(),
            example: dataset.frames()[0].name.clone(),
        });
    }
    strangers.retain(|path| {
        let is_label = labels.iter().flatten().any(|label| label == path);
        path.extension().is_some_and(|ext| ext == "png") && !is_label
    });
    Ok(Labels {
        files: labels,
        strangers,
    })
}

/// Reads a label for a view of `size` (width, height): a pixel is marked if at least half of it is.
///
/// # Errors
/// [`SceneError`] naming the file if it is no PNG or too large.
pub(crate) fn read(path: &Path, size: (u32, u32)) -> Result<Mask, SceneError> {
    let label = decode(path)?;
    let (width, height) = size;
    let at = |pixel: u32, step: u32, size: u32, label_size: u32| {
        let place = u64::from(SUBPIXELS * pixel + step) * 2 + 1;
        // Pixel centres: place / (2 · subpixels) of the view, scaled to the label.
        let scaled = place * u64::from(label_size) / (2 * u64::from(SUBPIXELS) * u64::from(size));
        scaled as u32
    };
    Ok(Mask::from_fn(width, height, |x, y| {
        let num_marked = (0..SUBPIXELS * SUBPIXELS)
            .filter(|i| {
                let column = at(x, i % SUBPIXELS, width, label.width());
                let row = at(y, i / SUBPIXELS, height, label.height());
                label.has(column, row)
            })
            .count() as u32;
        2 * num_marked >= SUBPIXELS * SUBPIXELS
    }))
}

fn decode(path: &Path) -> Result<Mask, SceneError> {
    let bytes = files::read(path)?;
    let invalid = |problem: String| SceneError::invalid(path, "label", problem);
    let mut reader = ImageReader::with_format(Cursor::new(bytes), ImageFormat::Png);
    let mut limits = Limits::default();
    limits.max_image_width = Some(MAX_SIDE);
    limits.max_image_height = Some(MAX_SIDE);
    limits.max_alloc = Some(MAX_BYTES);
    reader.limits(limits);
    let image = reader
        .decode()
        .map_err(|error| invalid(error.to_string()))?;
    let (width, height) = (image.width(), image.height());
    Ok(match image {
        DynamicImage::ImageLuma8(gray) => {
            Mask::from_fn(width, height, |x, y| gray.get_pixel(x, y).0 != [0])
        }
        // Sixteen bits: an instance number below 256 would vanish in eight.
        other => {
            let rgba = other.into_rgba16();
            Mask::from_fn(width, height, |x, y| {
                let [r, g, b, alpha] = rgba.get_pixel(x, y).0;
                alpha != 0 && [r, g, b] != [0; 3]
            })
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{GrayImage, ImageBuffer, Luma, Rgba, RgbaImage};

    #[test]
    fn any_size_and_any_value_mark_what_they_cover() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.png");
        // Twice as large as the view: the first column is marked in full, the second one half, the
        // third a quarter.
        let rows = ["##..", "##.#", "##..", "##.."];
        let label = GrayImage::from_fn(4, 4, |x, y| {
            Luma([u8::from(rows[y as usize].as_bytes()[x as usize] == b'#')])
        });
        label.save(&path).unwrap();
        let marked = Mask::from_fn(2, 2, |x, _| x == 0);
        assert_eq!(read(&path, (2, 2)).unwrap(), marked);
        // A third of its size: nearest.
        let label = GrayImage::from_fn(2, 1, |x, _| Luma([if x == 1 { 255 } else { 0 }]));
        label.save(&path).unwrap();
        let marked = Mask::from_fn(6, 3, |x, _| x >= 3);
        assert_eq!(read(&path, (6, 3)).unwrap(), marked);
    }

    #[test]
    fn sixteen_bits_and_transparency_are_understood() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.png");
        let instances: ImageBuffer<Luma<u16>, Vec<u16>> =
            ImageBuffer::from_fn(2, 1, |x, _| Luma([x as u16]));
        instances.save(&path).unwrap();
        let right = Mask::from_fn(2, 1, |x, _| x == 1);
        assert_eq!(read(&path, (2, 1)).unwrap(), right);
        let overlay = RgbaImage::from_fn(2, 1, |x, _| Rgba([255, 0, 0, 128 * x as u8]));
        overlay.save(&path).unwrap();
        assert_eq!(read(&path, (2, 1)).unwrap(), right);
    }

    #[test]
    fn a_file_that_is_no_png_is_named() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.png");
        std::fs::write(&path, b"JFIF").unwrap();
        let message = read(&path, (2, 2)).unwrap_err().to_string();
        assert!(message.contains("a.png: label: "), "{message}");
    }
}
