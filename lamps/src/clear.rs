//! What is in the way of a clean lamp: the Gaussians that it replaces, what stands in front of it
//! although cameras see it, and the rough surface that it is mounted on.

use crate::Candidate;
use crate::evidence::{Evidence, Lit};
use crate::shape::{Flat, Shape};
use crate::starts::median_of;
use eagpt_scene::{Gaussian, Gaussians, rotation};
use eagpt_trace::transport::EMISSION_THRESHOLD;
use eagpt_trace::{Device, TraceError};
use glam::{Mat3, Quat, Vec3};

/// Grows the box of a lamp on every side, in parts of its largest size …
const BOX_MARGIN: f32 = 0.15;
/// … and in sizes of the Gaussian that may lie in it.
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

/// What happens to the Gaussians of a scene.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Cleared {
    /// Whether each stays, `[n]`.
    pub keep: Vec<bool>,
    /// Those that stay at another place.
    pub moved: Vec<(u32, Gaussian)>,
}

impl Cleared {
    /// The scene after it.
    pub fn applied(&self, gaussians: &Gaussians) -> Gaussians {
        let mut all: Vec<Gaussian> = gaussians.iter().collect();
        for (i, moved) in &self.moved {
            all[*i as usize] = *moved;
        }
        let kept = all.into_iter().zip(&self.keep).filter(|(_, keep)| **keep);
        kept.map(|(gaussian, _)| gaussian).collect()
    }
}

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
            .map(|(k, lamp)| (k, excess(&lamp.shape, position, scale)))
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

/// Distance of a point from the grown box of a shape, negative inside.
fn excess(shape: &Shape, position: Vec3, scale: f32) -> f32 {
    let local = shape.rotation().conjugate() * (position - shape.centre());
    let size = shape.size();
    let half = 0.5 * size + BOX_MARGIN * size.max_element() + SIZE_MARGIN * scale;
    (local.abs() - half).max_element()
}

/// Flattens the surface around a flat lamp: of Gaussians in its plane those that stick out before
/// it go behind it, and all of them lie along it.
pub(crate) fn flatten_mount(gaussians: &Gaussians, flat: &Flat, cleared: &mut Cleared) {
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
        |i: &usize| cleared.keep[*i] && gaussians.emissions[*i] <= EMISSION_THRESHOLD && along(*i);
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
        return;
    }
    let middle = median_of(mount.iter().map(|&i| place(i).1));
    let spread = 1.4826 * median_of(mount.iter().map(|&i| (place(i).1 - middle).abs()));
    let thickness = MOUNT_DEVIATIONS * spread.max(MOUNT_DEPTH * thin);
    if middle.abs() > thickness {
        return;
    }
    for i in mount {
        let (_, height) = place(i);
        if height.abs() > thickness + middle.abs() {
            continue;
        }
        let mut gaussian = gaussians.get(i);
        let level = height.min(-MOUNT_DEPTH * thin);
        gaussian.position += normal * (level - height);
        gaussian.rotation = laid_along(gaussian.rotation, normal);
        cleared.moved.push((i as u32, gaussian));
    }
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

/// Takes out what is in front of lamps in pixels that show them. `scene` is that of `cleared` with
/// the lamps' `discs` after it.
///
/// # Errors
/// If the device fails.
pub(crate) fn remove_what_hides(
    device: &Device,
    evidence: &Evidence,
    gaussians: &Gaussians,
    shapes: &[Shape],
    discs: &Gaussians,
    cleared: &mut Cleared,
) -> Result<(), TraceError> {
    let after = cleared.applied(gaussians);
    let num = after.len();
    let scene: Gaussians = after.iter().chain(discs.iter()).collect();
    let tracer = device.scene(&scene)?;
    let mut before = vec![0.0_f32; num];
    let mut weight = vec![0.0_f32; num];
    for sight in &evidence.sights {
        let mut lit = vec![0.0_f32; sight.camera.num_pixels()];
        for pixel in &sight.pixels {
            // At a border the lamp is there in part; of thin lamps nothing else is seen.
            let whole = match pixel.lit {
                Lit::Inside => true,
                Lit::Border => covers(shapes, sight, pixel.x, pixel.y),
                Lit::Beside | Lit::Dark => false,
            };
            if whole
                && shapes
                    .iter()
                    .any(|s| s.meet(sight.origin, pixel.direction).is_some())
            {
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
    let mut at = 0;
    for (i, keep) in cleared.keep.iter_mut().enumerate() {
        if !*keep {
            continue;
        }
        let position = after.positions[at];
        let is_before = before[at] > MAX_BEFORE
            && (in_front(shapes, position) || before[at] > SHARE_LIT * weight[at]);
        if is_before {
            *keep = false;
        }
        at += 1;
        debug_assert!(i < gaussians.len());
    }
    cleared.moved.retain(|(i, _)| cleared.keep[*i as usize]);
    Ok(())
}

/// Whether one shape covers a whole pixel.
fn covers(shapes: &[Shape], sight: &crate::evidence::Sight, x: u32, y: u32) -> bool {
    let frame = sight.camera.ray_frame();
    let corners = [(0.1, 0.1), (0.9, 0.1), (0.1, 0.9), (0.9, 0.9)];
    shapes.iter().any(|shape| {
        corners.iter().all(|(dx, dy)| {
            let direction = frame.direction(x as f32 + dx, y as f32 + dy);
            shape.meet(sight.origin, direction).is_some()
        })
    })
}

/// Whether a place is in front of all flat shapes near it.
fn in_front(shapes: &[Shape], position: Vec3) -> bool {
    let behind = |shape: &Shape| {
        let Some(flat) = shape.flat() else {
            return false;
        };
        let height = (position - flat.centre).dot(flat.normal());
        let near = position.distance(flat.centre) < 2.0 * shape.size().length();
        near && height <= 0.0
    };
    !shapes.iter().any(behind)
}
