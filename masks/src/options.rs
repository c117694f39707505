//! Options of masks.

use crate::error::{MaskError, Result};
use serde::{Deserialize, Serialize};
use std::fmt;

/// Options of [`crate::make_masks`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MaskOptions {
    /// Where masks come from before labels.
    pub source: MaskSource,

    /// Which value of a pixel is compared with the level.
    pub rule: Rule,
    /// Treatment of the border of a lamp.
    pub border: Border,
    /// Radius of the closing, pixels: gaps up to twice as wide are closed; 0 closes none.
    pub closing_radius: u8,
    /// Smallest connected region that is kept, pixels, before growing; of any size if one of its
    /// pixels is ten times the threshold.
    pub min_pixels: u32,
    /// Radius by which regions are grown, pixels.
    pub grow_radius: u8,
    /// Comparison between views.
    pub check: CheckOptions,
}

/// Where masks come from before labels.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum MaskSource {
    /// Pixels at or above a level that is found in all views together, see `level`.
    Auto,
    /// Pixels at or above this level of linear radiance, above 0.
    Level(f32),
    /// Pixels whose blended emission in a trained scene is at least this, above 0 and at most 1.
    Emission(f32),
    /// Labels alone: a view without label has no mask.
    None,
}

impl fmt::Display for MaskSource {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Auto => f.write_str("auto"),
            Self::Level(value) | Self::Emission(value) => write!(f, "{value}"),
            Self::None => f.write_str("none"),
        }
    }
}

/// Which value of a pixel is compared with the level.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
pub enum Rule {
    /// The largest channel
    ///
    /// One channel at the level suffices, so that coloured lamps count.
    Any,
    /// The smallest channel
    ///
    /// All channels have to be at the level.
    All,
    /// Rec.709 luminance
    Luminance,
    /// Mean of the channels
    Mean,
}

impl Rule {
    /// The value of a pixel.
    pub fn value(self, rgb: [f32; 3]) -> f32 {
        let [r, g, b] = rgb;
        match self {
            Self::Any => r.max(g).max(b),
            Self::All => r.min(g).min(b),
            Self::Luminance => eagpt_scene::color::luminance(rgb),
            Self::Mean => (r + g + b) / 3.0,
        }
    }
}

/// Treatment of the border of a lamp, where a pixel shows the lamp in part.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
pub enum Border {
    /// If they are at least halfway between the light and its surroundings
    ///
    /// Both within two pixels: where the lamp covers half of the pixel, at any brightness and blur
    /// of the optics.
    Half,
    /// If they are at the threshold
    ///
    /// Bright lamps gain a rim.
    Full,
}

/// Options of the comparison between views, `consistency`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct CheckOptions {
    /// Treatment of regions that other views do not confirm.
    pub inconsistent: Inconsistent,
    /// Least share, among the places where other views see a region's surface, that are masked
    /// there, too; 0 to 1.
    pub min_support: f32,
}

/// Treatment of regions that other views do not confirm.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
pub enum Inconsistent {
    /// They are listed
    Keep,
    /// They are listed and leave the masks
    Drop,
    /// Nothing is compared
    Ignore,
}

impl Default for CheckOptions {
    fn default() -> Self {
        Self {
            inconsistent: Inconsistent::Keep,
            min_support: 0.5,
        }
    }
}

impl Default for MaskOptions {
    fn default() -> Self {
        Self {
            source: MaskSource::Auto,
            rule: Rule::Any,
            border: Border::Half,
            closing_radius: 0,
            min_pixels: 4,
            grow_radius: 0,
            check: CheckOptions::default(),
        }
    }
}

impl MaskOptions {
    /// Checks every range.
    ///
    /// # Errors
    /// [`MaskError::Option`] with the option's name, its value and its range.
    pub fn validate(&self) -> Result<()> {
        let wrong = |field, value: f32, expected| {
            let value = value.to_string();
            Err(MaskError::Option {
                field,
                value,
                expected,
            })
        };
        match self.source {
            MaskSource::Level(level) if !(level > 0.0 && level.is_finite()) => {
                return wrong("threshold", level, "above 0 and finite");
            }
            MaskSource::Emission(emission) if !(emission > 0.0 && emission <= 1.0) => {
                return wrong("emission", emission, "above 0 and at most 1");
            }
            _ => {}
        }
        if !(0.0..=1.0).contains(&self.check.min_support) {
            return wrong("min_support", self.check.min_support, "from 0 to 1");
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rules_pick_their_value() {
        let rgb = [0.5, 2.0, 0.25];
        let values = [Rule::Any, Rule::All, Rule::Mean].map(|rule| rule.value(rgb));
        assert_eq!(values, [2.0, 0.25, 2.75 / 3.0]);
        // 0.2126 · 0.5 + 0.7152 · 2 + 0.0722 · 0.25.
        assert!((Rule::Luminance.value(rgb) - 1.554_75).abs() < 1e-5);
    }

    #[test]
    fn ranges_are_checked_by_name() {
        let mut options = MaskOptions::default();
        options.validate().unwrap();
        options.source = MaskSource::Level(f32::NAN);
        let message = options.validate().unwrap_err().to_string();
        assert_eq!(message, "option threshold: NaN, must be above 0 and finite");
        options.source = MaskSource::Emission(1.5);
        assert!(options.validate().is_err());
        options.source = MaskSource::None;
        options.check.min_support = -0.1;
        let message = options.validate().unwrap_err().to_string();
        assert_eq!(message, "option min_support: -0.1, must be from 0 to 1");
    }
}
