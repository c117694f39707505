//! Gaussians in the way of a clean lamp: those that it replaces, what stands in front of it
//! although cameras see it, and the rough surface that it is mounted on.

use crate::Candidate;
use crate::evidence::{Evidence, Lit, Pixel, Sight};
use crate::fit::Fit;
use crate::median::median_of;
use crate::patches::Gaps;
use crate::shape::{Flat, Shape};
use eagpt_scene::lamps::BOX_MARGIN;
use eagpt_scene::{Gaussian, Gaussians, SceneEdit, rotation};
use eagpt_trace::transport::EMISSION_THRESHOLD;
use eagpt_trace::{Device, TraceError};
use glam::{Mat3, Quat, Vec3};

/// Grows the box of a lamp beyond [`BOX_MARGIN`], in sizes of the Gaussian that may lie in it.
const SIZE_MARGIN: f32 = 1.0;
/// Opaque pixels' worth of weight that a Gaussian may have before lit pixels.
const MAX_BEFORE: f32 = 0.05;
/// Share of a Gaussian's weight in lit pixels from which on it is a part of what it shows there.
const SHARE_LIT: f32 = 0.6;
/// Cosine between a flat lamp and the surface that it is mounted on, at least.
const MOUNT_COSINE: f32 = 0.7;
/// Heights of a mount's Gaussians over the lamp's plane, in their standard deviations, within which
/// they are taken for it.
const MOUNT_DEVIATIONS: f32 = 3.0;
/// Least number of Gaussians of a mount.
const MIN_MOUNT: usize = 8;
/// Depth of the mount's Gaussians behind the lamp, in sizes of the thinnest side.
const MOUNT_DEPTH: f32 = 0.03;

/// Marks the Gaussians that clean lamps replace; returns how many are each lamp's.
pub(crate) fn replaced(
    gaussians: &Gaussians,
    lamps: &[Candidate],
    keep: &mut [bool],
) -> Vec<usize> {
    let mut nums = vec![0; lamps.len()];
    for i in 0..gaussians.len() {
        if gaussians.emissions[i] <= EMISSION_THRESHOLD {
            continue;
        }
        let (position, scale) = (gaussians.positions[i], gaussians.scales[i].max_element());
        let nearest = (lamps.iter().enumerate())
            .map(|(k, lamp)| (k, excess(&lamp.fit.shape, position, scale)))
            .min_by(|a, b| a.1.total_cmp(&b.1));
        if let Some((k, distance)) = nearest
            && distance <= 0.0
        {
            keep[i] &= !lamps[k].is_clean;
            nums[k] += 1;
        }
    }
    nums
}

/// Whether a point is in the grown box of a shape.
pub(crate) fn is_near(shape: &Shape, position: Vec3) -> bool {
    excess(shape, position, 0.0) <= 0.0
}

/// Distance of a Gaussian of size `scale` from the grown box of a shape, negative inside.
fn excess(shape: &Shape, position: Vec3, scale: f32) -> f32 {
    let local = shape.rotation().conjugate() * (position - shape.centre());
    let size = shape.size();
    let half = 0.5 * size + BOX_MARGIN * size.max_element() + SIZE_MARGIN * scale;
    (local.abs() - half).max_element()
}

/// Flattens the surface around a flat lamp: of Gaussians in its plane those that stick out before
/// it go behind it, and all of them lie along it. Those that are not to `keep` do not count.
/// Returns what becomes of which.
pub(crate) fn flatten_mount(
    gaussians: &Gaussians,
    flat: &Flat,
    keep: &[bool],
) -> Vec<(u32, Gaussian)> {
    let normal = flat.normal();
    let inverse = flat.rotation.conjugate();
    let [width, height] = flat.size;
    let reach = 0.5 * width.hypot(height);
    let thin = width.min(height);
    let along = |i: usize| {
        let n = gaussians.rotations[i] * Vec3::Z;
        n.dot(normal).abs() > MOUNT_COSINE
    };
    let place = |i: usize| {
        let local = inverse * (gaussians.positions[i] - flat.centre);
        let outside = Vec3::new(
            (local.x.abs() - 0.5 * width).max(0.0),
            (local.y.abs() - 0.5 * height).max(0.0),
            0.0,
        );
        (outside.length(), local.z)
    };
    let reflects =
        |i: &usize| keep[*i] && gaussians.emissions[*i] <= EMISSION_THRESHOLD && along(*i);
    let near: Vec<usize> = (0..gaussians.len())
        .filter(reflects)
        .filter(|&i| {
            let (outside, height) = place(i);
            outside <= reach && height.abs() <= reach
        })
        .collect();
    let size = median_of(near.iter().map(|&i| gaussians.scales[i].max_element()));
    let limit = (3.0 * size).min(reach);
    let mount: Vec<usize> = near
        .into_iter()
        .filter(|&i| place(i).1.abs() <= limit)
        .collect();
    if mount.len() < MIN_MOUNT {
        return Vec::new();
    }
    let middle = median_of(mount.iter().map(|&i| place(i).1));
    let spread = 1.4826 * median_of(mount.iter().map(|&i| (place(i).1 - middle).abs()));
    let thickness = MOUNT_DEVIATIONS * spread.max(MOUNT_DEPTH * thin);
    if middle.abs() > thickness {
        return Vec::new();
    }
    (mount.into_iter())
        .map(|i| (i, place(i).1))
        .filter(|(_, height)| height.abs() <= thickness + middle.abs())
        .map(|(i, height)| {
            let mut gaussian = gaussians.get(i);
            let level = height.min(-MOUNT_DEPTH * thin);
            gaussian.position += normal * (level - height);
            gaussian.rotation = laid_along(gaussian.rotation, normal);
            (i as u32, gaussian)
        })
        .collect()
}

/// `rotation` turned so that its plane has `normal` or its opposite.
fn laid_along(rotation: Quat, normal: Vec3) -> Quat {
    let frame = Mat3::from_quat(rotation);
    let z = if frame.z_axis.dot(normal) < 0.0 {
        -normal
    } else {
        normal
    };
    let x = (frame.x_axis - z * frame.x_axis.dot(z)).normalize_or(z.any_orthonormal_vector());
    rotation::unit(Quat::from_mat3(&Mat3::from_cols(x, z.cross(x), z)))
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
    let stay = edit.keep.iter_mut().filter(|keep| **keep);
    for (at, keep) in stay.enumerate() {
        let is_of_lit = before[at] > SHARE_LIT * weight[at];
        let hides = is_of_lit || in_front(lamps, scene.positions[at]);
        *keep = !(before[at] > MAX_BEFORE && hides);
    }
    edit.moved.retain(|(i, _)| edit.keep[*i as usize]);
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

/// Whether a place is in front of all flat lamps near it, where none of them has bars.
fn in_front(lamps: &[Fit], position: Vec3) -> bool {
    let may_stay = |lamp: &Fit| {
        let Some(flat) = lamp.shape.flat() else {
            return false;
        };
        let height = (position - flat.centre).dot(flat.normal());
        let near = position.distance(flat.centre) < 2.0 * lamp.shape.size().length();
        near && (height <= 0.0 || lamp.gaps == Gaps::Bars)
    };
    !lamps.iter().any(may_stay)
}
