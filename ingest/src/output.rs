//! Files of a stack: radiance, preview, mask; and its items in the ledger of the result.

use crate::capture::{StackFiles, StackReport};
use crate::develop::Developed;
use crate::error::Result;
use crate::resample::{fitted, shrink};
use crate::stack::{ONLY_CONDITION, Stack};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use eagpt_scene::color::srgb8_from_linear;
use eagpt_scene::exr::{Precision, write_rgb};
use eagpt_scene::{Image, files, png};
use image::codecs::jpeg::JpegEncoder;
use image::{ExtendedColorType, ImageEncoder};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// The command in ledgers.
pub(crate) const COMMAND: &str = "ingest";
/// Width of the pictures in the report.
const THUMBNAIL_SIDE: u32 = 320;
/// JPEG quality of the pictures in the report.
const THUMBNAIL_QUALITY: u8 = 80;

/// A merged stack, as the ledger has it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct MergedStack {
    pub report: StackReport,
    /// A small JPEG, base64.
    pub(crate) thumbnail: String,
}

/// Names of the files of a stack; folders of conditions only where there are several.
pub(crate) fn stack_files(stack: &Stack, several: bool) -> StackFiles {
    let Stack {
        condition,
        position,
        ..
    } = stack;
    let folder = if several || condition != ONLY_CONDITION {
        format!("{condition}/")
    } else {
        String::new()
    };
    StackFiles {
        radiance: format!("{folder}Radiance-exr/{position}.exr"),
        preview: format!("{folder}Preview/{position}.png"),
        unreliable: format!("{folder}Unreliable/{position}.png"),
    }
}

/// Item of the ledger for a stack.
pub(crate) fn item(kind: &str, stack: &Stack) -> String {
    format!("{kind}/{}/{}", stack.condition, stack.position)
}

/// Writes radiance, preview and mask.
pub(crate) fn write_stack(
    out: &Path,
    files: &StackFiles,
    developed: &Developed,
    preview_exposure: f64,
    precision: Precision,
) -> Result<()> {
    let paths = [&files.radiance, &files.preview, &files.unreliable].map(|file| out.join(file));
    for path in &paths {
        files::create_parent(path)?;
    }
    let image = &developed.image;
    let (width, height) = image.size();
    let radiance = || {
        fit_in_half(image, precision, |image| {
            write_rgb(&paths[0], image, precision)
        })
    };
    let pictures = || -> Result<()> {
        let bytes = encoded(image, preview_exposure);
        png::write_rgb8(&paths[1], width, height, &bytes)?;
        Ok(png::write_gray8(
            &paths[2],
            width,
            height,
            &developed.flags,
        )?)
    };
    let (first, second) = rayon::join(radiance, pictures);
    first?;
    second
}

/// Clamps to the largest value of half precision, 65,504.
fn fit_in_half(
    image: &Image<3>,
    precision: Precision,
    write: impl FnOnce(&Image<3>) -> eagpt_scene::Result<()>,
) -> Result<()> {
    const LARGEST: f32 = 65_504.0;
    let too_bright = precision == Precision::Half && image.values().iter().any(|v| *v > LARGEST);
    if too_bright {
        return Ok(write(&image.map(|pixel| pixel.map(|v| v.min(LARGEST))))?);
    }
    Ok(write(image)?)
}

/// Bytes of sRGB after a factor.
fn encoded(image: &Image<3>, exposure: f64) -> Vec<u8> {
    // A table over the exponent and eight bits of the mantissa: half a code off at most, and many
    // times as fast as powers.
    const STEPS_PER_OCTAVE: u32 = 256;
    const SHIFT: u32 = 23 - STEPS_PER_OCTAVE.trailing_zeros();
    const LOWEST: f32 = 1.0 / 16_384.0;
    let first = LOWEST.to_bits() >> SHIFT;
    let num = (1.0_f32.to_bits() >> SHIFT) - first;
    let table: Vec<u8> = (0..num)
        .map(|step| {
            let [low, high] = [step, step + 1].map(|step| f32::from_bits((first + step) << SHIFT));
            srgb8_from_linear(0.5 * (low + high))
        })
        .collect();
    let exposure = exposure as f32;
    let mut bytes = vec![0_u8; image.values().len()];
    bytes
        .par_chunks_mut(1 << 14)
        .zip(image.values().par_chunks(1 << 14))
        .for_each(|(bytes, values)| {
            for (byte, value) in bytes.iter_mut().zip(values) {
                let value = value * exposure;
                *byte = if value >= 1.0 {
                    255
                } else if value < LOWEST {
                    0
                } else {
                    table[((value.to_bits() >> SHIFT) - first) as usize]
                };
            }
        });
    bytes
}

/// A small JPEG, base64, for the report.
pub(crate) fn thumbnail(image: &Image<3>, exposure: f64) -> String {
    let small = shrink(image, fitted(image.size(), THUMBNAIL_SIDE));
    let bytes = encoded(&small, exposure);
    let mut jpeg = Vec::new();
    let written = JpegEncoder::new_with_quality(&mut jpeg, THUMBNAIL_QUALITY).write_image(
        &bytes,
        small.width(),
        small.height(),
        ExtendedColorType::Rgb8,
    );
    // A report without a picture is still a report.
    if written.is_err() {
        return String::new();
    }
    STANDARD.encode(&jpeg)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn previews_are_within_one_code_of_srgb() {
        let values: Vec<[f32; 3]> = (0..1000)
            .map(|i| [i as f32 / 700.0, i as f32 / 70_000.0, 0.5])
            .collect();
        let image = Image::from_pixels(1000, 1, values).unwrap();
        for (byte, value) in encoded(&image, 1.0).iter().zip(image.values()) {
            assert!(byte.abs_diff(srgb8_from_linear(*value)) <= 1, "{value}");
        }
    }
}
