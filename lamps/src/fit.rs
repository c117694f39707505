//! The shape of a lamp: of a rectangle, an ellipse, a ball, a tube and a box the one whose
//! silhouettes are most like what the views show.

use crate::bars::behind_bars;
use crate::bearings;
use crate::boxes;
use crate::evidence::{Evidence, Lit};
use crate::group::Group;
use crate::measure;
use crate::patches::{Gaps, Patch, differences, patches, residual};
use crate::search::{best_shape, descent};
use crate::shape::Shape;
use crate::starts::{self, axes, first_flat, first_tube, mount, normals, points};
use eagpt_scene::median::median_of;
use glam::Vec3;
use rayon::prelude::*;
use std::cmp::Ordering;

/// How much better a shape with more freedom has to fit than one with less.
pub(crate) const BETTER: f32 = 0.6;
/// … and that of a lamp of less than [`FEW`] pixels in all views, which say little of a shape.
const BETTER_OF_FEW: f32 = 0.4;
const FEW: usize = 120;
/// Freedom of flat shapes and boxes that are tilted against their mount and the vertical, of tubes
/// that are, and of edges.
const TILTED: f32 = 1.0;
const TURNED: f32 = 0.5;
const EDGES: f32 = 0.5;
/// Residual from which on a shape is no better than none, though views may agree on its flux.
const NOTHING: f32 = 0.9;
/// Thickness of a box that is flat, in its narrower other side.
const FLAT: f32 = 0.1;
/// Residuals below this are alike.
pub(crate) const MIN_RESIDUAL: f32 = 0.002;
/// Steps of a descent from every start, and evaluations of a search from the best of where they end.
const NUM_STEPS: usize = 15;
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
    let search = Search {
        patches: &patches,
        views: measure::Views::new(evidence, group),
        width: pixel,
        better: if group.members.len() < FEW {
            BETTER_OF_FEW
        } else {
            BETTER
        },
        doubtful: DEVIATION.max(doubtful),
    };
    let mut starts: Vec<(Shape, bool)> = Vec::new();
    for (normal, is_mount) in flats {
        let flat = first_flat(&points, centre, normal, pixel);
        starts.push((Shape::Rectangle(flat), is_mount));
        starts.push((Shape::Ellipse(flat), is_mount));
    }
    let radius = 0.5 * extent;
    starts.push((Shape::Ball { centre, radius }, true));
    starts.push((first_tube(&points, centre, up, pixel), true));
    for axis in axes(&points) {
        starts.push((first_tube(&points, centre, axis, pixel), false));
    }
    let mut fits = search.best(&starts, NUM_PROMISING);
    let best = fits.first()?;
    // A thin lamp that looks flat may be one of the sides of a bar.
    let is_flat = best.fit.shape.flat().is_some();
    let may_have_edges = is_flat || shows_edges(evidence, group);
    if (is_flat && !best.is_upright) || (best.fit.residual > PERFECT && may_have_edges) {
        let found: Vec<Shape> = fits.iter().map(|found| found.fit.shape).collect();
        let boxes = boxes::starts(&points, &found, up);
        let boxes = search.best(&boxes, NUM_PROMISING_BOXES);
        // A search for a long tube that begins beside it misses it.
        let tubes: Vec<(Shape, bool)> = (boxes.iter())
            .filter_map(|found| Some((boxes::tube(&found.fit.shape)?, false)))
            .collect();
        fits.extend(search.best(&tubes, NUM_PROMISING_BOXES));
        fits.extend(boxes);
    }
    let best = fits.into_iter().min_by(Scored::order)?.fit;
    Some(with_bars(evidence, group, &best, &patches).unwrap_or(best))
}

/// A fit and how much speaks against it.
struct Scored {
    fit: Fit,
    /// Whether it keeps the z axis that it was given: that of its mount, or the vertical.
    is_upright: bool,
    score: f32,
}

impl Scored {
    /// The better ones first.
    fn order(&self, other: &Self) -> Ordering {
        let explains_nothing = |scored: &Self| scored.fit.residual > NOTHING;
        let apart = explains_nothing(self).cmp(&explains_nothing(other));
        apart.then(self.score.total_cmp(&other.score))
    }
}

