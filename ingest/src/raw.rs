//! Undeveloped photographs: the interface between decoders and everything else.
//!
//! [`Decoding`] reads the header of a file or decodes its samples, in this process or in others
//! that a damaged file can end. Nothing is scaled, clipped or balanced here: samples below the
//! black level stay, since the mean of a dark shot would be too bright without them. The features
//! `rawler` and `rawloader` select the decoder of RAW files; with both, `rawloader` reads files
//! that `rawler` cannot.

mod ciff;
mod decoding;
mod display;
mod exif;
mod kinds;
mod linear;
mod metadata;
#[cfg(any(feature = "rawler", feature = "rawloader"))]
mod panics;
#[cfg(any(feature = "rawler", feature = "rawloader"))]
mod sensor;
#[cfg(feature = "rawler")]
mod with_rawler;
#[cfg(feature = "rawloader")]
mod with_rawloader;
mod worker;

pub use decoding::Decoding;
pub use display::Display;
pub use kinds::FileKind;
pub(crate) use kinds::kind_of;
pub use metadata::Metadata;
pub use worker::{Workers, serve_decoding};

use crate::error::{IngestError, Result};
use serde::{Deserialize, Serialize};
use std::path::Path;
use std::sync::Arc;

/// Largest image that is decoded, in pixels: above any camera of today, far below what exhausts
/// memory.
pub(crate) const MAX_PIXELS: u64 = 1 << 28;

/// Widths of a pixel over its height that are believed.
const PIXEL_ASPECTS: std::ops::RangeInclusive<f64> = 0.125..=8.0;

/// Longest period of channels times that of black levels along a row: X-Trans (6) with levels of
/// its own for each column.
const MAX_PERIOD: usize = 36;

/// A decoded photograph.
#[derive(Debug, Clone)]
pub struct RawFrame {
    /// Metadata stated by the file.
    pub header: Header,
    /// `[height, width]` for a mosaic, `[height, width, 3]` for linear RGB.
    pub samples: Samples,
}

/// Samples as they are in the file.
#[derive(Debug, Clone, PartialEq)]
pub enum Samples {
    /// Integers of up to 16 bits.
    Integer(Vec<u16>),
    /// Floating point.
    Float(Vec<f32>),
}

/// Metadata stated by a file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Header {
    /// Width in pixels, borders cut off.
    pub width: u32,
    /// Height in pixels, borders cut off.
    pub height: u32,
    /// Layout of colours.
    pub layout: Layout,
    /// Black level at the positions of a repeating block.
    pub(crate) black: Black,
    /// Value at which a channel saturates, R, G, B; infinite where the format has none.
    #[serde(with = "crate::numbers::or_null")]
    pub white: [f32; 3],
    /// Colour calibration of the camera.
    pub(crate) color: CameraColor,
    /// Colours of a picture for display, whose samples are codes; `None`: samples are light.
    pub display: Option<Display>,
    /// Exposure, camera, lens, time.
    pub metadata: Metadata,
}

/// Layout of colours on the sensor or in the file.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Layout {
    /// A colour filter array: the channels (0 red, 1 green, 2 blue) of the block at the top left,
    /// row by row.
    Mosaic {
        /// Columns of the block: 2 for Bayer, 6 for X-Trans.
        columns: u8,
        /// Rows of the block.
        rows: u8,
        /// `rows · columns` channels.
        channels: Vec<u8>,
    },
    /// Three samples at each pixel.
    Rgb,
}

/// Black level, repeated over the image from its top left.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Black {
    /// Columns of the block.
    pub columns: usize,
    /// Rows of the block.
    pub rows: usize,
    /// `rows · columns` levels, or three for RGB.
    pub levels: Vec<f32>,
}

/// Colour calibration of the camera.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub(crate) struct CameraColor {
    /// Factors that make a neutral surface equal in all channels, as the camera chose them; green
    /// is 1.
    pub as_shot: Option<[f32; 3]>,
    /// Camera from XYZ, row by row, for illuminants by their number in EXIF's LightSource (21:
    /// D65).
    pub matrices: Vec<(u16, [[f64; 3]; 3])>,
}

