//! The stages of a run: which view comes when; logs, previews, checkpoints, divergence.

use super::gloss::RunGloss;
use super::preview;
use super::run::Run;
use crate::backend::{Backend, Taken};
use crate::checkpoint::{self, Checkpoint, LossMonitor};
use crate::error::{Result, TrainError};
use crate::log::{Log, LogLine};
use crate::loss::LossTerms;
use crate::options::{Gather, Stage, StageChoice};
use crate::progress::TrainProgress;
use crate::views::Views;
use eagpt_scene::Lamps;
use eagpt_scene::lamps::read_lamps;
use std::sync::atomic::Ordering;
use std::time::Instant;

/// Smoothing of the loss that is watched, per iteration.
const MONITOR_DECAY: f64 = 0.98;
/// A run has diverged when its smoothed PQ error is this many times the best so far …
const DIVERGED_FACTOR: f64 = 4.0;
/// … and worse than this: PQ errors of a blank picture are about 0.3.
const DIVERGED_L1: f64 = 0.15;

impl Run<'_> {
    /// Runs the stages from `position` on; `false` if it was stopped from outside.
    pub(super) fn stages(
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
        self.gloss = match position.stage {
            Stage::Radiance => {
                self.mark_luminous(backend, views)?;
                RunGloss::estimate(&self.request.options, backend, views, self.progress)?
            }
            Stage::Albedo => RunGloss::from_rows(&position.gloss),
        };
        let gathers = self.request.options.albedo.gather == Gather::Gaussians;
        let over = position.stage == Stage::Albedo
            && position.iteration >= self.num_iterations(Stage::Albedo);
        if gathers && !over && !self.gather(backend, views)? {
            return Ok(false);
        }
        if position.stage == Stage::Radiance && gathers {
            if self.light_unseen(backend, views)? && !self.gather(backend, views)? {
                return Ok(false);
            }
            if self.place_bulbs(backend, views)? && !self.gather(backend, views)? {
                return Ok(false);
            }
            if self.correct_lamps(backend, views)? && !self.gather(backend, views)? {
                return Ok(false);
            }
            self.mark_glows(backend, views)?;
        }
        if !over {
            self.gloss.explain(&self.request.options, backend, views)?;
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
                view = self.gloss.diffuse_view(view, views.num_frames());
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
            // In several lights all become clean at once.
            let has_bare = stage == Stage::Radiance && views.num_lights() == 1;
            let cleans_bare = has_bare && lamps.is_due_for_bare(iteration, total);
            let all_clean = stage == Stage::Radiance && lamps.is_done(iteration, total);
            let frees = (all_clean || has_bare) && lamps.is_freed(iteration, total);
            let clears = has_bare && lamps.is_cleared(iteration, total);
            let is_watched = self.is_watched_now();
            let edits = splits.is_some() || cleans_bare || cleans || frees || clears;
            if stores || shows || edits || is_watched {
                for step in backend.finish()? {
                    self.note(&mut log, position, total, &step)?;
                }
            }
            if let Some(time) = splits {
                self.densify(backend, views, iteration, time)?;
            }
            if cleans_bare {
                self.clean_bare_lamps(backend, views, iteration)?;
            }
            if cleans {
                let num_mirrors = match options.radiance.mirrors {
                    true => self.place_mirrors(backend, views, iteration)?,
                    false => 0,
                };
                self.clean_lamps(backend, views, iteration, num_mirrors)?;
            }
            if frees {
                self.free_lamps(backend, views, all_clean)?;
            }
            if clears {
                self.clear_floaters(backend, views, all_clean)?;
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

    /// The lamps of the first light, if they are listed.
    fn listed_lamps(&self) -> Result<Option<Lamps>> {
        let list = self.folder.lamps(0);
        Ok(list.exists().then(|| read_lamps(&list)).transpose()?)
    }

    fn save(&mut self, backend: &mut dyn Backend, position: &Checkpoint) -> Result<()> {
        let checkpoint = Checkpoint {
            lamps: self.listed_lamps()?,
            gloss: self.gloss.rows(),
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
