//! The light of a lamp: the flux that views receive of it over the solid angle of its shape.

use crate::evidence::level::{Level, neighbourhood};
use crate::evidence::{Evidence, Lit, Pixel, Sight};
use crate::group::Group;
use crate::pixels::patches::{MAX_VIEWS, hidden_from};
use crate::shape::Shape;
use crate::shape::meet::{PLACES, ShapeFrom};
use eagpt_scene::color::luminance;
use eagpt_scene::median::{median_of, weighted_median};
use glam::Vec3;
use rayon::prelude::*;
use std::collections::HashSet;

/// Rays along each axis of a pixel and of its neighbours.
const RAYS_AROUND: usize = 7;
const CORNERS: [[f32; 2]; 4] = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]];
/// Part of a lamp's solid angle that may be hidden, or beyond the edge of the picture, in a view
/// that measures it.
const MAX_HIDDEN: f32 = 0.05;

/// Widths of a pixel beyond which one is nowhere near a shape: more than its diagonal and that of a
/// neighbour.
const AWAY_PIXELS: f32 = 4.0;

/// Difference of a view from others, over the mean, from which on it counts less and less: what
/// hides a part of a lamp there may be too near to it for the trained scene to tell.
const FAR_OFF: f32 = 0.1;
/// Standard deviation between views over the mean as expected before any is known.
const PRIOR_DEVIATION: f32 = 0.1;

/// Radiance of a lamp and how sure it is.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Measured {
    /// Linear, as of a shape that shines alike everywhere.
    pub(crate) radiance: Vec3,
    /// Standard deviation between views over the mean; 0 for one view.
    pub(crate) deviation: f32,
    /// The same where views that are far off count less.
    spread: f32,
    /// How much brighter the pixels are that the lamp fills, over the radiance; 0 without any.
    off: f32,
    /// Views that it is of.
    num_views: usize,
}

/// A view's measurement.
#[derive(Debug, Clone, Copy)]
struct Reading {
    /// Radiance times solid angle.
    flux: Vec3,
    /// Solid angle of the shape where the view shows it, sr.
    solid_angle: f32,
    /// That of what hides it.
    hidden: f32,
}

/// The views that measure a lamp, for any shape that it may have.
pub(crate) struct Views<'a> {
    views: Vec<View<'a>>,
    /// Luminance of pixels that the lamp fills, if it fills any.
    filled: Option<f32>,
}

/// A view that shows a lamp.
struct View<'a> {
    sight: &'a Sight,
    /// Which pixels are the lamp's, …
    own: Vec<bool>,
    /// … and which are these or their neighbours.
    around: Vec<bool>,
    level: Level,
}

impl<'a> Views<'a> {
    /// Those that show most of the lamp of `group`.
    pub(crate) fn new(evidence: &'a Evidence, group: &Group) -> Self {
        let view = |(view, own): (usize, HashSet<u32>)| {
            let sight = &evidence.sights[view];
            let around = around(sight, &own);
            let is_around = |pixel: &Pixel| around.contains(&[pixel.x, pixel.y]);
            View {
                sight,
                own: (0..sight.pixels.len() as u32)
                    .map(|i| own.contains(&i))
                    .collect(),
                around: sight.pixels.iter().map(is_around).collect(),
                level: group.level(sight.light),
            }
        };
        let best = group.best_views(MAX_VIEWS).into_par_iter();
        Self {
            views: best.map(view).collect(),
            filled: luminance_filled(evidence, group),
        }
    }

    /// Measures the lamp as one of `shape`; `None` where no view sees the shape.
    pub(crate) fn measure(&self, shape: &Shape) -> Option<Measured> {
        let used = self.readings(shape).into_iter().flatten();
        let means = used.map(|r| (r.flux / r.solid_angle, r.solid_angle));
        let measured = Measured::of_views(&means.collect::<Vec<_>>())?;
        Some(Measured {
            off: self.off(luminance(measured.radiance.to_array())),
            ..measured
        })
    }

    /// How much brighter pixels are that the lamp fills than a lamp of this luminance, over that.
    fn off(&self, luminance: f32) -> f32 {
        self.filled.map_or(0.0, |filled| filled / luminance - 1.0)
    }

