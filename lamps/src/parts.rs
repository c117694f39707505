//! Lamps that no view shows apart, as bulbs of a cluster that touch in photographs, or the pieces
//! of a bent tube: where one shape does not explain the silhouettes, several may. They are fitted
//! together: what one hides of another, and pixels that show two, say nothing of either by itself.

mod lines;

use crate::evidence::Evidence;
use crate::fit::by_silhouettes;
use crate::fit::shape_search::{BETTER, Fit, MIN_RESIDUAL};
use crate::group::Group;
use crate::group::points::{extent, points, points_at};
use crate::pixels::patches::{Patch, coarse, patches};
use crate::pixels::silhouette::{Gaps, Silhouette, residual};
use crate::shape::Shape;
use crate::shape::search::best_shape;
use eagpt_scene::median::{median, median_distance};
use glam::Vec3;
use lines::along_line;
use rayon::prelude::*;

/// Residual up to which one shape is enough.
const PERFECT: f32 = 0.03;
/// Residual up to which pieces explain a lamp, and least number of its pixels in all views: some
/// shapes always explain fewer.
const EXPLAINED: f32 = 0.06;
const ENOUGH_FOR_PIECES: usize = 400;
/// Most lamps in place of one.
const MAX_PARTS: usize = 4;
/// Share of points that are nearer to a cluster than one that is far.
const FAR: f32 = 0.85;
/// Steps in which points are divided.
const NUM_STEPS: usize = 8;
/// Rounds in which each shape is fitted among the others, and evaluations of each search.
const NUM_ROUNDS: usize = 3;
const NUM_TRIALS: usize = 150;

/// The lamp of `group`, or those that explain its pixels much better than its fit `whole`; `up` is
/// the unit vector upwards.
pub(crate) fn all(evidence: &Evidence, group: Group, whole: Fit, up: Vec3) -> Vec<(Group, Fit)> {
    parted(evidence, &group, &whole, up).unwrap_or_else(|| vec![(group, whole)])
}

/// The pixels of `group` that each of `shapes` has: those that meet it first, or miss it by least,
/// and by no more than it is large.
pub(crate) fn among(evidence: &Evidence, group: &Group, shapes: &[Shape]) -> Vec<Group> {
    let of_pixel = |member: &(u32, u32)| {
        let (sight, pixel) = evidence.pixel(member);
        let origin = sight.origin();
        let off = |shape: &Shape| {
            let off = shape.off(origin, pixel.direction);
            let is_far = off * shape.centre().distance(origin) > shape.size().length();
            (off, is_far)
        };
        let met = |shape: usize| {
            let distance = shapes[shape].meet(origin, pixel.direction);
            distance.unwrap_or(f32::INFINITY)
        };
        let nearest = shapes.iter().map(off).enumerate();
        let nearest = nearest.min_by(|(a, (off_a, _)), (b, (off_b, _))| {
            let by_off = off_a.total_cmp(off_b);
            by_off.then_with(|| met(*a).total_cmp(&met(*b)))
        });
        match nearest {
            Some((shape, (_, false))) => shape,
            _ => shapes.len(),
        }
    };
    let of: Vec<usize> = group.members.iter().map(of_pixel).collect();
    group.divided(&of, shapes.len())
}

/// Shapes in place of the lamp of `group`, if they explain it much better than its fit `whole`.
fn parted(evidence: &Evidence, group: &Group, whole: &Fit, up: Vec3) -> Option<Vec<(Group, Fit)>> {
    if whole.residual <= PERFECT || whole.gaps != Gaps::Seen {
        return None;
    }
    // Without pixels of lamps far away.
    let near = among(evidence, group, &[whole.shape]).remove(0);
    touching(evidence, &near, whole, up)
        .or_else(|| shown_apart(evidence, group, whole, up))
        .or_else(|| pieces(evidence, group, whole, up))
}

/// The lamps of a group that a view shows apart, where another one, which shows more detail, has
/// them in one region, if they explain it much better.
fn shown_apart(
    evidence: &Evidence,
    group: &Group,
    whole: &Fit,
    up: Vec3,
) -> Option<Vec<(Group, Fit)>> {
    if whole.residual <= EXPLAINED {
        return None;
    }
    let (_, _, seen) = seen(evidence, group)?;
    let regions = group.in_most_regions(evidence)?;
    let balls = regions.iter().map(|region| {
        let points = points(evidence, region).into_iter();
        ball(&points.map(|point| point.position).collect::<Vec<_>>())
    });
    let groups = among(evidence, group, &balls.collect::<Option<Vec<_>>>()?);
    if !groups.iter().all(Group::is_enough) {
        return None;
    }
    let shapes = groups
        .iter()
        .map(|group| by_silhouettes(evidence, group, up));
    let (residual, shapes) = fitted(shapes.collect::<Option<Vec<_>>>()?, &seen);
    let of_whole = residual_of(&[whole.shape], &seen);
    let is_better = residual + MIN_RESIDUAL < BETTER * (of_whole + MIN_RESIDUAL);
    is_better.then(|| shared_out(evidence, group, shapes, residual))
}

