//! RAW files through the crate `rawloader`.

use super::panics::guarded;
use super::sensor::{Sensor, Window, as_shot, mosaic};
use super::{Black, CameraColor, Header, Layout, Metadata, RawFrame, Samples, Want, exif};
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
    sensor(path, image, metadata)?.framed(path, want)
}

fn sensor(path: &Path, image: RawImage, metadata: Metadata) -> Result<Sensor> {
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
            mosaic(cfa.width, cfa.height, |row, column| {
                cfa.color_at(row, column)
            })
        }
        3 => Layout::Rgb,
        cpp => return Err(error("RAW", format!("{cpp} components a pixel"))),
    };
    let (width, height) = window.size();
    let header = Header {
        width,
        height,
        black: black(&image, &layout),
        white: [0, 1, 2].map(|channel| f32::from(image.whitelevels[channel])),
        color: color(&image),
        display: None,
        layout,
        metadata,
    };
    Ok(Sensor {
        header,
        window,
        stride: image.width,
        samples: match image.data {
            RawImageData::Integer(samples) => Samples::Integer(samples),
            RawImageData::Float(samples) => Samples::Float(samples),
        },
    })
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
    let row = |index: usize| image.xyz_to_cam[index].map(f64::from);
    let matrix = [row(0), row(1), row(2)];
    let known = matrix.as_flattened().iter().any(|v| *v != 0.0);
    CameraColor {
        as_shot: as_shot(image.wb_coeffs),
        matrices: if known {
            vec![(D65, matrix)]
        } else {
            Vec::new()
        },
    }
}
