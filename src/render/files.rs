//! The files of a rendering.

use super::RenderArgs;
use super::aov::Seen;
use super::shots::Shots;
use crate::output;
use anyhow::Result;
use eagpt_render::Shot;
use eagpt_scene::dataset::TRANSFORMS_FILE;
use eagpt_scene::exr::{self, Precision};
use eagpt_scene::tonemap::Display;
use eagpt_scene::{Shard, png};
use eagpt_trace::{RenderedView, Tracer};
use std::path::{Path, PathBuf};

/// Everything that will be written, relative to the output folder.
pub(super) fn all(args: &RenderArgs, shots: &Shots) -> Vec<PathBuf> {
    let shown = shots.list.iter().flat_map(|shot| of_shot(args, shot));
    let cameras = shots.path.as_ref().map(|_| TRANSFORMS_FILE.into());
    shown.chain(cameras).collect()
}

/// The files of all views of a shard, relative to the folder of the result.
pub(super) fn of_shard(args: &RenderArgs, shard: Shard, shots: &Shots) -> Vec<PathBuf> {
    let shots = shots.of_shard(shard);
    shots.flat_map(|shot| of_shot(args, shot)).collect()
}

/// The files of one picture.
pub(super) fn of_shot(args: &RenderArgs, shot: &Shot) -> Vec<PathBuf> {
    let mut files = Vec::new();
    if writes_exr(args) {
        files.push(exr_name(&shot.name));
    }
    files.push(png_name(&shot.name));
    for aov in &args.aov {
        let dir = Path::new(aov.name());
        files.push(dir.join(exr_name(&shot.name)));
        if aov.has_picture() {
            files.push(dir.join(png_name(&shot.name)));
        }
    }
    files
}

/// Views of a dataset are data, to be measured; frames of a path are pictures, unless more is asked
/// for.
fn writes_exr(args: &RenderArgs) -> bool {
    args.path.exr || args.path.camera_path.is_none()
}

// Not `Path::with_extension`: that would take the ".5" off a view called "a.5".
fn exr_name(view: &str) -> PathBuf {
    format!("{view}.exr").into()
}

fn png_name(view: &str) -> PathBuf {
    format!("{view}.png").into()
}

/// Writes the files of one picture, and returns their paths relative to the folder.
pub(super) fn write(
    args: &RenderArgs,
    display: &Display,
    scene: &dyn Tracer,
    (shot, rendered): (&Shot, &RenderedView),
) -> Result<Vec<PathBuf>> {
    let name = &shot.name;
    let picture = &rendered.radiance;
    if writes_exr(args) {
        let path = output::place(&args.out, &exr_name(name))?;
        exr::write_rgb(&path, picture, Precision::for_picture(picture))?;
    }
    let path = output::place(&args.out, &png_name(name))?;
    png::write_srgb8(&path, &display.shown(picture))?;
    let rays = (&shot.camera, args.antialias);
    let seen = Seen::new(&args.aov, &rendered.features, scene, rays)?;
    for aov in &args.aov {
        let dir = args.out.join(aov.name());
        let exr_path = output::place(&dir, &exr_name(name))?;
        let png_path = output::place(&dir, &png_name(name))?;
        aov.write(&shot.camera, &seen, &exr_path, &png_path)?;
    }
    Ok(of_shot(args, shot))
}
