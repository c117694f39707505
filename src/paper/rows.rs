//! The rows of the tables: what each changes in a project, which follows from its name.

use crate::run::{Part, ProjectFile, Section, part};
use anyhow::{Result, bail};
use eagpt_train::{Preset, TrainOptions};
use std::path::Path;
use toml::Value;

/// A row.
#[derive(Debug)]
pub(super) struct Row {
    pub(super) name: &'static str,
    /// Description, for the notes below a table.
    pub(super) title: &'static str,
}

/// The mode of a scene with its light baked, after an edit; others are those of `eagpt render`.
const BAKED: &str = "baked";
/// The scene as the project trains it.
const FULL: &str = "full";
const NO_NORMAL_SUPERVISION: &str = "no-normal-supervision";
const NO_NORMAL_CONSISTENCY: &str = "no-normal-consistency";
const INACCURATE_MASKS: &str = "inaccurate-masks";
const FEWER_GAUSSIANS: &str = "fewer-gaussians";

/// Pixels by which masks are too large.
const MASK_ERROR: i64 = 4;
/// Share of the Gaussians that is left, that of the paper: 200,000 of 500,000.
const FEWER: f64 = 0.4;

const fn row(name: &'static str, title: &'static str) -> Row {
    Row { name, title }
}

/// All rows: Tables 1 and 2, then the ablations of Table 3.
pub(super) const ROWS: [Row; 14] = [
    row("0-bounce", "the radiance of the Gaussians"),
    row("1-bounce", "one bounce into that radiance"),
    row("path", "path tracing from the emitters"),
    row(BAKED, "light baked after the edit"),
    row(NO_NORMAL_SUPERVISION, "trained without normal maps, path"),
    row(
        NO_NORMAL_CONSISTENCY,
        "trained without agreement of normals and depths, path",
    ),
    row(
        INACCURATE_MASKS,
        "emission masks from a threshold, 4 pixels too large all around, path",
    ),
    row(FEWER_GAUSSIANS, "two fifths of the Gaussians, path"),
    row("bounces-3", "path, at most 3 bounces"),
    row("bounces-7", "path, at most 7 bounces"),
    row("bounces-11", "path, at most 11 bounces"),
    row("spp-256", "path, 256 samples a pixel"),
    row("spp-1024", "path, 1,024 samples a pixel"),
    row("spp-4096", "path, 4,096 samples a pixel"),
];

/// The project that trains a scene, by its name.
///
/// # Errors
/// If the project leaves open how many Gaussians there are, and there should be fewer.
pub(super) fn training(scene: &str, base: &ProjectFile) -> Result<ProjectFile> {
    let mut project = base.clone();
    match scene {
        NO_NORMAL_SUPERVISION => set(&mut project, "radiance.weights.normal=0"),
        NO_NORMAL_CONSISTENCY => set(&mut project, "radiance.weights.depth_normal=0"),
        INACCURATE_MASKS => {
            let masks = project.masks.get_or_insert_default();
            masks.insert("grow".to_owned(), MASK_ERROR.into());
        }
        FEWER_GAUSSIANS => fewer_gaussians(&mut project)?,
        _ => {}
    }
    Ok(project)
}

fn fewer_gaussians(project: &mut ProjectFile) -> Result<()> {
    let train = project.train.get_or_insert_default();
    if let Some(num) = train.get("gaussians").and_then(Value::as_integer) {
        let fewer = (num as f64 * FEWER).round().max(1.0) as i64;
        train.insert("gaussians".to_owned(), fewer.into());
        return Ok(());
    }
    let is_open = |value: &Value| value.to_string().contains("num_gaussians");
    if train.contains_key("config") || train.get("set").is_some_and(is_open) {
        bail!("row fewer-gaussians: say in [train] how many `gaussians` there are");
    }
    let preset = match train.get("preset").and_then(Value::as_str) {
        Some("draft") => Preset::Draft,
        Some("paper") => Preset::Paper,
        _ => Preset::Fast,
    };
    let per_point = f64::from(TrainOptions::preset(preset).init.per_point) * FEWER;
    set(project, &format!("init.per_point={per_point}"));
    Ok(())
}

