//! Options from layers of TOML, and the ranges of their values.

use super::{Preset, TrainOptions};
use crate::error::{Result, TrainError};
use eagpt_scene::harmonics::MAX_DEGREE;

impl TrainOptions {
    /// The preset with TOML tables put on top, later ones winning.
    ///
    /// # Errors
    /// [`TrainError::Option`] for an unknown key, a value of the wrong type, or a value out of its
    /// range.
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
        let not_negative = |field: &str, value: f64| {
            check(
                value >= 0.0 && value.is_finite(),
                field,
                format!("{value} is negative or not a number"),
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
        share(
            "radiance.antialias_from",
            self.radiance.antialias_from.into(),
        )?;
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
        let harmonics = &self.radiance.harmonics;
        check(
            harmonics.degree <= MAX_DEGREE,
            "radiance.harmonics.degree",
            format!("{} is above {MAX_DEGREE}", harmonics.degree),
        )?;
        share("radiance.harmonics.from", harmonics.from.into())?;
        positive("radiance.harmonics.rate", harmonics.rate.into())?;
        not_negative("radiance.harmonics.decay", harmonics.decay.into())?;
        let weights = &self.radiance.weights;
        share("radiance.weights.ssim_share", weights.ssim_share)?;
        for (field, value) in [
            ("color", weights.color),
            ("normal", weights.normal),
            ("depth_normal", weights.depth_normal),
            ("emission", weights.emission),
            ("alpha", weights.alpha),
            ("depth", weights.depth),
        ] {
            not_negative(&format!("radiance.weights.{field}"), value)?;
        }
        let lamps = &self.radiance.lamps;
        share("radiance.lamps.bare_after", lamps.bare_after.into())?;
        share("radiance.lamps.after", lamps.after.into())?;
        let densify = &self.radiance.densify;
        share("radiance.densify.from", densify.from.into())?;
        share("radiance.densify.until", densify.until.into())?;
        check(
            densify.from <= densify.until,
            "radiance.densify.until",
            format!("{} lies before from = {}", densify.until, densify.from),
        )?;
        positive("radiance.densify.start_share", densify.start_share.into())?;
        share("radiance.densify.start_share", densify.start_share.into())?;
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

/// Puts `layer` on top of `base`; a key that `base` does not know is an error, but for optional
/// ones.
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
            // Floats are f32 inside and f64 in the file; the text still reads back to the same
            // bits.
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
            (
                "[radiance]\ndensify.start_share = 0",
                "radiance.densify.start_share",
                "0",
            ),
        ] {
            let message = layered(text).unwrap_err().to_string();
            assert!(
                message.contains(field) && message.contains(value),
                "{text}: {message}"
            );
        }
    }
}
