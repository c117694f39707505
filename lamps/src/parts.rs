//! Lamps that no view shows apart, as bulbs of a cluster that touch in photographs: where one shape
//! does not explain the silhouettes, two may.

use crate::candidates::is_enough;
use crate::evidence::Evidence;
use crate::fit::{BETTER, Fit, MIN_RESIDUAL, fit};
use crate::group::Group;
use crate::joint;
use crate::patches::{Gaps, patches, residual_of_all};
use crate::shape::Shape;
use crate::starts::{extent, points, points_at};
use eagpt_scene::median::median;
use glam::Vec3;
use rayon::prelude::*;

/// Residual up to which one shape is enough.
const PERFECT: f32 = 0.03;
/// Share of points that are nearer to a cluster than one that is far.
const FAR: f32 = 0.85;
/// Rounds of giving pixels to shapes and fitting these.
const NUM_ROUNDS: usize = 2;
/// Steps in which points are divided in two.
const NUM_STEPS: usize = 8;

/// The lamp of `group`, or those that explain its pixels better than its `fit`; `up` is the unit
/// vector upwards.
pub(crate) fn all(evidence: &Evidence, group: Group, fit: Fit, up: Vec3) -> Vec<(Group, Fit)> {
    let parts = apart(evidence, group, fit, up);
    match parts.len() {
        1 => parts,
        _ => joint::fitted(evidence, parts),
    }
}

fn apart(evidence: &Evidence, group: Group, fit: Fit, up: Vec3) -> Vec<(Group, Fit)> {
    match parted(evidence, &group, &fit, up) {
        Some(parts) => (parts.into_iter())
            .flat_map(|(group, fit)| apart(evidence, group, fit, up))
            .collect(),
        None => vec![(group, fit)],
    }
}

/// The pixels of `group` that each of `shapes` has: those that meet it, or miss it by least.
pub(crate) fn among(evidence: &Evidence, group: &Group, shapes: &[Shape]) -> Vec<Group> {
    let of_pixel = |member: &(u32, u32)| {
        let (sight, pixel) = evidence.pixel(member);
        let off = shapes
            .iter()
            .map(|shape| shape.off(sight.origin(), pixel.direction));
        let nearest = off.enumerate().min_by(|a, b| a.1.total_cmp(&b.1));
        nearest.map_or(0, |(shape, _)| shape)
    };
    let of: Vec<usize> = group.members.iter().map(of_pixel).collect();
    group.divided(&of, shapes.len())
}

/// Two lamps in place of that of `group`, if they explain its silhouettes much better than `whole`.
fn parted(evidence: &Evidence, group: &Group, whole: &Fit, up: Vec3) -> Option<Vec<(Group, Fit)>> {
    if whole.residual <= PERFECT || whole.gaps == Gaps::Bars {
        return None;
    }
    let own = points(evidence, group);
    let (centre, size) = extent(&own)?;
    let patches = patches(evidence, group, centre, size);
    let pixels = || group.members.iter().map(|member| evidence.pixel(member));
    // Where the scene has a pixel, it may have it on what is behind.
    let in_scene: Vec<Vec3> = own.iter().map(|point| point.position).collect();
    let about_centre: Vec<Vec3> = points_at(evidence, group, centre)
        .iter()
        .map(|point| point.position)
        .collect();
    let left_over: Vec<usize> = pixels()
        .map(|(sight, pixel)| usize::from(whole.shape.off(sight.origin(), pixel.direction) > 0.0))
        .collect();
    let starts = [left_over, in_two(&in_scene), in_two(&about_centre)];
    let tried = starts.par_iter().filter_map(|start| {
        let mut parts = group.divided(start, 2);
        let mut fits: Vec<Fit> = Vec::new();
        let mut shapes = Vec::new();
        for _ in 0..NUM_ROUNDS {
            let fitted = parts.iter().map(|part| fit(evidence, part, up));
            fits = fitted.collect::<Option<_>>()?;
            shapes = fits.iter().map(|fit| fit.shape).collect();
            parts = among(evidence, group, &shapes);
        }
        let residual = residual_of_all(&shapes, &patches);
        let found: Vec<(Group, Fit)> = parts.into_iter().zip(fits).collect();
        let are_enough = found.iter().all(|(group, _)| is_enough(group));
        are_enough.then_some((residual, found))
    });
    let tried: Vec<(f32, Vec<(Group, Fit)>)> = tried.collect();
    let (both, parts) = (tried.into_iter()).min_by(|a, b| a.0.total_cmp(&b.0))?;
    (both + MIN_RESIDUAL < BETTER * (whole.residual + MIN_RESIDUAL)).then_some(parts)
}

/// Which of two clusters points are of (Lloyd 1982, of medians), at first about points far from each
/// other: some points are of other lamps, far away.
fn in_two(points: &[Vec3]) -> Vec<usize> {
    let far_from = |centre: Vec3| {
        let mut away: Vec<&Vec3> = points.iter().collect();
        let distance = |point: &Vec3| point.distance_squared(centre);
        away.sort_by(|a, b| distance(a).total_cmp(&distance(b)));
        *away[((away.len() - 1) as f32 * FAR) as usize]
    };
    let first = far_from(median(&points.iter().copied()));
    let mut centres = [first, far_from(first)];
    let mut of = Vec::new();
    for _ in 0..NUM_STEPS {
        let nearest = |p: &Vec3| {
            let [first, second] = centres.map(|centre| p.distance_squared(centre));
            usize::from(second < first)
        };
        of = points.iter().map(nearest).collect();
        for (part, centre) in centres.iter_mut().enumerate() {
            let own = points.iter().zip(&of).filter(|(_, of)| **of == part);
            if own.clone().next().is_some() {
                *centre = median(&own.map(|(point, _)| *point));
            }
        }
    }
    of
}
