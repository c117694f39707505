//! Options of a training run.
//!
//! One struct serves the command line, TOML files and the record beside the result. A run starts from a [`Preset`];
//! [`TrainOptions::from_layers`] puts a file and single settings on top.

use crate::error::{Result, TrainError};
use eagpt_scene::dataset::SplitRule;
use serde::{Deserialize, Serialize};

/// Named sets of defaults.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Preset {
    /// A first look, in a few minutes.
    Draft,
    /// Good results on a CPU within 20 minutes for a small dataset.
    Fast,
    /// The iterations, rates and samples of the paper.
    Paper,
}

/// A stage of training.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Stage {
    /// Stage 0: geometry, radiance and emission.
    Radiance,
    /// Stage 1: diffuse albedo.
    Albedo,
}

impl Stage {
    /// The name used in files and messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::Radiance => "radiance",
            Self::Albedo => "albedo",
        }
    }
}

/// Which stages to run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum StageChoice {
    /// Stage 0, then stage 1.
    All,
    /// Stage 0 only.
    Radiance,
    /// Stage 1 on the scene that an earlier run left in the output folder.
    Albedo,
}

/// Everything a run can be told.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrainOptions {
    /// The preset the other values started from.
    pub preset: Preset,
    /// Stages to run.
    pub stage: StageChoice,
    /// Seed of all random numbers.
    pub seed: u64,
    /// How views are divided into training and test views.
    pub split: SplitRule,
    /// Number of Gaussians; without it, `init.per_point` for each point of the cloud.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub num_gaussians: Option<usize>,
    /// Starting values.
    pub init: InitOptions,
    /// Stage 0.
    pub radiance: RadianceOptions,
    /// Stage 1.
    pub albedo: AlbedoOptions,
    /// Checkpoints, previews and the log.
    pub output: OutputOptions,
}

/// Starting values of the Gaussians.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct InitOptions {
    /// Gaussians for each point of the cloud where `num_gaussians` is not given; those beyond the first start between a point and
    /// one of its neighbours.
    pub per_point: f32,
    /// Scale as a multiple of the root mean square distance to the three nearest points.
    pub scale_factor: f32,
    /// Opacity, between 0 and 1.
    pub opacity: f32,
    /// Emission where no mask says otherwise, between 0 and 1.
    pub emission: f32,
    /// Albedo before stage 1, between 0 and 1.
    pub albedo: f32,
}

/// Adam's step sizes for the raw parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LearningRates {
    /// Position, as a share of the scene's extent (half the diagonal of the box around the middle 98 % of the points).
    pub position: f32,
    /// Logarithm of the scales.
    pub scale: f32,
    /// Quaternion.
    pub rotation: f32,
    /// Logit of the opacity.
    pub opacity: f32,
    /// Logarithm of the radiance.
    pub radiance: f32,
    /// Logit of the emission.
    pub emission: f32,
    /// All rates fall exponentially to this share of their start at the end of the stage; 1 keeps them constant.
    pub final_share: f32,
}

/// Weights of the loss, λ of the paper.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LossWeights {
    /// Colour, λ_c.
    pub color: f64,
    /// Share of 1 − SSIM in the colour term; the rest is L1.
    pub ssim_share: f64,
    /// Blended normals against the view's normal map, λ_n.
    pub normal: f64,
    /// Normals of the depth's surface against the normal map (or against the blended normals), λ_d.
    pub depth_normal: f64,
    /// Emission against the view's mask, λ_e.
    pub emission: f64,
    /// Opacity, λ_a.
    pub alpha: f64,
}

/// Stage 0.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RadianceOptions {
    /// Iterations, one view each.
    pub iterations: u32,
    /// Share of the iterations after which the normal terms start, 0 to 1.
    pub normals_from: f32,
    /// Step sizes.
    pub rates: LearningRates,
    /// Loss weights.
    pub weights: LossWeights,
}

/// Stage 1.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AlbedoOptions {
    /// Iterations, one view each.
    pub iterations: u32,
    /// Irradiance samples of a Gaussian for the closed form that albedos start from; 0 starts at `init.albedo`.
    pub num_start_samples: u32,
    /// Irradiance samples of a pixel.
    pub num_samples: u32,
    /// Whether the samples are drawn anew in every iteration, as the reference does. Otherwise a view's irradiance, which does not
    /// change in this stage, is computed once.
    pub resample: bool,
    /// Step size of the albedo's logit.
    pub rate: f32,
    /// The rate falls exponentially to this share at the end.
    pub final_share: f32,
    /// τ_E: pixels of higher emission show their radiance.
    pub emission_threshold: f32,
}

/// Checkpoints, previews and the log.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OutputOptions {
    /// Iterations between checkpoints.
    pub checkpoint_every: u32,
    /// Checkpoints kept.
    pub keep_checkpoints: usize,
    /// Iterations between previews; 0 for none.
    pub preview_every: u32,
    /// Views shown in previews.
    pub num_previews: usize,
    /// Iterations between lines of the log.
    pub log_every: u32,
}

