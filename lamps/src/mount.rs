//! The surface that a lamp is mounted on.
//!
//! A ceiling of Gaussians is rough: discs that are tilted by a degree, or hang a centimetre below
//! it, hide a lamp that is flush with it. Few cameras see a lamp along its ceiling and complain,
//! but the walls of the room do, which is where its light goes.
//!
//! A panel is in the plane of its mount; a box or a tube may touch one with each of its flat faces,
//! and a tube may hang before a wall.

mod walls;

use crate::shape::Flat;
use crate::shape::faces::{self, Face, Solid};
use crate::strays::OPAQUE;
use eagpt_scene::lamps::{Lamp, Lamps, emits};
use eagpt_scene::median::{SIGMA_OF_MAD, median_of};
use eagpt_scene::{Gaussian, Gaussians, SceneEdit, rotation};
use glam::{Mat3, Quat, Vec3};
use std::f32::consts::TAU;

/// Cosine between a flat lamp and the surface that it is mounted on, at least.
const COSINE: f32 = 0.7;
/// Heights of a mount's Gaussians over the lamp's plane, in their standard deviations, within which
/// they are taken for it.
const DEVIATIONS: f32 = 3.0;
/// Area of a mount's discs over that of the lamp's face, grown by its narrow side, at least. In four
/// rooms those of a surface cover it 2 to 6 times, strays in a shade or beside a tube up to 0.34.
const MIN_COVER: f32 = 1.0;
/// Distance from a lamp up to which its mount is freed, in its narrow sides, if that is less than
/// half of its diagonal.
const REACH: f32 = 2.0;
/// Depth of the mount's Gaussians behind the lamp, in sizes of the thinnest side.
const DEPTH: f32 = 0.03;
/// Opacity of a Gaussian before a lamp from which on it hides it.
const HIDES: f32 = 0.01;

/// A Gaussian as a flat lamp has it.
struct Place {
    /// Distance of the centre from the lamp's box, within the lamp's plane.
    outside: f32,
    /// Height of the centre over the lamp's plane.
    height: f32,
    /// Height of the disc over the point of the lamp that is nearest to the centre, …
    height_there: f32,
    /// … and its opacity there.
    opacity_there: f32,
}

impl Place {
    fn new(gaussian: &Gaussian, flat: &Flat) -> Self {
        let inverse = flat.rotation.conjugate();
        let local = inverse * (gaussian.position - flat.centre);
        let half = 0.5 * Vec3::new(flat.size[0], flat.size[1], 0.0);
        let nearest = local.clamp(-half, half);
        let own = Mat3::from_quat(inverse * gaussian.rotation);
        let away = nearest - local;
        let up = -away.dot(own.z_axis) / own.z_axis.z;
        let on_disc = away + Vec3::Z * up;
        let [u, v] = [
            (own.x_axis, gaussian.scale.x),
            (own.y_axis, gaussian.scale.y),
        ]
        .map(|(axis, scale)| on_disc.dot(axis) / scale);
        Self {
            outside: (local - nearest).truncate().length(),
            height: local.z,
            height_there: up,
            opacity_there: gaussian.opacity * (-0.5 * (u * u + v * v)).exp(),
        }
    }

    fn hides(&self) -> bool {
        self.height_there > 0.0 && self.opacity_there > HIDES
    }
}

