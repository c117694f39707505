//! Windows whose panes photographs show apart: what shines is one lamp behind the frame. Fitted one
//! by one, panes take the depth of the frame for their own.

use crate::evidence::Evidence;
use crate::fit::bars;
use crate::fit::shape_search::Fit;
use crate::fit::starts::{first_flat, flats, mount};
use crate::group::Group;
use crate::group::points::{extent, pixel_width, points};
use crate::pixels::patches::patches;
use crate::pixels::silhouette::Gaps;
use crate::shape::Shape;
use eagpt_scene::plane::FittedPlane;
use glam::Vec3;
use rayon::prelude::*;

/// Width of a bar between panes in the narrow side of these, at most, …
const MAX_BAR: f32 = 0.35;
/// … and widths of a pixel by which photographs may show it wider.
const BLUR_PIXELS: f32 = 2.0;
/// Pixels of a pane that those of others are compared with, about.
const MAX_POINTS: usize = 150;
/// How much better a panel behind bars has to explain panes than one without.
const BETTER: f32 = 0.5;

/// Where a group of lit pixels is that may be a pane.
struct Pane {
    /// Places of some of its pixels.
    positions: Vec<Vec3>,
    /// Its narrow side, scene units.
    narrow: f32,
    /// Width of a pixel on it, scene units.
    pixel: f32,
}

impl Pane {
    /// `None` where pixels have no plane.
    fn new(evidence: &Evidence, group: &Group) -> Option<Self> {
        let points = points(evidence, group);
        let (centre, _) = extent(&points)?;
        let normal = FittedPlane::through(points.iter().map(|p| p.position)).normal?;
        let pixel = pixel_width(&points);
        let [width, height] = first_flat(&points, centre, normal, pixel).size;
        let step = points.len().div_ceil(MAX_POINTS).max(1);
        let some = points.iter().step_by(step);
        Some(Self {
            positions: some.map(|p| p.position).collect(),
            narrow: width.min(height),
            pixel,
        })
    }

    /// Whether no more than a bar is between it and another one.
    fn is_beside(&self, other: &Self) -> bool {
        let bar = MAX_BAR * self.narrow.min(other.narrow);
        let gap = bar + BLUR_PIXELS * self.pixel.max(other.pixel);
        let is_near = |a: &Vec3| {
            let mut others = other.positions.iter();
            others.any(|b| a.distance_squared(*b) < gap * gap)
        };
        self.positions.iter().any(is_near)
    }
}

/// Groups of lit pixels with those of one window joined, and the fit of a window that has bars;
/// `up` is the unit vector upwards.
pub(crate) fn joined(evidence: &Evidence, groups: &[Group], up: Vec3) -> Vec<(Group, Option<Fit>)> {
    let panes: Vec<Option<Pane>> = (groups.par_iter())
        .map(|group| Pane::new(evidence, group))
        .collect();
    let are_beside = |a: usize, b: usize| {
        let beside = (panes[a].as_ref()).zip(panes[b].as_ref());
        !groups[a].is_unlike(&groups[b]) && beside.is_some_and(|(a, b)| a.is_beside(b))
    };
    let mut found = Vec::new();
    for own in connected(groups.len(), are_beside) {
        let panes = own.iter().map(|pane| groups[*pane].clone());
        let whole = (own.len() > 1).then(|| Group::together(panes.clone()));
        let window = whole.and_then(|whole| Some((window(evidence, &whole, up)?, whole)));
        match window {
            Some((fit, whole)) => {
                let has_bars = fit.gaps == Gaps::Bars;
                found.push((whole, has_bars.then_some(fit)));
            }
            None => found.extend(panes.map(|pane| (pane, None))),
        }
    }
    found
}

/// The connected parts of a graph of `num` nodes, each ascending.
fn connected(num: usize, are_beside: impl Fn(usize, usize) -> bool) -> Vec<Vec<usize>> {
    let mut left: Vec<usize> = (0..num).collect();
    let mut parts = Vec::new();
    while let Some(first) = (!left.is_empty()).then(|| left.remove(0)) {
        let mut part = vec![first];
        let mut at = 0;
        while let Some(of) = part.get(at).copied() {
            let (beside, rest) = left.into_iter().partition(|other| are_beside(of, *other));
            part.extend::<Vec<usize>>(beside);
            left = rest;
            at += 1;
        }
        part.sort_unstable();
        parts.push(part);
    }
    parts
}

/// The window whose panes are `group`, if one panel behind bars, or one without, explains them all.
fn window(evidence: &Evidence, group: &Group, up: Vec3) -> Option<Fit> {
    if !group.is_large() {
        return None;
    }
    let points = points(evidence, group);
    let (centre, extent) = extent(&points)?;
    let patches = patches(evidence, group, centre, extent);
    let mount = mount(evidence, group, centre, extent);
    let starts = flats(&points, centre, mount, up).into_iter();
    let starts: Vec<(Shape, bool)> = starts
        .map(|(flat, is_mount)| (Shape::Rectangle(flat), is_mount))
        .collect();
    let fit = bars::fit(evidence, group, &starts, &patches, f32::INFINITY)?;
    let plain = Fit::new(fit.shape, &patches, Gaps::Seen);
    let has_bars = fit.residual < BETTER * plain.residual;
    Some(if has_bars { fit } else { plain })
}
