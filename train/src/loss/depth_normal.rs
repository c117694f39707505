//! Normals of the surface that the mean distances D̃ span, from central differences of its points.

use super::normal::{MIN_NORMAL_ALPHA, one_minus_cosine};
use eagpt_eval::KnownPixels;
use eagpt_scene::{Camera, Image};
use eagpt_trace::features::{Features, GBuffer, lane};
use glam::Vec3;
use rayon::prelude::*;

/// Derivatives of one pixel's term with respect to the horizontal and vertical differences of
/// points, and to its N.
#[derive(Debug, Clone, Copy, Default)]
struct PixelGradient {
    d_across: Vec3,
    d_down: Vec3,
    d_normal: Vec3,
    value: f32,
    counts: bool,
}

/// Adds `weight · mean(1 − Ñ_d·N)` to the gradient and returns the mean. N is the normal map where
/// it knows one, otherwise the blended Ñ, which then moves too. The image's border is left out, and
/// so is what is not `known`.
pub fn add(
    features: &GBuffer,
    camera: &Camera,
    map: Option<&Image<3>>,
    weight: f64,
    known: Option<&KnownPixels>,
    d_features: &mut [Features],
) -> f64 {
    let (width, height) = (features.width as usize, features.height as usize);
    let directions = directions(camera);
    // The origin drops out of differences.
    let points: Vec<Vec3> = features
        .pixels
        .par_iter()
        .zip(&directions)
        .with_min_len(2048)
        .map(|(s, d)| *d * s.mean_distance())
        .collect();
    let gradients: Vec<PixelGradient> = (0..width * height)
        .into_par_iter()
        .with_min_len(2048)
        .map(|i| {
            let (x, y) = (i % width, i / width);
            let is_border = x == 0 || y == 0 || x + 1 == width || y + 1 == height;
            if is_border || known.is_some_and(|known| !known.has(i)) {
                return PixelGradient::default();
            }
            let solid = [i, i - 1, i + 1, i - width, i + width]
                .iter()
                .all(|&j| features.pixels[j].alpha() > MIN_NORMAL_ALPHA);
            let on_map = map.map(|map| Vec3::from(map.pixels()[i]));
            let on_map = on_map.filter(|normal| *normal != Vec3::ZERO);
            let wanted = on_map.or_else(|| solid_normal(&features.pixels[i]));
            let (true, Some(wanted)) = (solid, wanted) else {
                return PixelGradient::default();
            };
            let across = points[i + 1] - points[i - 1];
            let down = points[i + width] - points[i - width];
            // x right, y down: down × across points back to the camera.
            let normal = down.cross(across);
            if normal.length_squared() <= f32::MIN_POSITIVE {
                return PixelGradient::default();
            }
            let (value, d_depth_normal) = one_minus_cosine(normal, wanted);
            let d_normal = match on_map {
                Some(_) => Vec3::ZERO,
                None => one_minus_cosine(features.pixels[i].normal(), normal.normalize()).1,
            };
            PixelGradient {
                d_across: d_depth_normal.cross(down),
                d_down: across.cross(d_depth_normal),
                d_normal,
                value,
                counts: true,
            }
        })
        .collect();
    let num = gradients.iter().filter(|g| g.counts).count();
    if num == 0 {
        return 0.0;
    }
    let share = (weight / num as f64) as f32;
    d_features
        .par_iter_mut()
        .with_min_len(2048)
        .enumerate()
        .for_each(|(i, d)| {
            let at = |j: Option<usize>| {
                j.and_then(|j| gradients.get(j))
                    .copied()
                    .unwrap_or_default()
            };
            // Border pixels carry zero gradients, so neighbours across the ends of rows add
            // nothing.
            let d_point = at(i.checked_sub(1)).d_across - at(Some(i + 1)).d_across
                + at(i.checked_sub(width)).d_down
                - at(Some(i + width)).d_down;
            for k in 0..3 {
                d.0[lane::NORMAL + k] += share * gradients[i].d_normal[k];
            }
            let alpha = features.pixels[i].alpha();
            if alpha > 0.0 {
                // D̃ = D / A
                let d_mean = share * d_point.dot(directions[i]);
                d.0[lane::DISTANCE] += d_mean / alpha;
                d.0[lane::ALPHA] -= d_mean * features.pixels[i].mean_distance() / alpha;
            }
        });
    gradients.iter().map(|g| f64::from(g.value)).sum::<f64>() / num as f64
}

/// Blended normal Ñ turned by nothing, or `None` where the pixel is too transparent.
fn solid_normal(features: &Features) -> Option<Vec3> {
    (features.alpha() > MIN_NORMAL_ALPHA)
        .then(|| features.unit_normal())
        .filter(|n| *n != Vec3::ZERO)
}

/// Directions of all pixels of a camera.
pub(super) fn directions(camera: &Camera) -> Vec<Vec3> {
    let frame = camera.ray_frame();
    (0..camera.num_pixels() as u32)
        .into_par_iter()
        .map(|i| {
            frame.direction(
                (i % camera.width) as f32 + 0.5,
                (i / camera.width) as f32 + 0.5,
            )
        })
        .collect()
}
