//! Parameters decided once for a capture, before anything is merged: colours, falloff, scale,
//! memory.

use crate::color::{ColorTransform, WhiteBalance};
use crate::error::{IngestError, Result};
use crate::gather::Gathered;
use crate::merge::{CLIPPED, merge};
use crate::noise::Noise;
use crate::options::IngestOptions;
use crate::raw::{FileKind, Header, Layout, RawFrame, kind_of};
use crate::request::IngestRequest;
use crate::response::{Response, recovery};
use crate::stack::{Photograph, Shot, Stack};
use crate::survey::{Reader, Survey, read_shots};
use crate::vignetting::{Falloff, Grid, Vignetting};
use eagpt_scene::files;
use eagpt_scene::files::Key;
use eagpt_scene::lens::Undistortion;
use serde::Serialize;
use std::path::Path;

/// Luminance that the geometric mean of a capture gets: middle grey.
const MIDDLE_GREY: f64 = 0.18;

/// Parameters decided once for a capture.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Decisions {
    /// Response of the camera, for pictures for display.
    pub(crate) response: Option<Response>,
    pub(crate) color: ColorTransform,
    pub(crate) falloff: Option<Falloff>,
    pub(crate) undistortion: Option<Undistortion>,
}

/// Rejects an output inside of the capture: the next run would take it for photographs.
///
/// # Errors
/// [`IngestError::Option`] if it is.
pub fn check_places(capture: &Path, out: &Path) -> Result<()> {
    let capture = capture
        .canonicalize()
        .unwrap_or_else(|_| capture.to_owned());
    // The output need not exist yet: its nearest existing ancestor decides.
    let existing = out.ancestors().find_map(|place| {
        let place = if place.as_os_str().is_empty() {
            Path::new(".")
        } else {
            place
        };
        place.canonicalize().ok()
    });
    if existing.is_some_and(|place| place.starts_with(&capture)) {
        return Err(IngestError::Option {
            field: "out",
            value: out.display().to_string(),
            wanted: "a folder outside of the capture",
        });
    }
    Ok(())
}

/// Colours and falloff.
pub(crate) fn decide(request: &IngestRequest, gathered: &Gathered) -> Result<Decisions> {
    let options = &request.options;
    let Some(first) = gathered
        .stacks
        .first()
        .and_then(|stack| stack.shots.first())
    else {
        return Err(IngestError::Empty {
            capture: request.capture.clone(),
            problem: "no stack is left".to_owned(),
        });
    };
    let response = recovery::recover(&request.capture, &gathered.stacks, &request.decoding)?;
    let reader = Reader {
        decoding: &request.decoding,
        response: response.as_ref(),
    };
    let manifest = gathered.manifest.as_ref();
    let falloff = match (&options.vignetting, manifest.and_then(|m| m.vignetting)) {
        (Vignetting::None, None) => None,
        (Vignetting::None, Some(abc)) => Some(Falloff::Polynomial(abc)),
        (Vignetting::Polynomial(abc), _) => Some(Falloff::Polynomial(*abc)),
        (Vignetting::FlatField(folder), _) => Some(Falloff::Grid(flat_field(
            &reader,
            folder,
            first,
            options.clip(),
        )?)),
        (Vignetting::Fit(folder), _) => {
            let grid = flat_field(&reader, folder, first, options.clip())?;
            let abc = grid.fit(first.header.width as usize, first.header.height as usize);
            Some(Falloff::Polynomial(abc.ok_or_else(|| {
                flat_error(folder, "determines no falloff")
            })?))
        }
    };
    if let Some(bad) = falloff.as_ref().filter(|falloff| !falloff.is_usable()) {
        return Err(IngestError::Option {
            field: "vignetting",
            value: match bad {
                Falloff::Polynomial(abc) => format!("{abc:?}"),
                Falloff::Grid(_) => "the flat field".to_owned(),
            },
            wanted: "a falloff that leaves light everywhere",
        });
    }
    let size = first.header.square_size();
    let lens = options.lens.as_ref();
    let undistortion = lens.map(|lens| lens.undistortion(size)).transpose()?;
    let factors = match (
        &options.white_balance,
        manifest.and_then(|m| m.white_balance),
    ) {
        (WhiteBalance::Factors(factors), _) => *factors,
        (WhiteBalance::AsShot, Some(factors)) => factors,
        (WhiteBalance::AsShot, None) => as_shot(first)?,
        (WhiteBalance::GreyCard { .. }, _) => {
            card_factors(options, &reader, gathered, falloff.as_ref())?
        }
    };
    Ok(Decisions {
        color: transform(&first.header, factors),
        response,
        falloff,
        undistortion,
    })
}

