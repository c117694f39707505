//! Whether views show a lamp as large and as often as they would if it were there: a glint on a
//! table is as bright as a lamp, but only from where it mirrors one. Of a lamp in a mirror, lines of
//! sight meet behind the mirror.

use crate::evidence::Evidence;
use crate::fit::shape_search::Fit;
use crate::group::Group;
use crate::pixels::patches::depth_tolerance;
use crate::pixels::silhouette::Gaps;
use eagpt_trace::{Ray, TraceError, Tracer};
use glam::Vec3;

/// Share of the pixels that a lamp would have which views have to show.
const MIN_SHARE: f32 = 0.4;
/// Mean width of a lamp in pixels, at least, in views that have to show it.
const MIN_WIDTH: f32 = 1.5;
/// Rays to a lamp from each camera, along each axis of a square across it.
const GRID: u16 = 24;
/// A lamp is hidden where the scene is nearer by this share of its distance: as trained, it may
/// be some way before the lamp's clean surface. A shade is as near as the fit of its bulb has it.
const HIDDEN: f32 = 0.1;
/// Share of the distance of a lamp below which a surface mirrors it, if the scene has most of its
/// pixels there: glass, bars and what training makes of a lamp are nearer to it.
const MIRROR: f32 = 0.75;

/// Whether the views of `evidence` in a `light`, whose scene `tracer` traces, show enough of what
/// they would of a lamp of `fit` to have `group` be one, whose pixels are in that light.
///
/// # Errors
/// If the device fails.
pub(crate) fn is_seen(
    evidence: &Evidence,
    (light, group): (usize, &Group),
    fit: &Fit,
    tracer: &dyn Tracer,
) -> Result<bool, TraceError> {
    let shape = &fit.shape;
    let is_mirrored = group.share(evidence, |sight, pixel| {
        pixel.distance < MIRROR * shape.centre().distance(sight.origin())
    });
    if is_mirrored > 0.5 {
        return Ok(false);
    }
    let half = 0.5 * shape.size().length();
    let step = 2.0 * half / f32::from(GRID);
    let (mut rays, mut expected) = (Vec::new(), Vec::new());
    let cameras = evidence.cameras.iter().filter(|(of, _)| *of == light);
    for (_, camera) in cameras {
        let origin = camera.origin();
        let towards = shape.centre() - origin;
        let pixel_width = towards.dot(camera.forward()) / camera.fx as f32;
        let Some(towards) = towards.try_normalize().filter(|_| pixel_width > 0.0) else {
            continue;
        };
        let (right, up) = towards.any_orthonormal_pair();
        let place = |i: u16| (f32::from(i) + 0.5) * step - half;
        let aims = (0..GRID * GRID)
            .map(|i| shape.centre() + right * place(i % GRID) + up * place(i / GRID));
        let met: Vec<(Vec3, f32)> = aims
            .filter(|aim| camera.is_in_picture(camera.project(*aim)))
            .filter_map(|aim| {
                let direction = (aim - origin).try_normalize()?;
                Some((direction, shape.meet(origin, direction)?))
            })
            .collect();
        let free = match fit.gaps {
            Gaps::Shade => 1.0 / (1.0 + depth_tolerance(1.0 / camera.fx as f32)),
            Gaps::Seen | Gaps::Bars => 1.0 - HIDDEN,
        };
        // Pixels that a cell of the square covers along `direction`, by solid angles: both are seen
        // smaller off their axes.
        let cell = step * step / (shape.centre() - origin).length_squared();
        let pixel = (camera.fx * camera.fy).recip() as f32;
        let pixels = |direction: Vec3| {
            let [to_centre, forward] = [towards, camera.forward()].map(|v| direction.dot(v));
            cell / pixel * (to_centre / forward).powi(3)
        };
        // Masks leave out what fills no pixel.
        let area = met.len() as f32 * step * step;
        if area < MIN_WIDTH * pixel_width * shape.size().max_element() {
            continue;
        }
        for (direction, distance) in met {
            rays.push(Ray::free(origin.to_array(), direction.to_array()));
            expected.push((distance * free, pixels(direction)));
        }
    }
    let met = tracer.trace_rays(&rays)?;
    let shown = |(features, (nearest, num)): (&eagpt_trace::Features, &(f32, f32))| {
        let is_free = features.alpha() < 0.5 || features.mean_distance() > *nearest;
        if is_free { *num } else { 0.0 }
    };
    let expected: f32 = met.iter().zip(&expected).map(shown).sum();
    let weights = group.members.iter().map(|m| evidence.pixel(m).1.weight);
    Ok(weights.sum::<f32>() >= MIN_SHARE * expected)
}
