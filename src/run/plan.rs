//! The commands that follow from a project, in an order in which each finds what it needs.

use super::project::{Capture, ORIGINAL, Options, Photographs, Project, Relight, Source};
use super::step::{Restart, Step, parse};
use anyhow::{Result, anyhow, bail};
use eagpt_edit::Script;
use eagpt_eval::METRICS_FILE;
use eagpt_scene::Dataset;
use eagpt_scene::dataset::{EMISSION_DIR, NORMAL_DIR, TRANSFORMS_FILE};
use std::path::{Path, PathBuf};

/// All steps.
#[derive(Debug)]
pub(super) struct Plan {
    pub(super) steps: Vec<Step>,
    /// Folder for all results.
    pub(super) out: PathBuf,
    /// Folder of the project file.
    pub(super) here: PathBuf,
}

impl Plan {
    /// The steps of a project. Every command is parsed: an option that cannot be is found here,
    /// before anything runs.
    pub(super) fn of(project: &Project) -> Result<Self> {
        let mut plan = Self {
            steps: Vec::new(),
            out: project.out.clone(),
            here: project.path.parent().unwrap_or(Path::new("")).to_owned(),
        };
        let dataset = match &project.source {
            Source::Dataset(path) => path.clone(),
            Source::Capture(capture) => plan.capture(capture),
        };
        let dataset = dataset.as_path();
        let scene = match &project.scene {
            Some(scene) => scene.clone(),
            None => {
                let masks = project.masks.as_ref();
                let masks =
                    masks.map(|options| plan.maps(["masks", EMISSION_DIR], dataset, options));
                let normals = project.normals.as_ref();
                let normals =
                    normals.map(|options| plan.maps(["normals", NORMAL_DIR], dataset, options));
                plan.train(dataset, [masks, normals], &project.train);
                plan.out.join("train/scene.ply")
            }
        };
        let dataset = project.measure.as_deref().unwrap_or(dataset);
        let mut evaluated = plan.condition(
            project,
            &Condition {
                name: ORIGINAL,
                scene: &scene,
                dataset,
                reference: Some(dataset),
                split: None,
                is_changed: false,
            },
        );
        for relight in &project.relight {
            let scene = plan.edit(relight, &scene);
            let of_capture = relight.condition.as_ref();
            let of_capture = of_capture.map(|name| plan.out.join("dataset").join(name));
            let reference = relight.reference.clone().or(of_capture);
            evaluated.extend(plan.condition(
                project,
                &Condition {
                    name: &relight.name,
                    scene: &scene,
                    dataset,
                    reference: reference.as_deref(),
                    split: relight.split.as_deref(),
                    is_changed: true,
                },
            ));
        }
        if !evaluated.is_empty() {
            plan.table(&evaluated);
        }
        plan.report();
        plan.check_inputs(project)?;
        for step in &plan.steps {
            parse(&step.arguments).map_err(|error| {
                anyhow!("{}: step {}: {error}", project.path.display(), step.name)
            })?;
        }
        Ok(plan)
    }

    /// Reads what people write and what every later step needs: an error should come before hours
    /// of work.
    fn check_inputs(&self, project: &Project) -> Result<()> {
        let dataset = match &project.source {
            Source::Dataset(path) => Some(Dataset::open(path)?),
            Source::Capture(_) => None,
        };
        for relight in &project.relight {
            Script::read(&relight.script)?;
            let reference = relight.reference.as_ref();
            // What the run itself makes is not there yet.
            let reference = reference.filter(|path| !path.starts_with(&self.out));
            if let (Some(dataset), Some(reference)) = (&dataset, reference) {
                let reference = Dataset::open(reference)?;
                let is_there = |name: &str| reference.frames().iter().any(|f| f.name == name);
                if !dataset.frames().iter().any(|frame| is_there(&frame.name)) {
                    bail!(
                        "{}: frames: no view is called like one of {}",
                        reference.transforms().display(),
                        dataset.transforms().display()
                    );
                }
            }
        }
        Ok(())
    }