fn transform(header: &Header, factors: [f32; 3]) -> ColorTransform {
    let Header { color, layout, .. } = header;
    if let Some(display) = &header.display {
        return ColorTransform {
            white_balance: factors,
            rec709_from_camera: display.rec709_from_rgb,
            white_xy: None,
        };
    }
    if *layout == Layout::Rgb && color.matrices.is_empty() && factors == [1.0; 3] {
        return ColorTransform::IDENTITY;
    }
    ColorTransform::new(color, factors)
}

fn as_shot(first: &Photograph) -> Result<[f32; 3]> {
    match (first.header.color.as_shot, kind_of(&first.path)) {
        (Some(factors), _) => Ok(factors),
        // The camera has balanced them.
        _ if first.header.display.is_some() => Ok([1.0; 3]),
        // Linear files are used unchanged: their colours are already converted.
        (None, Some(FileKind::Linear)) => Ok([1.0; 3]),
        (None, _) => Err(IngestError::photograph(
            &first.path,
            "white balance",
            "not in the file: --white-balance states it, as three factors or by a grey card",
        )),
    }
}

/// Factors that make the card neutral.
fn card_factors(
    options: &IngestOptions,
    reader: &Reader<'_>,
    gathered: &Gathered,
    falloff: Option<&Falloff>,
) -> Result<[f32; 3]> {
    let Some((name, [left, top, width, height])) = grey_card(options) else {
        return Ok([1.0; 3]);
    };
    let option = |value: String, wanted| IngestError::Option {
        field: "white_balance",
        value,
        wanted,
    };
    let stack = gathered
        .stacks
        .iter()
        .find(|stack| stack.name() == name || stack.position == name);
    let stack = stack.ok_or_else(|| option(name.to_owned(), "the name of a stack"))?;
    let frames = read_shots(stack, reader).map_err(|unreadable| unreadable.error)?;
    let header = &frames[0].header;
    let end = |start: u32, length: u32, limit: u32| {
        start.checked_add(length).is_some_and(|end| end <= limit)
    };
    if width < 4
        || height < 4
        || !end(left, width, header.width)
        || !end(top, height, header.height)
    {
        let wanted = "a rectangle of at least 4x4 pixels within the image";
        return Err(option(format!("{left},{top},{width},{height}"), wanted));
    }
    let exposures: Vec<f64> = stack.shots.iter().map(Photograph::exposure).collect();
    let merged = merge(&shots(&frames, &exposures), &Noise::ASSUMED, options.clip());
    let (mut sums, mut counts) = ([0.0_f64; 3], [0_u64; 3]);
    let per_pixel = header.row_len() / header.width as usize;
    for row in top as usize..(top + height) as usize {
        let factors =
            falloff.map(|f| f.row_factors(header.width as usize, header.height as usize, row));
        for sample in left as usize * per_pixel..(left + width) as usize * per_pixel {
            let index = row * header.row_len() + sample;
            if merged.flags[index] & CLIPPED == 0 {
                let channel = header.channel(row, sample);
                let factor = factors
                    .as_ref()
                    .map_or(1.0, |f| f[sample / per_pixel][channel]);
                sums[channel] += f64::from(merged.radiance[index] * factor);
                counts[channel] += 1;
            }
        }
    }
    let means = [0, 1, 2].map(|c| sums[c] / counts[c].max(1) as f64);
    if means.iter().any(|mean| *mean <= 0.0) {
        return Err(option(
            format!("{means:?}"),
            "a rectangle with light in it that is not clipped",
        ));
    }
    Ok(means.map(|mean| (means[1] / mean) as f32))
}

/// Whether the white balance needs a stack to be read.
fn grey_card(options: &IngestOptions) -> Option<(&str, [u32; 4])> {
    match &options.white_balance {
        WhiteBalance::GreyCard { stack, rectangle } => Some((stack, *rectangle)),
        _ => None,
    }
}

