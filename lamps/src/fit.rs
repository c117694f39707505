//! The shape of a lamp: of a rectangle, an ellipse, a ball, a tube and a box the one whose
//! silhouettes are most like what the views show.

use crate::bars::behind_bars;
use crate::bearings;
use crate::boxes;
use crate::evidence::{Evidence, Lit};
use crate::group::Group;
use crate::measure::measure;
use crate::patches::{Gaps, Patch, patches, residual};
use crate::search::best_shape;
use crate::shape::Shape;
use crate::starts::{self, axes, first_flat, first_tube, mount, normals, points};
use eagpt_scene::median::median_of;
use glam::Vec3;
use rayon::prelude::*;

/// How much better a shape with more freedom has to fit than one with less.
pub(crate) const BETTER: f32 = 0.6;
/// … and that of a lamp of less than [`FEW`] pixels in all views, which say little of a shape.
const BETTER_OF_FEW: f32 = 0.4;
const FEW: usize = 120;
/// Residuals below this are alike.
pub(crate) const MIN_RESIDUAL: f32 = 0.002;
/// Evaluations of the first search from every start, and of later ones from the best of these.
const NUM_FIRST_TRIALS: usize = 300;
const NUM_TRIALS: usize = 500;
const NUM_PROMISING: usize = 4;
const NUM_PROMISING_BOXES: usize = 2;
/// Share of the pixels of a lamp that have its own all around them from which on it shows edges: it
/// is four pixels wide.
const SHARE_INSIDE: f32 = 0.4;
/// Standard deviation of the flux between views that speaks against a shape as much as a residual
/// that is twice as large, at least; …
const DEVIATION: f32 = 0.05;
/// … of a lamp that has few pixels in a view, over the square root of their number.
const DOUBT: f32 = 0.25;

/// Residual of a fit beyond which a lamp is left as it was trained, if views show it as large as
/// [`LARGE`], or smaller.
const MAX_RESIDUAL: [f32; 2] = [0.06, 0.45];
/// … and that of one behind bars.
const MAX_RESIDUAL_BARS: f32 = 0.12;
/// Residual up to which a lamp needs no box to explain it, and a large one no bars.
const PERFECT: f32 = 0.015;
/// Pixels of a lamp in the view that shows it largest from which on it is large. Training gives
/// such lamps the right power, and what stands before them its place.
const LARGE: usize = 400;

/// A shape and how well it fits.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Fit {
    pub(crate) shape: Shape,
    /// Squared difference of covers over squared covers, 0 for a perfect fit.
    pub(crate) residual: f32,
    /// Where views do not show it, as the fit takes it.
    pub(crate) gaps: Gaps,
}

impl Fit {
    /// Whether the shape explains what the views show of a lamp of `group`.
    pub(crate) fn is_clean(&self, group: &Group) -> bool {
        let [large, small] = MAX_RESIDUAL;
        self.residual
            <= match self.gaps {
                Gaps::Bars => MAX_RESIDUAL_BARS,
                Gaps::Seen if is_large(group) => large,
                Gaps::Seen => small,
            }
    }
}

/// Whether the lamp is several pixels wide: else it has no edges that views could show.
fn shows_edges(evidence: &Evidence, group: &Group) -> bool {
    let pixels = group.members.iter().map(|member| evidence.pixel(member).1);
    let inside = pixels.filter(|pixel| pixel.lit == Lit::Inside);
    inside.count() as f32 > SHARE_INSIDE * group.members.len() as f32
}

fn is_large(group: &Group) -> bool {
    group.by_view().any(|(_, pixels)| pixels.len() >= LARGE)
}