/// Frees a face of a lamp of the `num` first Gaussians, but for those that are not to `keep`: of
/// those along its plane the ones that stick out of its mount before it go behind it and all of the
/// mount lie along it, and those that hang before the lamp itself are taken out, and so are
/// translucent ones across it. Returns what becomes of which, `None` for those taken out.
fn free(
    gaussians: &Gaussians,
    num: usize,
    face: &Face,
    keep: &[bool],
) -> Vec<(u32, Option<Gaussian>)> {
    let flat = &face.flat;
    let normal = flat.normal();
    let [width, height] = flat.size;
    let narrow = width.min(height);
    let reach = (0.5 * width.hypot(height)).min(REACH * narrow);
    let reach = reach.max(face.blur);
    let depth = DEPTH * narrow;
    let along = |i: usize| (gaussians.rotations[i] * Vec3::Z).dot(normal).abs() > COSINE;
    let others = || (0..num).filter(|&i| keep[i] && !emits(gaussians.emissions[i]));
    let placed = |i: usize| (i, Place::new(&gaussians.get(i), flat));
    let near: Vec<(usize, Place)> = others()
        .filter(|i| along(*i))
        .map(placed)
        .filter(|(_, place)| {
            let is_near = place.outside <= reach && place.height.abs() <= reach;
            is_near || (place.hides() && place.height_there <= reach)
        })
        .collect();
    let beside = || near.iter().filter(|(_, place)| place.outside <= reach);
    let size = median_of(beside().map(|(i, _)| gaussians.scales[*i].max_element()));
    let limit = (3.0 * size).min(reach);
    let level = || beside().filter(|(_, place)| place.height.abs() <= limit);
    let middle = median_of(level().map(|(_, place)| place.height));
    let off = median_of(level().map(|(_, place)| (place.height - middle).abs()));
    let spread = SIGMA_OF_MAD as f32 * off;
    let thickness = DEVIATIONS * spread.max(depth);
    let covering = level().filter(|(_, place)| place.outside <= narrow);
    let area = covering.map(|(i, _)| seen_along(&gaussians.get(*i), normal));
    let covered = (width + 2.0 * narrow) * (height + 2.0 * narrow);
    // A surface at the height of a lamp is none that it is mounted on.
    let is_outside = face.depth == 0.0 || middle <= 0.5 * face.depth;
    let is_plane =
        area.sum::<f32>() >= MIN_COVER * covered && middle.abs() <= thickness && is_outside;
    let is_mounted = face.is_mount && is_plane;
    if !is_mounted && !face.shines {
        return Vec::new();
    }
    let freed = |(i, place): &(usize, Place)| {
        let is_of_mount = is_mounted
            && [place.height, place.height_there]
                .iter()
                .all(|h| h.abs() <= thickness + middle.abs());
        if is_of_mount {
            let mut gaussian = gaussians.get(*i);
            let level = place.height.min(-depth);
            gaussian.position += normal * (level - place.height);
            gaussian.rotation = laid_along(gaussian.rotation, normal);
            Some((*i as u32, Some(gaussian)))
        } else {
            place.hides().then_some((*i as u32, None))
        }
    };
    let is_across = |i: &usize| face.shines && !along(*i) && gaussians.opacities[*i] < OPAQUE;
    let hangs = |(_, place): &(usize, Place)| {
        place.outside == 0.0 && place.height > 0.0 && place.height <= limit
    };
    let hanging = others().filter(is_across).map(placed).filter(hangs);
    let gone = hanging.map(|(i, _)| (i as u32, None));
    near.iter().filter_map(freed).chain(gone).collect()
}

/// Area of a Gaussian as seen along a unit vector: the integral of its opacity.
fn seen_along(gaussian: &Gaussian, direction: Vec3) -> f32 {
    let cosine = (gaussian.rotation * Vec3::Z).dot(direction).abs();
    TAU * gaussian.scale.x * gaussian.scale.y * gaussian.opacity * cosine
}

/// Frees all lamps that nothing real stands before of what training has put before them since;
/// the first `num_moving` Gaussians are not the lamps' own. `eyes` are the camera centres of the
/// views that show a lamp.
pub fn freed(
    gaussians: &Gaussians,
    num_moving: usize,
    lamps: &Lamps,
    eyes: impl Fn(&Lamp) -> Vec<Vec3>,
) -> SceneEdit {
    let mut edit = SceneEdit::nothing(gaussians.len());
    let solids = (lamps.lamps.iter()).filter_map(|lamp| Some((lamp, Solid::of_lamp(lamp)?)));
    let faces = solids.flat_map(|(lamp, solid)| faces(&solid, &eyes(lamp), gaussians, num_moving));
    free_all(gaussians, num_moving, faces, &mut edit);
    edit
}

/// Faces of a lamp that may touch what it is mounted on, the plane at the back of a tube that hangs
/// before a wall of the `num` first Gaussians among them; cameras at `eyes` see the lamp.
pub(crate) fn faces(lamp: &Solid, eyes: &[Vec3], gaussians: &Gaussians, num: usize) -> Vec<Face> {
    let mut faces = faces::of(lamp, eyes);
    faces.extend(walls::behind(lamp, eyes, gaussians, num));
    faces
}

/// Adds to `edit` what frees `faces` of the `num` first Gaussians, those that it takes out already
/// left out.
pub(crate) fn free_all(
    gaussians: &Gaussians,
    num: usize,
    faces: impl Iterator<Item = Face>,
    edit: &mut SceneEdit,
) {
    for face in faces {
        for (i, gaussian) in free(gaussians, num, &face, &edit.keep) {
            apply(edit, i, gaussian);
        }
    }
}

/// Adds to `edit` what becomes of a Gaussian. Where mounts meet, that of the first lamp counts.
fn apply(edit: &mut SceneEdit, i: u32, gaussian: Option<Gaussian>) {
    let at = edit.moved.binary_search_by_key(&i, |(moved, _)| *moved);
    match (gaussian, at) {
        (Some(gaussian), Err(at)) => edit.moved.insert(at, (i, gaussian)),
        (Some(_), Ok(_)) => (),
        (None, at) => {
            edit.keep[i as usize] = false;
            if let Ok(at) = at {
                edit.moved.remove(at);
            }
        }
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
