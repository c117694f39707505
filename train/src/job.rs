//! The training job: which view comes when, with which step sizes; logs, previews, checkpoints,
//! divergence.

mod finish;
mod gloss;
mod initial;
mod lamps;
mod lights;
mod memory;
mod plan;
mod request;
mod start;
mod steps;
pub(crate) mod views;
mod watch;

use crate::backend::{self, Backend, Taken};
use crate::checkpoint::{self, Checkpoint, LossMonitor};
use crate::error::{Result, TrainError};
use crate::log::{Log, LogLine};
use crate::loss::LossTerms;
use crate::options::{Gather, Stage, StageChoice, TrainOptions};
use crate::params::ParameterState;
use crate::preview;
use crate::progress::TrainProgress;
use eagpt_scene::SceneError;
use eagpt_scene::files::{self, digest};
use lights::Light;
use std::path::Path;
use std::sync::atomic::Ordering;
use std::time::Instant;
use views::Views;

pub use lights::light_name;
pub(crate) use plan::Folder;
pub use plan::light_part;
pub use request::{BadViews, Existing, TrainRequest, TrainSummary};

/// Smoothing of the loss that is watched, per iteration.
const MONITOR_DECAY: f64 = 0.98;
/// A run has diverged when its smoothed PQ error is this many times the best so far …
const DIVERGED_FACTOR: f64 = 4.0;
/// … and worse than this: PQ errors of a blank picture are about 0.3.
const DIVERGED_L1: f64 = 0.15;

/// Trains a scene.
///
/// # Errors
/// Bad input, an unusable output folder, too little memory, or a run that diverged; each names what
/// it is about.
pub fn train(
    request: &TrainRequest,
    progress: &mut dyn FnMut(TrainProgress),
) -> Result<TrainSummary> {
    let options = &request.options;
    options.validate()?;
    let mut lights = lights::open(request)?;
    let given = start::read(request)?;
    let mut fingerprint = plan::fingerprint(&lights, options)?;
    if let Some(path) = &request.start {
        fingerprint = fingerprint.with("start", digest::of_file(path)?);
    }
    let folder = plan::Folder::new(request, &lights);
    let resumed = folder.prepare(request.existing, options, &fingerprint)?;
    start::take_lamps(request)?;
    let mut run = Run {
        request,
        folder,
        progress,
        warnings: Vec::new(),
        started: Instant::now(),
        stage_seconds: Vec::new(),
        budget: options.gaussians_for(options.num_points(&lights[0].dataset)?),
        watch: watch::Watch::default(),
        gloss: gloss::RunGloss::default(),
        num_frames: lights
            .iter()
            .map(|light| light.dataset.frames().len())
            .sum(),
    };
    let of_splits = lights.iter().flat_map(|light| &light.split.warnings);
    for warning in of_splits.chain(&resumed.warnings) {
        run.warn(warning.clone());
    }
    let budget = memory::image_budget(request, &lights)?;
    let of_lights = lights.iter().map(Light::views).collect();
    let mut views = Views::new(of_lights, budget, options.seed);
    if let Some(given) = &given {
        if given.is_glossy() && !options.albedo.gloss {
            run.warn("the gloss of the given scene is left out".to_owned());
        }
        run.budget = options.num_gaussians.unwrap_or(0).max(given.len());
    }
    let start = match (resumed.checkpoint, &given) {
        (Some(checkpoint), _) => {
            views.check(request.bad_views, |_| (), &mut run)?;
            checkpoint
        }
        (None, Some(given)) => {
            views.check(request.bad_views, |_| (), &mut run)?;
            start::checkpoint(given, lights.len(), options, fingerprint.clone())
        }
        (None, None) => initial::checkpoint(&lights, &mut views, fingerprint.clone(), &mut run)?,
    };
    let mut backend = backend::new(&request.device, start.state.clone(), budget / 2)?;
    let mut position = start;
    position.state = ParameterState::default();
    let finished = run.stages(backend.as_mut(), &views, &mut position)?;
    let scenes = backend.state()?.in_lights();
    // Its memory, for what is done with the scene.
    drop(backend);
    let num_gaussians = scenes[0].len();
    let scene = request.out.join("scene.ply");
    let own_light = match finished {
        true => run.write_scenes(scenes, &views)?,
        false => None,
    };
    Ok(TrainSummary {
        scene: finished.then_some(scene),
        num_gaussians,
        device: request.device.name(),
        lights: match lights.as_slice() {
            [_] => Vec::new(),
            several => several.iter().map(|light| light.name.clone()).collect(),
        },
        split: lights.swap_remove(0).split,
        fingerprint,
        extent: position.extent,
        own_light,
        stage_seconds: run.stage_seconds,
        warnings: run.warnings,
    })
}