impl TrainOptions {
    /// The values of a preset.
    pub fn preset(preset: Preset) -> Self {
        let weights = LossWeights {
            color: 1.0,
            ssim_share: 0.2,
            normal: 0.5,
            depth_normal: 0.05,
            emission: 0.1,
            alpha: 0.1,
        };
        let fast_rates = LearningRates {
            position: 3e-4,
            scale: 2e-2,
            rotation: 1e-2,
            opacity: 5e-2,
            radiance: 3e-2,
            emission: 5e-2,
            final_share: 0.03,
        };
        let (iterations, per_point, rates) = match preset {
            Preset::Draft => (800, 1.0, fast_rates),
            Preset::Fast => (7000, 2.5, fast_rates),
            // The paper's rates; its position rate of 1.6e-5 units belongs to rooms of some five units' extent.
            Preset::Paper => (
                30_000,
                1.0,
                LearningRates {
                    position: 3.2e-6,
                    scale: 5e-3,
                    rotation: 1e-3,
                    opacity: 5e-2,
                    radiance: 1e-2,
                    emission: 5e-2,
                    final_share: 1.0,
                },
            ),
        };
        let albedo = |iterations, num_samples, resample, final_share| AlbedoOptions {
            iterations,
            num_start_samples: if resample { 0 } else { 32 },
            num_samples,
            resample,
            rate: if resample { 5e-2 } else { 2e-2 },
            final_share,
            emission_threshold: eagpt_trace::transport::EMISSION_THRESHOLD,
        };
        Self {
            preset,
            stage: StageChoice::All,
            seed: 0,
            split: SplitRule::Every8th,
            num_gaussians: None,
            init: InitOptions {
                per_point,
                scale_factor: 0.9,
                opacity: 0.5,
                emission: 0.1,
                albedo: 0.2,
            },
            radiance: RadianceOptions {
                iterations,
                normals_from: 0.1,
                rates,
                weights,
            },
            albedo: match preset {
                Preset::Draft => albedo(150, 4, false, 0.1),
                Preset::Fast => albedo(336, 12, false, 0.1),
                Preset::Paper => albedo(400, 256, true, 1.0),
            },
            output: OutputOptions {
                checkpoint_every: if preset == Preset::Draft { 200 } else { 500 },
                keep_checkpoints: 2,
                preview_every: if preset == Preset::Draft { 200 } else { 500 },
                num_previews: 3,
                log_every: 10,
            },
        }
    }

    /// Number of Gaussians to train for a cloud of `num_points` points.
    pub fn gaussians_for(&self, num_points: usize) -> usize {
        self.num_gaussians
            .unwrap_or((num_points as f64 * f64::from(self.init.per_point)).round() as usize)
    }

    /// The preset with TOML tables put on top, later ones winning.
    ///
    /// # Errors
    /// [`TrainError::Option`] for an unknown key, a value of the wrong type, or a value out of its range.
    pub fn from_layers(preset: Preset, layers: &[toml::Table]) -> Result<Self> {
        let describe = |problem: String| TrainError::Option {
            field: "(file)".to_owned(),
            problem,
        };
        let mut merged =
            toml::Table::try_from(Self::preset(preset)).map_err(|e| describe(e.to_string()))?;
        for layer in layers {
            merge(&mut merged, layer, "")?;
        }
        let options: Self = merged.try_into().map_err(|e: toml::de::Error| {
            // The text has a second line, which names the key.
            describe(e.to_string().trim().replace('\n', " "))
        })?;
        options.validate()?;
        Ok(options)
    }

