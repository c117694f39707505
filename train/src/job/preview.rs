//! Pictures of a run: captured and rendered side by side.

use super::folder::Folder;
use crate::backend::{Backend, TrainingView};
use crate::error::Result;
use crate::options::Stage;
use eagpt_eval::{KnownPixels, psnr_srgb};
use eagpt_scene::color::srgb8_from_linear;
use eagpt_scene::{Image, View, files, png};

/// Columns of black between the two pictures.
const GAP: usize = 4;

/// Writes `<stage>-<iteration>-<view>.png` for every view, with `<light>-` before the view for
/// other lights than the first, and returns the mean PSNR (clipped sRGB, dB). Stage 1 shows the
/// albedo beside the photograph.
///
/// # Errors
/// If the device fails or a file cannot be written.
pub(super) fn write(
    folder: &Folder,
    backend: &mut dyn Backend,
    views: &[TrainingView],
    stage: Stage,
    iteration: u32,
) -> Result<f64> {
    let dir = folder.previews();
    files::create_dir(&dir)?;
    let mut total = 0.0;
    for training in views {
        let view = &training.view;
        backend.show_light(training.light)?;
        let features = backend.gbuffer(&view.camera)?;
        let rendered = features.radiance();
        total += psnr(view, &rendered);
        let shown = match stage {
            Stage::Radiance => rendered,
            Stage::Albedo => features.extract(|s| s.albedo().to_array()),
        };
        let name = format!(
            "{}-{iteration:06}-{}{}.png",
            stage.name(),
            folder.prefix(training.light),
            view.name.replace('/', "_")
        );
        let (width, height, bytes) = side_by_side(&view.radiance, &shown);
        png::write_rgb8(&dir.join(name), width, height, &bytes)?;
    }
    Ok(total / views.len().max(1) as f64)
}

/// PSNR of the pixels that are known; of nothing 0.
fn psnr(view: &View, rendered: &Image<3>) -> f64 {
    let Some(valid) = &view.valid else {
        return psnr_srgb(&view.radiance, rendered);
    };
    let known = KnownPixels::new(valid);
    let pair = known.of(&view.radiance).zip(known.of(rendered));
    pair.map_or(0.0, |(reference, rendered)| {
        psnr_srgb(&reference, &rendered)
    })
}

fn side_by_side(left: &Image<3>, right: &Image<3>) -> (u32, u32, Vec<u8>) {
    let mut bytes = Vec::new();
    for y in 0..left.height() {
        for image in [left, right] {
            for x in 0..image.width() {
                bytes.extend(image.get(x, y).map(srgb8_from_linear));
            }
            if std::ptr::eq(image, left) {
                bytes.extend([0; 3 * GAP]);
            }
        }
    }
    (
        left.width() + right.width() + GAP as u32,
        left.height(),
        bytes,
    )
}
