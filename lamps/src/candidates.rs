//! Lamps by the shapes that explain their pixels, before what they do to the scene is known.

use crate::cut;
use crate::evidence::level::are_unlike;
use crate::evidence::{Evidence, Lit, Pixel, Sight};
use crate::fit;
use crate::fit::shape_search::Fit;
use crate::fit::{single, windows};
use crate::group::Group;
use crate::group::{bearings, grouping};
use crate::parts;
use crate::pixels::measure::{self, Measured};
use crate::pixels::silhouette::Gaps;
use crate::shade::Shade;
use crate::shape::Shape;
use glam::Vec3;
use std::cmp::Reverse;

/// Standard deviation of the flux between views beyond which there is no such lamp.
const MAX_DEVIATION: f32 = 0.5;
/// Share of its pixels on other lamps from which on a group is taken for a part of these.
const SHARE_ELSEWHERE: f32 = 0.5;

/// Residual of a lamp that one view shows, at most, from which on it is rather of the make of others
/// of its radiance than a part of the surface around it, which explains any outline.
const GOOD_OF_MAKE: f32 = 0.03;

/// Most pixels in a view of a lamp that training makes a heap of. Larger ones are known better once
/// geometry is right.
const MOST_PIXELS: usize = 25;
/// Views that show it, at least: a glint is in fewer.
const LEAST_VIEWS: usize = 3;
/// Share of the border of a bare lamp, at most, beside which something dimmer is lit, too.
const MOST_GLOW: f32 = 0.25;

/// A lamp under way.
pub(crate) struct Candidate {
    /// Its pixels in the light that shows most of them, and the index of that light.
    pub(crate) group: Group,
    pub(crate) light: usize,
    pub(crate) fit: Fit,
    pub(crate) measured: Measured,
    /// Its pixels in other lights, their indices, and its light there.
    pub(crate) others: Vec<(usize, Group, Measured)>,
    /// Whether its shape explains what the views show.
    pub(crate) is_clean: bool,
    /// The opaque shade around it.
    pub(crate) shade: Option<Shade>,
}

impl Candidate {
    /// Whether a pixel looks at its shape.
    fn shows(&self, sight: &Sight, pixel: &Pixel) -> bool {
        let met = self.fit.shape.meet(sight.origin(), pixel.direction);
        met.is_some()
    }

    /// Whether it is small to all views, sends its light to all sides, past no shade, and nothing
    /// glows beside it.
    pub(crate) fn is_bare(&self, evidence: &Evidence) -> bool {
        let is_free = self.shade.is_none() && self.fit.gaps == Gaps::Seen;
        let glows = self
            .group
            .share(evidence, |_, pixel| pixel.beside.is_some());
        let is_border = |_: &Sight, pixel: &Pixel| pixel.lit == Lit::Border;
        let is_alone = glows <= MOST_GLOW * self.group.share(evidence, is_border);
        let views = || self.group.by_view();
        let is_small = views().all(|(_, pixels)| pixels.len() <= MOST_PIXELS);
        let is_known = self.is_clean && views().count() >= LEAST_VIEWS;
        is_known && is_small && is_free && is_alone && self.fit.shape.flat().is_none()
    }

    /// Whether its shape and size are known well enough for others of its make.
    pub(crate) fn is_model(&self) -> bool {
        let is_known = self.is_clean && self.fit.gaps == Gaps::Seen;
        is_known && !self.group.is_large() && !self.group.is_of_one_view()
    }

    /// The lamp with another fit; `None` if views do not agree on its light.
    pub(crate) fn with_fit(&self, evidence: &Evidence, fit: Fit) -> Option<Self> {
        let others = self.others.iter();
        let others = others.map(|(light, group, _)| (*light, group));
        candidate(evidence, (self.light, self.group.clone()), fit, others)
    }
}

