//! The projects of all rows.

use super::published::{self, RELIT};
use super::rows::{self, Row};
use crate::run::{ORIGINAL, Project, ProjectFile};
use anyhow::{Context, Result, bail};
use eagpt_eval::tabulate::repeats::RepeatCell;
use eagpt_report::run::{RunRecord, folders};
use eagpt_scene::Dataset;
use std::path::{Path, PathBuf};

/// A dataset with the project that rows are derived from.
#[derive(Debug)]
pub(super) struct Base {
    pub(super) name: String,
    /// Folder for its rows and its table, absolute.
    pub(super) out: PathBuf,
    /// Its paths are absolute.
    project: ProjectFile,
    /// Other lights that are measured.
    relit: Vec<String>,
}

/// The project of a row or of a training.
#[derive(Debug)]
pub(super) struct RowProject {
    /// As `kitchen/rows/path/seed-0`.
    pub(super) name: String,
    pub(super) project: Project,
    /// The last of its steps.
    pub(super) until: Option<&'static str>,
}

/// A trained scene with the rows that show it.
#[derive(Debug)]
pub(super) struct Group {
    pub(super) scene: RowProject,
    rows: Vec<RowProject>,
}

impl Group {
    /// All projects, in order.
    pub(super) fn projects(&self) -> impl Iterator<Item = &RowProject> {
        std::iter::once(&self.scene).chain(&self.rows)
    }
}

impl RowProject {
    /// Whether all of its steps are done, as far as can be told without looking at files.
    ///
    /// # Errors
    /// If its record cannot be read.
    pub(super) fn is_done(&self) -> Result<bool> {
        let last = self.until.unwrap_or("report");
        let record = RunRecord::read(&self.project.out)?;
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
    config: Option<ProjectFile>,
    (preset, spp): (&str, i64),
) -> Result<ProjectFile> {
    let mut project = config.unwrap_or_default();
    let path = std::path::absolute(dataset).with_context(|| format!("{}", dataset.display()))?;
    project.dataset = Some(path);
    // As the dataset of the configuration, they are of another place.
    project.other_lights.clear();
    let train = project.train.get_or_insert_default();
    train.entry("preset").or_insert(preset.into());
    let render = project.render.get_or_insert_default();
    render.entry("spp").or_insert(spp.into());
    render.entry("denoise").or_insert("auto".into());
    let mut frames = Dataset::open(dataset)?.frames().to_vec().into_iter();
    if project.masks.is_none() && frames.all(|frame| frame.files.emission.is_none()) {
        project.masks = Some(Default::default());
    }
    Ok(project)
}

impl Base {
    /// A dataset as a project; `path` is where it is from, for messages.
    ///
    /// # Errors
    /// If it starts at something else than a dataset.
    pub(super) fn new(
        name: &str,
        path: &Path,
        mut project: ProjectFile,
        out: &Path,
    ) -> Result<Self> {
        for (key, is_there) in [
            ("capture", project.capture.is_some()),
            ("simulate", project.simulate.is_some()),
            ("scene", project.scene.is_some()),
        ] {
            if is_there {
                bail!(
                    "{}: {key}: tables are made of a dataset; `eagpt run` makes one of a capture",
                    path.display()
                );
            }
        }
        project.out = None;
        // Seeds are those of the rows.
        for (_, section) in project.sections_mut() {
            section.iter_mut().for_each(|of| drop(of.remove("seed")));
        }
        let measured = project.relight.iter().filter(|of| of.reference.is_some());
        Ok(Self {
            name: name.to_owned(),
            out: out.to_owned(),
            relit: measured.map(|of| of.name.clone()).collect(),
            project,
        })
    }

