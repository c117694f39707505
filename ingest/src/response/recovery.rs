//! Recovery of a response from shots of known exposures.
//!
//! A shot of exposure t shows the light E as the code z = f(tE). Shots of one scene at known
//! exposures determine g = ln f⁻¹ up to a constant (Debevec and Malik, "Recovering high dynamic
//! range radiance maps from photographs", SIGGRAPH 1997): the least squares of g(z) − ln E − ln t
//! over many pixels, and of the second difference of g. Here it is the difference of g from sRGB's
//! curve that is smooth, since cameras vary that one; the light of each pixel is eliminated, so
//! that any number of pixels gives 256 equations. Pixels that moved count little.
//!
//! One curve for each channel of a capture. What is grey at code [`GREY`] is taken for grey: the
//! white balance stays the camera's.

use super::solve::{self, Chain};
use super::{NUM_CODES, Response, USABLE, clips};
use crate::error::{IngestError, Result};
use crate::raw::{Decoding, RawFrame, Samples};
use crate::stack::{Photograph, Stack};
use crate::survey::{Reader, read_shots};
use eagpt_scene::spread::evenly;
use std::path::Path;

/// The code at which the channels agree.
const GREY: usize = 128;
/// Stacks that the response is recovered from, evenly spread over the capture.
const MAX_STACKS: usize = 12;
/// Pixels taken from a stack, evenly spread.
const PIXELS_PER_STACK: usize = 6000;
/// Largest difference of codes among a pixel and its neighbours: edges are where JPEG errs.
const MAX_STEP: u16 = 8;
/// Fewest pixels, and codes among them, that determine a curve.
const MIN_PIXELS: usize = 200;
const MIN_CODES: usize = 64;
/// Share by which the light of a code may be below that of the code before: noise of the fit.
const MAX_FALL: f64 = 0.01;

/// The response of the camera that took the stacks; `None` if their files are linear.
///
/// # Errors
/// [`IngestError::Response`] if the pictures do not determine it, or it falls.
pub(crate) fn recover(
    capture: &Path,
    stacks: &[Stack],
    decoding: &Decoding,
) -> Result<Option<Response>> {
    let of_display: Vec<&Stack> = stacks
        .iter()
        .filter(|stack| {
            let mut shots = stack.shots.iter();
            shots.len() > 1 && shots.all(|shot| shot.header.display.is_some())
        })
        .collect();
    let is_display = |shot: &Photograph| shot.header.display.is_some();
    if !stacks.iter().flat_map(|stack| &stack.shots).any(is_display) {
        return Ok(None);
    }
    let failed = |problem: String| IngestError::Response {
        capture: capture.to_owned(),
        problem,
    };
    let mut chains: [Vec<Chain>; 3] = Default::default();
    let mut num_stacks = 0;
    let reader = Reader {
        decoding,
        response: None,
    };
    for stack in evenly(&of_display, MAX_STACKS) {
        // One that cannot be read is reported by the survey.
        let Ok(frames) = read_shots(stack, &reader) else {
            continue;
        };
        let exposures: Vec<f64> = stack
            .shots
            .iter()
            .map(|shot| shot.exposure().ln())
            .collect();
        for (channel, chains) in chains.iter_mut().enumerate() {
            take_chains(&frames, &exposures, channel, chains);
        }
        num_stacks += 1;
    }
    let num_pixels = chains.iter().map(Vec::len).min().unwrap_or(0);
    let mut curves: [Vec<f64>; 3] = Default::default();
    let mut square = 0.0;
    for ((curve, chains), name) in curves.iter_mut().zip(&chains).zip(["red", "green", "blue"]) {
        let mut seen = [false; NUM_CODES];
        for (code, _) in chains.iter().flatten() {
            seen[usize::from(*code)] = true;
        }
        let num_codes = seen.into_iter().filter(|seen| *seen).count();
        if chains.len() < MIN_PIXELS || num_codes < MIN_CODES {
            return Err(failed(format!(
                "{name}: {} pixels with {num_codes} different codes are well exposed in two shots of a stack, {MIN_PIXELS} with {MIN_CODES} are needed: RAW files need no response",
                chains.len()
            )));
        }
        let (found, error) = solve::curve(chains, GREY);
        *curve = found;
        square += error * error / 3.0;
        check_rise(curve, name).map_err(failed)?;
    }
    Ok(Some(Response {
        light: fractions(&curves),
        num_stacks,
        num_pixels,
        error_stops: square.sqrt() / std::f64::consts::LN_2,
    }))
}

/// Rejects a curve on which a brighter code stands for less light.
fn check_rise(curve: &[f64], name: &str) -> std::result::Result<(), String> {
    let codes = usize::from(*USABLE.start())..=usize::from(*USABLE.end());
    let mut largest = f64::NEG_INFINITY;
    for code in codes {
        if curve[code] < largest - MAX_FALL {
            return Err(format!(
                "{name}: code {code} stands for less light than a lower one: exposures that are not as stated, or a tone curve that is not the same in all shots (automatic HDR, local contrast): --exposures states them, RAW files need no response"
            ));
        }
        largest = largest.max(curve[code]);
    }
    Ok(())
}

/// Logarithms of light as light, that at which the channels clip as 1.
fn fractions(curves: &[Vec<f64>; 3]) -> [Vec<f32>; 3] {
    let last = usize::from(*USABLE.end());
    let clip = curves
        .iter()
        .map(|curve| curve[last + 1])
        .fold(f64::NEG_INFINITY, f64::max);
    [0, 1, 2].map(|channel| {
        let mut largest = 0.0_f64;
        let light = curves[channel].iter().enumerate().map(|(code, log)| {
            // Code 0 is black, whatever the logarithm.
            if code > 0 {
                largest = largest.max((log - clip).exp());
            }
            (if code > last { 1.0 } else { largest.min(1.0) }) as f32
        });
        light.collect()
    })
}

/// Adds the pixels of a channel that two shots or more show well.
fn take_chains(frames: &[RawFrame], exposures: &[f64], channel: usize, chains: &mut Vec<Chain>) {
    let Some(first) = frames.first() else { return };
    let (width, height) = (first.header.width as usize, first.header.height as usize);
    let step = ((width * height / PIXELS_PER_STACK) as f64)
        .sqrt()
        .ceil()
        .max(1.0) as usize;
    for y in (1..height.saturating_sub(1)).step_by(step) {
        for x in (1..width.saturating_sub(1)).step_by(step) {
            let shown = frames.iter().zip(exposures);
            let chain: Chain = shown
                .filter_map(|(frame, &exposure)| {
                    Some((flat_code(frame, (x, y), channel)?, exposure))
                })
                .collect();
            if chain.len() > 1 {
                chains.push(chain);
            }
        }
    }
}

/// The code of a pixel, if it is usable, its neighbours are alike and no other channel clips.
fn flat_code(frame: &RawFrame, (x, y): (usize, usize), channel: usize) -> Option<u16> {
    let Samples::Integer(samples) = &frame.samples else {
        return None;
    };
    let width = frame.header.width as usize;
    let at = |x: usize, y: usize| samples[(y * width + x) * 3 + channel];
    let (mut low, mut high) = (u16::MAX, 0);
    for row in y - 1..=y + 1 {
        for column in x - 1..=x + 1 {
            low = low.min(at(column, row));
            high = high.max(at(column, row));
        }
    }
    let start = (y * width + x) * 3;
    let clips = clips(&samples[start..start + 3]);
    let code = at(x, y);
    (USABLE.contains(&code) && high - low <= MAX_STEP && !clips).then_some(code)
}
