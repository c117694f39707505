//! Photographs of a dataset as text.

use crate::error::Result;
use eagpt_report::picture::Picture;
use eagpt_scene::color::srgb8_from_linear;
use eagpt_scene::exr;
use image::RgbImage;
use std::path::Path;

/// Quality of JPEG.
const QUALITY: u8 = 80;

/// Code of light in an embedded photograph: x / (1 + x), so that lamps and windows keep their light
/// and other exposures can be shown; sRGB follows.
fn compressed(light: f32) -> f32 {
    let light = light.max(0.0);
    light / (1.0 + light)
}

/// A photograph of linear light as a data URI, at most `max_side` pixels along each edge.
///
/// # Errors
/// [`crate::ViewerError`] naming the file if it is no EXR.
pub fn embed(path: &Path, max_side: u32) -> Result<String> {
    let light = exr::read_rgb(path)?;
    let factor = light.width().max(light.height()).div_ceil(max_side);
    // Means of light first: those of its codes would darken lamps.
    let light = if light.width() % factor == 0 && light.height() % factor == 0 {
        light.averaged(factor)
    } else {
        light
    };
    let mut image = RgbImage::new(light.width(), light.height());
    for (to, from) in image.pixels_mut().zip(light.pixels()) {
        to.0 = from.map(|v| srgb8_from_linear(compressed(v)));
    }
    Ok(Picture::embed(path, image, max_side, QUALITY)?.uri)
}
