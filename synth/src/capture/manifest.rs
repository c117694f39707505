//! `capture.toml`: which files belong together.

use super::layout::MANIFEST_FILE;
use super::shot::{Shot, position_name};
use crate::error::Result;
use crate::script::SceneScript;
use eagpt_scene::files;
use std::path::Path;

/// Writes the manifest of a capture: one stack for each position and condition.
pub(super) fn write(out: &Path, script: &SceneScript, num_positions: usize) -> Result<()> {
    let mut text = String::from(
        "# Brackets of this capture: position, condition, files in the order they were taken.\n",
    );
    for (condition, name) in script.conditions.iter().enumerate() {
        for position in 0..num_positions {
            let exposures = 0..script.rig.exposures_s.len();
            let files: Vec<String> = exposures
                .map(|exposure| {
                    let shot = Shot {
                        condition,
                        position,
                        exposure,
                    };
                    format!("\"{}\"", shot.file(&script.conditions))
                })
                .collect();
            text += &format!(
                "\n[[stack]]\nposition = \"{}\"\ncondition = \"{name}\"\nfiles = [{}]\n",
                position_name(position),
                files.join(", ")
            );
        }
    }
    Ok(files::write_bytes_atomic(
        &out.join(MANIFEST_FILE),
        text.as_bytes(),
    )?)
}