/// Adds a `--set` of training.
fn set(project: &mut ProjectFile, setting: &str) {
    let train = project.train.get_or_insert_default();
    let mut all = match train.remove("set") {
        Some(Value::Array(all)) => all,
        Some(one) => vec![one],
        None => Vec::new(),
    };
    all.push(setting.into());
    train.insert("set".to_owned(), all.into());
}

impl Row {
    /// Name of the scene that it renders; rows of one scene share its training.
    pub(super) fn scene(&self) -> &'static str {
        match self.name {
            NO_NORMAL_SUPERVISION | NO_NORMAL_CONSISTENCY | INACCURATE_MASKS | FEWER_GAUSSIANS => {
                self.name
            }
            _ => FULL,
        }
    }

    /// How it shows the scene, and the name of its folder below that of a condition.
    pub(super) fn mode(&self) -> &'static str {
        match self.name {
            "0-bounce" | "1-bounce" | BAKED => self.name,
            _ => "path",
        }
    }

    /// The project that renders and measures a trained scene.
    pub(super) fn project(&self, base: &ProjectFile, scene: &Path) -> ProjectFile {
        let mut project = base.clone();
        for (name, section) in project.sections_mut() {
            if part(name) == Part::Training {
                *section = None;
            }
        }
        project.scene = Some(scene.to_owned());
        let render = project.render.get_or_insert_default();
        if self.shows(false) {
            let mode = self.mode();
            render.insert("modes".to_owned(), vec![mode].into());
            let special = render.entry(mode).or_insert_with(|| Section::new().into());
            let option = self.name.rsplit_once('-');
            if let (Value::Table(special), Some((key @ ("bounces" | "spp"), num))) =
                (special, option)
            {
                let num: i64 = num.parse().expect("names of rows end in their number");
                special.insert(key.to_owned(), num.into());
            }
            project.bake = None;
        } else {
            render.insert("modes".to_owned(), Vec::<Value>::new().into());
            project.bake.get_or_insert_default();
        }
        project
    }

    /// Whether it has anything to show of a condition, which is another light or not: nothing is
    /// baked unless the light changes.
    pub(super) fn shows(&self, is_changed: bool) -> bool {
        is_changed || self.mode() != BAKED
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn base(text: &str) -> ProjectFile {
        toml::from_str(text).unwrap()
    }

    #[test]
    fn rows_change_what_they_are_called_after() {
        let base = base(
            "dataset = \"a\"\n[normals]\nmaps = \"n\"\n[train]\nset = [\"a=1\"]\n[render]\nspp = 4\n[bake]",
        );
        let scene = Path::new("s.ply");
        let row = |name: &str| ROWS.iter().find(|row| row.name == name).unwrap();
        let derived = row("bounces-3").project(&base, scene);
        assert_eq!(derived.scene.as_deref(), Some(scene));
        let render = derived.render.unwrap();
        assert_eq!(render["path"]["bounces"].as_integer(), Some(3));
        assert_eq!(render["spp"].as_integer(), Some(4));
        assert!(derived.train.is_none() && derived.bake.is_none());
        assert!(derived.normals.is_none());
        let derived = row("baked").project(&base, scene);
        let render = derived.render.unwrap();
        assert!(render["modes"].as_array().unwrap().is_empty());
        assert!(derived.bake.is_some());
        let trained = training(NO_NORMAL_CONSISTENCY, &base).unwrap();
        let train = trained.train.unwrap();
        assert_eq!(
            train["set"][1].as_str(),
            Some("radiance.weights.depth_normal=0")
        );
    }

    #[test]
    fn fewer_gaussians_are_two_fifths() {
        let fewer = |text: &str| training(FEWER_GAUSSIANS, &base(text));
        let found = fewer("[train]\ngaussians = 500000").unwrap();
        assert_eq!(
            found.train.unwrap()["gaussians"].as_integer(),
            Some(200_000)
        );
        let found = fewer("[train]\npreset = \"paper\"").unwrap();
        assert_eq!(
            found.train.unwrap()["set"][0].as_str(),
            Some("init.per_point=0.4")
        );
        let open = "[train]\nset = [\"num_gaussians=10\"]";
        assert!(fewer(open).unwrap_err().to_string().contains("[train]"));
    }
}
