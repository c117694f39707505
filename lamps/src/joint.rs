//! Lamps that touch in photographs, fitted together: what one hides of another, and pixels that
//! show two, say nothing of either by itself.

use crate::evidence::Evidence;
use crate::fit::{BETTER, Fit, MIN_RESIDUAL};
use crate::group::Group;
use crate::parts::among;
use crate::patches::{Gaps, Patch, patches, residual_of_all};
use crate::search;
use crate::shape::{MAX_CHANGES, Shape};
use crate::starts::{extent, points};
use rayon::prelude::*;

/// Rounds in which each shape is fitted among the others.
const NUM_ROUNDS: usize = 2;
/// Evaluations of a search.
const NUM_TRIALS: usize = 200;

/// The lamps with shapes that explain together what views show of all of them. Pixels that miss
/// all by more than they are large are of none.
pub(crate) fn fitted(evidence: &Evidence, parts: Vec<(Group, Fit)>) -> Vec<(Group, Fit)> {
    let mut shapes: Vec<Shape> = parts.iter().map(|(_, fit)| fit.shape).collect();
    let mut whole = Group::default();
    for (group, fit) in &parts {
        whole.join(near(evidence, group, &fit.shape));
    }
    whole.members.sort_unstable();
    let Some((centre, size)) = extent(&points(evidence, &whole)) else {
        return parts;
    };
    let patches = patches(evidence, &whole, centre, size);
    let mut residual = residual_of_all(&shapes, &patches);
    for _ in 0..NUM_ROUNDS {
        for at in 0..shapes.len() {
            let own = shapes[at];
            let ball = Shape::Ball {
                centre: own.centre(),
                radius: 0.5 * own.size().element_product().cbrt(),
            };
            let found: Vec<(Shape, f32)> = [ball, own]
                .par_iter()
                .map(|start| refined(start, at, &shapes, &patches))
                .collect();
            let [(ball, of_ball), (own, of_own)] = [found[0], found[1]];
            // Of few pixels other shapes, with more freedom, explain the borders a little better.
            let is_ball = BETTER * (of_ball + MIN_RESIDUAL) <= of_own + MIN_RESIDUAL;
            (shapes[at], residual) = if is_ball {
                (ball, of_ball)
            } else {
                (own, of_own)
            };
        }
    }
    let groups = among(evidence, &whole, &shapes);
    let gaps = Gaps::Seen;
    (groups.into_iter().zip(shapes))
        .map(|(group, shape)| {
            (
                group,
                Fit {
                    shape,
                    residual,
                    gaps,
                },
            )
        })
        .collect()
}

/// The pixels of `group` that miss `shape` by no more than it is large: others are of another lamp.
fn near(evidence: &Evidence, group: &Group, shape: &Shape) -> Group {
    let is_far = |member: &(u32, u32)| {
        let (sight, pixel) = evidence.pixel(member);
        let origin = sight.origin();
        shape.off(origin, pixel.direction) * shape.centre().distance(origin) > shape.size().length()
    };
    let far: Vec<usize> = (group.members.iter())
        .map(|member| usize::from(is_far(member)))
        .collect();
    group.divided(&far, 1).remove(0)
}

/// The best shape about `start` in the place of one of `shapes`, and the residual of all.
fn refined(start: &Shape, at: usize, shapes: &[Shape], patches: &[Patch]) -> (Shape, f32) {
    let num = start.num_changes();
    let with = |by: &[f32]| {
        let mut all = [0.0; MAX_CHANGES];
        all[..num].copy_from_slice(by);
        start.changed(&all)
    };
    let value = |by: &[f32]| {
        let mut all = shapes.to_vec();
        all[at] = with(by);
        residual_of_all(&all, patches)
    };
    let (by, residual) = search::minimum(value, &start.first_steps()[..num], NUM_TRIALS);
    (with(&by), residual)
}
