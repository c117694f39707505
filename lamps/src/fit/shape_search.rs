//! Searches for the shape of a lamp, and what speaks for one against another.

use crate::fit::flatness::{self, is_rather_flat};
use crate::fit::halo::Beside;
use crate::group::Group;
use crate::pixels::measure;
use crate::pixels::patches::{Patch, coarse};
use crate::pixels::silhouette::{Gaps, Silhouette, differences, residual};
use crate::shape::search::{best_shape, descent};
use crate::shape::{Flat, Shape};
use glam::Vec3;
use rayon::prelude::*;
use std::cmp::Ordering;

/// How much better a shape with more freedom has to fit than one with less.
pub(crate) const BETTER: f32 = 0.6;
/// … and that of a lamp of less than [`FEW`] pixels in all views, which say little of a shape.
const BETTER_OF_FEW: f32 = 0.4;
const FEW: usize = 120;
/// Freedom of flat shapes and boxes that are tilted against their mount and the vertical, of flat
/// ones that are off their mount, of tilted tubes, and of edges and open ends.
const TILTED: f32 = 1.0;
const TURNED: f32 = 0.5;
const EDGES: f32 = 0.5;
/// Cosine between a flat shape and a mount from which on they are parallel, and widths of a pixel
/// from which on a parallel one is off it.
const PARALLEL: f32 = 0.999;
const OFF_PIXELS: f32 = 2.0;
/// Cosine from which on a flat shape shines away from a mount.
const AWAY: f32 = 0.5;
/// Residuals below this are alike.
pub(crate) const MIN_RESIDUAL: f32 = 0.002;
/// Residual from which on a shape explains little, though views may agree on its flux.
const LITTLE: f32 = 0.6;
/// Steps of a descent from every start; evaluations of a search from the best of where they end,
/// and of one that views are to agree on.
const NUM_STEPS: usize = 15;
const NUM_TRIALS: usize = 500;
const NUM_AGREED: usize = 150;
/// Shapes whose search goes on among all pixels.
const NUM_FINE: usize = 3;
/// Steps, in widths of a pixel, and their number, by which a search begins nearer and farther.
const FARTHER_PIXELS: f32 = 2.0;
const NUM_FARTHER: i32 = 2;
/// Standard deviation of the flux between views from which on a lamp is no solid one. In twelve
/// rooms that of tubes and boxes with their true power is at most 0.12.
const UNEVEN: f32 = 0.25;
/// Residual of a shape that views agree on, in that of the best one, at most.
const AS_GOOD: f32 = 2.0;
/// Standard deviation of the flux between views that speaks against a shape as much as a residual
/// that is twice as large, at least; …
const DEVIATION: f32 = 0.05;
/// … of a lamp that has few pixels in a view, over the square root of their number.
const DOUBT: f32 = 0.25;

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
    /// How well `shape` fits what `patches` show.
    pub(crate) fn new(shape: Shape, patches: &[Patch], gaps: Gaps) -> Self {
        Self {
            shape,
            residual: residual(&[&Silhouette::new(&shape, patches)], patches, gaps),
            gaps,
        }
    }
}

/// A fit and how much speaks against it.
pub(crate) struct Scored {
    pub(crate) fit: Fit,
    /// Whether it keeps the z axis that it was given: that of its mount, or the vertical.
    pub(crate) is_upright: bool,
    score: f32,
}

impl Scored {
    /// The better ones first.
    pub(crate) fn order(&self, other: &Self) -> Ordering {
        let explains_little = |scored: &Self| scored.fit.residual > LITTLE;
        let apart = explains_little(self).cmp(&explains_little(other));
        apart.then(self.score.total_cmp(&other.score))
    }
}

/// Measure by which one shape of a lamp is preferred to another.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Criterion {
    /// How much better a shape with more freedom has to be.
    pub(crate) better: f32,
    /// Deviation of the flux between views that speaks against a shape.
    doubtful: f32,
}

impl Criterion {
    /// Of a lamp that so many views show in so many pixels together.
    pub(crate) fn new(num_pixels: usize, num_views: usize) -> Self {
        let doubtful = DOUBT / (num_pixels as f32 / num_views as f32).sqrt();
        Self {
            better: if num_pixels < FEW {
                BETTER_OF_FEW
            } else {
                BETTER
            },
            doubtful: DEVIATION.max(doubtful),
        }
    }