/// A lamp that shapes are to explain.
struct Search<'a> {
    patches: &'a [Patch],
    views: measure::Views<'a>,
    /// Width of a pixel on the lamp, scene units.
    width: f32,
    /// How much better a shape with more freedom has to be.
    better: f32,
    /// Deviation of the flux between views that speaks against a shape.
    doubtful: f32,
}

impl Search<'_> {
    /// The best shapes that are found from some that may keep their z axis, and whether they do,
    /// at most `num` of them, the best first.
    fn best(&self, starts: &[(Shape, bool)], num: usize) -> Vec<Scored> {
        let first = starts.par_iter().map(|(start, is_upright)| {
            let fit = descended(start, *is_upright, self.width, self.patches);
            (fit, *is_upright)
        });
        let mut promising = self.ranked(first.collect());
        promising.truncate(num);
        let refined = promising.into_par_iter().map(|found| {
            let is_upright = found.is_upright;
            let fit = refined_again(&found.fit.shape, is_upright, self.patches, Gaps::Seen);
            (fit, is_upright)
        });
        self.ranked(refined.collect())
    }

    /// Fits, and whether they keep their z axis, the best first: those with least residual, where
    /// those with more freedom have to be better, and views have to agree on the flux.
    fn ranked(&self, fits: Vec<(Fit, bool)>) -> Vec<Scored> {
        let scored = fits.into_iter().filter_map(|(fit, is_upright)| {
            let tilted = |by: f32| if is_upright { 0.0 } else { by };
            let freedom = match fit.shape {
                Shape::Ball { .. } => 0.0,
                Shape::Rectangle(_) | Shape::Ellipse(_) => tilted(TILTED),
                Shape::Tube { .. } => tilted(TURNED),
                Shape::Box { size, .. } if is_flat(size) => return None,
                Shape::Box { .. } => tilted(TILTED) + EDGES,
            };
            let measured = self.views.measure(&fit.shape)?;
            let doubt = 1.0 + (measured.expected_deviation() / self.doubtful).powi(2);
            let score = (fit.residual + MIN_RESIDUAL) * self.better.powf(-freedom) * doubt;
            Some(Scored {
                fit,
                is_upright,
                score,
            })
        });
        let mut scored: Vec<Scored> = scored.collect();
        scored.sort_by(Scored::order);
        scored
    }
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

/// Whether a box is no more than a panel, of which nobody knows whether both sides shine.
fn is_flat(size: Vec3) -> bool {
    let [a, b, c] = size.to_array();
    let middle = a.max(b).min(a.min(b).max(c));
    size.min_element() < FLAT * middle
}

/// The best shape of two searches from `start`: the corners of a search grow flat, so
/// another one starts from where it ended.
fn refined_again(start: &Shape, is_upright: bool, patches: &[Patch], gaps: Gaps) -> Fit {
    let first = refined(start, is_upright, patches, gaps);
    refined(&first.shape, is_upright, patches, gaps)
}

/// The best shape that a descent from `start` comes to.
fn descended(start: &Shape, is_upright: bool, width: f32, patches: &[Patch]) -> Fit {
    let gaps = Gaps::Seen;
    let shape = descent(
        start,
        num_changes(start, is_upright),
        NUM_STEPS,
        width,
        |shape| {
            let mut all = Vec::new();
            differences(&[*shape], patches, gaps, |difference| all.push(difference));
            all
        },
    );
    Fit {
        shape,
        residual: residual(&[shape], patches, gaps),
        gaps,
    }
}

fn num_changes(shape: &Shape, is_upright: bool) -> usize {
    if is_upright {
        shape.num_upright()
    } else {
        shape.num_changes()
    }
}

/// The best shape of a search about `start`.
fn refined(start: &Shape, is_upright: bool, patches: &[Patch], gaps: Gaps) -> Fit {
    let num_changes = num_changes(start, is_upright);
    let value = |shape: &Shape| residual(&[*shape], patches, gaps);
    let (shape, residual) = best_shape(start, num_changes, NUM_TRIALS, value);
    Fit {
        shape,
        residual,
        gaps,
    }
}
