//! Settings of HDR-FLIP, and the exposures that follow from a reference (Andersson et al. 2021,
//! "Visualizing errors in rendered high dynamic range images").

use crate::error::{EvalError, Result};
use eagpt_scene::tonemap::ToneMapper;
use eagpt_scene::{Image, color::luminance};
use serde::{Deserialize, Serialize};

/// Settings of HDR-FLIP. What is `None` is derived from the reference.
///
/// Numbers are comparable only at equal exposures; those derived from one reference are equal for
/// all its tests.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct FlipOptions {
    /// Pixels per degree of vision; the default is a 0.7 m wide 3840-pixel display seen from 0.7 m.
    pub ppd: f32,
    /// Tone curve.
    pub tonemapper: ToneMapper,
    /// First exposure in stops.
    pub start_exposure: Option<f32>,
    /// Last exposure in stops.
    pub stop_exposure: Option<f32>,
    /// Number of exposures, evenly spaced.
    pub num_exposures: Option<u32>,
}

impl Default for FlipOptions {
    fn default() -> Self {
        Self {
            ppd: DEFAULT_PPD,
            tonemapper: ToneMapper::default(),
            start_exposure: None,
            stop_exposure: None,
            num_exposures: None,
        }
    }
}

/// 0.7 · (3840 / 0.7) · π / 180.
pub(crate) const DEFAULT_PPD: f32 = 67.020_645;
/// Limits of [`FlipOptions::ppd`]: the filters reach 0.14 degrees to each side, so these are 1 to
/// 1,351 pixels.
const PPD_LIMITS: std::ops::RangeInclusive<f32> = 1.0..=10_000.0;
/// Limit of [`FlipOptions::num_exposures`].
const MAX_EXPOSURES: u32 = 1000;
/// Limits of exposures in stops: their factors stay finite in f32.
const MAX_STOPS: f32 = 100.0;
/// Share of the display's range that the automatic exposures aim at.
const TARGET: f32 = 0.85;

impl FlipOptions {
    /// Checks the ranges: ppd 1 to 10,000, 1 to 1,000 exposures from −100 to 100 stops in ascending
    /// order.
    ///
    /// # Errors
    /// [`EvalError::Option`] with the field and its value, or [`EvalError::Exposures`].
    pub fn validate(&self) -> Result<()> {
        let invalid = |field, value: String, expected| {
            Err(EvalError::Option {
                field,
                value,
                expected,
            })
        };
        if !PPD_LIMITS.contains(&self.ppd) {
            return invalid("ppd", self.ppd.to_string(), "from 1 to 10000");
        }
        if let Some(num) = self.num_exposures
            && !(1..=MAX_EXPOSURES).contains(&num)
        {
            return invalid("num_exposures", num.to_string(), "from 1 to 1000");
        }
        for (field, exposure) in [
            ("start_exposure", self.start_exposure),
            ("stop_exposure", self.stop_exposure),
        ] {
            if let Some(exposure) = exposure
                && !(-MAX_STOPS..=MAX_STOPS).contains(&exposure)
            {
                return invalid(field, exposure.to_string(), "from -100 to 100 stops");
            }
        }
        match (self.start_exposure, self.stop_exposure) {
            (Some(start), Some(stop)) => refuse_reversed(start, stop),
            _ => Ok(()),
        }
    }
}

fn refuse_reversed(start: f32, stop: f32) -> Result<()> {
    if start > stop {
        return Err(EvalError::Exposures { start, stop });
    }
    Ok(())
}

/// The settings that a value of HDR-FLIP was computed with.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct FlipParameters {
    /// Pixels per degree of vision.
    pub ppd: f32,
    /// First exposure in stops.
    pub start_exposure: f32,
    /// Last exposure in stops.
    pub stop_exposure: f32,
    /// Number of exposures.
    pub num_exposures: u32,
    /// Tone curve.
    pub tonemapper: ToneMapper,
}

impl FlipParameters {
    /// The settings for a reference. The first exposure brings its brightest luminance to 0.85 on
    /// the display and the last one its median luminance; one exposure a stop and at least two.
    ///
    /// Where the median is 0, that of the luminances above 0 takes its place (the official tool has
    /// no finite exposure there); a black reference gives the single exposure 0. One exposure
    /// stands at the start.
    ///
    /// # Errors
    /// As [`FlipOptions::validate`], or [`EvalError::Exposures`] if the range is not ascending.
    pub(crate) fn for_reference(options: &FlipOptions, reference: &Image<3>) -> Result<Self> {
        options.validate()?;
        let automatic = automatic_range(options.tonemapper, reference);
        let start = options.start_exposure.or(automatic.map(|range| range.0));
        let stop = options.stop_exposure.or(automatic.map(|range| range.1));
        let start_exposure = start.or(stop).unwrap_or(0.0);
        let stop_exposure = stop.unwrap_or(start_exposure);
        refuse_reversed(start_exposure, stop_exposure)?;
        let range = stop_exposure - start_exposure;
        let automatic_num = if automatic.is_none() && range == 0.0 {
            1
        } else {
            (range.ceil() as u32).max(2)
        };
        Ok(Self {
            ppd: options.ppd,
            start_exposure,
            stop_exposure,
            num_exposures: options.num_exposures.unwrap_or(automatic_num),
            tonemapper: options.tonemapper,
        })
    }

