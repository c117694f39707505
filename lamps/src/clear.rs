//! Gaussians in the way of a clean lamp: those that it replaces, and what stands in front of it
//! although cameras see it.

use crate::candidates::Candidate;
use crate::evidence::{Evidence, Lit, Pixel, Sight};
use crate::fit::shape_search::Fit;
use crate::pixels::silhouette::Gaps;
use crate::shape::{Flat, Shape};
use eagpt_scene::color::luminance;
use eagpt_scene::lamps::{BOX_MARGIN, emits};
use eagpt_scene::{Gaussians, SceneEdit};
use eagpt_trace::{Device, TraceError};
use glam::Vec3;

/// Grows the box of a lamp beyond [`BOX_MARGIN`], in sizes of the Gaussian that may lie in it.
const SIZE_MARGIN: f32 = 1.0;
/// Radiance over that of a clean lamp beside it from which on a Gaussian is no surface that the
/// lamp lights: of a wall that a panel touches at a right angle it covers half of the view.
const AS_BRIGHT: f32 = 0.5;
/// Opaque pixels' worth of weight that a Gaussian may have before lit pixels.
const MAX_BEFORE: f32 = 0.05;
/// Share of a Gaussian's weight in lit pixels from which on it is a part of what it shows there.
const SHARE_LIT: f32 = 0.6;

/// Marks the Gaussians that clean lamps replace: those that emit, and what is as bright as a lamp
/// whose light nothing bounds. Returns how many emit at each lamp.
pub(crate) fn replaced(
    gaussians: &Gaussians,
    lamps: &[Candidate],
    keep: &mut [bool],
) -> Vec<usize> {
    let least: Vec<f32> = lamps.iter().map(least_of_heap).collect();
    let least_of_all = least.iter().copied().fold(f32::INFINITY, f32::min);
    let mut nums = vec![0; lamps.len()];
    for i in 0..gaussians.len() {
        let emits = emits(gaussians.emissions[i]);
        let light = luminance(gaussians.radiances[i].to_array());
        if !emits && light < least_of_all {
            continue;
        }
        let (position, scale) = (gaussians.positions[i], gaussians.scales[i].max_element());
        let nearest = (lamps.iter().enumerate())
            .map(|(k, lamp)| (k, excess(&lamp.fit.shape, position, scale)))
            .min_by(|a, b| a.1.total_cmp(&b.1));
        if let Some((k, distance)) = nearest
            && distance <= 0.0
        {
            let is_part = emits || light >= least[k];
            let radius = 0.5 * lamps[k].fit.shape.size().max_element();
            let shade = lamps[k].shade.as_ref();
            let is_spared = shade.is_some_and(|shade| shade.spares(position, radius));
            keep[i] &= !(lamps[k].is_clean && is_part && !is_spared);
            nums[k] += usize::from(emits);
        }
    }
    nums
}

/// Radiance from which on what is beside a lamp is part of the heap that it was.
fn least_of_heap(lamp: &Candidate) -> f32 {
    // Inside a shade light goes to and fro, and bars hide what is as bright as the window.
    let is_bound = lamp.shade.is_some() || lamp.fit.gaps != Gaps::Seen;
    let radiance = luminance(lamp.measured.radiance.to_array());
    if is_bound {
        f32::INFINITY
    } else {
        AS_BRIGHT * radiance
    }
}

/// Distance of a Gaussian of size `scale` from the grown box of a shape, negative inside.
fn excess(shape: &Shape, position: Vec3, scale: f32) -> f32 {
    let local = shape.rotation().conjugate() * (position - shape.centre());
    let size = shape.size();
    let half = 0.5 * size + BOX_MARGIN * size.max_element() + SIZE_MARGIN * scale;
    (local.abs() - half).max_element()
}

/// Takes out what is in front of `lamps` in pixels that show them; their discs are what `edit`
/// adds.
///
/// # Errors
/// If the device fails.
pub(crate) fn remove_what_hides(
    device: &Device,
    evidence: &Evidence,
    gaussians: &Gaussians,
    lamps: &[Fit],
    edit: &mut SceneEdit,
) -> Result<(), TraceError> {
    let scene = edit.applied(gaussians);
    let num = scene.len() - edit.fixed.len();
    let tracer = device.scene(&scene)?;
    let mut before = vec![0.0_f32; num];
    let mut weight = vec![0.0_f32; num];
    for sight in &evidence.sights {
        let mut lit = vec![0.0_f32; sight.camera.num_pixels()];
        for pixel in &sight.pixels {
            // At a border the lamp is there in part; of thin lamps nothing else is seen.
            let whole = match pixel.lit {
                Lit::Inside => true,
                Lit::Border => covers(lamps, sight, pixel),
                Lit::Beside | Lit::Dark => false,
            };
            if whole && meet(lamps, sight, pixel.direction) {
                lit[(pixel.y * sight.camera.width + pixel.x) as usize] = pixel.weight;
            }
        }
        let value = |pixel: usize, _: &eagpt_trace::Features| lit[pixel];
        let (_, contributions) = tracer.contributions(&sight.camera, &value)?;
        for c in contributions.iter().filter(|c| (c.gaussian as usize) < num) {
            before[c.gaussian as usize] += c.weighted_value;
            weight[c.gaussian as usize] += c.weight;
        }
    }
    let mut keep = edit.keep.clone();
    let stay = keep.iter_mut().filter(|keep| **keep);
    for (at, keep) in stay.enumerate() {
        let is_of_lit = before[at] > SHARE_LIT * weight[at];
        let hides = is_of_lit || in_front(lamps, scene.positions[at]);
        *keep = !(before[at] > MAX_BEFORE && hides);
    }
    edit.take_out(&keep);
    Ok(())
}

/// Whether a ray from the camera meets one of the lamps.
fn meet(lamps: &[Fit], sight: &Sight, direction: Vec3) -> bool {
    let mut shapes = lamps.iter().map(|lamp| lamp.shape);
    shapes.any(|shape| shape.meet(sight.origin(), direction).is_some())
}

/// Whether one lamp covers a whole pixel.
fn covers(lamps: &[Fit], sight: &Sight, pixel: &Pixel) -> bool {
    let corners =
        [(0.1, 0.1), (0.9, 0.1), (0.1, 0.9), (0.9, 0.9)].map(|(x, y)| sight.direction(pixel, x, y));
    lamps.iter().any(|lamp| {
        let meets = |direction: &Vec3| lamp.shape.meet(sight.origin(), *direction).is_some();
        corners.iter().all(meets)
    })
}

/// Whether a place is before all flat lamps near it, and near none that has bars or a shade.
fn in_front(lamps: &[Fit], position: Vec3) -> bool {
    let may_stay = |lamp: &Fit| {
        let near = position.distance(lamp.shape.centre()) < 2.0 * lamp.shape.size().length();
        let is_behind = |flat: &Flat| (position - flat.centre).dot(flat.normal()) <= 0.0;
        near && (lamp.gaps != Gaps::Seen || lamp.shape.flat().is_some_and(is_behind))
    };
    !lamps.iter().any(may_stay)
}
