//! The commands that follow from a project, in an order in which each finds what it needs.

mod results;
mod training;

use super::options::Options;
use super::project::{ORIGINAL, Project, Relight, is_file};
use super::section::MODEL;
use super::step::PlanStep;
use crate::colmap::{ColmapArgs, ColmapCommand, ImportArgs, RunArgs};
use crate::command::JobCommand;
use crate::edit::EditArgs;
use crate::eval::{EvalArgs, TableArgs};
use crate::report::ReportArgs;
use crate::synth::SynthArgs;
use anyhow::{Context, Result, anyhow, bail};
use eagpt_edit::Script;
use eagpt_eval::tabulate::DEFAULT_METRICS;
use eagpt_eval::{METRICS_FILE, TableFolder};
use eagpt_report::run::folders;
use eagpt_scene::Dataset;
use eagpt_scene::lamps::lamps_file_beside;
use results::Condition;
use std::path::{Path, PathBuf};
use training::all_lamps_on;

/// All steps.
#[derive(Debug)]
pub(crate) struct Plan {
    pub(crate) steps: Vec<PlanStep>,
    /// Folder for all results.
    pub(super) out: PathBuf,
    /// Folder of the project file.
    pub(super) here: PathBuf,
}

impl Plan {
    /// The steps of a project. All of its options are parsed: one that cannot be is found here,
    /// before anything runs.
    ///
    /// # Errors
    /// If a section does not fit its command, or a file that steps need cannot be read.
    pub(crate) fn of(project: &Project) -> Result<Self> {
        let mut plan = Self {
            steps: Vec::new(),
            out: project.out.clone(),
            here: project.path().parent().unwrap_or(Path::new("")).to_owned(),
        };
        let file = &project.file;
        let dataset = match &file.dataset {
            Some(path) => path.clone(),
            None => plan.capture(project)?,
        };
        let lights = plan.lights(project, &dataset)?;
        let scene = match &file.scene {
            Some(scene) => scene.clone(),
            None => plan.train(project, &lights)?,
        };
        let lit = all_lamps_on(&scene, lights.len());
        let dataset = file.measure.clone().unwrap_or(dataset);
        let original = Condition {
            name: ORIGINAL,
            scene: &scene,
            dataset: &dataset,
            reference: Some(&dataset),
            relight: None,
        };
        let mut evaluated = plan.condition(project, &original)?;
        for relight in &file.relight {
            let scene = plan.edit(relight, &lit);
            let of_capture = relight.condition.as_ref();
            let of_capture = of_capture.map(|name| plan.out.join("dataset").join(name));
            let reference = relight.reference.clone().or(of_capture);
            let condition = Condition {
                name: &relight.name,
                scene: &scene,
                dataset: &dataset,
                reference: reference.as_deref(),
                relight: Some(relight),
            };
            evaluated.extend(plan.condition(project, &condition)?);
        }
        if !evaluated.is_empty() {
            plan.table(evaluated);
        }
        plan.report();
        plan.check_inputs(project)?;
        for step in &plan.steps {
            let context = || format!("{}: step {}", project.path().display(), step.name);
            step.words().with_context(context)?;
        }
        Ok(plan)
    }

