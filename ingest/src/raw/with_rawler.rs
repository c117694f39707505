//! RAW files through the crate `rawler`.

use super::panics::guarded;
use super::sensor::{Sensor, Window, as_shot, mosaic};
use super::{Black, CameraColor, Header, Layout, Metadata, RawFrame, Samples, Want, exif};
use crate::error::{IngestError, Result};
use rawler::decoders::{RawDecodeParams, RawMetadata};
use rawler::rawimage::{RawImage, RawImageData, RawPhotometricInterpretation};
use rawler::rawsource::RawSource;
use std::path::Path;
use std::sync::Arc;

pub(super) fn read(path: &Path, bytes: &Arc<Vec<u8>>, want: Want) -> Result<RawFrame> {
    let source = RawSource::new_from_shared_vec(Arc::clone(bytes)).with_path(path);
    let failed = |problem: String| IngestError::photograph(path, "RAW", problem);
    let decoded = guarded(|| {
        let params = RawDecodeParams::default();
        let decoder = rawler::get_decoder(&source)?;
        // Metadata of a camera is optional: the samples count.
        let metadata = decoder.raw_metadata(&source, &params).ok();
        let image = decoder.raw_image(&source, &params, want == Want::Header)?;
        Ok::<_, rawler::RawlerError>((image, metadata))
    });
    let (image, metadata) = decoded
        .ok_or_else(|| failed("damaged: the decoder gave up".to_owned()))?
        .map_err(|error| failed(short(&error)))?;
    let mut known = metadata.map(described).unwrap_or_default();
    if known.make.is_empty() {
        known.make.clone_from(&image.make);
    }
    if known.model.is_empty() {
        known.model.clone_from(&image.model);
    }
    known.pixel_aspect = pixel_aspect(&image);
    exif::fill(&mut known, bytes);
    known.decoder = "rawler".to_owned();
    sensor(path, image, known)?.framed(path, want)
}

/// The first line of an error, without the decoder's advice.
fn short(error: &rawler::RawlerError) -> String {
    match error {
        rawler::RawlerError::Unsupported {
            what, model, make, ..
        } if make.is_empty() && model.is_empty() => {
            format!("damaged, or of no known camera: {what}")
        }
        rawler::RawlerError::Unsupported {
            what, model, make, ..
        } => format!("{make} {model} is not supported: {what}"),
        rawler::RawlerError::DecoderFailed(text) => {
            let text = text.lines().next().unwrap_or_default();
            let text = text.split(". Please").next().unwrap_or(text);
            let text = text.trim_start_matches("TODO: ");
            format!("damaged or not supported: {}", text.trim_end_matches(','))
        }
    }
}

fn described(metadata: RawMetadata) -> Metadata {
    let exif = metadata.exif;
    let ratio = |value: Option<rawler::formats::tiff::Rational>| {
        let value = value?;
        (value.d != 0 && value.n != 0).then(|| f64::from(value.n) / f64::from(value.d))
    };
    let iso = exif
        .iso_speed_ratings
        .map(u32::from)
        .filter(|iso| *iso > 0 && *iso < 65535)
        .or(exif.iso_speed)
        .or(exif.recommended_exposure_index);
    let date = exif.date_time_original.or(exif.create_date);
    let fraction = exif.sub_sec_time_original.unwrap_or_default();
    Metadata {
        make: metadata.make,
        model: metadata.model,
        exposure_s: ratio(exif.exposure_time),
        iso: iso.map(f64::from),
        f_number: ratio(exif.fnumber),
        focal_mm: ratio(exif.focal_length),
        time_s: date.and_then(|text| exif::seconds(&text)).map(|time| {
            time + format!("0.{}", fraction.trim_matches(['\0', ' ']))
                .parse()
                .unwrap_or(0.0)
        }),
        noise: None,
        orientation: exif.orientation,
        pixel_aspect: None,
        decoder: String::new(),
    }
}

/// Width of a pixel over its height, where the decoder knows it of the camera.
fn pixel_aspect(image: &RawImage) -> Option<f64> {
    let [horizontal, vertical] = image.camera.default_scale.0;
    let [horizontal, vertical] =
        [horizontal, vertical].map(|[scale, of]| f64::from(scale) / f64::from(of));
    let aspect = horizontal / vertical;
    (aspect.is_finite() && aspect != 1.0).then_some(aspect)
}

fn sensor(path: &Path, image: RawImage, metadata: Metadata) -> Result<Sensor> {
    let error = |field, problem: String| IngestError::photograph(path, field, problem);
    let whole = Window {
        left: 0,
        top: 0,
        width: image.width,
        height: image.height,
    };
    let area = image.crop_area.or(image.active_area);
    let window = area.map_or(whole, |area| Window {
        left: area.p.x,
        top: area.p.y,
        width: area.d.w,
        height: area.d.h,
    });
    let layout = match (&image.photometric, image.cpp) {
        (RawPhotometricInterpretation::Cfa(config), 1) => {
            let cfa = config.cfa.shift(window.left, window.top);
            mosaic(cfa.width, cfa.height, |row, column| {
                cfa.color_at(row, column)
            })
        }
        (RawPhotometricInterpretation::LinearRaw, 3) => Layout::Rgb,
        (_, cpp) => {
            return Err(error(
                "RAW",
                format!(
                    "{cpp} components a pixel: a reduced RAW, whose values the camera has already changed"
                ),
            ));
        }
    };
    let per_pixel = if layout == Layout::Rgb { 3 } else { 1 };
    let black = black(&image, window, per_pixel);
    let white = &image.whitelevel.0;
    let white = [0, 1, 2].map(|channel| {
        let level = white.get(channel).or(white.first()).copied();
        level.unwrap_or(u32::from(u16::MAX)) as f32
    });
    let (width, height) = window.size();
    let header = Header {
        width,
        height,
        layout,
        black,
        white,
        color: color(&image),
        display: None,
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

/// Black levels from the top left of the window; those of the file begin where the active area
/// does.
fn black(image: &RawImage, window: Window, per_pixel: usize) -> Black {
    let found = &image.blacklevel;
    let origin = image
        .active_area
        .map_or((0, 0), |area| (area.p.x, area.p.y));
    let levels = found.as_vec();
    let (columns, rows) = (found.width.max(1), found.height.max(1));
    let per_block = found.cpp.max(1);
    let at = |row: usize, column: usize, part: usize| {
        let row = (row + window.top + rows * origin.1 - origin.1) % rows;
        let column = (column + window.left + columns * origin.0 - origin.0) % columns;
        let index = (row * columns + column) * per_block + part.min(per_block - 1);
        levels.get(index).or(levels.first()).copied().unwrap_or(0.0)
    };
    let mut block = Vec::new();
    for row in 0..rows {
        for column in 0..columns {
            block.extend((0..per_pixel).map(|part| at(row, column, part)));
        }
    }
    Black {
        columns: columns * per_pixel,
        rows,
        levels: block,
    }
}

fn color(image: &RawImage) -> CameraColor {
    let mut matrices: Vec<_> = image
        .color_matrix
        .iter()
        .filter_map(|(illuminant, flat)| {
            let values: [f32; 9] = flat.as_slice().try_into().ok()?;
            let row = |index: usize| [0, 1, 2].map(|c| f64::from(values[3 * index + c]));
            Some((u16::from(*illuminant), [row(0), row(1), row(2)]))
        })
        .collect();
    // Sorted, as a map has no order.
    matrices.sort_by_key(|(illuminant, _)| *illuminant);
    CameraColor {
        as_shot: as_shot(image.wb_coeffs),
        matrices,
    }
}
