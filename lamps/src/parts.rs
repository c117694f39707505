//! Lamps that no view shows apart, as bulbs of a cluster that touch in photographs: where one shape
//! does not explain the silhouettes, two may.

use crate::evidence::Evidence;
use crate::fit::{BETTER, Fit, MIN_RESIDUAL, fit, is_large};
use crate::group::Group;
use crate::patches::{Gaps, patches, residual_of_all};
use crate::shape::Shape;
use crate::starts::{extent, points};
use glam::Vec3;

/// Residual up to which one shape is enough.
const PERFECT: f32 = 0.03;
/// Rounds of giving pixels to shapes and fitting these.
const NUM_ROUNDS: usize = 2;
/// Steps in which points are divided in two.
const NUM_STEPS: usize = 8;

/// The lamp of `group`, or those that explain its pixels better than its `fit`; `up` is the unit
/// vector upwards.
pub(crate) fn all(evidence: &Evidence, group: Group, fit: Fit, up: Vec3) -> Vec<(Group, Fit)> {
    match parted(evidence, &group, &fit, up) {
        Some(parts) => (parts.into_iter())
            .flat_map(|(group, fit)| all(evidence, group, fit, up))
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
    if whole.residual <= PERFECT || whole.gaps == Gaps::Bars || is_large(group) {
        return None;
    }
    let (centre, size) = extent(&points(evidence, group))?;
    let patches = patches(evidence, group, centre, size);
    let pixels = || group.members.iter().map(|member| evidence.pixel(member));
    // Where the scene has a pixel, it may have it on what is behind.
    let beside_centre: Vec<Vec3> = pixels()
        .map(|(sight, pixel)| sight.origin() + pixel.direction * centre.distance(sight.origin()))
        .collect();
    let left_over: Vec<usize> = pixels()
        .map(|(sight, pixel)| usize::from(whole.shape.off(sight.origin(), pixel.direction) > 0.0))
        .collect();
    let starts = [left_over, in_two(&beside_centre)];
    let tried = starts.iter().filter_map(|start| {
        let mut parts = group.divided(start, 2);
        let mut fits: Vec<Fit> = Vec::new();
        let mut shapes = Vec::new();
        for _ in 0..NUM_ROUNDS {
            let fitted = parts.iter().map(|part| fit(evidence, part, up));
            fits = fitted.collect::<Option<_>>()?;
            shapes = fits.iter().map(|fit| fit.shape).collect();
            parts = among(evidence, group, &shapes);
        }
        let found: Vec<(Group, Fit)> = parts.into_iter().zip(fits).collect();
        Some((residual_of_all(&shapes, &patches), found))
    });
    let (both, parts) = tried.min_by(|a, b| a.0.total_cmp(&b.0))?;
    // Each of two shapes has as much freedom again.
    let least = BETTER * BETTER * (whole.residual + MIN_RESIDUAL);
    (both + MIN_RESIDUAL < least).then_some(parts)
}

/// Which of two clusters points are of (Lloyd 1982), about points far from each other.
fn in_two(points: &[Vec3]) -> Vec<usize> {
    let farthest = |from: Vec3| {
        let away = |a: &&Vec3| a.distance_squared(from);
        let far = points.iter().max_by(|a, b| away(a).total_cmp(&away(b)));
        far.copied().unwrap_or(from)
    };
    let mut centres = [farthest(points[0]), farthest(farthest(points[0]))];
    let mut of = Vec::new();
    for _ in 0..NUM_STEPS {
        let nearest = |p: &Vec3| {
            let [first, second] = centres.map(|centre| p.distance_squared(centre));
            usize::from(second < first)
        };
        of = points.iter().map(nearest).collect();
        centres = [0, 1].map(|part| {
            let own = points.iter().zip(&of).filter(|(_, of)| **of == part);
            let (sum, num) = own.fold((Vec3::ZERO, 0), |(sum, num), (p, _)| (sum + *p, num + 1));
            if num > 0 { sum / num as f32 } else { points[0] }
        });
    }
    of
}
