//! Surfaces too small or too dark to tell their own gloss take that of a surface they continue.

use super::evidence::{Decision, Evidence, METAL};
use super::fit::Fit;
use super::observe::Observations;
use super::planes::{Plane, Planes};
use super::segments::Segments;
use crate::irradiance::smooth::Smoothing;
use eagpt_scene::median::median_of;
use glam::Vec3;
use std::collections::BTreeMap;

/// Rounds in which gloss goes on to the next surface.
const ROUNDS: usize = 3;
/// A surface that speaks for itself takes a lobe that explains this share of its own differences;
/// another one that is not against them, if it has the same colour.
const LEAST_SUPPORT: f64 = 0.05;
/// Difference of the logarithm of colour of what counts as the same.
const SAME_COLOR: f32 = 0.35;
/// A surface in the plane of a metal, by this part of its receivers, with at least this spread
/// between views is of it: where a dark part of the room is mirrored, a small error of the scene is
/// a large one of the prediction. Paint in the same plane differs less.
const LEAST_IN_PLANE: f32 = 0.6;
const LEAST_SPREAD: f32 = 0.5;

/// Of each surface, the one whose lobe it has: itself where it is `decided`, another, or none.
pub(super) fn shared(
    decided: &[Option<Decision>],
    evidence: &[Evidence],
    seen: &Observations,
    segments: &Segments,
    (smoothing, planes): (&Smoothing, &Planes),
) -> Vec<Option<usize>> {
    let mut source: Vec<Option<usize>> = (decided.iter().enumerate())
        .map(|(segment, lobe)| lobe.map(|_| segment))
        .collect();
    let mut sums = vec![(Vec3::ZERO, 0.0_f32); segments.num];
    for (color, &segment) in seen.colors.iter().zip(&segments.of) {
        let (sum, num) = &mut sums[segment as usize];
        *sum += *color;
        *num += 1.0;
    }
    let log = |segment: usize| (sums[segment].0 / sums[segment].1).map(|c| c.max(1e-6).ln());
    let members = segments.members();
    let of_some = |of: &Vec<usize>| median_of(of.iter().map(|&r| seen.spreads[r]));
    let spreads: Vec<f32> = members.iter().map(of_some).collect();
    let lies_in = |segment: usize, plane: Plane| {
        let of = &members[segment];
        let is_part = |r: &&usize| {
            let (_, surface) = &seen.receivers[**r];
            plane.has(surface.normal) && plane.reaches(surface.position)
        };
        of.iter().filter(is_part).count() as f32 >= LEAST_IN_PLANE * of.len() as f32
    };
    let is_of_metal = |segment: usize, from: usize, lobe: Fit| {
        lobe.specular >= METAL
            && spreads[segment] >= LEAST_SPREAD
            && planes.of[from].is_some_and(|plane| lies_in(segment, plane))
    };
    let borders = segments.borders(smoothing);
    for _ in 0..ROUNDS {
        let mut best: BTreeMap<usize, (usize, usize)> = BTreeMap::new();
        for (&(segment, other), &num) in &borders {
            let (None, Some(from)) = (source[segment], source[other]) else {
                continue;
            };
            let Some(Decision { lobe, .. }) = decided[from] else {
                continue;
            };
            let own = &evidence[segment];
            let takes = if own.is_known() {
                own.all.explained(lobe) >= LEAST_SUPPORT
            } else {
                let is_same = (log(segment) - log(from)).length() <= SAME_COLOR;
                is_same && own.all.explained(lobe) >= 0.0
            };
            let takes = takes || is_of_metal(segment, from, lobe);
            if takes
                && own.all.shows(lobe)
                && best.get(&segment).is_none_or(|&(most, _)| num > most)
            {
                best.insert(segment, (num, from));
            }
        }
        if best.is_empty() {
            break;
        }
        for (segment, (_, from)) in best {
            source[segment] = Some(from);
        }
    }
    source
}
