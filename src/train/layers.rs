//! Layers of options: preset, file, flags, single settings. An error says which layer it came from.

use super::TrainArgs;
use anyhow::{Context, Result, anyhow};
use eagpt_train::{Preset, TrainOptions};
use serde::Serialize;
use std::path::Path;
use toml::{Table, Value};

/// Name of the options file that a run leaves in its folder.
const RUN_OPTIONS: &str = "train.toml";

/// The effective options.
pub(crate) fn options(args: &TrainArgs) -> Result<TrainOptions> {
    let mut names = Vec::new();
    let mut layers = Vec::new();
    let from_run = args
        .out
        .as_ref()
        .map(|out| out.join(RUN_OPTIONS))
        .filter(|path| {
            args.resume && args.preset.is_none() && args.config.is_none() && path.is_file()
        });
    if let Some(path) = args.config.as_ref().or(from_run.as_ref()) {
        layers.push(read(path)?);
        names.push(path.display().to_string());
    }
    layers.push(flags(args)?);
    names.push("command line".to_owned());
    for setting in &args.set {
        layers.push(setting_table(setting)?);
        names.push(format!("--set {setting}"));
    }
    let preset = preset(args, layers.first(), &names[0])?;
    let mut options = TrainOptions::preset(preset);
    for end in 1..=layers.len() {
        options = TrainOptions::from_layers(preset, &layers[..end])
            .with_context(|| names[end - 1].clone())?;
    }
    Ok(options)
}

/// The preset that everything starts from: the flag's, else the file's.
fn preset(args: &TrainArgs, file: Option<&Table>, name: &str) -> Result<Preset> {
    if let Some(preset) = args.preset {
        return Ok(preset);
    }
    match file.and_then(|table| table.get("preset")) {
        None => Ok(Preset::Fast),
        Some(value) => value.clone().try_into().map_err(|e: toml::de::Error| {
            anyhow!("{name}: option preset: {value}: {}", e.message())
        }),
    }
}

fn read(path: &Path) -> Result<Table> {
    let bytes = eagpt_scene::files::read(path)?;
    let text =
        String::from_utf8(bytes).map_err(|e| anyhow!("{}: {}", path.display(), e.utf8_error()))?;
    text.parse::<Table>().map_err(|error| {
        let offset = error.span().map_or(0, |span| span.start);
        let line = 1 + text.bytes().take(offset).filter(|b| *b == b'\n').count();
        anyhow!("{}: line {line}: {}", path.display(), error.message())
    })
}

fn flags(args: &TrainArgs) -> Result<Table> {
    let mut table = Table::new();
    let mut put = |key: &str, value: Option<Value>| {
        if let Some(value) = value {
            insert(&mut table, key, value);
        }
    };
    put("preset", args.preset.map(value).transpose()?);
    put("stage", args.stage.map(value).transpose()?);
    put("split", args.split.map(value).transpose()?);
    put("seed", args.seed.map(value).transpose()?);
    put("num_gaussians", args.gaussians.map(value).transpose()?);
    put(
        "radiance.iterations",
        args.iterations.map(value).transpose()?,
    );
    put(
        "albedo.iterations",
        args.albedo_iterations.map(value).transpose()?,
    );
    Ok(table)
}

fn value(value: impl Serialize) -> Result<Value> {
    Ok(Value::try_from(value)?)
}

/// The table of one `key=value`. A value that is no TOML is a string: quotes rarely survive a
/// shell.
fn setting_table(setting: &str) -> Result<Table> {
    let (key, text) = setting
        .split_once('=')
        .ok_or_else(|| anyhow!("--set {setting}: not of the form KEY=VALUE"))?;
    let (key, text) = (key.trim(), text.trim());
    if key.split('.').any(str::is_empty) {
        return Err(anyhow!(
            "--set {setting}: `{key}` is not the name of an option"
        ));
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
    use crate::terminal::one_line;
    use clap::Parser;

    #[derive(Debug, Parser)]
    struct Alone {
        #[command(flatten)]
        train: TrainArgs,
    }

    fn layered(arguments: &[&str]) -> Result<TrainOptions> {
        let all = ["train", "data", "--out", "no-such-run"]
            .into_iter()
            .chain(arguments.iter().copied());
        options(&Alone::try_parse_from(all).unwrap().train)
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
        let file = file.to_str().unwrap();
        let options = layered(&["--config", file, "--seed", "2"]).unwrap();
        assert_eq!(options.preset, Preset::Draft);
        assert_eq!((options.seed, options.radiance.iterations), (2, 5));
        assert_eq!(options.albedo.iterations, 150);
        let set = [
            "--config",
            file,
            "--iterations",
            "6",
            "--set",
            "radiance.iterations=7",
        ];
        assert_eq!(layered(&set).unwrap().radiance.iterations, 7);
        let split = layered(&["--set", "split=listed"]).unwrap().split;
        assert_eq!(split.to_string(), "listed");
        let preset = layered(&["--config", file, "--preset", "paper"]).unwrap();
        assert_eq!(preset.preset, Preset::Paper);
        assert_eq!(preset.albedo.num_samples, 256);
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
            let message = one_line(&layered(&["--config", &path]).unwrap_err());
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
            let message = one_line(&layered(&["--set", setting]).unwrap_err());
            assert!(
                message.starts_with(&format!("--set {setting}: ")),
                "{message}"
            );
            assert!(message.contains(part), "no `{part}` in: {message}");
        }
    }
}
