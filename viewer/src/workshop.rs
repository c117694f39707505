//! Means of a server's jobs: a device, and the options of its bakes.

use crate::error::Result;
use eagpt_scene::{Gaussians, ply};
use eagpt_trace::Device;
use eagpt_train::bake::{BakeOptions, BakeProgress, BakeRequest, bake};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Means and options of the jobs of a server.
#[derive(Debug)]
pub struct Workshop {
    /// Device of all jobs.
    pub device: Device,
    /// Dataset whose cameras bakes are for; without one nothing is baked.
    pub cameras: Option<PathBuf>,
    /// Options of bakes.
    pub options: BakeOptions,
    /// Folder of stills; created when there is one.
    pub stills: PathBuf,
}

impl Workshop {
    /// `scene` with its light baked, to the bit as `eagpt bake` does of its file; `None` if `stop`
    /// was set. `tell` gets what is done, and the share of that.
    ///
    /// # Errors
    /// As [`bake`]; if there is no folder for temporary files.
    pub(crate) fn bake(
        &self,
        scene: &Gaussians,
        stop: &Arc<AtomicBool>,
        tell: &mut dyn FnMut(&str, f64),
    ) -> Result<Option<Gaussians>> {
        let Some(cameras) = &self.cameras else {
            return Ok(None);
        };
        let folder = tempfile::tempdir()?;
        let place = |name: &str| folder.path().join(name);
        ply::write_gaussians(&place("edited.ply"), scene)?;
        let request = BakeRequest {
            scene: place("edited.ply"),
            cameras: cameras.clone(),
            out: place("baked.ply"),
            work: place("work"),
            transport: None,
            per_light: None,
            options: self.options,
            device: self.device.clone(),
            start_over: true,
            stop: Arc::clone(stop),
        };
        let share = |done: usize, total: usize| done as f64 / total.max(1) as f64;
        let summary = bake(&request, &mut |progress| match progress {
            BakeProgress::Looking { done, total } => {
                tell("looking for surfaces", share(done, total));
            }
            BakeProgress::Gathering { done, total } => {
                tell("gathering light", share(done, total));
            }
            BakeProgress::Bounced { .. } => tell("adding bounces", 1.0),
            BakeProgress::Warning { text } => tracing::debug!("bake: {text}"),
            BakeProgress::Rendering { .. } | BakeProgress::Fitting { .. } => {}
        })?;
        let baked = summary.scene.map(|path| ply::read_gaussians(&path));
        Ok(baked.transpose()?)
    }
}