impl Header {
    /// Of three samples a pixel, black at 0 and saturated at `white`.
    fn rgb((width, height): (u32, u32), white: f32, metadata: Metadata) -> Self {
        Self {
            width,
            height,
            layout: Layout::Rgb,
            black: Black {
                columns: 1,
                rows: 1,
                levels: vec![0.0],
            },
            white: [white; 3],
            color: CameraColor::default(),
            display: None,
            metadata,
        }
    }

    /// Size with square pixels: the side with more pixels for its length has fewer.
    pub(crate) fn square_size(&self) -> (u32, u32) {
        let aspect = self.metadata.pixel_aspect.unwrap_or(1.0);
        let scaled = |side: u32, factor: f64| ((f64::from(side) * factor).round() as u32).max(1);
        match aspect > 1.0 {
            true => (self.width, scaled(self.height, aspect.recip())),
            false => (scaled(self.width, aspect), self.height),
        }
    }

    /// Samples of a row: the width, times three for RGB.
    pub(crate) fn row_len(&self) -> usize {
        let per_pixel = if self.layout == Layout::Rgb { 3 } else { 1 };
        self.width as usize * per_pixel
    }

    /// Channel (0 red, 1 green, 2 blue) of a sample of a row.
    pub fn channel(&self, row: usize, sample: usize) -> usize {
        match &self.layout {
            Layout::Rgb => sample % 3,
            Layout::Mosaic {
                columns,
                rows,
                channels,
            } => {
                let (columns, rows) = (usize::from(*columns), usize::from(*rows));
                usize::from(channels[row % rows * columns + sample % columns])
            }
        }
    }

    /// Black level of a sample of a row.
    pub(crate) fn black_at(&self, row: usize, sample: usize) -> f32 {
        let Black {
            columns,
            rows,
            levels,
        } = &self.black;
        levels[row % rows * columns + sample % columns]
    }

    fn pattern_columns(&self) -> usize {
        match &self.layout {
            Layout::Rgb => 3,
            Layout::Mosaic { columns, .. } => usize::from(*columns),
        }
    }

    /// Rejects impossible headers: sizes of 0 or beyond [`MAX_PIXELS`], levels that leave no range.
    pub(crate) fn check(self, path: &Path) -> Result<Self> {
        let error = |field, problem: String| Err(IngestError::photograph(path, field, problem));
        let pixels = u64::from(self.width) * u64::from(self.height);
        if pixels == 0 || pixels > MAX_PIXELS {
            return error("size", format!("{}x{} pixels", self.width, self.height));
        }
        if let Layout::Mosaic {
            columns,
            rows,
            channels,
        } = &self.layout
        {
            let block = usize::from(*columns) * usize::from(*rows);
            if block == 0 || channels.len() != block || channels.iter().any(|&c| c > 2) {
                return error(
                    "colour filter array",
                    format!(
                        "{columns}x{rows} of channels {channels:?}: only red, green and blue are known"
                    ),
                );
            }
        }
        let Black {
            columns,
            rows,
            levels,
        } = &self.black;
        if levels.is_empty() || columns * rows != levels.len() {
            return error("black level", format!("{levels:?} for {columns}x{rows}"));
        }
        if columns * self.pattern_columns() > MAX_PERIOD {
            return error("black level", format!("repeats after {columns} columns"));
        }
        let aspect = self.metadata.pixel_aspect.unwrap_or(1.0);
        if !PIXEL_ASPECTS.contains(&aspect) {
            return error("pixels", format!("{aspect} times as wide as high"));
        }
        let most_black = levels.iter().copied().fold(0.0, f32::max);
        let least_white = self.white.into_iter().fold(f32::INFINITY, f32::min);
        if !levels.iter().all(|v| v.is_finite())
            || least_white.is_nan()
            || least_white <= most_black
        {
            return error(
                "white level",
                format!("{least_white} with a black level of {most_black}"),
            );
        }
        Ok(self)
    }
}

