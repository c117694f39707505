//! Domes: balls of which views see what stands out of a mount, as globes half in a wall.

use crate::fit::shades::{EXPLAINED, partly_hidden};
use crate::fit::shape_search::Fit;
use crate::pixels::patches::Patch;
use crate::shape::Shape;
use eagpt_scene::plane::Plane;
use glam::Vec3;

/// Residual of a dome, at most: a rough mount bulges over its edge. Balls have .026 and less where
/// there are domes, and .1 or more where there are discs and drums.
const MAX_RESIDUAL: f32 = 0.03;
/// … and in that of the best drum: 5.4 where there is a dome and its wall is rough, 17 where there
/// is a drum half as high as wide.
const MAX_RATIO: f32 = 9.0;
/// Share of the ball that one view shows, at least: of flatter ones nearly any ball has the edge.
const MIN_SHOWN: f32 = 0.6;
/// Height of the middle of a dome over its mount, in radii, at most either way: a short drum is
/// much like a flatter dome.
const MAX_HEIGHT: f32 = 0.5;

/// The ball in `mount` that explains what `patches` show, if there is one about `centre`, where the
/// best shape with more freedom has this `residual`.
pub(crate) fn fit(
    centre: Vec3,
    radius: f32,
    mount: Plane,
    patches: &[Patch],
    residual: f32,
) -> Option<Fit> {
    // A fit that explains less is that of a ball in a shade, if of one at all.
    if residual > EXPLAINED {
        return None;
    }
    let ball = partly_hidden(centre, radius, patches, MIN_SHOWN)?;
    let Shape::Ball { centre, radius } = ball.shape else {
        return None;
    };
    let is_mounted = mount.height(centre).abs() <= MAX_HEIGHT * radius;
    let is_explained = ball.residual <= MAX_RESIDUAL.min(MAX_RATIO * residual);
    (is_mounted && is_explained).then_some(ball)
}
