//! The shape of a lamp: of a rectangle, an ellipse, a ball and a tube the one whose silhouettes
//! are most like what the views show.

use crate::evidence::{Evidence, Lit, rim};
use crate::group::Group;
use crate::search;
use crate::shape::{Flat, MAX_CHANGES, Shape};
use eagpt_scene::plane::FittedPlane;
use eagpt_scene::rotation;
use glam::{Mat3, Quat, Vec3};
use rayon::prelude::*;
use std::f32::consts::PI;

/// Views that a shape is fitted to: those with most pixels.
const MAX_VIEWS: usize = 16;
/// Rays along each axis of a pixel.
const RAYS: u32 = 3;
/// Share of its distance by which a pixel has to be nearer than the lamp to show what hides it.
const NEARER: f32 = 0.08;
/// Pixels of a view that a lamp fills or has nothing in that a fit compares.
const MAX_PLAIN: usize = 500;
/// How much better a shape with more freedom has to fit than one with less.
const BETTER: f32 = 0.85;
/// Evaluations of a search.
const NUM_TRIALS: usize = 500;
/// A mount that is turned by more than this (cosine) against the points of a lamp is none.
const MOUNT_COSINE: f32 = 0.8;

/// A pixel as a fit wants it.
struct Target {
    /// Unit directions of its rays.
    rays: [Vec3; (RAYS * RAYS) as usize],
    /// Part of it that the lamp covers, 0 to 1.
    cover: f32,
    /// Pixels that it stands for.
    weight: f32,
}

/// A view of a lamp.
struct Patch {
    origin: Vec3,
    targets: Vec<Target>,
}

/// A shape and how well it fits.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Fit {
    pub(crate) shape: Shape,
    /// Squared difference of covers over squared covers, 0 for a perfect fit.
    pub(crate) residual: f32,
}

/// Fits the lamp of `group`; `None` where its pixels have no extent.
pub(crate) fn fit(evidence: &Evidence, group: &Group) -> Option<Fit> {
    let points = points(evidence, group);
    if points.is_empty() {
        return None;
    }
    let centre = median(points.iter().map(|p| p.position));
    let extent = 2.0 * median_distance(centre, points.iter().map(|p| p.position));
    let pixel = median_of(points.iter().map(|p| p.width));
    let extent = extent.max(pixel);
    let patches = patches(evidence, group, centre, extent);
    if patches.is_empty() {
        return None;
    }
    let towards: Vec3 = points.iter().map(|p| p.towards).sum();
    let mount: Vec3 = points.iter().map(|p| p.normal).sum();
    let flats = normals(&points, towards, mount);
    let mut starts: Vec<(Shape, bool)> = Vec::new();
    for (normal, is_mount) in flats {
        let flat = first_flat(&points, centre, normal, pixel);
        starts.push((Shape::Rectangle(flat), is_mount));
        starts.push((Shape::Ellipse(flat), is_mount));
    }
    starts.push((Shape::Ball { centre, radius: 0.5 * extent }, false));
    for axis in axes(&points) {
        starts.push((first_tube(&points, centre, axis, pixel), false));
    }
    let fits: Vec<Fit> = starts
        .par_iter()
        .map(|(start, is_fixed)| refined(start, *is_fixed, &patches, extent))
        .collect();
    best(&fits, &starts)
}

/// Of all fits the one with the least residual, where those with more freedom have to be better by
/// [`BETTER`].
fn best(fits: &[Fit], starts: &[(Shape, bool)]) -> Option<Fit> {
    let freedom = |fit: &Fit, is_mount: bool| match fit.shape {
        Shape::Ball { .. } => 0,
        Shape::Rectangle(_) | Shape::Ellipse(_) if is_mount => 0,
        Shape::Rectangle(_) | Shape::Ellipse(_) | Shape::Tube { .. } => 1,
    };
    let score = |(fit, (_, is_mount)): &(&Fit, &(Shape, bool))| {
        fit.residual * BETTER.powi(-freedom(fit, *is_mount))
    };
    let all = fits.iter().zip(starts);
    all.min_by(|a, b| score(a).total_cmp(&score(b))).map(|(fit, _)| *fit)
}

/// A lit pixel in space.
struct Point {
    position: Vec3,
    /// Unit normal of the scene there.
    normal: Vec3,
    /// Unit vector to the camera.
    towards: Vec3,
    width: f32,
}

fn points(evidence: &Evidence, group: &Group) -> Vec<Point> {
    let members = group.members.iter().map(|&(view, pixel)| {
        let sight = &evidence.sights[view as usize];
        let pixel = &sight.pixels[pixel as usize];
        Point {
            position: sight.origin + pixel.direction * pixel.distance,
            normal: pixel.normal,
            towards: -pixel.direction,
            width: pixel.distance * sight.pixel_width(),
        }
    });
    members.collect()
}

