//! The job: a scene file in, a capture and its truth out.

mod layout;
mod manifest;
mod model;
mod options;
mod points;
mod shot;

pub use layout::outputs;
pub use options::{LightMethod, Parts, SynthOptions};

use crate::dng::{self, DngInfo};
use crate::error::Result;
use crate::light::{Cache, CacheOptions, Lighting};
use crate::photograph::{Photograph, Sampling};
use crate::rig::Sensor;
use crate::script::{CameraPlan, SceneScript};
use eagpt_scene::dataset::{DatasetInfo, DatasetWriter, UpAxis};
use eagpt_scene::exr::Precision;
use eagpt_scene::lens::Lens;
use eagpt_scene::rng::{Purpose, RandomKey};
use eagpt_scene::{Camera, files};
use model::ModelSource;
use points::PointSource;
use rayon::prelude::*;
use serde::Serialize;
use shot::{Shot, position_name};
use std::path::{Path, PathBuf};

/// When the first shot is taken, by the camera's clock: 2026-03-01 10:00:00.
const FIRST_SHOT_MS: u64 = 1_772_359_200_000;
/// Time between shots of a bracket, beside their exposures.
const BETWEEN_SHOTS_MS: u64 = 250;
/// Time to carry the tripod to the next position.
const BETWEEN_POSITIONS_MS: u64 = 20_000;
/// Time between conditions.
const BETWEEN_CONDITIONS_MS: u64 = 1_800_000;

/// Progress of a simulation.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "message", rename_all = "snake_case")]
pub enum SynthProgress {
    /// The light of the room has been solved.
    Lit {
        /// Cells of its surfaces.
        num_cells: usize,
    },
    /// Views have been photographed.
    Photographing {
        /// Views done.
        done: usize,
        /// Views of the job.
        total: usize,
    },
}

/// Result of a simulation.
#[derive(Debug, Clone, PartialEq)]
pub struct SynthSummary {
    /// All files, relative to the folder.
    pub files: Vec<PathBuf>,
    /// Number of positions.
    pub num_views: usize,
    /// Number of RAW files.
    pub num_shots: usize,
}

/// Photographs a scene into `out`, which is created; files that are there are replaced.
///
/// # Errors
/// [`crate::SynthError`] for an option that cannot be or a file that cannot be written.
pub fn simulate(
    script: &SceneScript,
    out: &Path,
    options: &SynthOptions,
    progress: &mut dyn FnMut(SynthProgress),
) -> Result<SynthSummary> {
    options.validate()?;
    let plan = options.plan(script);
    let mut lighting = Lighting::new(&script.room);
    if options.light == LightMethod::Cached {
        let key = RandomKey::new(options.seed, Purpose::Simulate, u32::MAX);
        let cache = Cache::solve(&lighting, key, &CacheOptions::default());
        let num_cells = cache.num_cells();
        lighting.cache = Some(cache);
        progress(SynthProgress::Lit { num_cells });
    }
    let cameras = plan.cameras();
    let margin = match cameras.first() {
        // Without a capture, too: the truth is the same whatever is written.
        Some(camera) => script.rig.margin(camera)?,
        None => 0,
    };
    let job = Simulation {
        script,
        out,
        options,
        sensor: Sensor::new(&script.rig, script.room.brightest()),
        lighting,
        cameras,
        margin,
    };
    job.run(&plan, progress)
}

struct Simulation<'a> {
    script: &'a SceneScript,
    out: &'a Path,
    options: &'a SynthOptions,
    lighting: Lighting<'a>,
    sensor: Sensor,
    cameras: Vec<Camera>,
    /// Pixels that the lens sees beyond the edges of the truth.
    margin: u32,
}

