//! The projects of all rows.

use super::published::{self, Light, SCENES};
use super::rows::{Mode, Row, Scene, section};
use crate::run::ORIGINAL;
use anyhow::{Context, Result, bail};
use eagpt_eval::tabulate::repeats::RepeatCell;
use eagpt_report::run::RunRecord;
use eagpt_scene::Dataset;
use std::path::{Path, PathBuf};
use toml::{Table, Value};

/// A dataset with the project that rows are derived from.
#[derive(Debug)]
pub(super) struct Base {
    pub(super) name: String,
    /// Folder for its rows and its table, absolute.
    pub(super) out: PathBuf,
    /// Its paths are absolute.
    project: Table,
    /// Other lights that are measured.
    relit: Vec<String>,
}

/// A project that a row or a training is.
#[derive(Debug)]
pub(super) struct Job {
    /// As `kitchen/rows/path/seed-0`.
    pub(super) name: String,
    /// Its file; results go into the folder of this name without its end.
    pub(super) project: PathBuf,
    /// What has to be in it.
    pub(super) text: String,
    /// The last of its steps.
    pub(super) until: Option<&'static str>,
}

/// A trained scene with the rows that show it.
#[derive(Debug)]
pub(super) struct Group {
    pub(super) scene: Job,
    rows: Vec<Job>,
}

impl Group {
    /// All projects, in order.
    pub(super) fn jobs(&self) -> impl Iterator<Item = &Job> {
        std::iter::once(&self.scene).chain(&self.rows)
    }
}

impl Job {
    /// Folder of its results.
    fn out(&self) -> PathBuf {
        self.project.with_extension("")
    }

    /// Whether all of its steps are done, as far as can be told without looking at files.
    ///
    /// # Errors
    /// If its record cannot be read.
    pub(super) fn is_done(&self) -> Result<bool> {
        let last = self.until.unwrap_or("report");
        let record = RunRecord::read(&self.out())?;
        let step = record.as_ref().and_then(|record| record.steps.get(last));
        Ok(step.is_some_and(|step| step.done))
    }
}

/// The project of a dataset that is a folder.
///
/// # Errors
/// If it is no dataset.
pub(super) fn of_folder(
    dataset: &Path,
    config: Option<Table>,
    (preset, spp): (&str, i64),
) -> Result<Table> {
    let mut project = config.unwrap_or_default();
    let path = std::path::absolute(dataset).with_context(|| format!("{}", dataset.display()))?;
    project.insert("dataset".to_owned(), path.display().to_string().into());
    let mut default = |name: &str, key: &str, value: Value| {
        let table = section(&mut project, name);
        table.entry(key).or_insert(value);
    };
    default("train", "preset", preset.into());
    default("render", "spp", spp.into());
    default("render", "denoise", "auto".into());
    let mut frames = Dataset::open(dataset)?.frames().to_vec().into_iter();
    if !project.contains_key("masks") && frames.all(|frame| frame.files.emission.is_none()) {
        section(&mut project, "masks");
    }
    Ok(project)
}

impl Base {
    /// A dataset as a project; `path` is where it is from, for messages.
    ///
    /// # Errors
    /// If it starts at something else than a dataset.
    pub(super) fn new(name: &str, path: &Path, mut project: Table, out: &Path) -> Result<Self> {
        for key in ["capture", "simulate", "scene"] {
            if project.contains_key(key) {
                bail!(
                    "{}: {key}: tables are made of a dataset; `eagpt run` makes one of a capture",
                    path.display()
                );
            }
        }
        project.remove("out");
        // Seeds are those of the rows.
        for (_, value) in &mut project {
            if let Value::Table(table) = value {
                table.remove("seed");
            }
        }
        let relight = project.get("relight").and_then(Value::as_array);
        let relight = relight.into_iter().flatten().filter_map(Value::as_table);
        let measured = relight.filter(|table| table.contains_key("reference"));
        let names = measured.filter_map(|table| table.get("name")?.as_str());
        Ok(Self {
            name: name.to_owned(),
            out: out.to_owned(),
            relit: names.map(str::to_owned).collect(),
            project,
        })
    }

