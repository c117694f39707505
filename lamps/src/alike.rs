//! Lamps of one make: spots in a row, strips under cabinets. Where one of them shows what it is,
//! the others are of the same shape and size, and only their places are looked for.

use crate::candidates::Candidate;
use crate::evidence::Evidence;
use crate::fit::shape_search::{Criterion, Fit};
use crate::pixels::measure::Views;
use crate::pixels::patches::{Patch, patches};
use crate::pixels::silhouette::Gaps;
use crate::shape::Shape;
use crate::shape::search::best_place;
use glam::{Quat, Vec3};
use rayon::prelude::*;
use std::f32::consts::FRAC_PI_2;

/// Lamps of one make are at most this many times as long as each other by their own fits, …
const LONGER: f32 = 2.0;
/// … and look at most this many times as large.
const LARGER: f32 = 4.0;

/// A lamp that may be of one make with others.
struct Member<'a> {
    /// Its index among the candidates.
    index: usize,
    patches: Vec<Patch>,
    views: Views<'a>,
    criterion: Criterion,
    own: Shape,
    /// Evidence against its own shape.
    against_own: f32,
}

/// Gives lamps that are alike the shape and the size of that one of them that explains most.
pub(crate) fn share_shapes(evidence: &Evidence, found: &mut [Candidate]) {
    let indices = (0..found.len()).filter(|&i| found[i].is_model());
    for set in sets(found, indices.collect()) {
        let members = set.into_iter();
        let members: Vec<Member<'_>> = members
            .map(|index| Member::new(evidence, found, index))
            .collect();
        for (member, fit) in members.iter().zip(common(&members)) {
            let changed = fit.and_then(|fit| found[member.index].with_fit(evidence, fit));
            if let Some(changed) = changed {
                found[member.index] = changed;
            }
        }
    }
}

/// Whether two lamps may be of one make by their radiance and their own fits.
fn are_alike(a: &Candidate, b: &Candidate) -> bool {
    let within = |a: f32, b: f32, most: f32| a <= most * b && b <= most * a;
    let longest = |c: &Candidate| c.fit.shape.size().max_element();
    let area = |c: &Candidate| c.fit.shape.mean_projection();
    !a.group.is_unlike(&b.group)
        && within(longest(a), longest(b), LONGER)
        && within(area(a), area(b), LARGER)
}

/// Sets of two or more lamps that are alike, directly or by others.
fn sets(found: &[Candidate], indices: Vec<usize>) -> Vec<Vec<usize>> {
    let mut sets: Vec<Vec<usize>> = Vec::new();
    for index in indices {
        let is_of = |set: &Vec<usize>| set.iter().any(|&i| are_alike(&found[i], &found[index]));
        let (mut joined, others): (Vec<_>, Vec<_>) = sets.into_iter().partition(is_of);
        joined.push(vec![index]);
        sets = others;
        sets.push(joined.concat());
    }
    sets.retain(|set| set.len() > 1);
    sets
}

impl<'a> Member<'a> {
    fn new(evidence: &'a Evidence, found: &[Candidate], index: usize) -> Self {
        let Candidate { group, fit, .. } = &found[index];
        let own = fit.shape;
        let extent = own.size().max_element();
        let patches = patches(evidence, group, own.centre(), extent);
        let mut member = Self {
            index,
            views: Views::new(evidence, group),
            criterion: Criterion::new(group.members.len(), patches.len()),
            patches,
            own,
            against_own: 0.0,
        };
        member.against_own = member.against(&own);
        member
    }

    /// Evidence against a shape; infinity where no view sees it.
    fn against(&self, shape: &Shape) -> f32 {
        let fit = Fit::new(*shape, &self.patches, Gaps::Seen);
        let measured = self.views.measure(shape);
        measured.map_or(f32::INFINITY, |measured| {
            self.criterion
                .against(&fit, measured.expected_disagreement(false))
        })
    }

    /// Its fit with the form and the size of `model`, which has less freedom, and a ball, which looks
    /// the same from everywhere, less than that in place of another shape; and the evidence against
    /// that over the most that there may be: at most 1, or there is none.
    fn placed(&self, model: &Shape) -> Option<(Fit, f32)> {
        let places = starts(model, &self.own).into_iter();
        let (shape, against) = places
            .map(|start| best_place(&start, |shape| self.against(shape)))
            .min_by(|a, b| a.1.total_cmp(&b.1))?;
        let is_ball = |shape: &Shape| matches!(shape, Shape::Ball { .. });
        let freedom = if is_ball(model) && !is_ball(&self.own) {
            2
        } else {
            1
        };
        let share = against * self.criterion.better.powi(freedom) / self.against_own;
        (share <= 1.0).then(|| (Fit::new(shape, &self.patches, Gaps::Seen), share))
    }
}

/// The fits of members with the shape of that one of them that most others accept, and best; none
/// for those that do not, and for itself.
fn common(members: &[Member<'_>]) -> Vec<Option<Fit>> {
    let of_model = |model: usize| {
        let others = members.par_iter().enumerate().map(|(i, member)| {
            let shape = (i != model).then_some(members[model].own)?;
            member.placed(&shape)
        });
        others.collect::<Vec<_>>()
    };
    let num_accepted = |fits: &Vec<Option<(Fit, f32)>>| fits.iter().flatten().count();
    let cost = |fits: &Vec<Option<(Fit, f32)>>| {
        let shares = fits.iter().flatten().map(|(_, share)| share.ln());
        shares.sum::<f32>()
    };
    let best = (0..members.len()).map(of_model).min_by(|a, b| {
        let more = num_accepted(b).cmp(&num_accepted(a));
        more.then(cost(a).total_cmp(&cost(b)))
    });
    let fits = best.into_iter().flatten();
    fits.map(|placed| Some(placed?.0)).collect()
}

/// Shapes of the size of `model` at the place of `own`, turned as either.
fn starts(model: &Shape, own: &Shape) -> Vec<Shape> {
    let centre = own.centre();
    let quarter = Quat::from_rotation_z(FRAC_PI_2);
    let model_rotation = model.rotation();
    let mut rotations = vec![model_rotation];
    match model {
        Shape::Ball { .. } => {}
        Shape::Tube { .. } => {
            rotations.extend(matches!(own, Shape::Tube { .. }).then(|| own.rotation()));
        }
        Shape::Rectangle(_) | Shape::Ellipse(_) | Shape::Box { .. } => {
            rotations.push(model_rotation * quarter);
            if own.kind() == model.kind() {
                rotations.extend([own.rotation(), own.rotation() * quarter]);
            }
        }
    }
    let at = |rotation| model.placed(centre, rotation, Vec3::ONE);
    rotations.into_iter().map(at).collect()
}