/// State shared by the parts of a run.
struct Run<'a> {
    request: &'a TrainRequest,
    folder: plan::Folder,
    progress: &'a mut dyn FnMut(TrainProgress),
    warnings: Vec<String>,
    started: Instant,
    stage_seconds: Vec<(Stage, f64)>,
    /// Number of Gaussians in the end.
    budget: usize,
    watch: watch::Watch,
    /// Gloss of the scene of stage 0.
    gloss: gloss::RunGloss,
    /// Number of frames of the dataset.
    num_frames: usize,
}

impl Run<'_> {
    fn warn(&mut self, text: String) {
        self.warnings.push(text.clone());
        (self.progress)(TrainProgress::Warning { text });
    }

    /// Runs the stages from `position` on; `false` if it was stopped from outside.
    fn stages(
        &mut self,
        backend: &mut dyn Backend,
        views: &Views,
        position: &mut Checkpoint,
    ) -> Result<bool> {
        let wanted = self.request.options.stage;
        let is_given = self.request.start.is_some() && wanted == StageChoice::Albedo;
        let begins = position.stage == Stage::Radiance && !is_given;
        if begins && !self.stage(backend, views, position)? {
            return Ok(false);
        }
        if wanted == StageChoice::Radiance {
            return Ok(true);
        }
        if position.stage == Stage::Radiance {
            self.mark_luminous(backend, views)?;
        }
        self.gloss = self.estimate_gloss(backend, views)?;
        let gathers = self.request.options.albedo.gather == Gather::Gaussians;
        let over = position.stage == Stage::Albedo
            && position.iteration >= self.num_iterations(Stage::Albedo);
        if gathers && !over && !self.gather(backend, views)? {
            return Ok(false);
        }
        if position.stage == Stage::Radiance {
            backend.begin_albedo(&self.gloss.shares)?;
            position.stage = Stage::Albedo;
            position.iteration = 0;
            position.monitor = LossMonitor {
                smoothed: 0.0,
                smoothed_l1: 0.0,
                best_l1: f64::MAX,
            };
        }
        self.stage(backend, views, position)
    }

    /// Runs one stage to its end; `false` if it was stopped from outside.
    fn stage(
        &mut self,
        backend: &mut dyn Backend,
        views: &Views,
        position: &mut Checkpoint,
    ) -> Result<bool> {
        let options = &self.request.options;
        let stage = position.stage;
        let total = self.num_iterations(stage);
        (self.progress)(TrainProgress::StageStarted {
            stage,
            done: position.iteration,
            total,
            num_gaussians: backend.state()?.len(),
            num_views: views.len(),
        });
        self.tell_scene(backend)?;
        let started = Instant::now();
        let first_line = (position.iteration > 0 || stage == Stage::Albedo)
            .then_some((stage, position.iteration));
        let mut log = Log::open(&self.folder.log(), first_line)?;
        let shown = views.previews(options.output.num_previews)?;
        while position.iteration < total {
            let iteration = position.iteration + 1;
            let mut view = views.at(stage, iteration)?;
            backend.show_light(view.light)?;
            if stage == Stage::Albedo {
                view = self.gloss.diffuse_view(view, self.num_frames);
            }
            for step in self.step(backend, &view, position, iteration)? {
                self.note(&mut log, position, total, &step)?;
            }
            position.iteration = iteration;
            let last = iteration == total;
            let stop = self.request.stop.load(Ordering::Relaxed);
            let stores = last || stop || iteration.is_multiple_of(options.output.checkpoint_every);
            let every = options.output.preview_every;
            let shows = every > 0 && (iteration.is_multiple_of(every) || last) && !shown.is_empty();
            let splits = match stage {
                Stage::Radiance => options.radiance.densify.time_at(iteration, total),
                Stage::Albedo => None,
            };
            let lamps = &options.radiance.lamps;
            let cleans = stage == Stage::Radiance && lamps.is_due(iteration, total);
            let frees = stage == Stage::Radiance && lamps.is_freed(iteration, total);
            let is_watched = self.is_watched_now();
            if stores || shows || splits.is_some() || cleans || frees || is_watched {
                for step in backend.finish()? {
                    self.note(&mut log, position, total, &step)?;
                }
            }
            if let Some(time) = splits {
                self.densify(backend, views, iteration, time)?;
            }
            if cleans {
                self.clean_lamps(backend, views, iteration)?;
            }
            if frees {
                self.free_lamps(backend, views)?;
            }
            if shows {
                let psnr_srgb_db = preview::write(&self.folder, backend, &shown, stage, iteration)?;
                (self.progress)(TrainProgress::Preview {
                    stage,
                    iteration,
                    psnr_srgb_db,
                });
            }
            if stores {
                self.save(backend, position)?;
            }
            if is_watched {
                self.tell_scene(backend)?;
            }
            if stop && !last {
                return Ok(false);
            }
        }
        self.stage_seconds
            .push((stage, started.elapsed().as_secs_f64()));
        Ok(true)
    }

    /// Logs a step of the stage of `position`, and checks its loss.
    fn note(
        &mut self,
        log: &mut Log,
        position: &mut Checkpoint,
        total: u32,
        step: &Taken,
    ) -> Result<()> {
        let diverged = |what: String| TrainError::Diverged {
            stage: position.stage.name(),
            iteration: step.iteration,
            view: step.view.view.name.clone(),
            what,
        };
        let terms = step.outcome.map_err(|bad| diverged(bad.to_string()))?;
        position.monitor = watched(position.monitor, step.iteration, &terms).map_err(diverged)?;
        let line = LogLine {
            stage: position.stage,
            iteration: step.iteration,
            view: step.view.view.name.clone(),
            smoothed: position.monitor.smoothed,
            terms,
            seconds: self.started.elapsed().as_secs_f64(),
        };
        self.report(log, total, &line)
    }

    fn report(&mut self, log: &mut Log, total: u32, line: &LogLine) -> Result<()> {
        let iteration = line.iteration;
        let is_first_or_last = iteration == 1 || iteration == total;
        if is_first_or_last || iteration.is_multiple_of(self.request.options.output.log_every) {
            log.push(line)?;
        }
        (self.progress)(TrainProgress::Iteration {
            stage: line.stage,
            iteration,
            total,
            loss: line.smoothed,
        });
        Ok(())
    }

    fn save(&mut self, backend: &mut dyn Backend, position: &Checkpoint) -> Result<()> {
        let checkpoint = Checkpoint {
            state: backend.state()?,
            ..position.clone()
        };
        let dir = self.folder.checkpoints();
        let path = checkpoint.write(&dir)?;
        checkpoint::prune(
            &dir,
            position.stage,
            self.request.options.output.keep_checkpoints,
        )?;
        (self.progress)(TrainProgress::Checkpoint { path });
        Ok(())
    }
}

