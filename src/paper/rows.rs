//! The rows of the tables: what each changes in a project.

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
    /// The scene that it renders; rows of one scene share its training.
    pub(super) scene: Scene,
    /// How it renders it.
    pub(super) mode: Mode,
    /// Options of `eagpt render` that it sets.
    render: &'static [(&'static str, i64)],
}

/// How a scene is shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Mode {
    /// By `eagpt render` in this mode.
    Render(&'static str),
    /// With its light baked, after an edit.
    Baked,
}

/// How a scene is trained.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Scene {
    /// As the project says.
    Full,
    /// Without the normal maps.
    NoNormalSupervision,
    /// Without the agreement of normals and depths.
    NoNormalConsistency,
    /// With masks that reach beyond the lights.
    InaccurateMasks,
    /// With 200,000 Gaussians for 500,000.
    FewerGaussians,
}

/// Pixels by which masks are too large.
const MASK_ERROR: i64 = 4;
/// Share of the Gaussians that is left, that of the paper.
const FEWER: f64 = 0.4;

const PATH: Mode = Mode::Render("path");

const fn row(
    name: &'static str,
    title: &'static str,
    scene: Scene,
    mode: Mode,
    render: &'static [(&'static str, i64)],
) -> Row {
    Row {
        name,
        title,
        scene,
        mode,
        render,
    }
}

/// All rows: Tables 1 and 2, then the ablations of Table 3.
pub(super) const ROWS: [Row; 14] = [
    row(
        "0-bounce",
        "the radiance of the Gaussians",
        Scene::Full,
        Mode::Render("0-bounce"),
        &[],
    ),
    row(
        "1-bounce",
        "one bounce into that radiance",
        Scene::Full,
        Mode::Render("1-bounce"),
        &[],
    ),
    row(
        "path",
        "path tracing from the emitters",
        Scene::Full,
        PATH,
        &[],
    ),
    row(
        "baked",
        "light baked after the edit",
        Scene::Full,
        Mode::Baked,
        &[],
    ),
    row(
        "no-normal-supervision",
        "trained without normal maps, path",
        Scene::NoNormalSupervision,
        PATH,
        &[],
    ),
    row(
        "no-normal-consistency",
        "trained without agreement of normals and depths, path",
        Scene::NoNormalConsistency,
        PATH,
        &[],
    ),
    row(
        "inaccurate-masks",
        "emission masks from a threshold, 4 pixels too large all around, path",
        Scene::InaccurateMasks,
        PATH,
        &[],
    ),
    row(
        "fewer-gaussians",
        "two fifths of the Gaussians, path",
        Scene::FewerGaussians,
        PATH,
        &[],
    ),
    row(
        "bounces-3",
        "path, at most 3 bounces",
        Scene::Full,
        PATH,
        &[("bounces", 3)],
    ),
    row(
        "bounces-7",
        "path, at most 7 bounces",
        Scene::Full,
        PATH,
        &[("bounces", 7)],
    ),
    row(
        "bounces-11",
        "path, at most 11 bounces",
        Scene::Full,
        PATH,
        &[("bounces", 11)],
    ),
    row(
        "spp-256",
        "path, 256 samples a pixel",
        Scene::Full,
        PATH,
        &[("spp", 256)],
    ),
    row(
        "spp-1024",
        "path, 1,024 samples a pixel",
        Scene::Full,
        PATH,
        &[("spp", 1024)],
    ),
    row(
        "spp-4096",
        "path, 4,096 samples a pixel",
        Scene::Full,
        PATH,
        &[("spp", 4096)],
    ),
];

impl Scene {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Full => "full",
            Self::NoNormalSupervision => "no-normal-supervision",
            Self::NoNormalConsistency => "no-normal-consistency",
            Self::InaccurateMasks => "inaccurate-masks",
            Self::FewerGaussians => "fewer-gaussians",
        }
    }

    /// The project that trains it.
    ///
    /// # Errors
    /// If the project leaves open how many Gaussians there are, and there should be fewer.
    pub(super) fn project(self, base: &ProjectFile) -> Result<ProjectFile> {
        let mut project = base.clone();
        match self {
            Self::Full => {}
            Self::NoNormalSupervision => set(&mut project, "radiance.weights.normal=0"),
            Self::NoNormalConsistency => set(&mut project, "radiance.weights.depth_normal=0"),
            Self::InaccurateMasks => {
                let masks = project.masks.get_or_insert_default();
                masks.insert("grow".to_owned(), MASK_ERROR.into());
            }
            Self::FewerGaussians => fewer_gaussians(&mut project)?,
        }
        Ok(project)
    }
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
        let modes = match self.mode {
            Mode::Render(mode) => vec![Value::from(mode)],
            Mode::Baked => Vec::new(),
        };
        render.insert("modes".to_owned(), modes.into());
        match self.mode {
            Mode::Render(mode) => {
                let options = self.render.iter();
                let options = options.map(|(key, value)| ((*key).to_owned(), (*value).into()));
                let special = render.entry(mode).or_insert_with(|| Section::new().into());
                if let Value::Table(special) = special {
                    special.extend(options);
                }
                project.bake = None;
            }
            Mode::Baked => {
                project.bake.get_or_insert_default();
            }
        }
        project
    }

    /// Whether it has anything to show of a condition, which is another light or not.
    pub(super) fn shows(&self, is_changed: bool) -> bool {
        is_changed || self.mode != Mode::Baked
    }

    /// Name of its folder below that of a condition.
    pub(super) fn folder(&self) -> &'static str {
        match self.mode {
            Mode::Render(mode) => mode,
            Mode::Baked => "baked",
        }
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
        let trained = Scene::NoNormalConsistency.project(&base).unwrap();
        let train = trained.train.unwrap();
        assert_eq!(
            train["set"][1].as_str(),
            Some("radiance.weights.depth_normal=0")
        );
    }

    #[test]
    fn fewer_gaussians_are_two_fifths() {
        let fewer = |text: &str| Scene::FewerGaussians.project(&base(text));
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
