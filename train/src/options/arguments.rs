//! Options as people give them: a preset, a file, arguments, single settings.

use super::{Preset, StageChoice, TrainOptions};
use crate::error::{Result, TrainError};
use eagpt_scene::dataset::SplitRule;
use eagpt_scene::files;
use serde::Serialize;
use std::path::{Path, PathBuf};
use toml::{Table, Value};

/// Layers of options, later ones winning: the preset, the file, the other fields, the settings.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
pub struct OptionArgs {
    /// Stages to run; `albedo` continues from the end of stage 0 in RUN [default: all]
    #[cfg_attr(feature = "clap", arg(long, value_enum))]
    pub stage: Option<StageChoice>,
    /// Defaults to start from [default: that of the --config file, else fast]
    #[cfg_attr(feature = "clap", arg(long, value_enum))]
    pub preset: Option<Preset>,
    /// Iterations of stage 0, one view each [default: 800 draft, 5000 fast, 30000 paper]
    #[cfg_attr(feature = "clap", arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..)))]
    pub iterations: Option<u32>,
    /// Iterations of stage 1, one view each, for each light [default: 150 draft, 336 fast, 400
    /// paper]
    #[cfg_attr(feature = "clap", arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..)))]
    pub albedo_iterations: Option<u32>,
    /// Number of Gaussians, at least 1 [default: init.per_point for each point of the cloud: 1
    /// (draft, paper), 2 (fast)]
    #[cfg_attr(feature = "clap", arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=i64::MAX as u64)))]
    pub gaussians: Option<u64>,
    /// Seed of all random numbers, 0 to 2^63 − 1 [default: 0]
    #[cfg_attr(feature = "clap", arg(long, value_name = "S", value_parser = clap::value_parser!(u64).range(..=i64::MAX as u64)))]
    pub seed: Option<u64>,
    /// Which views train and which test [default: every-8th]
    #[cfg_attr(feature = "clap", arg(long, value_name = "RULE", value_enum))]
    pub split: Option<SplitRule>,
    /// TOML file of options, all or some, as --dump-config prints them
    #[cfg_attr(feature = "clap", arg(long, value_name = "FILE.toml"))]
    pub config: Option<PathBuf>,
    /// Set one option, named as in the TOML file; may be repeated
    #[cfg_attr(feature = "clap", arg(long, value_name = "KEY=VALUE"))]
    pub set: Vec<String>,
}

impl OptionArgs {
    /// The effective options. `earlier` is the file of a run that is resumed, for lack of a preset
    /// and a file.
    ///
    /// # Errors
    /// [`TrainError::Layer`] with the layer, the option and the value, or a file that cannot be
    /// read.
    pub fn resolve(&self, earlier: Option<&Path>) -> Result<TrainOptions> {
        let earlier = earlier.filter(|_| self.preset.is_none());
        let mut layers = Vec::new();
        if let Some(path) = self.config.as_deref().or(earlier) {
            layers.push((path.display().to_string(), read(path)?));
        }
        layers.push(("command line".to_owned(), self.table()?));
        for setting in &self.set {
            let layer = format!("--set {setting}");
            let table = setting_table(setting).map_err(|problem| error(&layer, problem))?;
            layers.push((layer, table));
        }
        let (name, first) = &layers[0];
        let preset = match (self.preset, first.get("preset")) {
            (Some(preset), _) => preset,
            (None, None) => Preset::Fast,
            (None, Some(value)) => value.clone().try_into().map_err(|e: toml::de::Error| {
                error(name, format!("option preset: {value}: {}", e.message()))
            })?,
        };
        let (names, tables): (Vec<_>, Vec<_>) = layers.into_iter().unzip();
        let mut options = TrainOptions::preset(preset);
        for (end, name) in (1..).zip(&names) {
            options = TrainOptions::from_layers(preset, &tables[..end])
                .map_err(|problem| error(name, problem.to_string()))?;
        }
        Ok(options)
    }

    /// The fields that are given, under their names in a file.
    fn table(&self) -> Result<Table> {
        let mut table = Table::new();
        put(&mut table, "preset", self.preset)?;
        put(&mut table, "stage", self.stage)?;
        put(&mut table, "split", self.split)?;
        put(&mut table, "seed", self.seed)?;
        put(&mut table, "num_gaussians", self.gaussians)?;
        put(&mut table, "radiance.iterations", self.iterations)?;
        put(&mut table, "albedo.iterations", self.albedo_iterations)?;
        Ok(table)
    }
}

fn error(layer: &str, problem: String) -> TrainError {
    TrainError::Layer {
        layer: layer.to_owned(),
        problem,
    }
}

fn put(table: &mut Table, key: &str, value: Option<impl Serialize>) -> Result<()> {
    if let Some(value) = value {
        let value = Value::try_from(value).map_err(|e| error(key, e.to_string()))?;
        insert(table, key, value);
    }
    Ok(())
}