    /// Reads what people write and what every later step needs: an error should come before hours
    /// of work.
    fn check_inputs(&self, project: &Project) -> Result<()> {
        let dataset = project.file.dataset.as_deref().map(Dataset::open);
        let dataset = dataset.transpose()?;
        // Without a dataset they are conditions of a capture that is still to be made.
        if dataset.is_some() {
            for light in &project.file.other_lights {
                Dataset::open(light)?;
            }
        }
        for relight in &project.file.relight {
            Script::read(&relight.script)?;
            let reference = relight.reference.as_ref();
            // Products of the run itself do not exist yet.
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
        let exact = self.steps.iter().position(|step| step.name == name);
        let found = exact.or_else(|| self.steps.iter().position(|step| step.is_of(name)));
        found.ok_or_else(|| anyhow!("`{name}` is no step; there are {}", self.names()))
    }

    /// The index of a step; a name without "/" stands for the last of its kind too.
    pub(super) fn find_last(&self, name: &str) -> Result<usize> {
        let last = self.steps.iter().rposition(|step| step.is_of(name));
        last.map_or_else(|| self.find(name), Ok)
    }

    /// Names of all steps, separated by commas.
    pub(super) fn names(&self) -> String {
        let names: Vec<&str> = self.steps.iter().map(|step| step.name.as_str()).collect();
        names.join(", ")
    }

    /// Adds a step that takes files and folders, of the outside world or made by other steps, and
    /// returns what it makes.
    fn add(
        &mut self,
        name: impl Into<String>,
        command: JobCommand,
        takes: impl IntoIterator<Item = PathBuf>,
        product: PathBuf,
    ) -> PathBuf {
        let (mut reads, mut after) = (Vec::new(), Vec::new());
        for path in takes {
            let makes = |step: &PlanStep| step.products.iter().any(|made| path.starts_with(made));
            match self.steps.iter().position(makes) {
                Some(maker) => after.push(maker),
                None => reads.push(path),
            }
        }
        after.sort_unstable();
        after.dedup();
        self.steps.push(PlanStep {
            name: name.into(),
            command,
            reads,
            after,
            products: vec![product.clone()],
        });
        product
    }

    /// From photographs to the dataset of the first lighting; returns its folder.
    fn capture(&mut self, project: &Project) -> Result<PathBuf> {
        let file = &project.file;
        let photographs = match (&file.capture, &file.simulate) {
            (None, Some(scene)) => self.simulate(project, scene)?,
            (photographs, _) => photographs.clone().unwrap_or_default(),
        };
        let first = file.conditions.first();
        let in_first = |folder: &Path| first.map_or(folder.to_owned(), |name| folder.join(name));

        let ingested = self.out.join("ingest");
        let Options { mut args, paths } = project.options::<crate::ingest::IngestArgs>("ingest")?;
        args.capture.clone_from(&photographs);
        args.out.clone_from(&ingested);
        let takes = [photographs].into_iter().chain(paths);
        self.add("ingest", JobCommand::Ingest(args), takes, ingested.clone());

        let given = file.poses.as_ref().and_then(|poses| poses.get(MODEL));
        let model = match given {
            Some(toml::Value::String(model)) => PathBuf::from(model),
            Some(other) => {
                let problem = format!("{other} is no path");
                return Err(project.error(&["poses", MODEL], problem).into());
            }
            None => {
                let out = self.out.join("colmap");
                let Options { mut args, paths } = project.options::<RunArgs>("colmap")?;
                args.images = in_first(&ingested).join("Preview");
                args.out.clone_from(&out);
                let takes = [args.images.clone()].into_iter().chain(paths);
                let command = JobCommand::Colmap(ColmapArgs {
                    command: ColmapCommand::Run(args),
                });
                self.add("colmap", command, takes, out)
            }
        };
        let out = self.out.join("dataset");
        let Options { mut args, paths } = project.options::<ImportArgs>("poses")?;
        args.model.clone_from(&model);
        args.images = Some(ingested.clone());
        args.conditions.clone_from(&file.conditions);
        args.out.clone_from(&out);
        let takes = [model, ingested].into_iter().chain(paths);
        let command = JobCommand::Colmap(ColmapArgs {
            command: ColmapCommand::Import(args),
        });
        Ok(in_first(&self.add("poses", command, takes, out)))
    }

    fn simulate(&mut self, project: &Project, scene: &str) -> Result<PathBuf> {
        let out = self.out.join("capture");
        let Options { mut args, paths } = project.options::<SynthArgs>("synth")?;
        args.scene = Some(scene.to_owned());
        args.out = Some(out.clone());
        let takes = is_file(scene)
            .then(|| scene.into())
            .into_iter()
            .chain(paths);
        Ok(self.add("simulate", JobCommand::Synth(args), takes, out))
    }

    fn edit(&mut self, relight: &Relight, scene: &Path) -> PathBuf {
        let out = self
            .out
            .join(folders::EDIT)
            .join(format!("{}.ply", relight.name));
        let command = JobCommand::Edit(EditArgs {
            scene: scene.to_owned(),
            script: relight.script.clone(),
            lamps: None,
            lights: None,
            out: Some(out.clone()),
            dry_run: false,
            force: false,
        });
        // Those of a training come and go with its scene. A script that cannot be read is told of
        // later, with all that is wrong.
        let needs_lamps = || Script::read(&relight.script).is_ok_and(|of| of.needs_lamps());
        let lamps = Some(lamps_file_beside(scene));
        let lamps = lamps.filter(|path| !path.starts_with(&self.out) && needs_lamps());
        let takes = [scene.to_owned(), relight.script.clone()];
        let takes = takes.into_iter().chain(lamps);
        self.add(format!("edit/{}", relight.name), command, takes, out)
    }

    fn table(&mut self, folders: Vec<TableFolder>) {
        let out = self.out.join(folders::TABLE);
        let takes: Vec<PathBuf> = folders
            .iter()
            .map(|of| of.folder.join(METRICS_FILE))
            .collect();
        let command = JobCommand::Eval(EvalArgs::table(TableArgs {
            folders,
            metrics: DEFAULT_METRICS.map(str::to_owned).into(),
            out: out.clone(),
            force: false,
        }));
        self.add("table", command, takes, out);
    }

    fn report(&mut self) {
        let out = self.out.join("report.html");
        let command = JobCommand::Report(ReportArgs {
            run: self.out.clone(),
            out: out.clone(),
            force: false,
        });
        let takes: Vec<PathBuf> = self.steps.iter().flat_map(|s| s.products.clone()).collect();
        self.add("report", command, takes, out);
    }
}
