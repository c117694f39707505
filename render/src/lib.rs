//! Rendering of many views of a scene: antialiasing, denoising, and a ledger of the views that are
//! done, by which a stopped job resumes.
//!
//! [`render_views`] is the job. Its caller writes the files: a rendering for people differs in
//! them from one that light is fitted to.

mod denoise;

use eagpt_denoise::{DenoiseError, Denoiser};
use eagpt_scene::files::Ledger;
use eagpt_scene::{Camera, SceneError};
use eagpt_trace::{Integrator, LightOptions, RenderedView, TraceError, Tracer};
use serde::Serialize;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// Failure of a rendering.
#[derive(Debug, thiserror::Error)]
pub enum RenderError {
    /// A file could not be read or written.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The device failed.
    #[error(transparent)]
    Trace(#[from] TraceError),
    /// The denoiser failed.
    #[error(transparent)]
    Denoise(#[from] DenoiseError),
}

/// A view to render.
#[derive(Debug, Clone, Serialize)]
pub struct Shot {
    /// Name of its files without extension; may contain "/".
    pub name: String,
    /// Its camera.
    pub camera: Camera,
    /// Seed of its random numbers.
    #[serde(skip)]
    pub seed: u64,
}

/// Options that all views have in common.
#[derive(Clone, Copy)]
pub struct RenderJob<'a> {
    /// The scene.
    pub scene: &'a dyn Tracer,
    /// Light transport; samples are those of a ray.
    pub integrator: Integrator,
    /// Light sampling; the seed is that of each view.
    pub light: LightOptions,
    /// Rays along each axis of a pixel, at least 1.
    pub rays_per_axis: u32,
    /// Denoiser of the images, for integrators that sample light.
    pub denoiser: Option<&'a Denoiser>,
    /// Stops the job after the view under way.
    pub stop: &'a AtomicBool,
}

/// Progress of [`render_views`].
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case", tag = "message")]
pub enum RenderProgress {
    /// The job starts.
    Started {
        /// Views done by earlier processes.
        done: usize,
        /// All views.
        total: usize,
    },
    /// A view is done.
    View {
        /// Its name.
        view: String,
        /// Views done.
        done: usize,
        /// All views.
        total: usize,
        /// Wall time of the view.
        seconds: f64,
    },
}

/// Outcome of [`render_views`].
#[derive(Debug, Clone, Default)]
pub struct RenderSummary {
    /// Whether all views are done; else the job was stopped.
    pub complete: bool,
    /// Views that are done with the wall time of each, in the order of the shots.
    pub views: Vec<(String, f64)>,
    /// Wall time of the denoiser.
    pub denoising_seconds: f64,
    /// Rays traced by this process, those of cameras left out.
    pub num_rays: u64,
}

/// Renders the views that `ledger` does not list as done. `write` writes the files of a view and
/// returns their paths, relative to the ledger's folder.
///
/// # Errors
/// [`RenderError`], or the error of `write`.
pub fn render_views<E: From<RenderError>>(
    job: &RenderJob<'_>,
    shots: &[Shot],
    ledger: &mut Ledger,
    mut write: impl FnMut(&Shot, &RenderedView) -> Result<Vec<PathBuf>, E>,
    progress: &mut dyn FnMut(RenderProgress),
) -> Result<RenderSummary, E> {
    let total = shots.len();
    let mut summary = RenderSummary::default();
    let is_done = |shot: &&Shot| ledger.done(&shot.name).is_some();
    let mut done = shots.iter().filter(is_done).count();
    progress(RenderProgress::Started { done, total });
    for shot in shots {
        if let Some(item) = ledger.done(&shot.name) {
            summary.views.push((shot.name.clone(), item.seconds));
            continue;
        }
        if job.stop.load(Ordering::Relaxed) {
            return Ok(summary);
        }
        let started = Instant::now();
        let (rendered, denoising_seconds) = job.render(shot)?;
        summary.denoising_seconds += denoising_seconds;
        summary.num_rays += rendered.num_rays;
        let files = write(shot, &rendered)?;
        let seconds = started.elapsed().as_secs_f64();
        ledger
            .add(&shot.name, seconds, &files)
            .map_err(RenderError::from)?;
        summary.views.push((shot.name.clone(), seconds));
        done += 1;
        progress(RenderProgress::View {
            view: shot.name.clone(),
            done,
            total,
            seconds,
        });
    }
    summary.complete = true;
    Ok(summary)
}

impl RenderJob<'_> {
    /// Renders a view, and the seconds that the denoiser took.
    ///
    /// # Errors
    /// If the device or the denoiser fails.
    pub fn render(&self, shot: &Shot) -> Result<(RenderedView, f64), RenderError> {
        let camera = shot.camera.magnified(self.rays_per_axis);
        let light = LightOptions {
            seed: shot.seed,
            ..self.light
        };
        let rays = self.scene.render(&camera, &self.integrator, &light)?;
        let mut pixels = rays.averaged(self.rays_per_axis);
        let Some(denoiser) = self.denoiser else {
            return Ok((pixels, 0.0));
        };
        let started = Instant::now();
        pixels.radiance = denoise::denoised(self, denoiser, &camera, &rays, &pixels)?;
        Ok((pixels, started.elapsed().as_secs_f64()))
    }
}
