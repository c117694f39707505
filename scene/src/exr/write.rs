//! Writing EXR files.

use crate::error::{Result, SceneError};
use crate::files;
use crate::image::Image;
use ::exr::prelude::{
    AnyChannel, AnyChannels, Compression, Encoding, FlatSamples, Layer, LayerAttributes,
    WritableImage,
};
use half::f16;
use half::slice::HalfFloatSliceExt;
use std::path::Path;

/// Images below this many pixels are compressed on the calling thread; starting threads would cost
/// more.
const MIN_PARALLEL_PIXELS: usize = 1 << 20;

/// Sample type of a written file.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, Hash, Default, serde::Serialize, serde::Deserialize,
)]
#[serde(rename_all = "kebab-case")]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
pub enum Precision {
    /// 16 bits: 11 significant bits, up to 65504
    Half,
    /// 32 bits, exactly as in memory
    #[default]
    Float,
}

impl Precision {
    /// Half precision for a picture, unless a value is too bright for it.
    pub fn for_picture(image: &Image<3>) -> Self {
        // Half a step above the largest half: from here on values round to infinity.
        const OVERFLOW: f32 = 65_520.0;
        if image.values().iter().any(|value| value.abs() >= OVERFLOW) {
            Self::Float
        } else {
            Self::Half
        }
    }
}

/// Writes channels `R`, `G`, `B`; atomic, lossless but for the rounding to half precision where
/// asked for.
///
/// # Errors
/// [`SceneError::Io`], or [`SceneError::Invalid`] if a finite value does not fit in half precision.
pub fn write_rgb(path: &Path, image: &Image<3>, precision: Precision) -> Result<()> {
    write(path, image, ["R", "G", "B"], precision)
}

/// Writes one channel `Y`; otherwise as [`write_rgb`].
///
/// # Errors
/// As [`write_rgb`].
pub fn write_single(path: &Path, image: &Image<1>, precision: Precision) -> Result<()> {
    write(path, image, ["Y"], precision)
}

fn write<const C: usize>(
    path: &Path,
    image: &Image<C>,
    names: [&'static str; C],
    precision: Precision,
) -> Result<()> {
    if precision == Precision::Half {
        check_range(path, image, names)?;
    }
    let channels = (0..C).map(|channel| {
        let samples: Vec<f32> = image.pixels().iter().map(|pixel| pixel[channel]).collect();
        let samples = match precision {
            Precision::Float => FlatSamples::F32(samples),
            Precision::Half => {
                let mut halves = vec![f16::ZERO; samples.len()];
                halves.convert_from_f32_slice(&samples);
                FlatSamples::F16(halves)
            }
        };
        AnyChannel::new(names[channel], samples)
    });
    let layer = Layer::new(
        (image.width() as usize, image.height() as usize),
        LayerAttributes::default(),
        Encoding {
            compression: Compression::ZIP16,
            ..Encoding::SMALL_LOSSLESS
        },
        AnyChannels::sort(channels.collect()),
    );
    let image_file = ::exr::prelude::Image::from_layer(layer);
    files::write_atomic(path, |file| {
        let writer = image_file.write();
        let outcome = if image.pixels().len() < MIN_PARALLEL_PIXELS {
            writer.non_parallel().to_buffered(file)
        } else {
            writer.to_buffered(file)
        };
        outcome.map_err(|error| match error {
            ::exr::error::Error::Io(source) => SceneError::io(path, "write", source),
            other => SceneError::invalid(path, "image", other.to_string()),
        })
    })
}

/// Finite values that half precision would turn into infinities.
fn check_range<const C: usize>(path: &Path, image: &Image<C>, names: [&str; C]) -> Result<()> {
    // Values from here on round to infinity: half a step above the largest half.
    const OVERFLOW: f32 = 65_520.0;
    let width = image.width() as usize;
    for (index, pixel) in image.pixels().iter().enumerate() {
        for (value, name) in pixel.iter().zip(names) {
            if value.is_finite() && value.abs() >= OVERFLOW {
                return Err(SceneError::invalid(
                    path,
                    format!(
                        "pixel ({}, {}) channel {name}",
                        index % width,
                        index / width
                    ),
                    format!("{value:?} does not fit in half precision (at most 65504)"),
                ));
            }
        }
    }
    Ok(())
}