    /// Evidence against a fit on whose flux views differ by this `deviation`: its residual, more of
    /// it the less they agree.
    pub(crate) fn against(&self, fit: &Fit, deviation: f32) -> f32 {
        (fit.residual + MIN_RESIDUAL) * (1.0 + (deviation / self.doubtful).powi(2))
    }
}

/// A lamp that shapes are to explain.
pub(crate) struct ShapeSearch<'a> {
    patches: &'a [Patch],
    /// The same by fewer pixels.
    coarse: Vec<Patch>,
    /// Places of the cameras of these.
    eyes: Vec<Vec3>,
    views: measure::Views<'a>,
    /// Width of a pixel on the lamp, scene units.
    width: f32,
    /// Surface that the lamp may be mounted on.
    beside: Option<Beside>,
    criterion: Criterion,
}

impl<'a> ShapeSearch<'a> {
    /// A search for the lamp of `group`, which `patches` and `views` show and whose pixels are of
    /// this `width`, scene units, and which may lie in the surface `beside` it.
    pub(crate) fn new(
        patches: &'a [Patch],
        views: measure::Views<'a>,
        group: &Group,
        width: f32,
        beside: Option<Beside>,
    ) -> Self {
        Self {
            patches,
            coarse: coarse(patches),
            eyes: patches.iter().map(|patch| patch.origin).collect(),
            views,
            width,
            beside,
            criterion: Criterion::new(group.members.len(), patches.len()),
        }
    }

    /// The best shapes that are found from some that may keep their z axis, and whether they do,
    /// at most `num` of them, the best first.
    pub(crate) fn best(&self, starts: &[(Shape, bool)], num: usize) -> Vec<Scored> {
        let first = starts.par_iter().map(|(start, is_upright)| {
            let fit = descended(start, *is_upright, self.width, &self.coarse);
            (fit, *is_upright)
        });
        let mut promising = self.ranked(first.collect(), false);
        promising.truncate(num);
        let rough = promising.into_par_iter().map(|found| {
            let is_upright = found.is_upright;
            let rough = refined(&found.fit.shape, is_upright, &self.coarse, Gaps::Seen);
            (Fit::new(rough.shape, self.patches, Gaps::Seen), is_upright)
        });
        let mut rough = self.ranked(rough.collect(), false);
        let others = rough.split_off(NUM_FINE.min(rough.len()));
        let fine = rough.into_par_iter().map(|found| {
            let is_upright = found.is_upright;
            let fit = refined(&found.fit.shape, is_upright, self.patches, Gaps::Seen);
            (fit, is_upright)
        });
        let mut found = self.ranked(fine.collect(), false);
        found.extend(others);
        found.sort_by(Scored::order);
        found
    }

    /// Shapes that look alike from the middle of the cameras, nearer and farther: silhouettes of
    /// views from one side say least of that.
    pub(crate) fn nearer_and_farther(&self, shape: &Shape) -> Vec<Shape> {
        let eye = self.eyes.iter().sum::<Vec3>() / self.eyes.len() as f32;
        let step = FARTHER_PIXELS * self.width / shape.centre().distance(eye);
        (-NUM_FARTHER..=NUM_FARTHER)
            .map(|num| shape.farther(eye, 1.0 + step * num as f32))
            .collect()
    }

