//! Tone mapping: what a display shows of scene-referred light. Only pictures to look at go through
//! it, never data.
//!
//! | curve | shown as white | colours brighter than the display |
//! |---|---|---|
//! | [`ToneMap::Srgb`] | 1 | each channel is cut: hues shift to the nearest primary or secondary |
//! | [`ToneMap::Filmic`] | 5.6 | each channel bends: bright colours pale, hues shift somewhat |
//! | [`ToneMap::Aces`] | 12.1 | the same |
//! | [`ToneMap::Reinhard`] | never | hue and saturation stay until a channel is cut |
//! | [`ToneMap::Agx`] | 16.3 | channels are mixed first, then each bends: bright colours pale most |
//!
//! The numbers are for grey light. Exposure comes first: [`Display`] has both.

mod agx;

#[cfg(test)]
mod tests;

use crate::color::luminance;
use crate::image::Image;
use serde::{Deserialize, Serialize};
use std::fmt;

/// Exposed values are cut here: every tone curve is flat long before, and squares still fit in f32.
const BRIGHTEST: f32 = 1e15;
/// Displayed value of the mean luminance under automatic exposure: the middle grey of Reinhard et
/// al. 2002.
const MIDDLE_GREY: f64 = 0.18;
/// Automatic exposures are a whole number of these, in stops, so that a person can state the same
/// one.
const EXPOSURE_STEP: f64 = 0.01;
/// Dimmer than this is nothing, not dark: pixels that hit nothing would pull a mean of logarithms
/// down without end.
const DARKEST: f32 = 1e-6;

/// The rational tone curves, which HDR-FLIP uses as well (Andersson et al. 2021).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ToneMapper {
    /// The rational fit to the ACES filmic curve by Narkowicz 2016, without its pre-exposure.
    #[default]
    Aces,
    /// The filmic curve of Hable 2010 ("Uncharted 2"), with its exposure bias of 2 and its white of
    /// 11.2.
    Hable,
    /// Y / (1 + Y) on luminance, Reinhard et al. 2002.
    Reinhard,
}

impl ToneMapper {
    /// The name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Aces => "aces",
            Self::Hable => "hable",
            Self::Reinhard => "reinhard",
        }
    }

    /// `[a, b, c, d, e, f]` of the curve (a x² + b x + c) / (d x² + e x + f); Reinhard's is of the
    /// luminance.
    pub fn coefficients(self) -> [f32; 6] {
        // ACES is published for light that was multiplied by 0.6 before.
        const PRE: f32 = 0.6;
        match self {
            Self::Aces => [
                PRE * PRE * 2.51,
                PRE * 0.03,
                0.0,
                PRE * PRE * 2.43,
                PRE * 0.59,
                0.14,
            ],
            Self::Hable => [0.231_683, 0.013_791, 0.0, 0.18, 0.3, 0.018],
            Self::Reinhard => [0.0, 1.0, 0.0, 0.0, 1.0, 1.0],
        }
    }

    /// Grey light that is shown as `target`, above 0 and below 1.
    pub fn light_shown_as(self, target: f32) -> f32 {
        let [a, b, c, d, e, f] = self.coefficients();
        let (a, b, c) = (a - target * d, b - target * e, c - target * f);
        if a == 0.0 {
            return -c / b;
        }
        let half = -0.5 * (b / a);
        half + (half * half - c / a).sqrt()
    }

    /// Displayed value of exposed light of 0 and more: linear, 0 to 1.
    #[inline(always)]
    pub fn shown(self, light: [f32; 3]) -> [f32; 3] {
        let light = light.map(|v| v.min(BRIGHTEST));
        let shown = if self == Self::Reinhard {
            let scale = 1.0 / (1.0 + luminance(light));
            light.map(|v| v * scale)
        } else {
            let [a, b, c, d, e, f] = self.coefficients();
            light.map(|v| (v * v * a + v * b + c) / (v * v * d + v * e + f))
        };
        shown.map(|v| v.clamp(0.0, 1.0))
    }
}

/// Exposure and tone map of a picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
#[serde(rename_all = "lowercase")]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
pub enum ToneMap {
    /// None: cut at 1
    #[default]
    Srgb,
    /// The curve of Hable
    Filmic,
    /// The curve of ACES
    Aces,
    /// The curve of Reinhard
    Reinhard,
    /// AgX by Troy Sobotka, base look
    ///
    /// A sigmoid in log2 of light whose primaries were moved towards white.
    Agx,
}

impl ToneMap {
    /// All of them with their names in options and files.
    pub const ALL: [(Self, &'static str); 5] = [
        (Self::Srgb, "srgb"),
        (Self::Filmic, "filmic"),
        (Self::Aces, "aces"),
        (Self::Reinhard, "reinhard"),
        (Self::Agx, "agx"),
    ];

    /// The rational curve, where it is one.
    pub fn mapper(self) -> Option<ToneMapper> {
        match self {
            Self::Filmic => Some(ToneMapper::Hable),
            Self::Aces => Some(ToneMapper::Aces),
            Self::Reinhard => Some(ToneMapper::Reinhard),
            Self::Srgb | Self::Agx => None,
        }
    }

    /// Displayed value of exposed light: linear, 0 to 1. Negative light and NaN are shown as
    /// 0.
    pub fn shown(self, light: [f32; 3]) -> [f32; 3] {
        // NaN compares with nothing.
        let light = light.map(|v| if v > 0.0 { v.min(BRIGHTEST) } else { 0.0 });
        match self {
            Self::Agx => agx::shown(light),
            _ => match self.mapper() {
                Some(mapper) => mapper.shown(light),
                None => light.map(|v| v.min(1.0)),
            },
        }
    }
}

impl fmt::Display for ToneMap {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(Self::ALL[*self as usize].1)
    }
}

/// Exposure and tone map of a picture.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Display {
    /// Stops: light is multiplied by 2 to this power.
    #[serde(rename = "exposure_stops")]
    pub stops: f32,
    /// The tone map.
    pub tone_map: ToneMap,
}

impl Display {
    /// Displayed values of a picture: linear, 0 to 1.
    pub fn shown(&self, image: &Image<3>) -> Image<3> {
        let factor = self.stops.exp2();
        image.map(|pixel| self.tone_map.shown(pixel.map(|v| v * factor)))
    }
}

/// Finds one exposure for many pictures: the one that shows the mean of the logarithm of all their
/// luminances as middle grey, 0.18 (Reinhard et al. 2002, equations 1 and 2). Pixels without light
/// are left out.
#[derive(Debug, Clone, Copy, Default)]
pub struct ExposureMeter {
    sum_log2: f64,
    num_pixels: u64,
}

impl ExposureMeter {
    /// Looks at a picture as well.
    pub fn add(&mut self, image: &Image<3>) {
        for pixel in image.pixels() {
            let luminance = luminance(*pixel);
            if luminance.is_finite() && luminance > DARKEST {
                self.sum_log2 += f64::from(luminance).log2();
                self.num_pixels += 1;
            }
        }
    }

    /// The exposure in stops, to a hundredth; 0 if all was black.
    pub fn stops(&self) -> f32 {
        if self.num_pixels == 0 {
            return 0.0;
        }
        let stops = MIDDLE_GREY.log2() - self.sum_log2 / self.num_pixels as f64;
        ((stops / EXPOSURE_STEP).round() * EXPOSURE_STEP) as f32
    }
}
