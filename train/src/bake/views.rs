//! Light baking by path-traced views, the paper's way (EAG-PT, section 3.5).
//!
//! The work folder becomes a dataset: one image a view, named as in the cameras' dataset. Its
//! [`Ledger`] lists those that are done. Views are independent of each other, so that several
//! machines can each take a [`Shard`]; once all images are there, radiance is fitted to them by
//! iterations of stage 0 with everything else held.

use super::request::Bake;
use crate::backend::{self, RadianceStep};
use crate::error::{Result, TrainError};
use crate::loss::NormalTerms;
use crate::options::{LearningRates, LossWeights, Stage};
use crate::params::{ParameterState, StepSizes};
use crate::progress::BakeProgress;
use crate::views::Views;
use eagpt_render::{RenderJob, RenderProgress, Shot, render_views};
use eagpt_scene::dataset::{RADIANCE_DIR, TRANSFORMS_FILE, write_transforms};
use eagpt_scene::exr::{self, Precision};
use eagpt_scene::files::{self, Ledger};
use eagpt_scene::{Dataset, Shard};
use eagpt_trace::{Integrator, LightOptions, RenderedView};
use glam::Vec3;
use std::path::PathBuf;
use std::sync::Arc;

pub use super::request::ViewBake;

/// Bytes that images may take in memory during the fit.
const IMAGE_BUDGET: usize = 1 << 30;

impl Bake<'_> {
    /// Radiances of all Gaussians, or `None` if it was stopped from outside or is a shard.
    pub(super) fn fit_views(
        &mut self,
        method: &ViewBake,
        ledger: Ledger,
    ) -> Result<Option<Vec<Vec3>>> {
        if !self.render_views(method, ledger)? || method.shard != Shard::WHOLE {
            return Ok(None);
        }
        let cameras: Vec<_> = (self.frames.iter())
            .map(|&i| &self.dataset.frames()[i])
            .map(|frame| (frame.name.clone(), frame.camera))
            .collect();
        let transforms = self.request.work.join(TRANSFORMS_FILE);
        write_transforms(&transforms, &cameras, &self.dataset.info())?;
        self.fit(method)
    }

    /// Path-traces the views of the shard that are not done; `false` if it was stopped.
    fn render_views(&mut self, method: &ViewBake, mut ledger: Ledger) -> Result<bool> {
        let options = self.request.options;
        let scene = self.request.device.scene(&self.scene)?;
        let job = RenderJob {
            scene: scene.as_ref(),
            integrator: Integrator::Path {
                num_samples: method.num_samples,
                max_bounces: options.max_bounces,
                roulette_from: method.roulette_from,
            },
            light: LightOptions {
                sampling: method.sampling,
                ..LightOptions::default()
            },
            rays_per_axis: 1,
            denoiser: None,
            stop: &self.request.stop,
        };
        let mine = (0..).zip(&self.frames);
        let mine = mine.filter(|(place, _)| method.shard.has(*place));
        let shots: Vec<Shot> = mine
            .map(|(_, &view)| Shot {
                name: self.dataset.frames()[view].name.clone(),
                camera: self.dataset.frames()[view].camera,
                // Noise of its own for every view: what they share, the fit could not average away.
                seed: options.seed.wrapping_add(view as u64),
            })
            .collect();
        let work = &self.request.work;
        let write = |shot: &Shot, rendered: &RenderedView| {
            let image = PathBuf::from(RADIANCE_DIR).join(format!("{}.exr", shot.name));
            let path = work.join(&image);
            if let Some(parent) = path.parent() {
                files::create_dir(parent)?;
            }
            exr::write_rgb(&path, &rendered.radiance, Precision::Float)?;
            Ok::<_, TrainError>(vec![image])
        };
        let progress = &mut self.progress;
        let summary = render_views(&job, &shots, &mut ledger, write, &mut |message| {
            let (RenderProgress::Started { done, total }
            | RenderProgress::View { done, total, .. }) = message;
            progress(BakeProgress::Rendering { done, total });
        })?;
        self.num_rays += summary.num_rays;
        if summary.complete {
            ledger.complete()?;
        }
        Ok(summary.complete)
    }

    /// Fits radiance to the images of the work folder; `None` if it was stopped.
    fn fit(&mut self, method: &ViewBake) -> Result<Option<Vec<Vec3>>> {
        let images = Arc::new(Dataset::open(&self.request.work)?);
        let all = (0..images.len()).collect();
        let views = Views::new(vec![(images, all)], IMAGE_BUDGET, self.request.options.seed);
        let state = ParameterState::new(&self.scene);
        let mut backend = backend::new(&self.request.device, state, IMAGE_BUDGET / 2)?;
        let total = method.iterations;
        let rates = LearningRates {
            position: 0.0,
            scale: 0.0,
            rotation: 0.0,
            opacity: 0.0,
            radiance: method.rate,
            emission: 0.0,
            final_share: 0.1,
        };
        let weights = LossWeights {
            color: 1.0,
            ssim_share: 0.2,
            normal: 0.0,
            depth_normal: 0.0,
            emission: 0.0,
            alpha: 0.0,
            depth: 0.0,
        };
        for iteration in 1..=total {
            if self.stopped() {
                return Ok(None);
            }
            let view = views.at(Stage::Radiance, iteration)?;
            let progress = (iteration - 1) as f32 / total as f32;
            let step = RadianceStep {
                iteration,
                weights: &weights,
                normals: NormalTerms::Off,
                antialias: false,
                sizes: StepSizes::radiance(&rates, 0.0, progress),
            };
            let mut taken = backend.radiance_step(&view, &step)?;
            if iteration == total {
                taken.extend(backend.finish()?);
            }
            for step in taken {
                let terms = step.outcome.map_err(|bad| TrainError::Diverged {
                    stage: "bake",
                    iteration: step.iteration,
                    view: step.view.view.name.clone(),
                    what: bad.to_string(),
                })?;
                (self.progress)(BakeProgress::Fitting {
                    iteration: step.iteration,
                    total,
                    loss: terms.total,
                });
            }
        }
        Ok(Some(backend.state()?.gaussians().radiances))
    }
}