    /// The rows that there are.
    fn rows<'a>(&self, rows: &[&'a Row]) -> Vec<&'a Row> {
        let is_shown = |row: &&&Row| row.shows(!self.relit.is_empty());
        rows.iter().filter(is_shown).copied().collect()
    }

    /// Place of a project below the folder of the dataset.
    fn place(kind: &str, name: &str, seed: u32) -> String {
        format!("{kind}/{name}/seed-{seed}")
    }

    fn row_project(
        &self,
        place: &str,
        mut project: ProjectFile,
        (title, seed): (&str, u32),
    ) -> Result<RowProject> {
        project.seed = Some(seed);
        let comment = format!(
            "{title}. Written by `eagpt paper`, which writes it again; `eagpt run` takes it as it is."
        );
        Ok(RowProject {
            name: format!("{}/{place}", self.name),
            project: Project::derived(&self.out.join(format!("{place}.toml")), &project, &comment)?,
            until: None,
        })
    }

    /// The trainings and rows of a seed.
    ///
    /// # Errors
    /// If a row cannot be derived from this project.
    pub(super) fn groups(&self, rows: &[&Row], seed: u32) -> Result<Vec<Group>> {
        let mut groups: Vec<(&str, Group)> = Vec::new();
        for row in self.rows(rows) {
            let of = row.scene();
            let at = match groups.iter().position(|(scene, _)| *scene == of) {
                Some(at) => at,
                None => {
                    groups.push((of, self.group(of, seed)?));
                    groups.len() - 1
                }
            };
            let group = &mut groups[at].1;
            let scene = group.scene.project.out.join("train/scene.ply");
            let project = row.project(&self.project, &scene);
            let title = format!("Row {}: {}", row.name, row.title);
            let place = Self::place("rows", row.name, seed);
            let project = self.row_project(&place, project, (&title, seed))?;
            group.rows.push(project);
        }
        Ok(groups.into_iter().map(|(_, group)| group).collect())
    }

    fn group(&self, scene: &str, seed: u32) -> Result<Group> {
        let project = rows::training(scene, &self.project);
        let project = project.with_context(|| self.name.clone())?;
        let title = format!("Scene {scene}");
        let place = Self::place("scenes", scene, seed);
        let scene = RowProject {
            until: Some("train"),
            ..self.row_project(&place, project, (&title, seed))?
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
                    let out = self.out.join(Self::place("rows", row.name, *seed));
                    out.join(folders::EVAL).join(condition).join(row.mode())
                });
                // The paper changes the light of a scene once.
                let published = match place {
                    None => published::values(&self.name, ORIGINAL, row.name),
                    Some(0) => published::values(&self.name, RELIT, row.name),
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

    /// Notes of the table.
    pub(super) fn notes(&self, rows: &[&Row], seeds: &[u32]) -> Vec<String> {
        let mut notes = Vec::new();
        let all: Vec<String> = seeds.iter().map(u32::to_string).collect();
        let seeds = all.join(", ");
        if all.len() > 1 {
            notes.push(format!("seeds {seeds}: mean ± standard deviation (n − 1)"));
        } else {
            notes.push(format!("seed {seeds}"));
        }
        if published::has_scene(&self.name) {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::paper::rows::ROWS;

    #[test]
    fn rows_of_one_scene_share_its_training() {
        let project: ProjectFile = toml::from_str("dataset = \"/d\"\n[train]\nseed = 3\n[[relight]]\nname = \"ball\"\nscript = \"/s\"\nreference = \"/r\"",
        )
        .unwrap();
        let base = Base::new("d", Path::new("d"), project, Path::new("/out/d")).unwrap();
        let rows: Vec<&Row> = ROWS.iter().collect();
        let groups = base.groups(&rows, 7).unwrap();
        let num: Vec<usize> = groups.iter().map(|group| group.rows.len()).collect();
        assert_eq!(num, [10, 1, 1, 1, 1]);
        let scene = &groups[0].scene;
        let path = Path::new("/out/d/scenes/full/seed-7.toml");
        assert_eq!(scene.project.path(), path);
        let text = scene.project.text();
        assert!(text.contains("seed = 7") && !text.contains("seed = 3"));
        let row = &groups[0].rows[2];
        assert!(
            row.project
                .text()
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
