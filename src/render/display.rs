//! Exposure and tone map of the PNGs.

use crate::command_line;
use anyhow::Result;
use clap::Args;
use eagpt_render::Shot;
use eagpt_scene::spread::evenly;
use eagpt_scene::tonemap::{Display, ExposureMeter, ToneMap};
use eagpt_trace::{Integrator, LightOptions, Tracer};
use serde::Serialize;
use std::fmt;
use std::str::FromStr;

/// Exposures that a person may ask for, in stops either way.
const MAX_STOPS: f32 = 32.0;
/// Number of pictures that the automatic exposure meters.
const MAX_METERED: usize = 16;
/// Factor by which metered pictures are smaller along each axis.
const METER_REDUCTION: u32 = 4;

/// Display of light in PNGs; EXR files never change.
#[derive(Debug, Clone, Args, Serialize)]
#[command(next_help_heading = "Pictures")]
pub(super) struct DisplayArgs {
    /// Exposure of the PNGs in stops, or `auto`: one for all, from a first look at up to 16 of
    /// them, that shows the geometric mean of their luminance as middle grey
    #[arg(
        long,
        value_name = "EV|auto",
        default_value = "0",
        allow_negative_numbers = true
    )]
    #[serde(serialize_with = "command_line::text")]
    exposure: Exposure,
    /// Tone map of the PNGs for light that is brighter than the display; srgb clips it
    #[arg(long, value_name = "CURVE", default_value = "srgb", value_enum)]
    tone_map: ToneMap,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Exposure {
    Stops(f32),
    Auto,
}

impl fmt::Display for Exposure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Stops(stops) => write!(f, "{stops}"),
            Self::Auto => f.write_str("auto"),
        }
    }
}

impl FromStr for Exposure {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "auto" {
            return Ok(Self::Auto);
        }
        match text.parse::<f32>() {
            Ok(stops) if stops.abs() <= MAX_STOPS => Ok(Self::Stops(stops)),
            Ok(stops) => Err(format!("{stops} is outside -{MAX_STOPS} to {MAX_STOPS}")),
            Err(_) => Err("neither a number of stops nor `auto`".to_owned()),
        }
    }
}

impl DisplayArgs {
    /// Exposure and tone map for all of `shots`: a sequence with an exposure for each of its
    /// pictures would flicker.
    ///
    /// # Errors
    /// If the pictures that the automatic exposure needs cannot be rendered.
    pub(super) fn resolve(
        &self,
        scene: &dyn Tracer,
        shots: &[Shot],
        integrator: &Integrator,
        light: &LightOptions,
    ) -> Result<Display> {
        let stops = match self.exposure {
            Exposure::Stops(stops) => stops,
            Exposure::Auto => {
                let mut meter = ExposureMeter::default();
                for shot in evenly(shots, MAX_METERED) {
                    let camera = &shot.camera;
                    let [width, height] =
                        [camera.width, camera.height].map(|size| size.div_ceil(METER_REDUCTION));
                    let small = camera.resized(width, height);
                    meter.add(&scene.render(&small, integrator, light)?.radiance);
                }
                meter.stops()
            }
        };
        Ok(Display {
            stops,
            tone_map: self.tone_map,
        })
    }
}
