//! Silhouettes of shapes, compared with what views show of a lamp.

use crate::pixels::patches::{Patch, Target};
use crate::shape::Shape;
use crate::shape::meet::ShapeFrom;
use rayon::prelude::*;

/// Weight of a pixel inside a shape that does not show it, where the scene hides the place …
const HIDDEN: f32 = 0.25;
/// … and where it may be behind bars.
const BEHIND_BARS: f32 = 0.1;
/// Residual of a shape that is not at all where the scene has the lamp, as one that few views see
/// may be by its silhouettes; …
const ELSEWHERE: f32 = 0.02;
/// … and share of its distance by which it is half of that.
const OFF: f32 = 0.04;

/// Pixels inside a shape that do not show it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Gaps {
    /// The scene has there what hides it, or else they speak against the shape.
    Seen,
    /// Bars before it may hide it, too thin or too near for the scene to tell.
    Bars,
    /// A shade hides it where the scene is nearer, which says nothing of it; elsewhere they speak
    /// against the shape.
    Shade,
}

/// The part of patches that a shape would cover.
pub(crate) struct Silhouette(Vec<InPatch>);

struct InPatch {
    /// Part of each target that it covers, and the farthest place where it does.
    covers: Vec<(f32, f32)>,
    /// Where the rays of known distances meet it.
    distances: Vec<Option<f32>>,
}

impl Silhouette {
    pub(crate) fn new(shape: &Shape, patches: &[Patch]) -> Self {
        let in_patch = |patch: &Patch| {
            let seen = ShapeFrom::new(shape, patch.origin);
            let targets = patch.targets.iter();
            let distances = patch.distances.iter();
            InPatch {
                covers: targets.map(|target| seen.cover(&target.rays)).collect(),
                distances: distances.map(|(ray, _)| seen.meet(*ray)).collect(),
            }
        };
        Self(patches.par_iter().map(in_patch).collect())
    }
}

/// Residual of shapes that are what the views show together: the sum of [`differences`] squared.
pub(crate) fn residual(shapes: &[&Silhouette], patches: &[Patch], gaps: Gaps) -> f32 {
    let differences = differences(shapes, patches, gaps);
    differences.into_iter().map(|d| d * d).sum()
}

/// Differences of shapes from the lamp: at every pixel and every known distance, in the same order
/// whatever the shapes are.
pub(crate) fn differences(shapes: &[&Silhouette], patches: &[Patch], gaps: Gaps) -> Vec<f32> {
    let targets = patches.iter().flat_map(|patch| &patch.targets);
    let all: f32 = targets.map(|t| t.weight * t.cover * t.cover).sum();
    let all = all.max(f32::MIN_POSITIVE);
    let mut of_all = Vec::new();
    let mut offs = Vec::new();
    for (at, patch) in patches.iter().enumerate() {
        let seen = || shapes.iter().map(move |shape| &shape.0[at]);
        of_all.extend(patch.targets.iter().enumerate().map(|(i, target)| {
            let covers = seen().map(|in_patch| in_patch.covers[i]);
            difference(target, covers, gaps, all)
        }));
        offs.extend(patch.distances.iter().enumerate().map(|(i, (_, trained))| {
            let met = seen().filter_map(|in_patch| in_patch.distances[i]);
            let distance = met.reduce(f32::min);
            distance.map(|distance| (distance / trained - 1.0).powi(2))
        }));
    }
    let num_met = offs.iter().flatten().count().max(1) as f32;
    of_all.extend(offs.into_iter().map(|off| {
        let share = off.map_or(0.0, |off| off / (off + OFF * OFF));
        (ELSEWHERE * share / num_met).sqrt()
    }));
    of_all
}

/// Cover of a pixel by shapes less that by the lamp, weighted, where `all` is the sum of all covers
/// squared.
fn difference(
    target: &Target,
    covers: impl Iterator<Item = (f32, f32)>,
    gaps: Gaps,
    all: f32,
) -> f32 {
    let (mut cover, mut farthest) = (0.0_f32, 0.0_f32);
    for (share, distance) in covers {
        cover = (cover + share).min(1.0);
        farthest = farthest.max(distance);
    }
    // A lamp may go on behind what hides it, but has no reason to.
    let counts = match gaps {
        _ if cover <= target.cover => 1.0,
        Gaps::Bars => BEHIND_BARS,
        Gaps::Seen if farthest > target.hidden_from => HIDDEN,
        Gaps::Shade if farthest > target.hidden_from => 0.0,
        Gaps::Seen | Gaps::Shade => 1.0,
    };
    (target.weight * counts / all).sqrt() * (cover - target.cover)
}