    /// The index of a step; a name without "/" stands for the first of its kind too.
    pub(super) fn find(&self, name: &str) -> Result<usize> {
        let mut names = self.steps.iter().map(|step| step.name.as_str());
        let kind = |full: &str| full.split('/').next() == Some(name);
        let found = names
            .clone()
            .position(|full| full == name)
            .or_else(|| names.clone().position(kind));
        found.ok_or_else(|| {
            let all: Vec<&str> = names.by_ref().collect();
            anyhow!("`{name}` is no step; there are {}", all.join(", "))
        })
    }

    /// The index of a step; a name without "/" stands for the last of its kind too.
    pub(super) fn find_last(&self, name: &str) -> Result<usize> {
        let kind = |step: &Step| step.name.split('/').next() == Some(name);
        match self.steps.iter().rposition(kind) {
            Some(index) => Ok(index),
            None => self.find(name),
        }
    }

    fn push(&mut self, step: Step) -> usize {
        self.steps.push(step);
        self.steps.len() - 1
    }

    /// Adds a step whose command gets options of the project, and reads what they name, and a place
    /// to write to.
    fn push_with(&mut self, options: &Options, out: &Path, mut step: Step) -> usize {
        step.arguments.extend(options.words.iter().cloned());
        step.arguments.extend(words(&["--out"], &[out]));
        let paths: Vec<&Path> = options.paths.iter().map(PathBuf::as_path).collect();
        let (reads, after) = self.sources(&paths);
        step.reads.extend(reads);
        step.after.extend(after);
        step.after.sort_unstable();
        step.after.dedup();
        self.push(step)
    }

    /// From photographs to the dataset of the first lighting; returns its folder.
    fn capture(&mut self, capture: &Capture) -> PathBuf {
        let ingested = self.out.join("ingest");
        let (photographs, reads, after) = match &capture.photographs {
            Photographs::Taken(path) => (path.clone(), vec![path.clone()], Vec::new()),
            Photographs::Simulated(scene, options) => {
                let out = self.out.join("capture");
                let simulate = self.simulate(scene, options, &out);
                (out, Vec::new(), vec![simulate])
            }
        };
        let first = capture.conditions.first();
        let ingest = Step {
            name: "ingest".to_owned(),
            arguments: words(&["ingest"], &[&photographs]),
            reads,
            after,
            products: vec![ingested.clone()],
            restart: Restart::Itself,
        };
        let ingest = self.push_with(&capture.ingest, &ingested, ingest);
        let (model, reads, after) = match &capture.model {
            Some(model) => {
                let (reads, mut after) = self.sources(&[model]);
                after.push(ingest);
                (model.clone(), reads, after)
            }
            None => {
                let out = self.out.join("colmap");
                let previews = first.map_or(ingested.clone(), |first| ingested.join(first));
                let arguments = words(&["colmap", "run"], &[&previews.join("Preview")]);
                let colmap = Step {
                    name: "colmap".to_owned(),
                    arguments,
                    reads: Vec::new(),
                    after: vec![ingest],
                    products: vec![out.clone()],
                    restart: Restart::Anew,
                };
                let colmap = self.push_with(&capture.colmap, &out, colmap);
                (out, Vec::new(), vec![ingest, colmap])
            }
        };
        let out = self.out.join("dataset");
        let mut arguments = words(&["colmap", "import"], &[&model]);
        arguments.extend(words(&["--images"], &[&ingested]));
        if !capture.conditions.is_empty() {
            arguments.extend(["--conditions".to_owned(), capture.conditions.join(",")]);
        }
        let poses = Step {
            name: "poses".to_owned(),
            arguments,
            reads,
            after,
            products: vec![out.clone()],
            restart: Restart::Anew,
        };
        self.push_with(&capture.poses, &out, poses);
        first.map_or(out.clone(), |first| out.join(first))
    }

    fn simulate(&mut self, scene: &str, options: &Options, out: &Path) -> usize {
        let is_file = scene.contains(['/', '.']);
        let simulate = Step {
            name: "simulate".to_owned(),
            arguments: words(&["synth", scene], &[]),
            reads: is_file.then(|| scene.into()).into_iter().collect(),
            after: Vec::new(),
            products: vec![out.to_owned()],
            restart: Restart::Anew,
        };
        self.push_with(options, out, simulate)
    }

