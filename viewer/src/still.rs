//! Path-traced pictures of what a page shows.

use crate::error::{Result, ViewerError};
use crate::workshop::Workshop;
use eagpt_render::{RenderJob, Shot};
use eagpt_scene::camera_path::CameraPath;
use eagpt_scene::exr::{self, Precision};
use eagpt_scene::tonemap::{Display, ToneMap};
use eagpt_scene::{Gaussians, files, png};
use eagpt_trace::transport::{MAX_BOUNCES, ROULETTE_FROM};
use eagpt_trace::{CameraRays, Integrator, LightOptions};
use serde::Deserialize;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::time::Instant;

/// Most pixels along an axis.
const MAX_SIZE: u32 = 4096;
/// Most samples of a pixel.
const MAX_SAMPLES: u32 = 4096;
/// Factor by which a first picture, which tells how long the other will take, is smaller along each
/// axis.
const FIRST_REDUCTION: u32 = 8;

/// A picture to be made.
#[derive(Debug, Clone, Deserialize)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
pub(crate) struct StillRequest {
    /// Where it is seen from: a `camera_path.json` of one frame ([`eagpt_scene::camera_path`]).
    pub path: Value,
    /// Samples of a pixel, 1 to 4096.
    pub samples: u32,
    /// Stops.
    pub exposure: f32,
    /// Name of a tone map.
    pub tone_map: String,
}

impl StillRequest {
    /// Exposure and tone map of the PNG.
    ///
    /// # Errors
    /// [`ViewerError::Script`] if there is no such tone map.
    fn display(&self) -> Result<Display> {
        let named = |map: &ToneMap| map.to_string() == self.tone_map;
        let found = ToneMap::ALL.into_iter().map(|(map, _)| map).find(named);
        let Some(tone_map) = found else {
            let name = self.tone_map.escape_debug();
            return Err(ViewerError::Still(format!("tone map: no `{name}`")));
        };
        Ok(Display {
            stops: self.exposure,
            tone_map,
        })
    }

    /// The one frame, and the text of the path.
    fn shot(&self, file: &Path) -> Result<(Shot, Vec<u8>)> {
        let text = serde_json::to_vec_pretty(&self.path)?;
        let path = CameraPath::of_nerfstudio(file, &text)?;
        let (width, height) = path.size();
        if width > MAX_SIZE || height > MAX_SIZE {
            let problem = format!("{width} × {height} pixels, more than {MAX_SIZE}");
            return Err(ViewerError::Still(problem));
        }
        let [camera] = path.cameras[..] else {
            let num = path.cameras.len();
            return Err(ViewerError::Still(format!("{num} frames, not 1")));
        };
        let shot = Shot {
            name: "still".to_owned(),
            camera,
            seed: 0,
        };
        Ok((shot, text))
    }

    /// Checks a request before it waits for its turn.
    ///
    /// # Errors
    /// [`ViewerError`] naming what cannot be: samples, size, camera, tone map.
    pub(crate) fn check(&self) -> Result<()> {
        if !(1..=MAX_SAMPLES).contains(&self.samples) {
            let problem = format!("{} samples are not 1 to {MAX_SAMPLES}", self.samples);
            return Err(ViewerError::Still(problem));
        }
        if !self.exposure.is_finite() {
            return Err(ViewerError::Still("exposure: no number".to_owned()));
        }
        self.display()?;
        self.shot(Path::new("camera"))?;
        Ok(())
    }
}

/// The files of a still: `file`, a PNG; the light beside it; and the camera, for `eagpt render
/// --camera-path`, which makes the same picture of the same scene.
pub(crate) fn files_of(file: &Path) -> [PathBuf; 3] {
    ["png", "exr", "json"].map(|extension| file.with_extension(extension))
}

impl Workshop {
    /// Path-traces a picture of `scene` as `eagpt render --mode path` does, and writes its files.
    /// `expected` is told the seconds that it will take, after a picture with few of its pixels.
    ///
    /// # Errors
    /// As [`StillRequest::check`]; if the device fails, or a file cannot be written.
    pub(crate) fn still(
        &self,
        scene: &Gaussians,
        request: &StillRequest,
        file: &Path,
        expected: &mut dyn FnMut(f64),
    ) -> Result<()> {
        let [png_file, exr_file, path_file] = files_of(file);
        let (shot, path) = request.shot(&path_file)?;
        let tracer = self.device.scene(scene)?;
        let job = RenderJob {
            scene: tracer.as_ref(),
            integrator: Integrator::Path {
                num_samples: request.samples.div_ceil(CameraRays::RAYS_PER_AXIS.pow(2)),
                max_bounces: MAX_BOUNCES,
                roulette_from: Some(ROULETTE_FROM),
            },
            light: LightOptions::default(),
            rays_per_axis: CameraRays::RAYS_PER_AXIS,
            denoiser: None,
            stop: &AtomicBool::new(false),
        };
        let first = Shot {
            camera: shot.camera.resized(
                shot.camera.width.div_ceil(FIRST_REDUCTION),
                shot.camera.height.div_ceil(FIRST_REDUCTION),
            ),
            ..shot.clone()
        };
        let started = Instant::now();
        job.render(&first)?;
        let pixels = |shot: &Shot| shot.camera.num_pixels() as f64;
        expected(started.elapsed().as_secs_f64() * pixels(&shot) / pixels(&first));
        let (rendered, _) = job.render(&shot)?;
        let picture = &rendered.radiance;
        files::create_dir(png_file.parent().unwrap_or(Path::new("")))?;
        exr::write_rgb(&exr_file, picture, Precision::for_picture(picture))?;
        files::write_bytes_atomic(&path_file, &path)?;
        png::write_srgb8(&png_file, &request.display()?.shown(picture))?;
        Ok(())
    }
}