    /// Fits, and whether they keep their z axis, the best first: those with least residual, where
    /// those with more freedom have to be better, and views have to agree on the flux, with `limit`
    /// those that are far off less.
    fn ranked(&self, fits: Vec<(Fit, bool)>, limit: bool) -> Vec<Scored> {
        let scored = fits.into_iter().filter_map(|(fit, is_upright)| {
            let tilted = |by: f32| if is_upright { 0.0 } else { by };
            let off = || if self.is_off(&fit.shape) { TILTED } else { 0.0 };
            let freedom = match fit.shape {
                shape if self.is_panel(&shape) => return None,
                Shape::Ball { .. } => 0.0,
                Shape::Rectangle(flat) | Shape::Ellipse(flat) => {
                    tilted(TILTED).max(off()) + if self.leaves_dark(&flat) { TILTED } else { 0.0 }
                }
                Shape::Tube { is_open: true, .. } => tilted(TURNED) + EDGES,
                Shape::Tube { .. } if is_rather_flat(&fit.shape) => {
                    tilted(TURNED).max(off()) + EDGES
                }
                Shape::Tube { .. } => tilted(TURNED),
                Shape::Box { .. } => tilted(TILTED) + EDGES,
            };
            let measured = self.views.measure(&fit.shape)?;
            let Criterion { better, .. } = self.criterion;
            let against = self
                .criterion
                .against(&fit, measured.expected_disagreement(limit));
            let score = against * better.powf(-freedom);
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

    /// Whether a shape is a panel of which nobody knows whether other sides shine.
    fn is_panel(&self, shape: &Shape) -> bool {
        flatness::is_panel(shape, &self.eyes, self.width)
    }

    /// Whether a flat shape is parallel to the mount but before or behind it.
    fn is_off(&self, flat: &Shape) -> bool {
        self.beside.is_some_and(|Beside { mount, .. }| {
            let normal = flat.rotation() * Vec3::Z;
            let is_parallel = normal.dot(mount.normal).abs() > PARALLEL;
            is_parallel && mount.height(flat.centre()).abs() > OFF_PIXELS * self.width
        })
    }

    /// Whether a flat shape shines away from a mount that the lamp lights.
    fn leaves_dark(&self, flat: &Flat) -> bool {
        self.beside.is_some_and(|Beside { mount, is_lit }| {
            is_lit && flat.normal().dot(mount.normal) > AWAY
        })
    }

    /// Whether the flux of views differs by more than it does of a solid lamp with edges or an
    /// axis, if the shape is one.
    pub(crate) fn is_uneven(&self, shape: &Shape) -> bool {
        let is_long = matches!(shape, Shape::Tube { .. } | Shape::Box { .. });
        let measured = self.views.measure(shape);
        is_long && measured.is_some_and(|measured| measured.deviation > UNEVEN)
    }

    /// The best fits of searches about some by their residual and by how far views agree on their
    /// flux, the best first: silhouettes of few pixels say little of the width and the depth of a
    /// bar, on which it depends what goes to each side.
    pub(crate) fn agreed(&self, found: &[Scored]) -> Vec<Scored> {
        let least = found.iter().map(|found| found.fit.residual);
        let most = AS_GOOD * least.fold(f32::INFINITY, f32::min) + MIN_RESIDUAL;
        let agreed = found.par_iter().map(|found| {
            let shape = self.agreed_about(found, most);
            (
                Fit::new(shape, self.patches, found.fit.gaps),
                found.is_upright,
            )
        });
        self.ranked(agreed.collect(), true)
    }

    /// The best shape about that of a fit, of a residual of at most `most`.
    fn agreed_about(&self, found: &Scored, most: f32) -> Shape {
        let Fit { shape, gaps, .. } = found.fit;
        let against = |shape: &Shape| {
            if self.is_panel(shape) {
                return f32::INFINITY;
            }
            let fit = Fit::new(*shape, self.patches, gaps);
            if fit.residual > most {
                return f32::INFINITY;
            }
            let measured = self.views.measure(shape);
            measured.map_or(f32::INFINITY, |measured| {
                self.criterion.against(&fit, measured.disagreement(true))
            })
        };
        // The same as a sum of squares, but that residuals near that of the fit weigh alike.
        let weight = (found.fit.residual + MIN_RESIDUAL).sqrt() / self.criterion.doubtful;
        let differences = |shape: &Shape, limit: bool| {
            let of_flux = self.views.differences(shape, limit).into_iter();
            let silhouette = Silhouette::new(shape, self.patches);
            let mut all = differences(&[&silhouette], self.patches, gaps);
            all.extend(of_flux.map(|difference| weight * difference));
            all
        };
        let num_changes = num_changes(&shape, found.is_upright);
        let width = 0.5 * self.width;
        // From afar views that are far off have to lead, too.
        let lower = [true, false].map(|limit| {
            descent(&shape, num_changes, NUM_STEPS, width, |s| {
                differences(s, limit)
            })
        });
        let start =
            ([shape].into_iter().chain(lower)).min_by(|a, b| against(a).total_cmp(&against(b)));
        best_shape(&start.unwrap_or(shape), num_changes, NUM_AGREED, against).0
    }
}

/// The best shape of two searches from `start`: the corners of a search grow flat, so
/// another one starts from where it ended.
pub(crate) fn refined_again(start: &Shape, is_upright: bool, patches: &[Patch], gaps: Gaps) -> Fit {
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
        |shape| differences(&[&Silhouette::new(shape, patches)], patches, gaps),
    );
    Fit::new(shape, patches, gaps)
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
    let value = |shape: &Shape| Fit::new(*shape, patches, gaps).residual;
    let (shape, residual) = best_shape(start, num_changes, NUM_TRIALS, value);
    Fit {
        shape,
        residual,
        gaps,
    }
}