fn read(path: &Path) -> Result<Table> {
    let layer = path.display().to_string();
    let text = String::from_utf8(files::read(path)?)
        .map_err(|e| error(&layer, e.utf8_error().to_string()))?;
    text.parse::<Table>().map_err(|e| {
        let offset = e.span().map_or(0, |span| span.start);
        let line = 1 + text.bytes().take(offset).filter(|b| *b == b'\n').count();
        error(&layer, format!("line {line}: {}", e.message()))
    })
}

/// The table of one `key=value`. A value that is no TOML is a string: quotes rarely survive a
/// shell.
fn setting_table(setting: &str) -> Result<Table, String> {
    let (key, text) = setting
        .split_once('=')
        .ok_or_else(|| "not of the form KEY=VALUE".to_owned())?;
    let (key, text) = (key.trim(), text.trim());
    if key.split('.').any(str::is_empty) {
        return Err(format!("`{key}` is not the name of an option"));
    }
    let parsed = format!("value = {text}").parse::<Table>().ok();
    let parsed = parsed.filter(|table| table.len() == 1);
    let value = parsed
        .and_then(|mut table| table.remove("value"))
        .unwrap_or_else(|| Value::String(text.to_owned()));
    let mut table = Table::new();
    insert(&mut table, key, value);
    Ok(table)
}

/// Puts `value` at a dotted `key`, with the tables on the way.
fn insert(table: &mut Table, key: &str, value: Value) {
    match key.split_once('.') {
        None => {
            table.insert(key.to_owned(), value);
        }
        Some((first, rest)) => {
            let inner = table
                .entry(first)
                .or_insert_with(|| Value::Table(Table::new()));
            if let Value::Table(inner) = inner {
                insert(inner, rest, value);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn resolved(file: Option<&str>, set: &[&str]) -> Result<TrainOptions> {
        let args = OptionArgs {
            config: file.map(PathBuf::from),
            set: set.iter().map(|&setting| setting.to_owned()).collect(),
            ..OptionArgs::default()
        };
        args.resolve(None)
    }

    #[test]
    fn later_layers_win() {
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("a.toml");
        std::fs::write(
            &file,
            "preset = \"draft\"\nseed = 1\n[radiance]\niterations = 5",
        )
        .unwrap();
        let base = OptionArgs {
            config: Some(file.clone()),
            ..OptionArgs::default()
        };
        let with = |change: &dyn Fn(&mut OptionArgs)| {
            let mut args = base.clone();
            change(&mut args);
            args.resolve(None).unwrap()
        };
        let options = with(&|args| args.seed = Some(2));
        assert_eq!(options.preset, Preset::Draft);
        assert_eq!((options.seed, options.radiance.iterations), (2, 5));
        assert_eq!(options.albedo.iterations, 150);
        let options = with(&|args| {
            args.iterations = Some(6);
            args.set = vec!["radiance.iterations=7".to_owned()];
        });
        assert_eq!(options.radiance.iterations, 7);
        let split = resolved(None, &["split=listed"]).unwrap().split;
        assert_eq!(split.to_string(), "listed");
        let preset = with(&|args| args.preset = Some(Preset::Paper));
        assert_eq!(preset.preset, Preset::Paper);
        assert_eq!(preset.albedo.num_samples, 256);
        // The file of a run that is resumed counts unless a preset or a file is given.
        let earlier = |args: OptionArgs| args.resolve(Some(&file)).unwrap().seed;
        assert_eq!(earlier(OptionArgs::default()), 1);
        let preset = OptionArgs {
            preset: Some(Preset::Fast),
            ..OptionArgs::default()
        };
        assert_eq!(earlier(preset), 0);
    }

    #[test]
    fn errors_name_the_layer_the_option_and_the_value() {
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("a.toml");
        let path = file.to_str().unwrap().to_owned();
        for (text, parts) in [
            ("sed = 1", ["option sed", "no such option"]),
            ("seed = 1\nseed = 2", ["line 2", "duplicate key"]),
            ("[init]\nopacity = 2.0", ["option init.opacity", "2"]),
            ("preset = \"quick\"", ["option preset", "quick"]),
            ("stage = \"both\"", ["stage", "both"]),
            ("seed = -4", ["seed", "-4"]),
        ] {
            std::fs::write(&file, text).unwrap();
            let message = resolved(Some(&path), &[]).unwrap_err().to_string();
            assert!(message.starts_with(&path), "{message}");
            for part in parts {
                assert!(message.contains(part), "no `{part}` in: {message}");
            }
        }
        for (setting, part) in [
            ("seed", "KEY=VALUE"),
            ("radiance..x=1", "not the name"),
            ("seed=x", "string"),
            ("radiance.rates.sale=1", "radiance.rates.sale"),
        ] {
            let message = resolved(None, &[setting]).unwrap_err().to_string();
            assert!(
                message.starts_with(&format!("--set {setting}: ")),
                "{message}"
            );
            assert!(message.contains(part), "no `{part}` in: {message}");
        }
    }
}