    /// Divides what a step reads into the files of the outside world and the steps that make the
    /// others.
    fn sources(&self, paths: &[&Path]) -> (Vec<PathBuf>, Vec<usize>) {
        let (mut reads, mut after) = (Vec::new(), Vec::new());
        for path in paths {
            let makes = |step: &Step| step.products.iter().any(|made| path.starts_with(made));
            match self.steps.iter().position(makes) {
                Some(maker) => after.push(maker),
                None => reads.push((*path).to_owned()),
            }
        }
        (reads, after)
    }

    /// What a command adds to a dataset, inside of a folder that is called like the command.
    fn maps(&mut self, [command, maps]: [&str; 2], dataset: &Path, options: &Options) -> usize {
        let out = self.out.join(command);
        let (reads, after) = self.sources(&[dataset]);
        let step = Step {
            name: command.to_owned(),
            arguments: words(&[command], &[dataset]),
            reads,
            after,
            products: vec![out.join(maps)],
            restart: Restart::Anew,
        };
        self.push_with(options, &out, step)
    }

    fn train(&mut self, dataset: &Path, maps: [Option<usize>; 2], options: &Options) {
        let out = self.out.join("train");
        let mut arguments = words(&["train"], &[dataset]);
        let (reads, mut after) = self.sources(&[dataset]);
        for step in maps.into_iter().flatten() {
            let name = &self.steps[step].name;
            arguments.extend(words(&[&format!("--{name}")], &[&self.out.join(name)]));
            after.push(step);
        }
        let train = Step {
            name: "train".to_owned(),
            arguments,
            reads,
            after,
            products: vec![out.join("scene.ply")],
            restart: Restart::Resume("checkpoints"),
        };
        self.push_with(options, &out, train);
    }

    fn edit(&mut self, relight: &Relight, scene: &Path) -> PathBuf {
        let out = self.out.join("edit").join(format!("{}.ply", relight.name));
        let (mut reads, after) = self.sources(&[scene]);
        reads.push(relight.script.clone());
        self.push(Step {
            name: format!("edit/{}", relight.name),
            arguments: with_out(words(&["edit"], &[scene, &relight.script]), &out),
            reads,
            after,
            products: vec![out.clone()],
            restart: Restart::Anew,
        });
        out
    }

    /// Baking, rendering and measuring of one light; returns the evaluations.
    fn condition(&mut self, project: &Project, condition: &Condition<'_>) -> Vec<Evaluated> {
        let mut rendered = Vec::new();
        for (mode, options) in &project.modes {
            let step = self.render(mode, mode, condition, options);
            rendered.push((mode.clone(), step));
        }
        if let (Some(options), true) = (&project.bake, condition.is_changed) {
            self.bake(condition, options);
            let seen = Condition {
                scene: &self
                    .out
                    .join("bake")
                    .join(format!("{}.ply", condition.name)),
                ..*condition
            };
            let step = self.render("baked", "0-bounce", &seen, &project.zero_bounce);
            rendered.push(("baked".to_owned(), step));
        }
        let Some(reference) = condition.reference else {
            return Vec::new();
        };
        rendered
            .into_iter()
            .map(|(row, step)| self.eval(project, &row, step, condition, reference))
            .collect()
    }

    fn bake(&mut self, condition: &Condition<'_>, options: &Options) {
        let out = self
            .out
            .join("bake")
            .join(format!("{}.ply", condition.name));
        let name = format!("bake/{}", condition.name);
        self.look(name, &[], condition, options, &out);
    }

    fn render(
        &mut self,
        row: &str,
        mode: &str,
        condition: &Condition<'_>,
        options: &Options,
    ) -> usize {
        let out = self.out.join("render").join(condition.name).join(row);
        let name = format!("render/{}/{row}", condition.name);
        self.look(name, &["--mode", mode], condition, options, &out)
    }