/// Follows the loss, that of `iteration` after those that `monitor` has seen.
///
/// # Errors
/// The problem of a loss that is not a number or diverges.
fn watched(
    mut monitor: LossMonitor,
    iteration: u32,
    terms: &LossTerms,
) -> std::result::Result<LossMonitor, String> {
    if !terms.total.is_finite() {
        return Err(format!("the loss is {}", terms.total));
    }
    // Starting values count fully at first and fade: the mean of the first iterations, then an
    // exponential one.
    let weight = (1.0 / f64::from(iteration)).max(1.0 - MONITOR_DECAY);
    monitor.smoothed += weight * (terms.total - monitor.smoothed);
    monitor.smoothed_l1 += weight * (terms.l1 - monitor.smoothed_l1);
    if f64::from(iteration) > 1.0 / (1.0 - MONITOR_DECAY) {
        monitor.best_l1 = monitor.best_l1.min(monitor.smoothed_l1);
        if monitor.smoothed_l1 > DIVERGED_L1.max(DIVERGED_FACTOR * monitor.best_l1) {
            return Err(format!(
                "the mean PQ error rose to {:.4} from {:.4}",
                monitor.smoothed_l1, monitor.best_l1
            ));
        }
    }
    Ok(monitor)
}

/// Creates the output folder and notes the effective options in it: a folder that cannot be written
/// is found before any work.
fn write_options(out: &Path, options: &TrainOptions) -> Result<()> {
    files::create_dir(out)?;
    let path = out.join("train.toml");
    let text = toml::to_string(options)
        .map_err(|e| SceneError::invalid(&path, "options", e.to_string()))?;
    files::write_bytes_atomic(&path, text.as_bytes())?;
    Ok(())
}