/// Balls in place of a lamp, if they explain its silhouettes much better, and other shapes in place
/// of these, if they do so again.
fn touching(
    evidence: &Evidence,
    group: &Group,
    whole: &Fit,
    up: Vec3,
) -> Option<Vec<(Group, Fit)>> {
    let (centre, _, seen) = seen(evidence, group)?;
    let of_whole = residual_of(&[whole.shape], &seen);
    let (mut residual, mut shapes) = balls(evidence, group, centre, of_whole, &seen)?;
    let groups = among(evidence, group, &shapes);
    if !groups.iter().all(Group::is_enough) {
        return None;
    }
    for (at, group) in groups.iter().enumerate() {
        let (other, of_other) = refined(&by_silhouettes(evidence, group, up)?, at, &shapes, &seen);
        if of_other + MIN_RESIDUAL < BETTER * (residual + MIN_RESIDUAL) {
            (shapes[at], residual) = (other, of_other);
        }
    }
    Some(shared_out(evidence, group, shapes, residual))
}

/// Shapes in place of a lamp that together explain it: each is that of a line of pixels that those
/// before leave over, if these have one.
fn pieces(evidence: &Evidence, group: &Group, whole: &Fit, up: Vec3) -> Option<Vec<(Group, Fit)>> {
    if group.members.len() < ENOUGH_FOR_PIECES {
        return None;
    }
    let (_, size, seen) = seen(evidence, group)?;
    let those = |group: &Group, are_those: &[bool]| {
        let of: Vec<usize> = are_those.iter().map(|is| usize::from(!is)).collect();
        group.divided(&of, 1).remove(0)
    };
    let (mut residual, mut shapes) = (whole.residual, Vec::new());
    while residual > EXPLAINED && shapes.len() < MAX_PARTS {
        let left = those(group, &left_over(evidence, group, &shapes));
        let at = points(evidence, &left).into_iter();
        let at: Vec<Vec3> = at.map(|point| point.position).collect();
        let piece = those(&left, &along_line(&at, size));
        if !piece.is_enough() {
            return None;
        }
        shapes.push(by_silhouettes(evidence, &piece, up)?);
        (residual, shapes) = fitted(shapes, &seen);
    }
    let is_explained = residual <= EXPLAINED && shapes.len() > 1;
    is_explained.then(|| shared_out(evidence, group, shapes, residual))
}

/// Middle and extent of a group, and the pixels that searches for its parts compare; `None` where
/// it has no extent.
fn seen(evidence: &Evidence, group: &Group) -> Option<(Vec3, f32, Vec<Patch>)> {
    let (centre, size) = extent(&points(evidence, group))?;
    let seen = coarse(&patches(evidence, group, centre, size));
    Some((centre, size, seen))
}

/// Fits of the `shapes` that a group consists of, and the pixels of each.
fn shared_out(
    evidence: &Evidence,
    group: &Group,
    shapes: Vec<Shape>,
    residual: f32,
) -> Vec<(Group, Fit)> {
    let gaps = Gaps::Seen;
    let fit = |(group, shape)| {
        let fit = Fit {
            shape,
            residual,
            gaps,
        };
        (group, fit)
    };
    let groups = among(evidence, group, &shapes).into_iter();
    groups.zip(shapes).map(fit).collect()
}

/// Which pixels of a group miss all of some shapes.
fn left_over(evidence: &Evidence, group: &Group, shapes: &[Shape]) -> Vec<bool> {
    let is_left = |member: &(u32, u32)| {
        let (sight, pixel) = evidence.pixel(member);
        let mut shapes = shapes.iter();
        shapes.all(|shape| shape.off(sight.origin(), pixel.direction) > 0.0)
    };
    group.members.iter().map(is_left).collect()
}