    /// The rows that there are: nothing is baked unless the light changes.
    fn rows<'a>(&self, rows: &[&'a Row]) -> Vec<&'a Row> {
        let is_shown = |row: &&&Row| row.mode != Mode::Baked || !self.relit.is_empty();
        rows.iter().filter(is_shown).copied().collect()
    }

    fn job(&self, kind: &str, name: &str, seed: u32) -> Job {
        let place = format!("{kind}/{name}/seed-{seed}");
        Job {
            name: format!("{}/{place}", self.name),
            project: self.out.join(format!("{place}.toml")),
            text: String::new(),
            until: None,
        }
    }

    /// The trainings and rows of a seed.
    ///
    /// # Errors
    /// If a row cannot be derived from this project.
    pub(super) fn groups(&self, rows: &[&Row], seed: u32) -> Result<Vec<Group>> {
        let mut scenes: Vec<(Scene, Group)> = Vec::new();
        for row in self.rows(rows) {
            let at = match scenes.iter().position(|(scene, _)| *scene == row.scene) {
                Some(at) => at,
                None => {
                    scenes.push((row.scene, self.group(row.scene, seed)?));
                    scenes.len() - 1
                }
            };
            let group = &mut scenes[at].1;
            let scene = group.scene.out().join("train/scene.ply");
            let project = row.project(&self.project, &scene.display().to_string());
            let job = self.job("rows", row.name, seed);
            group.rows.push(Job {
                text: written(project, &format!("Row {}: {}", row.name, row.title), seed)?,
                ..job
            });
        }
        Ok(scenes.into_iter().map(|(_, group)| group).collect())
    }

    fn group(&self, scene: Scene, seed: u32) -> Result<Group> {
        let project = scene
            .project(&self.project)
            .with_context(|| self.name.clone())?;
        let scene = Job {
            text: written(project, &format!("Scene {}", scene.name()), seed)?,
            until: Some("train"),
            ..self.job("scenes", scene.name(), seed)
        };
        let rows = Vec::new();
        Ok(Group { scene, rows })
    }

    /// The cells of the table.
    pub(super) fn cells(&self, rows: &[&Row], seeds: &[u32]) -> Vec<RepeatCell> {
        let lights = std::iter::once((ORIGINAL, None));
        let relit = self.relit.iter().enumerate();
        let lights: Vec<(&str, Option<usize>)> = lights
            .chain(relit.map(|(place, name)| (name.as_str(), Some(place))))
            .collect();
        let mut cells = Vec::new();
        for row in self.rows(rows) {
            for &(condition, place) in lights.iter().filter(|(_, p)| row.shows(p.is_some())) {
                let folders = seeds.iter().map(|seed| {
                    let out = self.job("rows", row.name, *seed).out();
                    out.join("eval").join(condition).join(row.folder())
                });
                // The paper changes the light of a scene once.
                let published = match place {
                    None => published::values(&self.name, Light::Original, row.name),
                    Some(0) => published::values(&self.name, Light::Relit, row.name),
                    Some(_) => Default::default(),
                };
                cells.push(RepeatCell {
                    row: row.name.to_owned(),
                    condition: condition.to_owned(),
                    folders: folders.collect(),
                    published,
                });
            }
        }
        cells
    }

    /// What has to be known of the table.
    pub(super) fn notes(&self, rows: &[&Row], seeds: &[u32]) -> Vec<String> {
        let mut notes = Vec::new();
        let all: Vec<String> = seeds.iter().map(u32::to_string).collect();
        let seeds = all.join(", ");
        if all.len() > 1 {
            notes.push(format!("seeds {seeds}: mean ± standard deviation (n − 1)"));
        } else {
            notes.push(format!("seed {seeds}"));
        }
        if SCENES.contains(&self.name.as_str()) {
            notes.push(format!(
                "paper: EAG-PT (SIGGRAPH 2026, arXiv 2601.23065), Tables 1 to 3, scene {}, on an RTX 4090; its relit scene stands beside the first other light",
                self.name
            ));
        }
        let rows = self.rows(rows);
        notes.extend(
            rows.iter()
                .map(|row| format!("{}: {}", row.name, row.title)),
        );
        notes
    }
}

/// A project as a file.
fn written(mut project: Table, title: &str, seed: u32) -> Result<String> {
    project.insert("seed".to_owned(), seed.into());
    let body = toml::to_string(&project)?;
    Ok(format!(
        "# {title}. Written by `eagpt paper`, which writes it again; `eagpt run` takes it as it is.\n\n{body}"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::paper::rows::ROWS;

    #[test]
    fn rows_of_one_scene_share_its_training() {
        let project: Table = "dataset = \"/d\"\n[train]\nseed = 3\n[[relight]]\nname = \"ball\"\nscript = \"/s\"\nreference = \"/r\""
            .parse()
            .unwrap();
        let base = Base::new("d", Path::new("d"), project, Path::new("/out/d")).unwrap();
        let rows: Vec<&Row> = ROWS.iter().collect();
        let groups = base.groups(&rows, 7).unwrap();
        let num: Vec<usize> = groups.iter().map(|group| group.rows.len()).collect();
        assert_eq!(num, [10, 1, 1, 1, 1]);
        let scene = &groups[0].scene;
        assert_eq!(scene.project, Path::new("/out/d/scenes/full/seed-7.toml"));
        assert!(scene.text.contains("seed = 7") && !scene.text.contains("seed = 3"));
        let row = &groups[0].rows[2];
        assert!(
            row.text
                .contains("scene = \"/out/d/scenes/full/seed-7/train/scene.ply\"")
        );
        // Baking has nothing to show of the light that was photographed.
        let cells = base.cells(&rows, &[7]);
        assert_eq!(cells.len(), 2 * ROWS.len() - 1);
        assert!(cells.iter().any(|cell| {
            cell.folders == [Path::new("/out/d/rows/baked/seed-7/eval/ball/baked")]
        }));
    }
}