    /// Differences from the median, over it, of the radiance that each view measures, 0 of views
    /// that do not, and of pixels that the lamp fills. With `limit` those far off count less, and
    /// their squares add up to that of [`Measured::disagreement`].
    pub(crate) fn differences(&self, shape: &Shape, limit: bool) -> Vec<f32> {
        let readings = self.readings(shape);
        let mean = |r: &Reading| luminance((r.flux / r.solid_angle).to_array());
        let used = || readings.iter().flatten();
        let all: f32 = used().map(|r| r.solid_angle).sum();
        let median = weighted_median(used().map(|r| (mean(r), r.solid_angle)));
        let difference = |r: &Reading| {
            let off = mean(r) / median - 1.0;
            let off = if limit { limited(off) } else { off };
            (r.solid_angle / all).sqrt() * off
        };
        let of_views = readings.iter();
        of_views
            .map(|reading| reading.as_ref().map_or(0.0, difference))
            .chain([self.off(median)])
            .collect()
    }

    /// The measurement of each view if the lamp has `shape`: of those that see it whole, or of all
    /// that see it if none does.
    fn readings(&self, shape: &Shape) -> Vec<Option<Reading>> {
        let readings: Vec<Option<Reading>> = (self.views.par_iter())
            .map(|view| view.reading(shape))
            .map(|r| (r.solid_angle > 0.0 && r.flux.min_element() >= 0.0).then_some(r))
            .collect();
        let is_whole = |r: &Reading| r.hidden <= MAX_HIDDEN * r.solid_angle;
        match readings.iter().flatten().any(is_whole) {
            true => (readings.into_iter())
                .map(|reading| reading.filter(is_whole))
                .collect(),
            false => readings,
        }
    }
}

impl Measured {
    /// The median of what views measured, which count by their solid angles; `None` without any.
    pub(crate) fn of_views(views: &[(Vec3, f32)]) -> Option<Self> {
        let all: f32 = views.iter().map(|(_, weight)| weight).sum();
        if all <= 0.0 {
            return None;
        }
        let radiance = Vec3::from_array([0, 1, 2].map(|channel| {
            let values = views.iter().map(|(mean, weight)| (mean[channel], *weight));
            weighted_median(values)
        }));
        let median = luminance(radiance.to_array());
        let rms = |of: fn(f32) -> f32| {
            let squares = views.iter().map(|(mean, weight)| {
                let ratio = luminance(mean.to_array()) / median;
                weight * of(ratio - 1.0).powi(2)
            });
            let is_one = views.len() == 1;
            if is_one {
                0.0
            } else {
                (squares.sum::<f32>() / all).sqrt()
            }
        };
        Some(Self {
            radiance,
            deviation: rms(|off| off),
            spread: rms(limited),
            off: 0.0,
            num_views: views.len(),
        })
    }

    /// By how much views, and pixels that the lamp fills, disagree on its radiance, over that. With
    /// `limit` views that are far off count less.
    pub(crate) fn disagreement(&self, limit: bool) -> f32 {
        let of_views = if limit { self.spread } else { self.deviation };
        of_views.hypot(self.off)
    }

    /// The disagreement that is to be expected with more views: few that agree say little.
    pub(crate) fn expected_disagreement(&self, limit: bool) -> f32 {
        let more = PRIOR_DEVIATION.powi(2) / self.num_views as f32;
        self.disagreement(limit).hypot(more.sqrt())
    }
}

/// A difference of a view from others that counts less the farther it is off (Geman and McClure
/// 1985).
fn limited(off: f32) -> f32 {
    off / (1.0 + (off / FAR_OFF).powi(2)).sqrt()
}