    /// Checks every value's range.
    ///
    /// # Errors
    /// [`TrainError::Option`] with the field, the value and the range.
    pub fn validate(&self) -> Result<()> {
        let check = |holds: bool, field: &str, problem: String| {
            if holds {
                Ok(())
            } else {
                Err(TrainError::Option {
                    field: field.to_owned(),
                    problem,
                })
            }
        };
        let positive = |field: &str, value: f64| {
            check(
                value > 0.0 && value.is_finite(),
                field,
                format!("{value} is not a positive number"),
            )
        };
        let share = |field: &str, value: f64| {
            check(
                (0.0..=1.0).contains(&value),
                field,
                format!("{value} is outside 0 to 1"),
            )
        };
        let inside = |field: &str, value: f32| {
            check(
                value > 0.0 && value < 1.0,
                field,
                format!("{value} is not strictly between 0 and 1"),
            )
        };
        let at_least_one =
            |field: &str, value: u64| check(value > 0, field, "0 is too few".to_owned());
        positive("init.per_point", self.init.per_point.into())?;
        positive("init.scale_factor", self.init.scale_factor.into())?;
        inside("init.opacity", self.init.opacity)?;
        inside("init.emission", self.init.emission)?;
        inside("init.albedo", self.init.albedo)?;
        at_least_one("num_gaussians", self.num_gaussians.unwrap_or(1) as u64)?;
        at_least_one("radiance.iterations", self.radiance.iterations.into())?;
        share("radiance.normals_from", self.radiance.normals_from.into())?;
        let rates = &self.radiance.rates;
        for (field, value) in [
            ("position", rates.position),
            ("scale", rates.scale),
            ("rotation", rates.rotation),
            ("opacity", rates.opacity),
            ("radiance", rates.radiance),
            ("emission", rates.emission),
            ("final_share", rates.final_share),
        ] {
            positive(&format!("radiance.rates.{field}"), value.into())?;
        }
        let weights = &self.radiance.weights;
        share("radiance.weights.ssim_share", weights.ssim_share)?;
        for (field, value) in [
            ("color", weights.color),
            ("normal", weights.normal),
            ("depth_normal", weights.depth_normal),
            ("emission", weights.emission),
            ("alpha", weights.alpha),
        ] {
            check(
                value >= 0.0 && value.is_finite(),
                &format!("radiance.weights.{field}"),
                format!("{value} is negative or not a number"),
            )?;
        }
        at_least_one("albedo.iterations", self.albedo.iterations.into())?;
        at_least_one("albedo.num_samples", self.albedo.num_samples.into())?;
        positive("albedo.rate", self.albedo.rate.into())?;
        positive("albedo.final_share", self.albedo.final_share.into())?;
        share(
            "albedo.emission_threshold",
            self.albedo.emission_threshold.into(),
        )?;
        at_least_one(
            "output.checkpoint_every",
            self.output.checkpoint_every.into(),
        )?;
        at_least_one(
            "output.keep_checkpoints",
            self.output.keep_checkpoints as u64,
        )?;
        at_least_one("output.log_every", self.output.log_every.into())
    }
}

/// Puts `layer` on top of `base`; a key that `base` does not know is an error, but for optional ones.
fn merge(base: &mut toml::Table, layer: &toml::Table, path: &str) -> Result<()> {
    /// Keys that a preset leaves out.
    const OPTIONAL: [&str; 1] = ["num_gaussians"];
    for (key, value) in layer {
        let field = if path.is_empty() {
            key.clone()
        } else {
            format!("{path}.{key}")
        };
        match (base.get_mut(key), value) {
            (Some(toml::Value::Table(inner)), toml::Value::Table(over)) => {
                merge(inner, over, &field)?;
            }
            (Some(toml::Value::Float(old)), toml::Value::Integer(new)) => *old = *new as f64,
            (Some(old), new) if old.same_type(new) => *old = new.clone(),
            (Some(old), new) => {
                let problem = format!(
                    "{new} is of type {}, not {}",
                    new.type_str(),
                    old.type_str()
                );
                return Err(TrainError::Option { field, problem });
            }
            (None, new) if OPTIONAL.contains(&field.as_str()) => {
                base.insert(key.clone(), new.clone());
            }
            (None, _) => {
                let known: Vec<&str> = base.keys().map(String::as_str).collect();
                let problem = format!("no such option; here there are {}", known.join(", "));
                return Err(TrainError::Option { field, problem });
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn layered(text: &str) -> Result<TrainOptions> {
        TrainOptions::from_layers(Preset::Fast, &[text.parse().unwrap()])
    }

    #[test]
    fn presets_are_valid_and_survive_toml() {
        for preset in [Preset::Draft, Preset::Fast, Preset::Paper] {
            let options = TrainOptions::preset(preset);
            options.validate().unwrap();
            let text = toml::to_string(&options).unwrap();
            // Floats are f32 inside and f64 in the file; the text still reads back to the same bits.
            assert_eq!(
                TrainOptions::from_layers(preset, &[text.parse().unwrap()]).unwrap(),
                options
            );
        }
    }

    #[test]
    fn a_layer_changes_what_it_names_and_nothing_else() {
        let options =
            layered("num_gaussians = 5\n[radiance]\niterations = 7\nrates.scale = 1").unwrap();
        let mut expected = TrainOptions::preset(Preset::Fast);
        expected.num_gaussians = Some(5);
        expected.radiance.iterations = 7;
        expected.radiance.rates.scale = 1.0;
        assert_eq!(options, expected);
    }

    #[test]
    fn bad_settings_name_field_and_value() {
        for (text, field, value) in [
            ("sed = 1", "sed", "no such option"),
            (
                "[radiance]\nrates.positon = 1.0",
                "radiance.rates.positon",
                "position",
            ),
            ("seed = \"x\"", "seed", "string"),
            ("[init]\nopacity = 1.5", "init.opacity", "1.5"),
            ("[radiance]\niterations = 0", "radiance.iterations", "0"),
            (
                "[radiance]\nrates.scale = nan",
                "radiance.rates.scale",
                "NaN",
            ),
            ("num_gaussians = 0", "num_gaussians", "0"),
        ] {
            let message = layered(text).unwrap_err().to_string();
            assert!(
                message.contains(field) && message.contains(value),
                "{text}: {message}"
            );
        }
    }
}