/// Two or more balls that explain the lamp of `group` about `centre` much better than one shape
/// `of_whole` residual, and their residual.
fn balls(
    evidence: &Evidence,
    group: &Group,
    centre: Vec3,
    of_whole: f32,
    seen: &[Patch],
) -> Option<(f32, Vec<Shape>)> {
    // Where the scene has a pixel, it may have it on what is behind.
    let points = [points(evidence, group), points_at(evidence, group, centre)]
        .map(|points| -> Vec<Vec3> { points.into_iter().map(|point| point.position).collect() });
    let best = |starts: [Vec<Shape>; 2]| {
        let fitted = starts.into_par_iter().map(|shapes| fitted(shapes, seen));
        fitted.min_by(|a, b| a.0.total_cmp(&b.0))
    };
    // Each more of them has as much freedom again.
    let score = |residual: f32, num: usize| {
        (residual + MIN_RESIDUAL) * BETTER.powi(1 - i32::try_from(num).unwrap_or(i32::MAX))
    };
    let mut least = score(of_whole, 1);
    let mut found = None;
    let mut start = points.each_ref().map(|points| two_balls(points));
    for _ in 1..MAX_PARTS {
        let (residual, shapes) = needed(best(start)?, seen);
        if shapes.len() > 1 && score(residual, shapes.len()) < least {
            least = score(residual, shapes.len());
            found = Some((residual, shapes.clone()));
        }
        // One more where pixels are left over.
        let left = left_over(evidence, group, &shapes);
        start = points.each_ref().map(|points| {
            let left = points.iter().zip(&left).filter(|(_, left)| **left);
            let ball = ball(&left.map(|(point, _)| *point).collect::<Vec<_>>());
            shapes.iter().copied().chain(ball).collect()
        });
    }
    found
}

fn residual_of(shapes: &[Shape], seen: &[Patch]) -> f32 {
    let silhouettes = silhouettes(shapes, seen);
    residual(&silhouettes.iter().collect::<Vec<_>>(), seen, Gaps::Seen)
}

fn silhouettes(shapes: &[Shape], seen: &[Patch]) -> Vec<Silhouette> {
    let silhouette = |shape| Silhouette::new(shape, seen);
    shapes.iter().map(silhouette).collect()
}

/// Those of shapes without which the others would explain much less, and their residual.
fn needed((mut residual, mut shapes): (f32, Vec<Shape>), seen: &[Patch]) -> (f32, Vec<Shape>) {
    while shapes.len() > 1 {
        let without = |at: usize| {
            let mut others = shapes.clone();
            others.remove(at);
            (residual_of(&others, seen), others)
        };
        let best = (0..shapes.len())
            .map(without)
            .min_by(|a, b| a.0.total_cmp(&b.0));
        match best {
            Some((of_others, others))
                if BETTER * (of_others + MIN_RESIDUAL) <= residual + MIN_RESIDUAL =>
            {
                (residual, shapes) = (of_others, others);
            }
            _ => break,
        }
    }
    (residual, shapes)
}

/// Shapes fitted one by one among the others, and their residual.
fn fitted(mut shapes: Vec<Shape>, seen: &[Patch]) -> (f32, Vec<Shape>) {
    let mut residual = f32::INFINITY;
    for _ in 0..NUM_ROUNDS {
        for at in 0..shapes.len() {
            (shapes[at], residual) = refined(&shapes[at], at, &shapes, seen);
        }
    }
    (residual, shapes)
}

/// The best shape about `start` in the place of one of `shapes`, and the residual of all.
fn refined(start: &Shape, at: usize, shapes: &[Shape], seen: &[Patch]) -> (Shape, f32) {
    let all = silhouettes(shapes, seen);
    best_shape(start, start.num_changes(), NUM_TRIALS, |shape| {
        let own = Silhouette::new(shape, seen);
        let mut all: Vec<&Silhouette> = all.iter().collect();
        all[at] = &own;
        residual(&all, seen, Gaps::Seen)
    })
}

/// Balls about two clusters of points (Lloyd 1982, of medians), at first about points far from each
/// other: some points are of other lamps.
fn two_balls(points: &[Vec3]) -> Vec<Shape> {
    let far_from = |centre: Vec3| {
        let mut away: Vec<(f32, Vec3)> = points.iter().map(|p| (p.distance(centre), *p)).collect();
        away.sort_by(|a, b| a.0.total_cmp(&b.0));
        away[((away.len() - 1) as f32 * FAR) as usize].1
    };
    let first = far_from(median(&points.iter().copied()));
    let mut centres = [first, far_from(first)];
    let mut clusters = [Vec::new(), Vec::new()];
    for _ in 0..NUM_STEPS {
        let [first, second] = centres;
        let is_second = |p: &Vec3| p.distance(second) < p.distance(first);
        clusters = [false, true].map(|second| -> Vec<Vec3> {
            let own = points.iter().filter(|point| is_second(point) == second);
            own.copied().collect()
        });
        for (centre, own) in centres.iter_mut().zip(&clusters) {
            if !own.is_empty() {
                *centre = median(&own.iter().copied());
            }
        }
    }
    clusters.iter().filter_map(|points| ball(points)).collect()
}

/// The ball about points, if there are any.
fn ball(points: &[Vec3]) -> Option<Shape> {
    let centre = median(&points.iter().copied());
    let radius = median_distance(centre, points.iter().copied());
    (radius > 0.0).then_some(Shape::Ball { centre, radius })
}
