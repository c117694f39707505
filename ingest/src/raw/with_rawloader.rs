//! RAW files through the crate `rawloader`.

use super::panics::guarded;
use super::{Black, CameraColor, Header, Layout, Metadata, RawFrame, Samples, Want, Window, exif};
use crate::error::{IngestError, Result};
use rawloader::{RawImage, RawImageData};
use std::path::Path;

/// EXIF's number of the illuminant D65, for which `rawloader` gives its matrices.
const D65: u16 = 21;

pub(super) fn read(path: &Path, bytes: &[u8], want: Want) -> Result<RawFrame> {
    let failed = |problem: String| IngestError::photograph(path, "RAW", problem);
    let image = guarded(|| match want {
        Want::Samples => rawloader::decode(&mut &*bytes),
        Want::Header => rawloader::decode_dummy(&mut &*bytes),
    })
    .ok_or_else(|| failed("damaged: the decoder gave up".to_owned()))?
    .map_err(|error| {
        let text = error.to_string();
        let text = text.lines().next().unwrap_or_default();
        failed(format!("damaged or not supported: {text}"))
    })?;
    let mut metadata = Metadata {
        make: image.clean_make.clone(),
        model: image.clean_model.clone(),
        decoder: "rawloader".to_owned(),
        ..Metadata::default()
    };
    exif::fill(&mut metadata, bytes);
    framed(path, image, metadata, want)
}

fn framed(path: &Path, image: RawImage, metadata: Metadata, want: Want) -> Result<RawFrame> {
    let error = |field, problem: String| IngestError::photograph(path, field, problem);
    let [top, right, bottom, left] = image.crops;
    let window = Window {
        left,
        top,
        width: image.width.saturating_sub(left + right),
        height: image.height.saturating_sub(top + bottom),
    };
    let layout = match image.cpp {
        1 => {
            let cfa = image.cfa.shift(left, top);
            let channel = |index: usize| cfa.color_at(index / cfa.width, index % cfa.width) as u8;
            Layout::Mosaic {
                columns: cfa.width.min(255) as u8,
                rows: cfa.height.min(255) as u8,
                channels: (0..cfa.width * cfa.height).map(channel).collect(),
            }
        }
        3 => Layout::Rgb,
        cpp => return Err(error("RAW", format!("{cpp} components a pixel"))),
    };
    let per_pixel = image.cpp;
    let header = Header {
        width: u32::try_from(window.width).unwrap_or(u32::MAX),
        height: u32::try_from(window.height).unwrap_or(u32::MAX),
        black: black(&image, &layout),
        white: [0, 1, 2].map(|channel| f32::from(image.whitelevels[channel])),
        color: color(&image),
        layout,
        metadata,
    };
    if want == Want::Header {
        let samples = Samples::Integer(Vec::new());
        return Ok(RawFrame { header, samples });
    }
    let stride = image.width;
    let samples = match image.data {
        RawImageData::Integer(samples) => {
            window.cut(samples, stride, per_pixel).map(Samples::Integer)
        }
        RawImageData::Float(samples) => window.cut(samples, stride, per_pixel).map(Samples::Float),
    };
    let samples =
        samples.ok_or_else(|| error("crop", format!("{window:?} is outside of the image")))?;
    Ok(RawFrame { header, samples })
}

/// The levels of the channels, laid out as the channels are.
fn black(image: &RawImage, layout: &Layout) -> Black {
    let level = |channel: u8| f32::from(image.blacklevels[usize::from(channel.min(3))]);
    match layout {
        Layout::Rgb => Black {
            columns: 3,
            rows: 1,
            levels: [0, 1, 2].map(level).to_vec(),
        },
        Layout::Mosaic {
            columns,
            rows,
            channels,
        } => Black {
            columns: usize::from(*columns),
            rows: usize::from(*rows),
            levels: channels.iter().map(|&channel| level(channel)).collect(),
        },
    }
}

fn color(image: &RawImage) -> CameraColor {
    let [r, g, b, _] = image.wb_coeffs;
    let usable = |v: f32| v.is_finite() && v > 0.0;
    let row = |index: usize| image.xyz_to_cam[index].map(f64::from);
    let matrix = [row(0), row(1), row(2)];
    let known = matrix.as_flattened().iter().any(|v| *v != 0.0);
    CameraColor {
        as_shot: [r, g, b]
            .into_iter()
            .all(usable)
            .then(|| [r / g, 1.0, b / g]),
        matrices: if known {
            vec![(D65, matrix)]
        } else {
            Vec::new()
        },
    }
}
