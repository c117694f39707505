//! Shapes that a search for a lamp's own begins with.

use crate::evidence::{Evidence, Pixel};
use crate::group::Group;
use crate::group::points::{Point, pixel_width};
use crate::shape::{Flat, Shape};
use eagpt_scene::median::{median, median_of};
use eagpt_scene::plane::{FittedPlane, Plane};
use eagpt_scene::rotation;
use glam::{Mat3, Quat, Vec3};
use std::collections::HashSet;
use std::f32::consts::PI;

/// The surface that a lamp is mounted on is looked for within this many pixels of the lamp; …
const MOUNT_RING: u32 = 3;
/// … has at least so many pixels and this share of those that are there; …
const MIN_MOUNT: usize = 12;
const MOUNT_SHARE: f32 = 0.6;
/// … normals within this (cosine), and heights within so many extents.
const MOUNT_COSINE: f32 = 0.8;
const MOUNT_HEIGHT: f32 = 0.5;
/// Cosine between a mount and an upright wall or a level ceiling, at least, that it is taken for.
const UPRIGHT: f32 = 0.97;
/// Cosine between a tilted flat shape and a level one, at least, that it may be.
const NEARLY_LEVEL: f32 = 0.8;
/// Half the width of a ring in its mean radius, and its length in its width, to begin with.
const RING: f32 = 0.1;
const RING_LENGTH: f32 = 0.01;

/// The normal of a mount, or that of a level plane if it is nearly so: a few pixels tell it to a
/// degree.
pub(crate) fn level_normal(mount: Plane, up: Vec3) -> Vec3 {
    let cosine = mount.normal.dot(up);
    if cosine.abs() > UPRIGHT {
        up * cosine.signum()
    } else {
        mount.normal
    }
}

/// Flat shapes that a lamp about `centre` may have, and whether they are to keep their normal.
pub(crate) fn flats(
    points: &[Point],
    centre: Vec3,
    mount: Option<Plane>,
    up: Vec3,
) -> Vec<(Flat, bool)> {
    let pixel = pixel_width(points);
    let flat = |(normal, is_mount)| (first_flat(points, centre, normal, pixel), is_mount);
    normals(points, mount, up).into_iter().map(flat).collect()
}

/// Sum of the unit vectors from the points of a lamp to the cameras that show them.
pub(crate) fn towards(points: &[Point]) -> Vec3 {
    points.iter().map(|p| p.towards).sum()
}

/// A normal of either sign, turned `towards` the cameras.
pub(crate) fn facing(normal: Vec3, towards: Vec3) -> Vec3 {
    if normal.dot(towards) < 0.0 {
        -normal
    } else {
        normal
    }
}

/// Normals that a flat lamp may have, towards the cameras, and whether it is that of the surface it
/// is mounted on.
fn normals(points: &[Point], mount: Option<Plane>, up: Vec3) -> Vec<(Vec3, bool)> {
    let towards = towards(points);
    let mount = mount.map(|mount| mount.normal);
    let turned = |n: Vec3| facing(n, towards);
    let plane = FittedPlane::through(points.iter().map(|p| p.position));
    let mut found: Vec<(Vec3, bool)> = mount.map(|n| (turned(n), true)).into_iter().collect();
    // Most lamps face up or down, if they are flat, and most walls stand upright, though training
    // may have them tilted.
    found.push((turned(up), true));
    let upright = mount.and_then(|n| n.reject_from_normalized(up).try_normalize());
    let is_wall = |n: &Vec3| mount.is_some_and(|mount| mount.dot(*n) > UPRIGHT);
    found.extend(upright.filter(is_wall).map(|n| (turned(n), true)));
    found.extend(mount.map(|n| (turned(n), false)));
    found.extend(plane.normal.map(|n| (turned(n), false)));
    found.extend(towards.try_normalize().map(|n| (n, false)));
    found
}

/// The plane of the surface around a lamp, if there is one in which it may lie.
pub(crate) fn mount(
    evidence: &Evidence,
    group: &Group,
    centre: Vec3,
    extent: f32,
) -> Option<Plane> {
    let mut near: HashSet<(u32, u32, u32)> = HashSet::new();
    for member in &group.members {
        let Pixel { x, y, .. } = *evidence.pixel(member).1;
        for v in y.saturating_sub(MOUNT_RING)..=y + MOUNT_RING {
            let row = x.saturating_sub(MOUNT_RING)..=x + MOUNT_RING;
            near.extend(row.map(|u| (member.0, u, v)));
        }
    }
    let mut around = Vec::new();
    for (view, sight) in (0_u32..).zip(&evidence.sights) {
        for pixel in sight
            .pixels
            .iter()
            .filter(|p| !p.lit.is_lit() && p.distance.is_finite())
        {
            if pixel.normal != Vec3::ZERO && near.contains(&(view, pixel.x, pixel.y)) {
                around.push((sight.position(pixel), pixel.normal));
            }
        }
    }
    let normal = median(&around.iter().map(|a| a.1)).try_normalize()?;
    let holds = |(position, own): &&(Vec3, Vec3)| {
        own.dot(normal) > MOUNT_COSINE
            && (*position - centre).dot(normal).abs() < MOUNT_HEIGHT * extent
    };
    let held = || around.iter().filter(holds);
    let num = held().count();
    let is_plane = num >= MIN_MOUNT && num as f32 > MOUNT_SHARE * around.len() as f32;
    is_plane.then(|| Plane {
        normal,
        offset: median_of(held().map(|(position, _)| position.dot(normal))),
    })
}