/// What the views with most pixels of the lamp show.
fn patches(evidence: &Evidence, group: &Group, centre: Vec3, extent: f32) -> Vec<Patch> {
    let mut by_view: Vec<(usize, Vec<u32>)> = Vec::new();
    for &(view, pixel) in &group.members {
        match by_view.last_mut() {
            Some((last, pixels)) if *last == view as usize => pixels.push(pixel),
            _ => by_view.push((view as usize, vec![pixel])),
        }
    }
    by_view.sort_by_key(|(view, pixels)| (std::cmp::Reverse(pixels.len()), *view));
    by_view.truncate(MAX_VIEWS);
    let bright = brightness(evidence, group);
    (by_view.iter())
        .map(|(view, own)| {
            let sight = &evidence.sights[*view];
            let frame = sight.camera.ray_frame();
            let own: std::collections::HashSet<u32> = own.iter().copied().collect();
            let of_own = || own.iter().map(|&i| &sight.pixels[i as usize]);
            let bounds = |of: fn(&crate::evidence::Pixel) -> u32| {
                let values = of_own().map(of);
                (values.clone().min().unwrap_or(0), values.max().unwrap_or(0))
            };
            let ((x0, x1), (y0, y1)) = (bounds(|p| p.x), bounds(|p| p.y));
            let (rim_x, rim_y) = (rim(x1 - x0 + 1), rim(y1 - y0 + 1));
            let distance = centre.distance(sight.origin);
            let nearest = (distance - extent) * (1.0 - NEARER);
            let mut targets = Vec::new();
            for (i, pixel) in (0_u32..).zip(&sight.pixels) {
                let near = pixel.x + rim_x >= x0
                    && pixel.x <= x1 + rim_x
                    && pixel.y + rim_y >= y0
                    && pixel.y <= y1 + rim_y;
                if !near {
                    continue;
                }
                let is_own = own.contains(&i);
                // Another lamp's, or what stands before the lamp, which hides what it does.
                if pixel.lit.is_lit() != is_own || (!is_own && pixel.distance < nearest) {
                    continue;
                }
                let share = pixel.radiance.max_element() / bright;
                let cover = match pixel.lit {
                    Lit::Inside => 1.0,
                    Lit::Border => share.clamp(0.5, 1.0),
                    Lit::Beside => share.clamp(0.0, 0.5),
                    Lit::Dark => 0.0,
                };
                let mut rays = [Vec3::ZERO; (RAYS * RAYS) as usize];
                for (k, ray) in (0..).zip(&mut rays) {
                    let within = |k: u32| (k as f32 + 0.5) / RAYS as f32;
                    let (x, y) = (
                        pixel.x as f32 + within(k % RAYS),
                        pixel.y as f32 + within(k / RAYS),
                    );
                    *ray = frame.direction(x, y);
                }
                targets.push(Target {
                    rays,
                    cover,
                    weight: 1.0,
                });
            }
            Patch {
                origin: sight.origin,
                targets: thinned(targets),
            }
        })
        .collect()
}

/// Of many pixels that a lamp fills, or has nothing in, some that stand for all.
fn thinned(targets: Vec<Target>) -> Vec<Target> {
    let is_plain = |t: &Target| t.cover == 0.0 || t.cover == 1.0;
    let num_plain = targets.iter().filter(|t| is_plain(t)).count();
    let step = num_plain.div_ceil(MAX_PLAIN).max(1);
    let mut at = 0;
    (targets.into_iter())
        .filter_map(|mut target| {
            if is_plain(&target) {
                at += 1;
                target.weight = step as f32;
            }
            (!is_plain(&target) || at % step == 0).then_some(target)
        })
        .collect()
}

/// Radiance of the lamp where it fills a pixel: the brightest channel of most of the pixels that it
/// is alone in, or else of its brightest ones.
fn brightness(evidence: &Evidence, group: &Group) -> f32 {
    let values = |inside: bool| {
        let pixels = group.members.iter().map(|&(view, pixel)| {
            &evidence.sights[view as usize].pixels[pixel as usize]
        });
        let mut values: Vec<f32> = pixels
            .filter(|p| !inside || p.lit == Lit::Inside)
            .map(|p| p.radiance.max_element())
            .collect();
        values.sort_unstable_by(f32::total_cmp);
        values
    };
    let inside = values(true);
    let of = |values: &[f32], share: f32| values[((values.len() - 1) as f32 * share) as usize];
    let value = if inside.is_empty() {
        of(&values(false), 0.9)
    } else {
        of(&inside, 0.5)
    };
    value.max(f32::MIN_POSITIVE)
}

