//! Pictures as text, to be embedded in the page.

use crate::error::{ReportError, Result};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use eagpt_scene::color::srgb8_from_linear;
use eagpt_scene::{exr, files};
use image::codecs::jpeg::JpegEncoder;
use image::imageops::FilterType;
use image::{ImageFormat, ImageReader, RgbImage};
use serde::Serialize;
use std::io::Cursor;
use std::path::Path;

/// Longest side of an embedded picture, pixels.
const MAX_SIDE: u32 = 720;
/// Pictures smaller than this are enlarged for people by the browser, without blurring what a pixel
/// is.
const SMALL_SIDE: u32 = 400;
/// Quality of JPEG: differences to the picture are invisible, and noise stays visible.
const QUALITY: u8 = 88;

/// An embedded picture.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Picture {
    /// `data:image/jpeg;base64,…`.
    pub uri: String,
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Whether it has so few pixels that they should be shown as squares.
    pub is_small: bool,
}

impl Picture {
    /// A PNG.
    ///
    /// # Errors
    /// [`ReportError`] naming the file if it is none.
    pub fn of_png(path: &Path) -> Result<Self> {
        let bytes = files::read(path)?;
        let decoded = ImageReader::with_format(Cursor::new(bytes), ImageFormat::Png).decode();
        let image = decoded.map_err(|e| ReportError::content(path, &e))?;
        Self::embed(path, image.into_rgb8(), MAX_SIDE, QUALITY)
    }

    /// Linear light, shown as sRGB and cut off at display white.
    ///
    /// # Errors
    /// [`ReportError`] naming the file if it is no EXR.
    pub fn of_light(path: &Path) -> Result<Self> {
        let light = exr::read_rgb(path)?;
        let bytes = light
            .values()
            .iter()
            .map(|&v| srgb8_from_linear(v.max(0.0)));
        let image = RgbImage::from_raw(light.width(), light.height(), bytes.collect())
            .ok_or_else(|| ReportError::content(path, &"no pixels"))?;
        Self::embed(path, image, MAX_SIDE, QUALITY)
    }

    /// The `image` that `path` was made into, at most `max_side` pixels along each edge, as JPEG of
    /// a `quality` of 1 to 100.
    ///
    /// # Errors
    /// [`ReportError`] naming the file if it has no pixels.
    pub fn embed(path: &Path, image: RgbImage, max_side: u32, quality: u8) -> Result<Self> {
        let longest = image.width().max(image.height());
        let shown = if longest > max_side {
            let scaled = |side: u32| (side * max_side / longest).max(1);
            let (width, height) = (scaled(image.width()), scaled(image.height()));
            image::imageops::resize(&image, width, height, FilterType::Triangle)
        } else {
            image
        };
        let mut encoded = Vec::new();
        JpegEncoder::new_with_quality(&mut encoded, quality)
            .encode_image(&shown)
            .map_err(|e| ReportError::content(path, &e))?;
        Ok(Self {
            uri: format!("data:image/jpeg;base64,{}", STANDARD.encode(encoded)),
            width: shown.width(),
            height: shown.height(),
            is_small: shown.width().max(shown.height()) < SMALL_SIDE,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use eagpt_scene::png;

    #[test]
    fn pictures_are_embedded_at_a_bounded_size() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.png");
        png::write_rgb8(&path, 1440, 2, &[200; 1440 * 2 * 3]).unwrap();
        let picture = Picture::of_png(&path).unwrap();
        assert_eq!((picture.width, picture.height), (720, 1));
        assert!(!picture.is_small);
        let encoded = picture.uri.strip_prefix("data:image/jpeg;base64,").unwrap();
        let bytes = STANDARD.decode(encoded).unwrap();
        let back = image::load_from_memory(&bytes).unwrap().into_rgb8();
        assert!(
            back.pixels()
                .all(|p| p.0.iter().all(|v| v.abs_diff(200) <= 2))
        );
        std::fs::write(&path, b"nothing").unwrap();
        assert!(
            Picture::of_png(&path)
                .unwrap_err()
                .to_string()
                .contains("a.png")
        );
    }
}