impl RawFrame {
    /// A row with the black level taken off, as a fraction of the range up to white; as `out` is
    /// long.
    pub(crate) fn scaled_row(&self, row: usize, out: &mut [f32]) {
        let header = &self.header;
        let start = row * header.row_len();
        let period = header.black.columns * header.pattern_columns();
        let mut table = [(0.0, 1.0); MAX_PERIOD];
        for (sample, entry) in table.iter_mut().enumerate().take(period) {
            let black = header.black_at(row, sample);
            let white = header.white[header.channel(row, sample)];
            let range = if white.is_finite() {
                white - black
            } else {
                1.0
            };
            *entry = (black, 1.0 / range);
        }
        let table = &table[..period];
        match &self.samples {
            Samples::Integer(samples) => {
                let samples = &samples[start..start + out.len()];
                for (out, samples) in out.chunks_mut(period).zip(samples.chunks(period)) {
                    for ((out, sample), (black, scale)) in out.iter_mut().zip(samples).zip(table) {
                        *out = (f32::from(*sample) - black) * scale;
                    }
                }
            }
            Samples::Float(samples) => {
                let samples = &samples[start..start + out.len()];
                for (out, samples) in out.chunks_mut(period).zip(samples.chunks(period)) {
                    for ((out, sample), (black, scale)) in out.iter_mut().zip(samples).zip(table) {
                        *out = (sample - black) * scale;
                    }
                }
            }
        }
    }
}

/// Decodes a photograph in this process.
///
/// # Errors
/// [`IngestError::Photograph`] if the file is no photograph that can be used: 8 bits, a reduced RAW
/// with three components, an unknown camera or format, a damaged header, damaged samples;
/// [`IngestError::Scene`] if it cannot be read.
pub fn read(path: &Path) -> Result<RawFrame> {
    Decoding::InProcess.read(path)
}

/// Whether to decode the samples or the header alone.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Want {
    Header,
    Samples,
}

impl Samples {
    fn len(&self) -> usize {
        match self {
            Self::Integer(samples) => samples.len(),
            Self::Float(samples) => samples.len(),
        }
    }
}

fn decode(path: &Path, bytes: &Arc<Vec<u8>>, want: Want) -> Result<RawFrame> {
    let frame = match kind_of(path) {
        Some(FileKind::Linear) => linear::read(path, bytes, want)?,
        Some(FileKind::Jpeg) => display::read_jpeg(path, bytes, want)?,
        Some(FileKind::Raw) => decode_raw(path, bytes, want)?,
        Some(FileKind::Display) => {
            return Err(IngestError::photograph(
                path,
                "format",
                "a picture for display: the camera's RAW files hold the light; JPEG and 8-bit PNG and TIFF are read where there are none",
            ));
        }
        None => return Err(IngestError::photograph(path, "format", "no known format")),
    };
    let header = frame.header.check(path)?;
    let num_wanted = header.row_len() * header.height as usize;
    if want == Want::Samples && frame.samples.len() != num_wanted {
        return Err(IngestError::photograph(
            path,
            "samples",
            format!("{} of {num_wanted}", frame.samples.len()),
        ));
    }
    Ok(RawFrame { header, ..frame })
}

#[cfg(any(feature = "rawler", feature = "rawloader"))]
fn decode_raw(path: &Path, bytes: &Arc<Vec<u8>>, want: Want) -> Result<RawFrame> {
    #[cfg(feature = "rawler")]
    let first = with_rawler::read(path, bytes, want);
    #[cfg(all(feature = "rawler", feature = "rawloader"))]
    // The message of the decoder with more cameras is the more useful one.
    let first = first.or_else(|error| with_rawloader::read(path, bytes, want).map_err(|_| error));
    #[cfg(not(feature = "rawler"))]
    let first = with_rawloader::read(path, bytes, want);
    first
}

#[cfg(not(any(feature = "rawler", feature = "rawloader")))]
fn decode_raw(path: &Path, _: &Arc<Vec<u8>>, _: Want) -> Result<RawFrame> {
    Err(IngestError::photograph(
        path,
        "format",
        "RAW, but this program was built without a RAW decoder",
    ))
}
