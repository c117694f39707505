//! Brackets that are linear already: EXR, TIFF of 16 bits or floating point, PNG of 16 bits.

use super::{
    Black, CameraColor, Header, Layout, MAX_PIXELS, Metadata, RawFrame, Samples, Want, exif,
};
use crate::error::{IngestError, Result};
use eagpt_scene::exr;
use image::ImageDecoder;
use std::io::Cursor;
use std::path::Path;
use tiff::ColorType;
use tiff::decoder::{Decoder, DecodingResult, Limits};

pub(super) fn read(path: &Path, bytes: &[u8], want: Want) -> Result<RawFrame> {
    let extension = path
        .extension()
        .and_then(|e| e.to_str())
        .unwrap_or_default();
    let mut metadata = Metadata {
        decoder: "linear".to_owned(),
        ..Metadata::default()
    };
    let (size, white, samples) = match extension.to_ascii_lowercase().as_str() {
        "exr" => {
            let (size, samples) = read_exr(path, want)?;
            (size, f32::INFINITY, samples)
        }
        "png" => {
            exif::fill(&mut metadata, bytes);
            let (size, samples) = read_png(path, bytes, want)?;
            (size, f32::from(u16::MAX), samples)
        }
        _ => {
            exif::fill(&mut metadata, bytes);
            read_tiff(path, bytes, want)?
        }
    };
    let header = Header {
        width: size.0,
        height: size.1,
        layout: Layout::Rgb,
        black: Black {
            columns: 1,
            rows: 1,
            levels: vec![0.0],
        },
        white: [white; 3],
        color: CameraColor::default(),
        metadata,
    };
    Ok(RawFrame { header, samples })
}

fn read_exr(path: &Path, want: Want) -> Result<((u32, u32), Samples)> {
    if want == Want::Header {
        return Ok((exr::read_size(path)?, Samples::Float(Vec::new())));
    }
    let image = exr::read_rgb(path)?;
    Ok((image.size(), Samples::Float(image.values().to_vec())))
}

fn read_png(path: &Path, bytes: &[u8], want: Want) -> Result<((u32, u32), Samples)> {
    let failed = |problem: String| IngestError::photograph(path, "PNG", problem);
    let decoder = image::codecs::png::PngDecoder::new(Cursor::new(bytes))
        .map_err(|error| failed(error.to_string()))?;
    let size = decoder.dimensions();
    if decoder.color_type() != image::ColorType::Rgb16 {
        return Err(failed(format!(
            "{:?}: only RGB of 16 bits holds the light of a bracket",
            decoder.color_type()
        )));
    }
    if u64::from(size.0) * u64::from(size.1) > MAX_PIXELS {
        return Err(failed(format!("{}x{} pixels", size.0, size.1)));
    }
    if want == Want::Header {
        return Ok((size, Samples::Integer(Vec::new())));
    }
    let image =
        image::DynamicImage::from_decoder(decoder).map_err(|error| failed(error.to_string()))?;
    Ok((size, Samples::Integer(image.into_rgb16().into_raw())))
}

fn read_tiff(path: &Path, bytes: &[u8], want: Want) -> Result<((u32, u32), f32, Samples)> {
    let failed = |problem: String| IngestError::photograph(path, "TIFF", problem);
    let text = |error: tiff::TiffError| failed(error.to_string());
    let mut limits = Limits::default();
    limits.decoding_buffer_size = MAX_PIXELS as usize * 3 * size_of::<f32>();
    let mut decoder = Decoder::new(Cursor::new(bytes))
        .map_err(text)?
        .with_limits(limits);
    let size = decoder.dimensions().map_err(text)?;
    let white = match decoder.colortype().map_err(text)? {
        ColorType::RGB(16) => f32::from(u16::MAX),
        ColorType::RGB(32) => f32::INFINITY,
        other => {
            return Err(failed(format!(
                "{other:?}: only RGB of 16 bits or of floating point holds the light of a bracket"
            )));
        }
    };
    if want == Want::Header {
        return Ok((size, white, Samples::Integer(Vec::new())));
    }
    match decoder.read_image().map_err(text)? {
        DecodingResult::U16(samples) => Ok((size, white, Samples::Integer(samples))),
        DecodingResult::F32(samples) => Ok((size, white, Samples::Float(samples))),
        _ => Err(failed(
            "samples of another type than 16 bits or floating point".to_owned(),
        )),
    }
}