    /// A command that takes the scene and the cameras of a condition; its name begins that of the
    /// step.
    fn look(
        &mut self,
        name: String,
        own: &[&str],
        condition: &Condition<'_>,
        options: &Options,
        out: &Path,
    ) -> usize {
        let command = name.split('/').next().unwrap_or_default();
        let mut arguments = words(&[command], &[condition.scene]);
        arguments.extend(words(&["--cameras"], &[condition.dataset]));
        arguments.extend(words(own, &[]));
        let (reads, after) = self.sources(&[&transforms(condition.dataset), condition.scene]);
        let look = Step {
            name,
            arguments,
            reads,
            after,
            products: vec![out.to_owned()],
            restart: Restart::Itself,
        };
        self.push_with(options, out, look)
    }

    fn eval(
        &mut self,
        project: &Project,
        row: &str,
        render: usize,
        condition: &Condition<'_>,
        reference: &Path,
    ) -> Evaluated {
        let renders = self.out.join("render").join(condition.name).join(row);
        let out = self.out.join("eval").join(condition.name).join(row);
        let mut arguments = words(&["eval"], &[&renders]);
        arguments.extend(words(&["--reference"], &[reference]));
        arguments.extend(["--name".to_owned(), condition.name.to_owned()]);
        if let Some(split) = condition.split {
            arguments.extend(["--split".to_owned(), split.to_owned()]);
        }
        let mut datasets = vec![reference];
        if condition.is_changed {
            arguments.extend(words(&["--before"], &[condition.dataset]));
            datasets.push(condition.dataset);
        }
        let (reads, mut after) = self.sources(&datasets);
        after.push(render);
        let step = Step {
            name: format!("eval/{}/{row}", condition.name),
            arguments,
            reads,
            after,
            products: vec![out.join(METRICS_FILE)],
            restart: Restart::Anew,
        };
        let step = self.push_with(&project.eval, &out, step);
        Evaluated {
            row: row.to_owned(),
            folder: out,
            step,
        }
    }

    fn report(&mut self) {
        let out = self.out.join("report.html");
        self.push(Step {
            name: "report".to_owned(),
            arguments: with_out(words(&["report"], &[&self.out]), &out),
            reads: Vec::new(),
            after: (0..self.steps.len()).collect(),
            products: vec![out],
            restart: Restart::Anew,
        });
    }

    fn table(&mut self, evaluated: &[Evaluated]) {
        let mut arguments = words(&["eval", "table"], &[]);
        let cells = evaluated.iter();
        arguments.extend(cells.map(|one| format!("{}={}", one.row, one.folder.display())));
        let out = self.out.join("table");
        self.push(Step {
            name: "table".to_owned(),
            arguments: with_out(arguments, &out),
            reads: Vec::new(),
            after: evaluated.iter().map(|one| one.step).collect(),
            products: vec![out],
            restart: Restart::Anew,
        });
    }
}

/// A light to render and measure.
#[derive(Clone, Copy)]
struct Condition<'a> {
    name: &'a str,
    scene: &'a Path,
    /// Dataset whose cameras count.
    dataset: &'a Path,
    reference: Option<&'a Path>,
    split: Option<&'a str>,
    /// Whether it is another light than that of the photographs.
    is_changed: bool,
}

/// An evaluation on its way into the table.
struct Evaluated {
    row: String,
    folder: PathBuf,
    step: usize,
}

fn words(words: &[&str], paths: &[&Path]) -> Vec<String> {
    let words = words.iter().map(|word| (*word).to_owned());
    let paths = paths.iter().map(|path| path.display().to_string());
    words.chain(paths).collect()
}

fn with_out(mut arguments: Vec<String>, out: &Path) -> Vec<String> {
    arguments.extend(words(&["--out"], &[out]));
    arguments
}

/// What a command reads that needs the cameras of a dataset alone.
fn transforms(dataset: &Path) -> PathBuf {
    if dataset.is_file() {
        dataset.to_owned()
    } else {
        dataset.join(TRANSFORMS_FILE)
    }
}