impl View<'_> {
    /// The view's measurement of the lamp if it has `shape`.
    fn reading(&self, shape: &Shape) -> Reading {
        let Self {
            sight, own, level, ..
        } = self;
        let mut reading = Reading {
            flux: Vec3::ZERO,
            solid_angle: 0.0,
            hidden: 0.0,
        };
        let seen = ShapeFrom::new(shape, sight.origin());
        let away = AWAY_PIXELS * sight.pixel_width();
        let around = places_around();
        // A pixel of its own that is nowhere near it shows a lamp that touches it.
        let is_near = |pixel: &Pixel| seen.part_met(&sight.rays(pixel, &around)).0 > 0.0;
        for (i, pixel) in sight.near(&seen, away) {
            let (corners, farthest) = seen.part_met(&sight.rays(pixel, &CORNERS));
            let is_plain = matches!(pixel.lit, Lit::Inside | Lit::Dark);
            let cover = if is_plain && (corners == 0.0 || corners == 1.0) {
                corners
            } else {
                seen.part_met(&sight.rays(pixel, &PLACES)).0
            };
            let is_own = own[i];
            // The lamp that has the rest of the pixel.
            let rest = match pixel.lit {
                Lit::Inside | Lit::Border if is_own => sight.level_beside(pixel),
                Lit::Inside | Lit::Border => Some(sight.level(pixel)),
                Lit::Beside | Lit::Dark => None,
            };
            let is_dimmer = |rest: Level| level.outshines(&rest);
            // Neighbours of its own pixels count as far as they are brighter than what is behind.
            let beside =
                !is_own && self.around[i] && rest.map_or(pixel.lit == Lit::Beside, is_dimmer);
            // A brighter lamp before it has a part of the pixel.
            let is_shared = is_own && rest.is_some_and(|rest| rest.outshines(level));
            // Another one like it may be before it, and so is what the scene has nearer.
            let is_like = || pixel.lit.is_lit() && !level.is_unlike(&sight.level(pixel));
            let is_behind = || is_like() || farthest > hidden_from(sight, pixel);
            let is_hidden = is_shared || (!is_own && !beside && is_behind());
            if (is_hidden || sight.at_edge(pixel)) && cover > 0.0 {
                reading.hidden += cover * pixel.solid_angle;
                continue;
            }
            reading.solid_angle += cover * pixel.solid_angle;
            if (is_own || beside) && (cover > 0.0 || is_near(pixel)) {
                // The surface behind the lamp counts where the lamp does not cover the pixel.
                let behind = rest.map_or(pixel.behind, |rest| rest.radiance) * (1.0 - cover);
                reading.flux += (pixel.radiance - behind).max(Vec3::ZERO) * pixel.solid_angle;
            }
        }
        reading
    }
}

/// Radiance of the lamp of `group` in pixels that it fills, and how far views differ; `None` where
/// it fills none. What hides a part of it may be too thin, or too near, to tell how much.
pub(crate) fn in_filled_pixels(
    evidence: &Evidence,
    group: &Group,
    shape: &Shape,
) -> Option<Measured> {
    let mut means = Vec::new();
    for (view, own) in group.best_views(MAX_VIEWS) {
        let sight = &evidence.sights[view];
        let seen = ShapeFrom::new(shape, sight.origin());
        let (mut sum, mut weight) = (Vec3::ZERO, 0.0);
        for (i, pixel) in (0_u32..).zip(&sight.pixels) {
            let is_whole = own.contains(&i) && pixel.lit == Lit::Inside;
            if is_whole && seen.meet(pixel.direction).is_some() {
                sum += pixel.radiance * pixel.solid_angle;
                weight += pixel.solid_angle;
            }
        }
        if weight > 0.0 {
            means.push((sum / weight, weight));
        }
    }
    Measured::of_views(&means)
}

/// Luminance of most pixels that the lamp of `group` fills, if it fills any.
fn luminance_filled(evidence: &Evidence, group: &Group) -> Option<f32> {
    let pixels = group.members.iter().map(|member| evidence.pixel(member).1);
    let filled = pixels.filter(|pixel| pixel.lit == Lit::Inside);
    let values: Vec<f32> = filled
        .map(|pixel| luminance(pixel.radiance.to_array()))
        .collect();
    (!values.is_empty()).then(|| median_of(values.into_iter()))
}

/// Places in a pixel and its neighbours: their corners, the middles of their edges, and their own
/// middles.
fn places_around() -> [[f32; 2]; RAYS_AROUND * RAYS_AROUND] {
    let place = |k: usize| 0.5 * k as f32 - 1.0;
    std::array::from_fn(|i| [i % RAYS_AROUND, i / RAYS_AROUND].map(place))
}

/// Places of a lamp's `own` pixels and of their neighbours.
fn around(sight: &Sight, own: &HashSet<u32>) -> HashSet<[u32; 2]> {
    let pixels = own.iter().map(|&i| &sight.pixels[i as usize]);
    pixels.flat_map(|p| neighbourhood([p.x, p.y])).collect()
}