impl Simulation<'_> {
    fn run(
        &self,
        plan: &CameraPlan,
        progress: &mut dyn FnMut(SynthProgress),
    ) -> Result<SynthSummary> {
        let (parts, total) = (self.options.parts, self.cameras.len());
        let mut truths = Vec::new();
        if parts.has_truth() {
            for condition in &self.script.conditions {
                let dir = self.out.join("truth").join(condition);
                truths.push(DatasetWriter::create(&dir, Precision::Half)?);
            }
        }
        if parts.has_capture() {
            for condition in &self.script.conditions {
                files::create_dir(&self.out.join(condition))?;
            }
        }
        let lens = match self.cameras.first() {
            Some(camera) if parts.has_capture() => Some(self.script.rig.lens(camera)?),
            _ => None,
        };
        let mut model = lens.map(|lens| ModelSource::new(self, lens));
        let mut points = PointSource::new(self.options, total, self.script.conditions.len());
        for (index, camera) in self.cameras.iter().enumerate() {
            let photograph = self.photograph(index, camera);
            for (condition, writer) in truths.iter_mut().enumerate() {
                let view = photograph.view(condition, &position_name(index));
                points.look(index, condition, &view);
                writer.write_view(&view)?;
            }
            if let (Some(model), Some(lens)) = (&mut model, &lens) {
                model.look(self, index, &photograph);
                self.shoot(index, (&photograph, lens), plan)?;
            }
            progress(SynthProgress::Photographing {
                done: index + 1,
                total,
            });
        }
        for (writer, cloud) in truths.into_iter().zip(points.clouds()) {
            writer.write_points(&cloud)?;
            writer.finish(&DatasetInfo {
                up_axis: Some(UpAxis::Z),
                metres_per_unit: Some(1.0),
                ..DatasetInfo::default()
            })?;
        }
        if parts.has_capture() {
            manifest::write(self.out, self.script, total)?;
        }
        let model_from_world = match model {
            Some(model) => Some(model.write(self)?),
            None => None,
        };
        layout::write_truth(self, lens.as_ref(), model_from_world)?;
        let num_exposures = self.script.rig.exposures_s.len();
        Ok(SynthSummary {
            files: outputs(self.script, self.options),
            num_views: total,
            num_shots: if parts.has_capture() {
                total * self.script.conditions.len() * num_exposures
            } else {
                0
            },
        })
    }

    fn photograph(&self, index: usize, camera: &Camera) -> Photograph {
        let sampling = Sampling {
            num_samples: self.options.num_samples,
            num_cells: self.script.rig.oversampling,
            margin: self.margin,
            noise: self.options.noise,
        };
        let key = RandomKey::new(self.options.seed, Purpose::Simulate, index as u32);
        Photograph::take(&self.lighting, camera, sampling, key)
    }

    /// Takes the brackets of a position.
    fn shoot(
        &self,
        position: usize,
        (photograph, lens): (&Photograph, &Lens),
        plan: &CameraPlan,
    ) -> Result<()> {
        let rig = &self.script.rig;
        let camera = photograph.fine_camera();
        let mut on_sensor = Vec::new();
        for condition in 0..self.script.conditions.len() {
            let light = photograph.fine(condition);
            on_sensor.push(if rig.is_straight() {
                light.clone()
            } else {
                rig.through_lens(light, &camera, lens)?
            });
        }
        let shots = (0..self.script.conditions.len()).flat_map(|condition| {
            (0..rig.exposures_s.len()).map(move |exposure| Shot {
                condition,
                position,
                exposure,
            })
        });
        let shots: Vec<Shot> = shots.collect();
        shots.into_par_iter().try_for_each(|shot| {
            let exposure_s = rig.exposures_s[shot.exposure];
            let number = (shot.condition * self.cameras.len() + position) as u32;
            let key = RandomKey::new(self.options.seed, Purpose::Capture, number);
            let light = &on_sensor[shot.condition];
            let mosaic = self
                .sensor
                .expose(light, exposure_s, (key, shot.exposure as u32));
            let info = DngInfo {
                make: rig.make.clone(),
                model: rig.model.clone(),
                cfa: rig.cfa(),
                black: [rig.black; 4],
                white: rig.white,
                as_shot_neutral: rig.as_shot_neutral(),
                camera_from_xyz: rig.camera_from_xyz,
                exposure_s: Some(exposure_s),
                iso: rig.iso,
                f_number: rig.f_number,
                focal_length_mm: round_to(rig.focal_length_mm(plan.fov_x_rad), 0.1),
                taken_ms: self.taken_ms(shot),
            };
            let path = self.out.join(shot.file(&self.script.conditions));
            dng::write(&path, &mosaic, &info)
        })?;
        Ok(())
    }

    /// When a shot begins: brackets, positions and conditions one after the other.
    fn taken_ms(&self, shot: Shot) -> u64 {
        let length = |seconds: &f64| (seconds * 1e3) as u64 + BETWEEN_SHOTS_MS;
        let exposures = &self.script.rig.exposures_s;
        let bracket: u64 = exposures.iter().map(length).sum();
        let before: u64 = exposures[..shot.exposure].iter().map(length).sum();
        let position = bracket + BETWEEN_POSITIONS_MS;
        let condition = position * self.cameras.len() as u64 + BETWEEN_CONDITIONS_MS;
        FIRST_SHOT_MS + condition * shot.condition as u64 + position * shot.position as u64 + before
    }
}

fn round_to(value: f64, step: f64) -> f64 {
    (value / step).round() * step
}

#[cfg(test)]
mod tests;