pub(crate) fn first_flat(points: &[Point], centre: Vec3, normal: Vec3, pixel: f32) -> Flat {
    let start = Mat3::from_quat(rotation::from_z_to(normal));
    let flat: Vec<[f32; 2]> = (points.iter().map(|p| p.position - centre))
        .map(|d| [d.dot(start.x_axis), d.dot(start.y_axis)])
        .collect();
    // The direction in which a box around the points is smallest.
    let spread = |turn: f32| -> [f32; 2] {
        let (sin, cos) = turn.sin_cos();
        [
            range(flat.iter().map(|p| p[0] * cos + p[1] * sin)),
            range(flat.iter().map(|p| p[1] * cos - p[0] * sin)),
        ]
    };
    let turns = (0..18).map(|i| i as f32 * (0.5 * PI / 18.0));
    let boxes = turns.map(|turn| (turn, spread(turn).map(|side| side + pixel)));
    let area = |&(_, [a, b]): &(f32, [f32; 2])| a * b;
    let smallest = boxes.min_by(|a, b| area(a).total_cmp(&area(b)));
    let (turn, size) = smallest.unwrap_or((0.0, [pixel; 2]));
    Flat {
        centre,
        rotation: rotation::unit(
            rotation::from_z_to(normal) * Quat::from_scaled_axis(Vec3::Z * turn),
        ),
        size,
    }
}

/// The range of values, at least one, without a twentieth of them at either end.
pub(crate) fn range(values: impl Iterator<Item = f32>) -> f32 {
    let mut values: Vec<f32> = values.collect();
    let tail = values.len() / 20;
    let last = values.len() - 1;
    let mut nth = |n: usize| *values.select_nth_unstable_by(n, f32::total_cmp).1;
    nth(last - tail) - nth(tail)
}

/// The flat shape of a vertical unit `normal`, towards the cameras, about the middle of another one,
/// as large; `None` of boxes, and of what is upright.
pub(crate) fn level(of: &Shape, normal: Vec3) -> Option<Flat> {
    let cosine = (of.rotation() * Vec3::Z).dot(normal);
    let (rotation, size) = match *of {
        Shape::Rectangle(flat) | Shape::Ellipse(flat) if cosine > NEARLY_LEVEL => {
            let own = flat.rotation;
            let turn = Quat::from_rotation_arc(own * Vec3::Z, normal);
            (rotation::unit(turn * own), flat.size)
        }
        Shape::Tube { radius, .. } if cosine.abs() > NEARLY_LEVEL => {
            (rotation::from_z_to(normal), [2.0 * radius; 2])
        }
        Shape::Ball { radius, .. } => (rotation::from_z_to(normal), [2.0 * radius; 2]),
        _ => return None,
    };
    Some(Flat {
        centre: of.centre(),
        rotation,
        size,
    })
}

/// Directions that a tube may have.
pub(crate) fn axes(points: &[Point]) -> Vec<Vec3> {
    let centre = median(&points.iter().map(|p| p.position));
    let farthest = (points.iter().map(|p| p.position - centre))
        .max_by(|a, b| a.length_squared().total_cmp(&b.length_squared()));
    let mut found = vec![Vec3::Z];
    found.extend(farthest.and_then(Vec3::try_normalize));
    found
}

pub(crate) fn first_tube(points: &[Point], centre: Vec3, axis: Vec3, pixel: f32) -> Shape {
    let along = median_of(points.iter().map(|p| (p.position - centre).dot(axis).abs()));
    let across = median_of(points.iter().map(|p| {
        let d = p.position - centre;
        (d - axis * d.dot(axis)).length()
    }));
    Shape::Tube {
        centre,
        rotation: rotation::from_z_to(axis),
        radius: across.max(0.5 * pixel),
        length: (4.0 * along).max(pixel),
        taper: 0.0,
        is_open: false,
    }
}

/// The ring about the middle of a flat shape, as wide: an open tube of hardly any length whose
/// narrow end is in front, so that its side faces there.
pub(crate) fn ring(of: &Flat) -> Shape {
    let width = 0.5 * (of.size[0] + of.size[1]);
    Shape::Tube {
        centre: of.centre,
        rotation: rotation::from_z_to(-of.normal()),
        radius: 0.5 * width * (1.0 - RING),
        length: RING_LENGTH * width,
        taper: RING,
        is_open: true,
    }
}
