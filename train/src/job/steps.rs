//! Steps of the stages on a backend.

use super::run::Run;
use crate::backend::{AlbedoStep, Backend, RadianceStep, Taken, TrainingView};
use crate::checkpoint::Checkpoint;
use crate::error::Result;
use crate::loss::NormalTerms;
use crate::options::Stage;
use crate::params::StepSizes;
use crate::progress::TrainProgress;
use crate::views::Views;
use std::sync::atomic::Ordering;

/// Gaussians gathered for between two checks of the stop flag.
const GATHERED_AT_ONCE: usize = 2048;

impl Run<'_> {
    /// Number of iterations of a stage. Stage 1 is short: each light has as many there as one
    /// alone.
    pub(super) fn num_iterations(&self, stage: Stage) -> u32 {
        let options = &self.request.options;
        match stage {
            Stage::Radiance => options.radiance.iterations,
            Stage::Albedo => {
                (options.albedo.iterations).saturating_mul(self.folder.num_lights() as u32)
            }
        }
    }

    /// Begins a step, and returns the finished ones.
    pub(super) fn step(
        &mut self,
        backend: &mut dyn Backend,
        view: &TrainingView,
        position: &Checkpoint,
        iteration: u32,
    ) -> Result<Vec<Taken>> {
        let options = &self.request.options;
        let progress = (iteration - 1) as f32 / self.num_iterations(position.stage) as f32;
        match position.stage {
            Stage::Radiance => {
                let stage = &options.radiance;
                let normals = if progress < stage.normals_from {
                    NormalTerms::Off
                } else {
                    NormalTerms::On
                };
                let mut sizes = StepSizes::radiance(&stage.rates, position.extent, progress);
                let start = stage.harmonics.start(stage.iterations);
                if start == Some(iteration) {
                    backend.begin_harmonics()?;
                }
                if start.is_some_and(|start| iteration >= start) {
                    let share = stage.rates.share_at(progress);
                    sizes = sizes.with_harmonics(&stage.harmonics, share);
                }
                backend.radiance_step(
                    view,
                    &RadianceStep {
                        iteration,
                        weights: &stage.weights,
                        normals,
                        antialias: progress >= stage.antialias_from,
                        sizes,
                    },
                )
            }
            Stage::Albedo => {
                let stage = &options.albedo;
                let rate = stage.rate * stage.final_share.powf(progress);
                let step = AlbedoStep {
                    options: stage,
                    ssim_share: options.radiance.weights.ssim_share,
                    seed: options.seed,
                    iteration,
                    sizes: StepSizes::albedo(rate),
                };
                backend.albedo_step(view, &step)
            }
        }
    }

    /// Splits Gaussians for the `time`-th time.
    pub(super) fn densify(
        &mut self,
        backend: &mut dyn Backend,
        views: &Views,
        iteration: u32,
        time: u32,
    ) -> Result<()> {
        for view in views.poses() {
            let view = view?;
            backend.show_light(view.light)?;
            backend.attribute(&view)?;
        }
        let densify = &self.request.options.radiance.densify;
        let outcome = backend.densify(densify.num_after(time, self.budget))?;
        (self.progress)(TrainProgress::Densified {
            iteration,
            num_moved: outcome.num_moved,
            num_gaussians: outcome.num_gaussians,
        });
        Ok(())
    }

    /// Gathers irradiance for stage 1; `false` if it was stopped from outside. It is not stored: a
    /// resumed run gathers the same again.
    pub(super) fn gather(&mut self, backend: &mut dyn Backend, views: &Views) -> Result<bool> {
        let options = &self.request.options;
        let cameras = views.cameras();
        let num_lights = views.num_lights();
        for light in 0..num_lights {
            backend.show_light(light)?;
            let num = backend.begin_gathering(&cameras)?;
            let (before, total) = (light * num, num_lights * num);
            if light == 0 {
                (self.progress)(TrainProgress::Gathering { done: 0, total });
            }
            for start in (0..num).step_by(GATHERED_AT_ONCE) {
                if self.request.stop.load(Ordering::Relaxed) {
                    return Ok(false);
                }
                let end = num.min(start + GATHERED_AT_ONCE);
                backend.gather(start..end, options.albedo.num_samples, options.seed)?;
                let done = before + end;
                (self.progress)(TrainProgress::Gathering { done, total });
            }
        }
        Ok(true)
    }
}
