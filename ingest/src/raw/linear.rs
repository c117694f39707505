//! Brackets that are linear already: EXR, TIFF of 16 bits or floating point, PNG of 16 bits. PNG
//! and TIFF of 8 bits are for display.

use super::display::{self, Display};
use super::{Header, MAX_PIXELS, Metadata, RawFrame, Samples, Want, exif};
use crate::error::{IngestError, Result};
use eagpt_scene::exr;
use image::codecs::png::PngDecoder;
use image::{DynamicImage, ImageDecoder};
use std::io::Cursor;
use std::path::Path;
use tiff::ColorType;
use tiff::decoder::{Decoder, DecodingResult, Limits};
use tiff::tags::Tag;

pub(super) fn read(path: &Path, bytes: &[u8], want: Want) -> Result<RawFrame> {
    let extension = path
        .extension()
        .and_then(|e| e.to_str())
        .unwrap_or_default();
    let mut metadata = Metadata {
        decoder: "linear".to_owned(),
        ..Metadata::default()
    };
    let found = match extension.to_ascii_lowercase().as_str() {
        "exr" => read_exr(path, want)?,
        "png" => {
            exif::fill(&mut metadata, bytes);
            read_png(path, bytes, want)?
        }
        _ => {
            exif::fill(&mut metadata, bytes);
            read_tiff(path, bytes, want)?
        }
    };
    Ok(match found {
        Found::Linear(size, white, samples) => RawFrame {
            header: Header::rgb(size, white, metadata),
            samples,
        },
        Found::Display(size, codes, profile) => {
            metadata.decoder = "display".to_owned();
            let display = Display::of(path, profile.as_deref(), bytes)?;
            display::frame(size, codes, metadata, display)
        }
    })
}

/// Content of a file, of its width and height.
enum Found {
    /// Light, and where it clips.
    Linear((u32, u32), f32, Samples),
    /// Codes, and an ICC profile.
    Display((u32, u32), Vec<u8>, Option<Vec<u8>>),
}

fn read_exr(path: &Path, want: Want) -> Result<Found> {
    const WHITE: f32 = f32::INFINITY;
    if want == Want::Header {
        let size = exr::read_size(path)?;
        return Ok(Found::Linear(size, WHITE, Samples::Float(Vec::new())));
    }
    let image = exr::read_rgb(path)?;
    let samples = Samples::Float(image.values().to_vec());
    Ok(Found::Linear(image.size(), WHITE, samples))
}

fn read_png(path: &Path, bytes: &[u8], want: Want) -> Result<Found> {
    const WHITE: f32 = u16::MAX as f32;
    let failed = |problem: String| IngestError::photograph(path, "PNG", problem);
    let text = |error: image::ImageError| failed(error.to_string());
    let mut decoder = PngDecoder::new(Cursor::new(bytes)).map_err(text)?;
    let size = decoder.dimensions();
    let color = decoder.color_type();
    if !matches!(color, image::ColorType::Rgb16 | image::ColorType::Rgb8) {
        return Err(failed(format!(
            "{color:?}: only RGB of 16 bits holds the light of a bracket, or of 8 bits for display"
        )));
    }
    if u64::from(size.0) * u64::from(size.1) > MAX_PIXELS {
        return Err(failed(format!("{}x{} pixels", size.0, size.1)));
    }
    let profile = decoder.icc_profile().map_err(text)?;
    let pixels = match want {
        Want::Header => None,
        Want::Samples => Some(DynamicImage::from_decoder(decoder).map_err(text)?),
    };
    if color == image::ColorType::Rgb8 {
        let codes = pixels.map_or_else(Vec::new, |pixels| pixels.into_rgb8().into_raw());
        return Ok(Found::Display(size, codes, profile));
    }
    let samples = pixels.map_or_else(Vec::new, |pixels| pixels.into_rgb16().into_raw());
    Ok(Found::Linear(size, WHITE, Samples::Integer(samples)))
}

fn read_tiff(path: &Path, bytes: &[u8], want: Want) -> Result<Found> {
    /// The tag of an ICC profile (ICC.1, annex B).
    const PROFILE: Tag = Tag::Unknown(34_675);
    let failed = |problem: String| IngestError::photograph(path, "TIFF", problem);
    let text = |error: tiff::TiffError| failed(error.to_string());
    let mut limits = Limits::default();
    limits.decoding_buffer_size = MAX_PIXELS as usize * 3 * size_of::<f32>();
    let mut decoder = Decoder::new(Cursor::new(bytes))
        .map_err(text)?
        .with_limits(limits);
    let size = decoder.dimensions().map_err(text)?;
    let white = match decoder.colortype().map_err(text)? {
        ColorType::RGB(8) => {
            let profile = decoder.find_tag(PROFILE).map_err(text)?;
            let profile = profile
                .map(tiff::decoder::ifd::Value::into_u8_vec)
                .transpose();
            let profile = profile.map_err(text)?;
            let codes = match want {
                Want::Header => DecodingResult::U8(Vec::new()),
                Want::Samples => decoder.read_image().map_err(text)?,
            };
            let DecodingResult::U8(codes) = codes else {
                return Err(failed("8 bits that are none".to_owned()));
            };
            return Ok(Found::Display(size, codes, profile));
        }
        ColorType::RGB(16) => f32::from(u16::MAX),
        ColorType::RGB(32) => f32::INFINITY,
        other => {
            return Err(failed(format!(
                "{other:?}: only RGB of 16 bits or of floating point holds the light of a bracket, or of 8 bits for display"
            )));
        }
    };
    if want == Want::Header {
        return Ok(Found::Linear(size, white, Samples::Integer(Vec::new())));
    }
    match decoder.read_image().map_err(text)? {
        DecodingResult::U16(samples) => Ok(Found::Linear(size, white, Samples::Integer(samples))),
        DecodingResult::F32(samples) => Ok(Found::Linear(size, white, Samples::Float(samples))),
        _ => Err(failed(
            "samples of another type than 16 bits or floating point".to_owned(),
        )),
    }
}