/// Residual of a shape.
fn residual(shape: &Shape, patches: &[Patch]) -> f32 {
    let (mut error, mut all) = (0.0_f32, 0.0_f32);
    for patch in patches {
        for target in &patch.targets {
            let met = (target.rays.iter())
                .filter(|ray| shape.meet(patch.origin, **ray).is_some())
                .count();
            let cover = met as f32 / (RAYS * RAYS) as f32;
            error += target.weight * (cover - target.cover).powi(2);
            all += target.weight * target.cover * target.cover;
        }
    }
    error / all.max(f32::MIN_POSITIVE)
}

fn refined(start: &Shape, keeps_normal: bool, patches: &[Patch], extent: f32) -> Fit {
    let num = start.num_changes() - if keeps_normal { 2 } else { 0 };
    let value = |by: &[f32]| {
        let mut all = [0.0; MAX_CHANGES];
        all[..num].copy_from_slice(by);
        residual(&start.changed(&all, extent), patches)
    };
    let mut steps = [0.2_f32; MAX_CHANGES];
    steps[..3].fill(0.15);
    let (by, residual) = search::minimum(value, &steps[..num], NUM_TRIALS);
    let mut all = [0.0; MAX_CHANGES];
    all[..num].copy_from_slice(&by);
    Fit {
        shape: start.changed(&all, extent),
        residual,
    }
}

/// Normals that a flat lamp may have, towards the cameras, and whether it is that of the surface it
/// is mounted on.
fn normals(points: &[Point], towards: Vec3, mount: Vec3) -> Vec<(Vec3, bool)> {
    let turned = |n: Vec3| if n.dot(towards) < 0.0 { -n } else { n };
    let plane = FittedPlane::through(points.iter().map(|p| p.position));
    let mut found = Vec::new();
    let aligned = (points.iter()).filter(|p| p.normal.dot(mount) > MOUNT_COSINE * mount.length());
    if let Some(mount) = mount.try_normalize()
        && 2 * aligned.count() > points.len()
    {
        found.push((turned(mount), true));
    }
    found.extend(plane.normal.map(|n| (turned(n), false)));
    found.extend(towards.try_normalize().map(|n| (n, false)));
    found
}

fn first_flat(points: &[Point], centre: Vec3, normal: Vec3, pixel: f32) -> Flat {
    let start = Mat3::from_quat(rotation::from_z_to(normal));
    let flat: Vec<[f32; 2]> = (points.iter().map(|p| p.position - centre))
        .map(|d| [d.dot(start.x_axis), d.dot(start.y_axis)])
        .collect();
    // The direction in which a box around the points is smallest.
    let spread = |turn: f32| -> [f32; 2] {
        let (sin, cos) = turn.sin_cos();
        let along = |f: &dyn Fn(&[f32; 2]) -> f32| {
            let mut values: Vec<f32> = flat.iter().map(f).collect();
            values.sort_unstable_by(f32::total_cmp);
            let tail = values.len() / 20;
            values[values.len() - 1 - tail] - values[tail]
        };
        [
            along(&|p| p[0] * cos + p[1] * sin),
            along(&|p| p[1] * cos - p[0] * sin),
        ]
    };
    let turns = (0..18).map(|i| i as f32 * (0.5 * PI / 18.0));
    let area = |turn: f32| spread(turn).iter().map(|s| s + pixel).product::<f32>();
    let turn = (turns.min_by(|a, b| area(*a).total_cmp(&area(*b)))).unwrap_or(0.0);
    let size = spread(turn).map(|s| s + pixel);
    Flat {
        centre,
        rotation: rotation::unit(
            rotation::from_z_to(normal) * Quat::from_scaled_axis(Vec3::Z * turn),
        ),
        size,
    }
}

/// Directions that a tube may have.
fn axes(points: &[Point]) -> Vec<Vec3> {
    let centre = median(points.iter().map(|p| p.position));
    let farthest = (points.iter().map(|p| p.position - centre))
        .max_by(|a, b| a.length_squared().total_cmp(&b.length_squared()));
    let mut found = vec![Vec3::Z];
    found.extend(farthest.and_then(Vec3::try_normalize));
    found
}

fn first_tube(points: &[Point], centre: Vec3, axis: Vec3, pixel: f32) -> Shape {
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
    }
}

pub(crate) fn median_of(values: impl Iterator<Item = f32>) -> f32 {
    let mut values: Vec<f32> = values.collect();
    values.sort_unstable_by(f32::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

pub(crate) fn median(points: impl Iterator<Item = Vec3> + Clone) -> Vec3 {
    Vec3::from_array([0, 1, 2].map(|axis| median_of(points.clone().map(|p| p[axis]))))
}

fn median_distance(centre: Vec3, points: impl Iterator<Item = Vec3>) -> f32 {
    median_of(points.map(|p| p.distance(centre)))
}
