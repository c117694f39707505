//! Settings of a simulated capture.

use crate::error::{Result, SynthError};
use crate::light::points::MAX_SAMPLES;
use crate::photograph::SampleNoise;
use crate::script::{CameraPlan, SceneScript};
use serde::{Deserialize, Serialize};

/// Parts of a capture to write.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
pub enum Parts {
    /// The RAW capture and the truth
    #[default]
    All,
    /// The RAW capture alone
    Capture,
    /// The true datasets alone
    Truth,
}

impl Parts {
    pub(super) fn has_truth(self) -> bool {
        self != Self::Capture
    }

    pub(super) fn has_capture(self) -> bool {
        self != Self::Truth
    }
}

/// Settings of a simulated capture.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SynthOptions {
    /// Parts of a capture to write.
    pub parts: Parts,
    /// Size of the truth images, pixels; `None` for the scene's.
    pub size: Option<[u32; 2]>,
    /// Number of positions; `None` for the scene's.
    pub num_views: Option<u32>,
    /// Samples for each pixel of the truth, 1 to 65,536.
    pub num_samples: u32,
    /// Computation of indirect light.
    pub light: LightMethod,
    /// Treatment of the noise of sampled light.
    pub noise: SampleNoise,
    /// Points of each condition's cloud.
    pub num_points: u32,
    /// Seed of all random numbers.
    pub seed: u64,
}

/// Computation of indirect light.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
pub enum LightMethod {
    /// By a final gather at every pixel, into light solved once for the room
    #[default]
    Cached,
    /// By paths to their end: unbiased, slower and noisier
    Paths,
}

impl Default for SynthOptions {
    fn default() -> Self {
        Self {
            parts: Parts::All,
            size: None,
            num_views: None,
            num_samples: 16,
            light: LightMethod::Cached,
            noise: SampleNoise::Filtered,
            num_points: 20_000,
            seed: 0,
        }
    }
}

impl SynthOptions {
    /// Checks all values.
    ///
    /// # Errors
    /// [`SynthError::Option`] naming the first that cannot be.
    pub(crate) fn validate(&self) -> Result<()> {
        let option = |field, problem: String| Err(SynthError::Option { field, problem });
        if let Some([width, height]) = self.size
            && !([width, height]
                .iter()
                .all(|side| (8..=16_384).contains(side)))
        {
            return option(
                "size",
                format!("{width}x{height}: sides are 8 to 16384 pixels"),
            );
        }
        if let Some(num @ (0 | 10_001..)) = self.num_views {
            return option("num_views", format!("{num} is not from 1 to 10000"));
        }
        if !(1..=MAX_SAMPLES).contains(&self.num_samples) {
            let num = self.num_samples;
            return option(
                "num_samples",
                format!("{num} is not from 1 to {MAX_SAMPLES}"),
            );
        }
        if self.num_points > 100_000_000 {
            let num = self.num_points;
            return option("num_points", format!("{num} is above 100000000"));
        }
        Ok(())
    }

    /// The cameras' plan of a scene under these options.
    pub(crate) fn plan(&self, script: &SceneScript) -> CameraPlan {
        let plan = &script.cameras;
        CameraPlan {
            num_views: self.num_views.unwrap_or(plan.num_views),
            size: self.size.unwrap_or(plan.size),
            ..plan.clone()
        }
    }
}
