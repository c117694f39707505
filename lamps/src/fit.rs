//! The shape of a lamp: of a rectangle, an ellipse, a ball, a tube, a ring and a box the one whose
//! silhouettes are most like what the views show.

mod bars;
mod boxes;
mod domes;
mod flatness;
mod halo;
mod shades;
pub(crate) mod shape_search;
pub(crate) mod single;
mod starts;
pub(crate) mod windows;

use crate::evidence::{Evidence, Lit};
use crate::group::Group;
use crate::group::bearings;
use crate::group::points::{self, pixel_width, points};
use crate::pixels::measure;
use crate::pixels::patches::{Patch, patches};
use crate::pixels::silhouette::Gaps;
use crate::shape::{Flat, Shape};
use glam::Vec3;
use halo::Beside;
use shape_search::{BETTER, Fit, Scored, ShapeSearch};
use starts::{axes, first_tube, flats, mount};

/// Shapes, and boxes, that a search goes on with from the best of where descents end.
const NUM_PROMISING: usize = 8;
const NUM_PROMISING_BOXES: usize = 2;
/// Best shapes that may be level ones.
const NUM_LEVEL: usize = 2;
/// Best tubes that may be open.
const NUM_OPEN: usize = 2;
/// Best shapes that are fitted again with the flux of views.
const NUM_AGREED: usize = 3;
/// Share of the pixels of a lamp that have its own all around them from which on it shows edges: it
/// is four pixels wide.
const SHARE_INSIDE: f32 = 0.4;
/// Residual of a fit beyond which a lamp is left as it was trained, if a view shows it large,
/// or smaller.
const MAX_RESIDUAL: [f32; 2] = [0.06, 0.45];
/// Residual of a flat shape in that of a solid one which views do not agree on, at most, from which
/// on it is the opening of a shade, whose inside is lit unevenly.
const OPENING: f32 = 2.0;
/// Residual up to which a lamp needs no box to explain it, and a large one no bars, …
const PERFECT: f32 = 0.015;
/// … and beyond which it may be a box though it shows no edges.
const POOR: f32 = 0.2;

impl Fit {
    /// Whether the shape explains what the views show of a lamp of `group`.
    pub(crate) fn is_clean(&self, group: &Group) -> bool {
        let [large, small] = MAX_RESIDUAL;
        self.residual
            <= match self.gaps {
                Gaps::Bars => bars::MAX_RESIDUAL,
                Gaps::Seen if group.is_large() => large,
                Gaps::Seen | Gaps::Shade => small,
            }
    }
}

/// Whether the lamp is several pixels wide: else it has no edges that views could show.
fn shows_edges(evidence: &Evidence, group: &Group) -> bool {
    let pixels = group.members.iter().map(|member| evidence.pixel(member).1);
    let inside = pixels.filter(|pixel| pixel.lit == Lit::Inside);
    inside.count() as f32 > SHARE_INSIDE * group.members.len() as f32
}

/// Fits the lamp of `group`, `up` being the unit vector upwards; `None` where its pixels have no
/// extent.
pub(crate) fn fit(evidence: &Evidence, group: &Group, up: Vec3) -> Option<Fit> {
    fitted(evidence, group, up, true)
}

/// The shape of the lamp of `group`, as [`fit`], by silhouettes alone: for a search among others,
/// which knows no more, to begin with.
pub(crate) fn by_silhouettes(evidence: &Evidence, group: &Group, up: Vec3) -> Option<Shape> {
    Some(fitted(evidence, group, up, false)?.shape)
}

