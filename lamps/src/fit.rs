//! The shape of a lamp: of a rectangle, an ellipse, a ball and a tube the one whose silhouettes
//! are most like what the views show.

use crate::evidence::{Evidence, Lit, Pixel, Sight, rim};
use crate::group::Group;
use crate::measure::measure;
use crate::search;
use crate::shape::{Flat, MAX_CHANGES, Shape};
use eagpt_scene::plane::FittedPlane;
use eagpt_scene::rotation;
use glam::{Mat3, Quat, Vec3};
use rayon::prelude::*;
use std::collections::HashSet;
use std::f32::consts::PI;

/// Views that a shape is fitted to: those with most pixels.
const MAX_VIEWS: usize = 16;
/// Rays along each axis of a pixel.
const RAYS: u32 = 3;
/// Share of its distance by which a pixel has to be nearer than the lamp to show what hides it.
const NEARER: f32 = 0.08;
/// What is farther than the scene by so many widths of a pixel, and by this share, is hidden …
const HIDDEN_PIXELS: f32 = 2.0;
const HIDDEN_SHARE: f32 = 0.01;
/// … and counts so much where a view does not show it.
const HIDDEN: f32 = 0.25;
/// Pixels of a view that a lamp fills or has nothing in that a fit compares.
const MAX_PLAIN: usize = 500;
/// How much better a shape with more freedom has to fit than one with less.
const BETTER: f32 = 0.6;
/// … and that of a lamp of less than [`FEW`] pixels in all views, which say little of a shape.
const BETTER_OF_FEW: f32 = 0.4;
const FEW: usize = 120;
/// Residuals below this are alike.
const MIN_RESIDUAL: f32 = 0.002;
/// Evaluations of the first search from every start, and of later ones from the best of these.
const NUM_FIRST_TRIALS: usize = 300;
const NUM_TRIALS: usize = 500;
const NUM_PROMISING: usize = 4;
/// The surface that a lamp is mounted on is looked for within this many pixels of the lamp; …
const MOUNT_RING: u32 = 3;
/// … has at least so many pixels and this share of those that are there; …
const MIN_MOUNT: usize = 12;
const MOUNT_SHARE: f32 = 0.6;
/// … normals within this (cosine), and heights within so many extents.
const MOUNT_COSINE: f32 = 0.8;
const MOUNT_HEIGHT: f32 = 0.5;
/// Standard deviation of the flux between views that speaks against a shape as much as a residual
/// that is twice as large, at least; …
const DEVIATION: f32 = 0.05;
/// … of a lamp that has few pixels in a view, over the square root of their number.
const DOUBT: f32 = 0.25;

/// A pixel as a fit wants it.
struct Target {
    /// Unit directions of its rays.
    rays: [Vec3; (RAYS * RAYS) as usize],
    /// Part of it that the lamp covers, 0 to 1.
    cover: f32,
    /// Pixels that it stands for.
    weight: f32,
    /// Distance along its rays at which a lamp is behind what the scene has there.
    hidden_from: f32,
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

/// Fits the lamp of `group`, `up` being the unit vector upwards; `None` where its pixels have no extent.
pub(crate) fn fit(evidence: &Evidence, group: &Group, up: Vec3) -> Option<Fit> {
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
    let doubtful = DOUBT / (group.members.len() as f32 / patches.len() as f32).sqrt();
    let flats = normals(&points, towards, mount(evidence, group, centre, extent), up);
    let mut starts: Vec<(Shape, bool)> = Vec::new();
    for (normal, is_mount) in flats {
        let flat = first_flat(&points, centre, normal, pixel);
        starts.push((Shape::Rectangle(flat), is_mount));
        starts.push((Shape::Ellipse(flat), is_mount));
    }
    starts.push((
        Shape::Ball {
            centre,
            radius: 0.5 * extent,
        },
        false,
    ));
    for axis in axes(&points) {
        starts.push((first_tube(&points, centre, axis, pixel), false));
    }
    let fits: Vec<(Fit, bool)> = starts
        .par_iter()
        .map(|(start, is_fixed)| {
            let fit = refined(start, *is_fixed, NUM_FIRST_TRIALS, &patches);
            (fit, *is_fixed)
        })
        .collect();
    let promising = ranked(evidence, group, fits, doubtful)
        .into_iter()
        .take(NUM_PROMISING);
    let promising: Vec<(Fit, bool)> = promising.collect();
    let fits: Vec<(Fit, bool)> = (promising.into_par_iter())
        .map(|(fit, is_fixed)| {
            // The corners of a search grow flat: another one starts from where it ended.
            let mut fit = fit;
            for _ in 0..2 {
                fit = refined(&fit.shape, is_fixed, NUM_TRIALS, &patches);
            }
            (fit, is_fixed)
        })
        .collect();
    ranked(evidence, group, fits, doubtful)
        .first()
        .map(|(fit, _)| *fit)
}

/// Fits, and whether they keep the normal of a mount, the best first: those with the least residual,
/// where those with more freedom have to be better by [`BETTER`], and views have to agree on the
/// flux.
fn ranked(
    evidence: &Evidence,
    group: &Group,
    fits: Vec<(Fit, bool)>,
    doubtful: f32,
) -> Vec<(Fit, bool)> {
    let better = if group.members.len() < FEW {
        BETTER_OF_FEW
    } else {
        BETTER
    };
    let score = |(fit, is_mount): &(Fit, bool)| {
        let freedom = match fit.shape {
            Shape::Rectangle(_) | Shape::Ellipse(_) => i32::from(!*is_mount),
            Shape::Ball { .. } | Shape::Tube { .. } => 0,
        };
        let measured = measure(evidence, group, &fit.shape)?;
        let doubt = 1.0 + (measured.deviation / DEVIATION.max(doubtful)).powi(2);
        Some((fit.residual + MIN_RESIDUAL) * better.powi(-freedom) * doubt)
    };
    let mut scored: Vec<(f32, (Fit, bool))> = (fits.into_iter())
        .filter_map(|fit| Some((score(&fit)?, fit)))
        .collect();
    scored.sort_by(|a, b| a.0.total_cmp(&b.0));
    scored.into_iter().map(|(_, fit)| fit).collect()
}

/// A lit pixel in space.
struct Point {
    position: Vec3,
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
            let own: HashSet<u32> = own.iter().copied().collect();
            let of_own = || own.iter().map(|&i| &sight.pixels[i as usize]);
            let bounds = |of: fn(&Pixel) -> u32| {
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
                    weight: pixel.weight,
                    hidden_from: hidden_from(sight, pixel),
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
                target.weight *= step as f32;
            }
            (!is_plain(&target) || at % step == 0).then_some(target)
        })
        .collect()
}

