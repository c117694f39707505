//! Names and places of files, and what is true of them.

use super::shot::{Shot, position_name};
use super::{Parts, Simulation, SynthOptions};
use crate::error::Result;
use crate::lamps::lamps;
use crate::script::SceneScript;
use eagpt_colmap::model::Similarity;
use eagpt_scene::dataset::{
    ALBEDO_DIR, DEPTH_DIR, EMISSION_DIR, NORMAL_DIR, POINTS_FILE, RADIANCE_DIR, ROUGHNESS_DIR,
    SPECULAR_DIR, TRANSFORMS_FILE,
};
use eagpt_scene::lens::Lens;
use eagpt_scene::{SceneError, files};
use serde_json::json;
use std::path::PathBuf;

/// The manifest of the capture.
pub(super) const MANIFEST_FILE: &str = "capture.toml";
/// Everything that is true of the capture.
const TRUTH_FILE: &str = "synth.json";

/// All files that [`super::simulate`] writes, relative to its folder.
pub fn outputs(script: &SceneScript, options: &SynthOptions) -> Vec<PathBuf> {
    let num_views = options.plan(script).num_views as usize;
    let mut files = vec![PathBuf::from(TRUTH_FILE)];
    for (condition, name) in script.conditions.iter().enumerate() {
        if options.parts != Parts::Truth {
            for position in 0..num_views {
                let exposures = 0..script.rig.exposures_s.len();
                files.extend(exposures.map(|exposure| {
                    let shot = Shot {
                        condition,
                        position,
                        exposure,
                    };
                    PathBuf::from(shot.file(&script.conditions))
                }));
            }
        }
        if options.parts != Parts::Capture {
            let dir = PathBuf::from("truth").join(name);
            files.extend([TRANSFORMS_FILE, POINTS_FILE].map(|file| dir.join(file)));
            for folder in [
                RADIANCE_DIR,
                EMISSION_DIR,
                NORMAL_DIR,
                DEPTH_DIR,
                ALBEDO_DIR,
                SPECULAR_DIR,
                ROUGHNESS_DIR,
            ] {
                let file = |index| {
                    dir.join(folder)
                        .join(format!("{}.exr", position_name(index)))
                };
                files.extend((0..num_views).map(file));
            }
        }
    }
    if options.parts != Parts::Truth {
        files.push(PathBuf::from(MANIFEST_FILE));
        files.extend(super::model::files());
    }
    files
}

/// Writes what is true of the capture.
pub(super) fn write_truth(
    job: &Simulation<'_>,
    lens: Option<&Lens>,
    model_from_world: Option<Similarity>,
) -> Result<()> {
    let rig = &job.script.rig;
    let [width, height] = job.options.plan(job.script).size;
    let value = json!({
        "scene": {
            "title": job.script.title,
            "file": job.script.path,
            "blake3": job.script.blake3,
            "num_surfaces": job.script.room.surfaces().len(),
        },
        "conditions": job.script.conditions,
        "lamps": lamps(&job.script.room, &job.script.conditions),
        "num_views": job.cameras.len(),
        "size": [width, height],
        "sensor_size": [width * rig.oversampling, height * rig.oversampling],
        "rig": rig,
        "camera_from_rec709": rig.camera_from_rec709(),
        "as_shot_neutral": rig.as_shot_neutral(),
        "radiance_of_clipping_at_1s": job.sensor.clip_of_second(),
        "electrons_of_step": job.sensor.electrons_of_step(),
        "lens": lens.map(|lens| json!({ "model": lens.model().name(), "params": lens.params() })),
        "model_from_world": model_from_world,
        "options": job.options,
    });
    let path = job.out.join(TRUTH_FILE);
    let mut text = serde_json::to_vec_pretty(&value)
        .map_err(|error| SceneError::invalid(&path, "JSON", error.to_string()))?;
    text.push(b'\n');
    Ok(files::write_bytes_atomic(&path, &text)?)
}
