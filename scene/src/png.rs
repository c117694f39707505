//! PNG: 8-bit pictures to look at. Data never goes through them.

use crate::color::srgb8_from_linear;
use crate::error::{Result, SceneError};
use crate::files;
use crate::image::Image;
use ::image::codecs::png::PngEncoder;
use ::image::{ExtendedColorType, ImageEncoder};
use std::path::Path;

/// Writes linear Rec.709 light as 8-bit sRGB, clipped to the display's range; NaN becomes 0.
/// Atomic.
///
/// # Errors
/// [`SceneError`] with the file's name.
pub fn write_srgb8(path: &Path, image: &Image<3>) -> Result<()> {
    let bytes: Vec<u8> = image
        .values()
        .iter()
        .map(|&linear| srgb8_from_linear(linear.max(0.0)))
        .collect();
    write_rgb8(path, image.width(), image.height(), &bytes)
}

/// Writes display-ready bytes, `[height, width, 3]`, as they are. Atomic.
///
/// # Errors
/// [`SceneError::Invalid`] if there are not `height · width · 3` bytes or none, or
/// [`SceneError::Io`].
pub fn write_rgb8(path: &Path, width: u32, height: u32, bytes: &[u8]) -> Result<()> {
    write8(path, (width, height), bytes, ExtendedColorType::Rgb8)
}

/// Writes one byte a pixel, `[height, width]`, as a grey picture. Atomic.
///
/// # Errors
/// As [`write_rgb8`], for `height · width` bytes.
pub fn write_gray8(path: &Path, width: u32, height: u32, bytes: &[u8]) -> Result<()> {
    write8(path, (width, height), bytes, ExtendedColorType::L8)
}

fn write8(
    path: &Path,
    (width, height): (u32, u32),
    bytes: &[u8],
    color: ExtendedColorType,
) -> Result<()> {
    let num_wanted = u64::from(width) * u64::from(height) * u64::from(color.channel_count());
    if bytes.is_empty() || bytes.len() as u64 != num_wanted {
        let kind = if color == ExtendedColorType::L8 {
            "grey"
        } else {
            "RGB"
        };
        return Err(SceneError::invalid(
            path,
            "size",
            format!("{} bytes for {width}x{height} {kind}", bytes.len()),
        ));
    }
    let mut encoded = Vec::new();
    PngEncoder::new(&mut encoded)
        .write_image(bytes, width, height, color)
        .map_err(|e| SceneError::invalid(path, "image", e.to_string()))?;
    files::write_bytes_atomic(path, &encoded)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn linear_light_is_encoded_and_clipped() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.png");
        // ((128/255 + 0.055) / 1.055)^2.4 = 0.215861.
        let pixels = vec![[0.0, 0.215_861, 1.0], [-3.0, 7.5, f32::NAN]];
        write_srgb8(&path, &Image::from_pixels(2, 1, pixels).unwrap()).unwrap();
        let back = ::image::open(&path).unwrap().into_rgb8();
        assert_eq!(back.dimensions(), (2, 1));
        assert_eq!(back.as_raw(), &[0, 128, 255, 0, 255, 0]);
    }

    #[test]
    fn a_wrong_number_of_bytes_is_named() {
        let message = write_rgb8(Path::new("a.png"), 2, 2, &[0; 11])
            .unwrap_err()
            .to_string();
        assert_eq!(message, "a.png: size: 11 bytes for 2x2 RGB");
    }
}