/// Distance along the ray of a pixel at which something is behind what the scene has there.
pub(crate) fn hidden_from(sight: &Sight, pixel: &Pixel) -> f32 {
    let tolerance = (HIDDEN_PIXELS * sight.pixel_width()).max(HIDDEN_SHARE);
    pixel.distance * (1.0 + tolerance)
}

/// Radiance of the lamp where it fills a pixel: the brightest channel of most of the pixels that it
/// is alone in, or else of its brightest ones.
fn brightness(evidence: &Evidence, group: &Group) -> f32 {
    let values = |inside: bool| {
        let pixels = group
            .members
            .iter()
            .map(|&(view, pixel)| &evidence.sights[view as usize].pixels[pixel as usize]);
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
            let (mut met, mut farthest) = (0, 0.0_f32);
            for distance in target
                .rays
                .iter()
                .filter_map(|ray| shape.meet(patch.origin, *ray))
            {
                met += 1;
                farthest = farthest.max(distance);
            }
            let cover = met as f32 / (RAYS * RAYS) as f32;
            // A lamp may go on behind what hides it, but has no reason to.
            let is_hidden = cover > target.cover && farthest > target.hidden_from;
            let weight = target.weight * if is_hidden { HIDDEN } else { 1.0 };
            error += weight * (cover - target.cover).powi(2);
            all += target.weight * target.cover * target.cover;
        }
    }
    error / all.max(f32::MIN_POSITIVE)
}

fn refined(start: &Shape, keeps_normal: bool, num_trials: usize, patches: &[Patch]) -> Fit {
    let num = start.num_changes() - if keeps_normal { 2 } else { 0 };
    let with = |by: &[f32]| {
        let mut all = [0.0; MAX_CHANGES];
        all[..num].copy_from_slice(by);
        start.changed(&all)
    };
    let steps = start.first_steps();
    let value = |by: &[f32]| residual(&with(by), patches);
    let (by, residual) = search::minimum(value, &steps[..num], num_trials);
    Fit {
        shape: with(&by),
        residual,
    }
}

/// Normals that a flat lamp may have, towards the cameras, and whether it is that of the surface it
/// is mounted on.
fn normals(points: &[Point], towards: Vec3, mount: Option<Vec3>, up: Vec3) -> Vec<(Vec3, bool)> {
    let turned = |n: Vec3| if n.dot(towards) < 0.0 { -n } else { n };
    let plane = FittedPlane::through(points.iter().map(|p| p.position));
    let mut found: Vec<(Vec3, bool)> = mount.map(|n| (turned(n), true)).into_iter().collect();
    // Most lamps face up or down, if they are flat.
    if mount.is_none_or(|n| n.dot(up).abs() < MOUNT_COSINE) {
        found.push((turned(up), true));
    }
    found.extend(mount.map(|n| (turned(n), false)));
    found.extend(plane.normal.map(|n| (turned(n), false)));
    found.extend(towards.try_normalize().map(|n| (n, false)));
    found
}

/// Normal of the surface around a lamp, if there is one in which it may lie.
fn mount(evidence: &Evidence, group: &Group, centre: Vec3, extent: f32) -> Option<Vec3> {
    let mut near: HashSet<(u32, u32, u32)> = HashSet::new();
    for &(view, pixel) in &group.members {
        let Pixel { x, y, .. } = evidence.sights[view as usize].pixels[pixel as usize];
        for v in y.saturating_sub(MOUNT_RING)..=y + MOUNT_RING {
            let row = x.saturating_sub(MOUNT_RING)..=x + MOUNT_RING;
            near.extend(row.map(|u| (view, u, v)));
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
                let position = sight.origin + pixel.direction * pixel.distance;
                around.push((position, pixel.normal));
            }
        }
    }
    let normal = median(around.iter().map(|a| a.1)).try_normalize()?;
    let holds = |(position, own): &&(Vec3, Vec3)| {
        own.dot(normal) > MOUNT_COSINE
            && (*position - centre).dot(normal).abs() < MOUNT_HEIGHT * extent
    };
    let num = around.iter().filter(holds).count();
    (num >= MIN_MOUNT && num as f32 > MOUNT_SHARE * around.len() as f32).then_some(normal)
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