    /// The factor of each exposure.
    pub(super) fn factors(&self) -> Vec<f32> {
        let num_steps = self.num_exposures.saturating_sub(1).max(1) as f32;
        let step = (self.stop_exposure - self.start_exposure) / num_steps;
        (0..self.num_exposures)
            .map(|i| (self.start_exposure + i as f32 * step).exp2())
            .collect()
    }
}

/// First and last exposure; `None` for a black image. Luminances that are not finite are left out.
fn automatic_range(tonemapper: ToneMapper, reference: &Image<3>) -> Option<(f32, f32)> {
    let luminances = reference.pixels().iter().map(|pixel| luminance(*pixel));
    let mut luminances: Vec<f32> = luminances.filter(|l| l.is_finite()).collect();
    let brightest = luminances.iter().copied().fold(0.0, f32::max);
    if brightest <= 0.0 {
        return None;
    }
    let mut median = median(&mut luminances);
    if median <= 0.0 {
        luminances.retain(|l| *l > 0.0);
        median = self::median(&mut luminances);
    }
    let light = f64::from(tonemapper.light_shown_as(TARGET));
    let exposure = |luminance: f32| {
        let stops = (light / f64::from(luminance)).log2() as f32;
        stops.clamp(-MAX_STOPS, MAX_STOPS)
    };
    Some((exposure(brightest), exposure(median)))
}

/// The value ranked n/2 of `values`, counted from 0, as the official tool takes it; they are
/// reordered and not empty.
fn median(values: &mut [f32]) -> f32 {
    let rank = values.len() / 2;
    *values.select_nth_unstable_by(rank, f32::total_cmp).1
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grey(values: &[f32]) -> Image<3> {
        let pixels = values.iter().map(|v| [*v; 3]).collect();
        Image::from_pixels(values.len() as u32, 1, pixels).unwrap()
    }

    fn automatic(values: &[f32]) -> FlipParameters {
        FlipParameters::for_reference(&FlipOptions::default(), &grey(values)).unwrap()
    }

    #[test]
    fn exposures_span_brightest_to_median() {
        let found = automatic(&[1.0, 1.0, 8.0, 32.0]);
        // The upper median, 8, against 32 is two stops: two exposures.
        assert!((found.stop_exposure - found.start_exposure - 2.0).abs() < 1e-5);
        assert_eq!(found.num_exposures, 2);
        let found = automatic(&[1.0, 1.0, 7.0, 32.0]);
        assert_eq!(found.num_exposures, 3);
        let factors = found.factors();
        let light = ToneMapper::Aces.light_shown_as(TARGET);
        assert!((factors[0] * 32.0 / light - 1.0).abs() < 1e-5);
        assert!((factors[2] * 7.0 / light - 1.0).abs() < 1e-5);
        assert!((factors[1] / (factors[0] * factors[2]).sqrt() - 1.0).abs() < 1e-5);
        // A uniform grey image has a range of zero, and two equal exposures as in the official
        // tool.
        assert_eq!(automatic(&[0.5; 4]).num_exposures, 2);
        assert_eq!(automatic(&[0.5]).num_exposures, 2);
    }

    #[test]
    fn black_is_no_reason_for_infinite_exposures() {
        let found = automatic(&[0.0, 0.0, 0.0, 3.0, 16.0]);
        let light = ToneMapper::Aces.light_shown_as(TARGET);
        assert!((found.start_exposure - (light / 16.0).log2()).abs() < 1e-6);
        assert!((found.stop_exposure - (light / 16.0).log2()).abs() < 1e-6);
        let black = automatic(&[0.0; 3]);
        assert_eq!((black.start_exposure, black.stop_exposure), (0.0, 0.0));
        assert_eq!(black.num_exposures, 1);
        assert_eq!(black.factors(), [1.0]);
        assert_eq!(automatic(&[f32::INFINITY, f32::NAN]), black);
        let faint = automatic(&[1e-42; 3]);
        assert_eq!(faint.start_exposure, 100.0);
        assert!(faint.factors().iter().all(|factor| factor.is_finite()));
    }

    #[test]
    fn overrides_are_taken_and_bad_ones_named() {
        let options = FlipOptions {
            start_exposure: Some(-1.0),
            stop_exposure: Some(2.0),
            num_exposures: Some(4),
            ..FlipOptions::default()
        };
        let found = FlipParameters::for_reference(&options, &grey(&[1.0; 2])).unwrap();
        assert_eq!(found.factors(), [0.5, 1.0, 2.0, 4.0]);
        let reversed = FlipOptions {
            start_exposure: Some(3.0),
            ..options
        };
        let message = reversed.validate().unwrap_err().to_string();
        assert!(message.contains('3') && message.contains('2'), "{message}");
        // Of a reversed range that only the reference reveals.
        let late = FlipOptions {
            start_exposure: Some(50.0),
            ..FlipOptions::default()
        };
        assert!(late.validate().is_ok());
        assert!(FlipParameters::for_reference(&late, &grey(&[1.0; 2])).is_err());
        for (options, field) in [
            (
                FlipOptions {
                    ppd: f32::NAN,
                    ..options
                },
                "ppd",
            ),
            (
                FlipOptions {
                    num_exposures: Some(0),
                    ..options
                },
                "num_exposures",
            ),
            (
                FlipOptions {
                    stop_exposure: Some(f32::INFINITY),
                    ..options
                },
                "stop_exposure",
            ),
        ] {
            let message = options.validate().unwrap_err().to_string();
            assert!(message.contains(field), "{message}");
        }
    }
}