/// The groups of lit pixels that a shape explains; `progress` is told how many are done, of how many.
pub(crate) fn explained(
    evidence: &Evidence,
    up: Vec3,
    progress: &mut dyn FnMut(usize, usize),
) -> Vec<Candidate> {
    let groups = bearings::joined(evidence, grouping::group(evidence));
    let mut groups = windows::joined(evidence, &groups, up);
    // Where most views show a lamp its place is known best, and others may show parts of it that
    // the scene has elsewhere.
    groups.sort_by_key(|(group, window)| {
        Reverse((
            window.is_some(),
            group.by_view().count(),
            group.members.len(),
        ))
    });
    let mut found: Vec<Candidate> = Vec::new();
    let total = groups.len();
    for (done, (all, window)) in groups.into_iter().enumerate() {
        progress(done, total);
        let mut lights = all.by_light(evidence);
        lights.retain(|(_, group)| group.is_enough());
        // Of equal ones the first: the sort is stable.
        lights.sort_by_key(|(_, group)| Reverse(group.members.len()));
        let mut lights = lights.into_iter();
        let Some((light, group)) = lights.next() else {
            continue;
        };
        let elsewhere = group.share(evidence, |sight, pixel| {
            let alike = |c: &&Candidate| !c.group.is_unlike(&group);
            let mut others = found.iter().filter(alike);
            others.any(|c| c.shows(sight, pixel))
        });
        if elsewhere > SHARE_ELSEWHERE {
            continue;
        }
        // All that more views show are found by then.
        let fit = || match group.is_of_one_view() {
            true => of_one_view(evidence, (light, &group), &found, up),
            false => fit::fit(evidence, &group, up),
        };
        let Some(fit) = window.or_else(fit) else {
            continue;
        };
        let whole = |c: &Candidate| cut::joined(evidence, [(&c.group, &c.fit), (&group, &fit)], up);
        // The pixels of a piece in other lights would be lost.
        let is_of_light = |c: &Candidate| c.light == light && c.others.is_empty();
        let mut wholes = (found.iter().enumerate()).filter(|(_, c)| is_of_light(c));
        let whole = wholes.find_map(|(at, c)| Some((at, whole(c)?)));
        let (group, fit) = match whole {
            Some((at, whole)) => {
                found.remove(at);
                whole
            }
            None => (group, fit),
        };
        let parts = parts::all(evidence, group, fit, up);
        let shapes: Vec<Shape> = parts.iter().map(|(_, fit)| fit.shape).collect();
        let others: Vec<(usize, Vec<Group>)> = lights
            .map(|(light, group)| (light, parts::among(evidence, &group, &shapes)))
            .collect();
        for (i, (group, fit)) in parts.into_iter().enumerate() {
            let others = others.iter().map(|(light, groups)| (*light, &groups[i]));
            found.extend(candidate(evidence, (light, group), fit, others));
        }
    }
    if total > 0 {
        progress(total, total);
    }
    without_repeated(evidence, found)
}

/// The fit of a group that one view shows: of the make of lamps that were found, or of one in the
/// surface around it.
fn of_one_view(
    evidence: &Evidence,
    (light, group): (usize, &Group),
    found: &[Candidate],
    up: Vec3,
) -> Option<Fit> {
    let is_model = |c: &&Candidate| c.is_model() && !c.group.is_unlike(group);
    let models: Vec<&Candidate> = found.iter().filter(is_model).collect();
    let shapes: Vec<Shape> = models.iter().map(|c| c.fit.shape).collect();
    let is_alike = |fit: &Fit| {
        let lamp = candidate(evidence, (light, group.clone()), *fit, std::iter::empty());
        lamp.is_some_and(|lamp| {
            let radiance = lamp.measured.radiance;
            let mut models = models.iter();
            models.any(|model| !are_unlike(model.measured.radiance, radiance))
        })
    };
    let made = single::of_make(evidence, group, &shapes, up).filter(is_alike);
    match made {
        Some(fit) if fit.residual <= GOOD_OF_MAKE => Some(fit),
        _ => single::fit(evidence, group).or(made),
    }
}

/// Lamps whose pixels are not those of others with more pixels, and of their radiance.
fn without_repeated(evidence: &Evidence, mut found: Vec<Candidate>) -> Vec<Candidate> {
    found.sort_by_key(|c| Reverse(c.group.members.len()));
    let mut kept: Vec<Candidate> = Vec::new();
    for c in found {
        let alike = |other: &&Candidate| !are_unlike(other.measured.radiance, c.measured.radiance);
        let elsewhere = c.group.share(evidence, |sight, pixel| {
            let mut others = kept.iter().filter(alike);
            others.any(|other| other.shows(sight, pixel))
        });
        if elsewhere <= SHARE_ELSEWHERE {
            kept.push(c);
        }
    }
    kept
}

/// The lamp of a shape that views in a light agree on, and in `others`.
fn candidate<'a>(
    evidence: &Evidence,
    (light, group): (usize, Group),
    fit: Fit,
    others: impl Iterator<Item = (usize, &'a Group)>,
) -> Option<Candidate> {
    let measure = |group: &Group| {
        let of_silhouettes = || measure::Views::new(evidence, group).measure(&fit.shape);
        let measured = match fit.gaps {
            Gaps::Seen => of_silhouettes(),
            Gaps::Bars | Gaps::Shade => {
                measure::in_filled_pixels(evidence, group, &fit.shape).or_else(of_silhouettes)
            }
        };
        measured.filter(|measured| measured.deviation <= MAX_DEVIATION)
    };
    let measured = measure(&group)?;
    let others = others.filter_map(|(light, group)| {
        let measured = measure(group)?;
        Some((light, group.clone(), measured))
    });
    Some(Candidate {
        others: others.collect(),
        is_clean: fit.is_clean(&group),
        shade: None,
        group,
        light,
        fit,
        measured,
    })
}