fn shots<'a>(frames: &'a [RawFrame], exposures: &[f64]) -> Vec<Shot<'a>> {
    let pairs = frames.iter().zip(exposures);
    pairs
        .map(|(frame, &exposure)| Shot { frame, exposure })
        .collect()
}

fn flat_error(folder: &Path, problem: &str) -> IngestError {
    IngestError::photograph(folder, "flat field", problem)
}

/// The falloff in a folder of photographs of an even surface.
fn flat_field(reader: &Reader<'_>, folder: &Path, first: &Photograph, clip: f32) -> Result<Grid> {
    let mut paths = files::list(folder)?;
    paths.retain(|path| kind_of(path).is_some_and(|kind| Some(kind) == kind_of(&first.path)));
    let mut frames = Vec::new();
    for path in &paths {
        let frame = reader.read(path)?;
        let (header, expected) = (&frame.header, &first.header);
        if (header.width, header.height, &header.layout)
            != (expected.width, expected.height, &expected.layout)
        {
            return Err(flat_error(
                path,
                &format!(
                    "{}x{} pixels, the capture has {}x{}",
                    header.width, header.height, expected.width, expected.height
                ),
            ));
        }
        frames.push(frame);
    }
    if frames.is_empty() {
        return Err(flat_error(folder, "no photographs of the capture's kind"));
    }
    let exposure = |frame: &RawFrame| {
        let stated = frame.header.metadata.exposure();
        stated.filter(|exposure| *exposure > 0.0).unwrap_or(1.0)
    };
    frames.sort_by(|a, b| exposure(a).total_cmp(&exposure(b)));
    let exposures: Vec<f64> = frames.iter().map(exposure).collect();
    let merged = merge(&shots(&frames, &exposures), &Noise::ASSUMED, clip);
    Grid::measure(&frames[0].header, &merged).ok_or_else(|| flat_error(folder, "clipped or dark"))
}

/// Radiance of the range per exposure, and what previews are multiplied by.
pub(crate) fn scales(given: Option<f64>, surveys: &[Survey]) -> (f64, f64) {
    let sum: f64 = surveys.iter().map(|survey| survey.log_luminance).sum();
    let mean = (sum / surveys.len().max(1) as f64).exp();
    // Through f32, which is what images are multiplied by.
    let automatic = f64::from((MIDDLE_GREY / mean) as f32);
    match given {
        None => (automatic, 1.0),
        Some(scale) => (scale, automatic / scale),
    }
}

/// Key of an item of the ledger: version and everything else that decides it.
pub(crate) fn item_key(decides: &impl Serialize) -> Result<Key> {
    let key = Key::new().with_value("version", &env!("CARGO_PKG_VERSION"))?;
    Ok(key.with_value("input", decides)?)
}

/// Digests and exposures of the shots of a stack before they are decoded.
pub(crate) fn shots_key(stack: &Stack) -> Vec<(String, f64)> {
    stack
        .shots
        .iter()
        .map(|shot| (shot.blake3.clone(), shot.exposure()))
        .collect()
}

/// Bytes that merging a stack takes at most: first all shots and the merged samples, then colours,
/// and the image with what is written of it.
pub(crate) fn needed_memory(stack: &Stack) -> u64 {
    let Some(first) = stack.shots.first() else {
        return 0;
    };
    let pixels = u64::from(first.header.width) * u64::from(first.header.height);
    let per_pixel = if first.header.layout == Layout::Rgb {
        3
    } else {
        1
    };
    let sample = if first.header.white[0].is_finite() && first.header.display.is_none() {
        2
    } else {
        4
    };
    let shots = stack.shots.len() as u64 * sample * per_pixel;
    // f32 and a flag for each sample beside the shots; or f32 RGB, samples, f16 RGB and one plane
    // of f32, a flag and 8-bit RGB.
    let merging = shots + 5 * per_pixel;
    let writing = 12 + 5 * per_pixel + 6 + 4 + 1 + 3;
    // The file of a shot is in memory while it is decoded.
    let files = 2 * 2 * sample * per_pixel;
    pixels * (merging + files).max(writing)
}
