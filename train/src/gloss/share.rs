//! Surfaces too small or too dark to tell their own gloss take that of a surface they continue.

use super::evidence::{Decision, Evidence, METAL};
use super::fit::Fit;
use super::observe::Observations;
use super::planes::{Planes, SurfacePlane};
use eagpt_light::irradiance::smooth::Smoothing;
use eagpt_light::segments::Segments;
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
/// One of two metals in a plane has the lobe of the other if that explains this many times the
/// share of the differences.
const CLEARER: f64 = 2.0;

/// Metals in one plane with another, whose lobe explains twice as much of what it shows, with that
/// one: metal looks like several where it mirrors light and dark parts of the room, and where those
/// are a little off, the lobe that is found is, too.
fn one_metal(
    decided: &[Option<Decision>],
    lies_in: &impl Fn(usize, SurfacePlane) -> bool,
    planes: &Planes,
) -> Vec<(usize, usize)> {
    let bare = |(segment, own): (usize, &Option<Decision>)| {
        Some((segment, own.filter(|own| own.is_bare)?))
    };
    let mut metals: Vec<(usize, Decision)> = decided.iter().enumerate().filter_map(bare).collect();
    metals.sort_by(|(_, a), (_, b)| b.explained.total_cmp(&a.explained));
    let is_part = |of: usize, whole: usize| planes.of[whole].is_some_and(|p| lies_in(of, p));
    let of_stronger = |&(segment, own): &(usize, Decision)| {
        let (from, _) = metals.iter().find(|&&(other, stronger)| {
            stronger.explained >= CLEARER * own.explained
                && (is_part(segment, other) || is_part(other, segment))
        })?;
        Some((segment, *from))
    };
    metals.iter().filter_map(of_stronger).collect()
}

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
    let lies_in = |segment: usize, plane: SurfacePlane| {
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
    for (segment, from) in one_metal(decided, &lies_in, planes) {
        source[segment] = Some(from);
    }
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

#[cfg(test)]
mod tests {
    use super::*;
    use eagpt_scene::Gloss;
    use eagpt_scene::plane::Plane;

    /// A wall of steel in three parts, one of which is told badly, and a pan before it.
    #[test]
    fn metals_of_a_plane_have_the_lobe_that_is_told_best() {
        let metal = |specular: f64, explained: f64| {
            Some(Decision {
                lobe: Fit {
                    roughness: 3,
                    specular,
                },
                gloss: Gloss {
                    specular: Vec3::splat(specular as f32),
                    roughness: 0.3,
                },
                is_bare: true,
                explained,
                foretold: explained,
            })
        };
        let wall = SurfacePlane {
            plane: Plane {
                normal: Vec3::X,
                offset: 0.0,
            },
            reach: 0.05,
        };
        let decided = [
            metal(0.3, 0.3),
            metal(0.5, 0.8),
            None,
            metal(0.6, 0.7),
            metal(0.25, 0.2),
        ];
        let planes = Planes::flat(vec![Some(wall), Some(wall), None, Some(wall), None]);
        let is_in_wall = |segment: usize, _| [0, 1, 3].contains(&segment);
        // The pan, the last, is in no plane; the third part is told well enough.
        assert_eq!(one_metal(&decided, &is_in_wall, &planes), [(0, 1)]);
    }
}