/// The fit of the lamp of `group`, with the flux of views if `by_flux`.
fn fitted(evidence: &Evidence, group: &Group, up: Vec3, by_flux: bool) -> Option<Fit> {
    let mut points = points(evidence, group);
    let (mut centre, mut extent) = points::extent(&points)?;
    if let Some(met) = bearings::elsewhere(evidence, group, centre) {
        points = points::points_at(evidence, group, met);
        (centre, extent) = points::extent(&points)?;
    }
    let pixel = pixel_width(&points);
    let patches = patches(evidence, group, centre, extent);
    if patches.is_empty() {
        return None;
    }
    let mount = mount(evidence, group, centre, extent);
    let views = measure::Views::new(evidence, group);
    // Of a lamp that views show large, and several pixels wide, silhouettes tell what it is, and it
    // may be in a recess.
    let shows_edges = shows_edges(evidence, group);
    let is_wide = group.is_large() && shows_edges;
    let beside = mount.filter(|_| !is_wide);
    let beside = beside.map(|mount| Beside::new(evidence, group, mount));
    let search = ShapeSearch::new(&patches, views, group, pixel, beside);
    let mut starts: Vec<(Shape, bool)> = Vec::new();
    let flats = flats(&points, centre, mount, up);
    for &(flat, is_mount) in &flats {
        starts.push((Shape::Rectangle(flat), is_mount));
        starts.push((Shape::Ellipse(flat), is_mount));
    }
    let radius = 0.5 * extent;
    starts.push((Shape::Ball { centre, radius }, true));
    starts.push((first_tube(&points, centre, up, pixel), true));
    // Drums and domes stand out of what they hang on.
    if let Some(mount) = mount {
        starts.push((first_tube(&points, centre, mount.normal, pixel), true));
    }
    for axis in axes(&points) {
        starts.push((first_tube(&points, centre, axis, pixel), false));
    }
    let mut fits = search.best(&starts, NUM_PROMISING);
    // The heap that training makes of a small lamp may be too long for a flat one to begin with.
    let vertical = starts::facing(up, starts::towards(&points));
    let level = fits.iter().map(|found| &found.fit.shape);
    let level = level.filter_map(|shape| starts::level(shape, vertical));
    let level: Vec<(Shape, bool)> = level
        .take(NUM_LEVEL)
        .flat_map(|flat| [Shape::Rectangle(flat), Shape::Ellipse(flat)])
        .map(|shape| (shape, true))
        .collect();
    fits.extend(search.best(&level, NUM_LEVEL));
    fits.sort_by(Scored::order);
    let best = fits.first()?;
    // A thin lamp that looks flat, or lights what is behind it, may be a bar.
    let is_flat = best.fit.shape.flat().is_some();
    let is_tilted = is_flat && !best.is_upright;
    let may_have_edges = is_flat || shows_edges || best.fit.residual > POOR;
    let is_bar = is_tilted || beside.is_some_and(|beside| beside.is_lit);
    if is_bar || (best.fit.residual > PERFECT && may_have_edges) {
        let found: Vec<Shape> = fits.iter().map(|found| found.fit.shape).collect();
        let boxes = boxes::starts(&points, &found, up);
        let boxes = search.best(&boxes, NUM_PROMISING_BOXES);
        // Searches for a long tube that begin beside it, and for a drum that begin with a long one,
        // miss it.
        let long = boxes.iter().filter_map(|f| boxes::tube(&f.fit.shape));
        let drums = fits.iter().filter_map(|f| boxes::drum(&f.fit.shape, up));
        let tubes = long.map(|tube| (tube, false));
        let tubes: Vec<(Shape, bool)> = tubes.chain(drums.map(|drum| (drum, true))).collect();
        fits.extend(search.best(&tubes, NUM_PROMISING_BOXES));
        fits.extend(boxes);
    }
    // Lampshades that shine and are dark inside look closed from the side, rings like nothing else.
    fits.sort_by(Scored::order);
    if fits.first()?.fit.residual > POOR {
        let ring = |(flat, is_mount): &(Flat, bool)| (starts::ring(flat), *is_mount);
        let rings: Vec<(Shape, bool)> = flats.iter().map(ring).collect();
        fits.extend(search.best(&rings, NUM_OPEN));
        fits.sort_by(Scored::order);
    }
    if shows_edges && fits.first()?.fit.residual > PERFECT {
        let opened = |found: &Scored| Some((found.fit.shape.opened()?, found.is_upright));
        let opened: Vec<(Shape, bool)> = fits.iter().filter_map(opened).take(NUM_OPEN).collect();
        fits.extend(search.best(&opened, NUM_OPEN));
        fits.sort_by(Scored::order);
    }
    let mut best = fits.first()?.fit;
    let mut all = fits.iter().map(|found| found.fit);
    let flat = all.find(|fit| fit.shape.flat().is_some());
    if by_flux && best.is_clean(group) && !is_wide {
        let bar = fits
            .iter()
            .find_map(|found| boxes::bar(&found.fit.shape, up));
        let bars = bar.map_or(Vec::new(), |bar| search.nearer_and_farther(&bar));
        let bars: Vec<(Shape, bool)> = bars.into_iter().map(|bar| (bar, true)).collect();
        fits.truncate(NUM_AGREED);
        fits.extend(search.best(&bars, 1));
        let agreed = search.agreed(&fits);
        best = agreed.first().map_or(best, |agreed| agreed.fit);
        let opening = flat.filter(|flat| flat.residual <= OPENING * best.residual);
        best = opening
            .filter(|_| search.is_uneven(&best.shape))
            .unwrap_or(best);
    }
    let hidden = with_bars(evidence, group, &best, flat.as_ref(), &patches)
        .or_else(|| shades::fit(centre, radius, &patches, best.residual))
        .or_else(|| match best.shape {
            Shape::Ball { .. } | Shape::Box { .. } => None,
            _ => domes::fit(centre, radius, mount?, &patches, best.residual),
        });
    Some(hidden.unwrap_or(best))
}

/// A lamp of many pixels behind bars, about the best `flat` fit without, if that explains more than
/// the `best` one.
fn with_bars(
    evidence: &Evidence,
    group: &Group,
    best: &Fit,
    flat: Option<&Fit>,
    patches: &[Patch],
) -> Option<Fit> {
    if best.residual <= PERFECT || group.members.len() < bars::LEAST_PIXELS {
        return None;
    }
    let start = Shape::Rectangle(*flat?.shape.flat()?);
    bars::fit(
        evidence,
        group,
        &[(start, false)],
        patches,
        BETTER * best.residual,
    )
}