/// Fits the lamp of `group`, `up` being the unit vector upwards; `None` where its pixels have no
/// extent.
pub(crate) fn fit(evidence: &Evidence, group: &Group, up: Vec3) -> Option<Fit> {
    let mut points = points(evidence, group);
    let (mut centre, mut extent) = starts::extent(&points)?;
    if let Some(met) = bearings::elsewhere(evidence, group, centre) {
        points = starts::points_at(evidence, group, met);
        (centre, extent) = starts::extent(&points)?;
    }
    let pixel = median_of(points.iter().map(|p| p.width));
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
            let fit = refined(start, *is_fixed, NUM_FIRST_TRIALS, &patches, Gaps::Seen);
            (fit, *is_fixed)
        })
        .collect();
    let promising = ranked(evidence, group, fits, doubtful)
        .into_iter()
        .take(NUM_PROMISING);
    let promising: Vec<(Fit, bool)> = promising.collect();
    let again = |(fit, is_fixed): (Fit, bool)| {
        let fit = refined_again(&fit.shape, is_fixed, &patches, Gaps::Seen);
        (fit, is_fixed)
    };
    let mut fits: Vec<(Fit, bool)> = promising.into_par_iter().map(again).collect();
    let (best, _) = *ranked(evidence, group, fits.clone(), doubtful).first()?;
    // A thin lamp that looks flat may be one of the sides of a bar.
    let may_have_edges = best.shape.flat().is_some() || shows_edges(evidence, group);
    if best.residual > PERFECT && may_have_edges {
        let first = |start: Shape| {
            let fit = refined(&start, false, NUM_FIRST_TRIALS, &patches, Gaps::Seen);
            (fit, false)
        };
        let boxes = boxes::starts(&points, &best.shape, up).into_par_iter();
        let mut boxes = ranked(evidence, group, boxes.map(first).collect(), doubtful);
        boxes.truncate(NUM_PROMISING_BOXES);
        fits.par_extend(boxes.into_par_iter().map(again));
    }
    let (best, _) = *ranked(evidence, group, fits, doubtful).first()?;
    Some(with_bars(evidence, group, &best, &patches).unwrap_or(best))
}

/// A flat lamp of many pixels behind bars, if that explains more than the `best` fit without.
fn with_bars(evidence: &Evidence, group: &Group, best: &Fit, patches: &[Patch]) -> Option<Fit> {
    if best.residual <= PERFECT || !is_large(group) {
        return None;
    }
    let start = Shape::Rectangle(*best.shape.flat()?);
    let fit = refined_again(&start, false, patches, Gaps::Bars);
    if fit.residual > MAX_RESIDUAL_BARS.min(BETTER * best.residual) {
        return None;
    }
    let flat = behind_bars(evidence, group, fit.shape.flat()?, patches)?;
    let shape = Shape::Rectangle(flat);
    Some(Fit { shape, ..fit })
}

/// Fits, and whether they keep the normal of a mount, the best first: those with least residual,
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
            Shape::Box { .. } => 1,
        };
        let measured = measure(evidence, group, &fit.shape)?;
        let doubt = 1.0 + (measured.expected_deviation() / DEVIATION.max(doubtful)).powi(2);
        Some((fit.residual + MIN_RESIDUAL) * better.powi(-freedom) * doubt)
    };
    let mut scored: Vec<(f32, (Fit, bool))> = (fits.into_iter())
        .filter_map(|fit| Some((score(&fit)?, fit)))
        .collect();
    scored.sort_by(|a, b| a.0.total_cmp(&b.0));
    scored.into_iter().map(|(_, fit)| fit).collect()
}

/// The best shape of two searches from `start`: the corners of a search grow flat, so another one
/// starts from where it ended.
fn refined_again(start: &Shape, keeps_normal: bool, patches: &[Patch], gaps: Gaps) -> Fit {
    let first = refined(start, keeps_normal, NUM_TRIALS, patches, gaps);
    refined(&first.shape, keeps_normal, NUM_TRIALS, patches, gaps)
}

/// The best of `num_trials` shapes about `start`.
fn refined(
    start: &Shape,
    keeps_normal: bool,
    num_trials: usize,
    patches: &[Patch],
    gaps: Gaps,
) -> Fit {
    let num_changes = start.num_changes() - if keeps_normal { 2 } else { 0 };
    let value = |shape: &Shape| residual(shape, patches, gaps);
    let (shape, residual) = best_shape(start, num_changes, num_trials, value);
    Fit {
        shape,
        residual,
        gaps,
    }
}
