//! Shared by the decoders of RAW files: a sensor, of which a window is image.

use super::{Header, Layout, RawFrame, Samples, Want};
use crate::error::{IngestError, Result};
use std::path::Path;

/// A decoded sensor.
pub(super) struct Sensor {
    /// Header of the frame.
    pub(super) header: Header,
    /// Where the image is.
    pub(super) window: Window,
    /// Pixels in a row of `samples`.
    pub(super) stride: usize,
    /// All samples, borders included; unspecified where only the header is requested.
    pub(super) samples: Samples,
}

impl Sensor {
    /// The image alone.
    pub(super) fn framed(self, path: &Path, want: Want) -> Result<RawFrame> {
        let Self {
            header,
            window,
            stride,
            samples,
        } = self;
        if want == Want::Header {
            let samples = Samples::Integer(Vec::new());
            return Ok(RawFrame { header, samples });
        }
        let per_pixel = if header.layout == Layout::Rgb { 3 } else { 1 };
        let samples = match samples {
            Samples::Integer(all) => window.cut(all, stride, per_pixel).map(Samples::Integer),
            Samples::Float(all) => window.cut(all, stride, per_pixel).map(Samples::Float),
        };
        let outside = || {
            let problem = format!("{window:?} is outside of the image");
            IngestError::photograph(path, "crop", problem)
        };
        let samples = samples.ok_or_else(outside)?;
        Ok(RawFrame { header, samples })
    }
}

/// A pattern of so many columns and rows; `color_at` gives the channel of a row and a column.
pub(super) fn mosaic(
    columns: usize,
    rows: usize,
    color_at: impl Fn(usize, usize) -> usize,
) -> Layout {
    let channel = |index: usize| color_at(index / columns, index % columns) as u8;
    Layout::Mosaic {
        columns: columns.min(255) as u8,
        rows: rows.min(255) as u8,
        channels: (0..columns * rows).map(channel).collect(),
    }
}

/// Factors of a white balance, green 1; `None` where the file has none.
pub(super) fn as_shot([r, g, b, _]: [f32; 4]) -> Option<[f32; 3]> {
    let is_usable = [r, g, b].iter().all(|v| v.is_finite() && *v > 0.0);
    is_usable.then(|| [r / g, 1.0, b / g])
}

/// The part of a sensor's samples that is image, in pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Window {
    pub(super) left: usize,
    pub(super) top: usize,
    pub(super) width: usize,
    pub(super) height: usize,
}

impl Window {
    /// Width and height; excessive sizes are rejected later.
    pub(super) fn size(self) -> (u32, u32) {
        let side = |pixels: usize| u32::try_from(pixels).unwrap_or(u32::MAX);
        (side(self.width), side(self.height))
    }

    /// Cuts the window out of rows of `stride` pixels with `per_pixel` samples each; `None` if it
    /// is not inside.
    pub(super) fn cut<T: Copy>(
        self,
        samples: Vec<T>,
        stride: usize,
        per_pixel: usize,
    ) -> Option<Vec<T>> {
        let row = stride * per_pixel;
        if row == 0 {
            return None;
        }
        if self.left == 0
            && self.top == 0
            && self.width == stride
            && samples.len() == row * self.height
        {
            return Some(samples);
        }
        if self.left + self.width > stride || (self.top + self.height) * row > samples.len() {
            return None;
        }
        let rows = samples.chunks_exact(row).skip(self.top).take(self.height);
        let (from, to) = (self.left * per_pixel, (self.left + self.width) * per_pixel);
        Some(rows.flat_map(|row| row[from..to].iter().copied()).collect())
    }
}
