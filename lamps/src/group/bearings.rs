//! Lamps by triangulation: where the lines of sight of several views meet is a small lamp, wherever
//! the trained scene has their pixels, as on what is behind it.

use crate::evidence::Evidence;
use crate::group::bearing::Bearing;
use crate::group::points::{extent, points};
use crate::group::{Group, MIN_PIXELS_OF_FEW};
use eagpt_scene::median::median_of;
use glam::{Mat3, Vec3};
use std::collections::BTreeSet;

/// Views that have to agree on a place.
const MIN_VIEWS: usize = 3;
/// Least angle between two of the lines that say where they meet, rad.
const MIN_ANGLE: f32 = 0.05;
/// Largest ratio between the sizes that two views give one lamp.
const MAX_RATIO: f32 = 2.0;
/// Two views alone agree on a place if each shows enough of the lamp, and their sizes are in this
/// ratio at most.
const MAX_RATIO_OF_TWO: f32 = 1.25;
/// … and lines of two lamps, of which many may meet by chance, miss it by this at most. Lines of a
/// lamp that the scene has in one place may be of several lamps, if fewer miss it by less.
const MAX_CHANCE_MISS: f32 = 0.5;
/// Pixels that views show of a lamp which training may lack altogether, at most.
const MAX_LACKED: f32 = 30.0;
/// Lines that miss where the trained scene has a lamp by more, in what they may, look for another
/// place: less comes of what hides a part of it.
const MAX_TRAINED_MISS: f32 = 0.75;
/// Rounds in which lines that miss the place lose weight.
const NUM_ROUNDS: usize = 4;

fn bearings(evidence: &Evidence, group: &Group) -> Vec<Bearing> {
    let of_view = |(view, members): (usize, &[(u32, u32)])| {
        Bearing::new(view, &evidence.sights[view], members)
    };
    group.by_view().filter_map(of_view).collect()
}

/// Middle of the lamp of `group` by the lines of sight to it, if these agree on one and `trained`,
/// where the scene has it, is elsewhere.
pub(crate) fn elsewhere(evidence: &Evidence, group: &Group, trained: Vec3) -> Option<Vec3> {
    let bearings = bearings(evidence, group);
    let median = |place: Vec3| median_of(bearings.iter().map(|bearing| bearing.miss(place)));
    let all_meet = |place: Vec3| bearings.iter().all(|bearing| bearing.miss(place) <= 1.0);
    // Views side by side have it on one place of a wall, from which a third tells it apart.
    let only_most = |met: Vec3| may_lack(&bearings) && !all_meet(trained) && all_meet(met);
    let met = meeting(&bearings)?;
    if median(trained) <= MAX_TRAINED_MISS && !only_most(met) {
        return None;
    }
    let is_sure = match bearings.as_slice() {
        [a, b] => are_alike(a, b, met),
        _ => true,
    };
    (is_sure && median(met) <= 1.0).then_some(met)
}

/// Whether training may lack a lamp that views show as small.
fn may_lack(bearings: &[Bearing]) -> bool {
    let mut lines = bearings.iter();
    lines.all(|line| line.num_pixels <= MAX_LACKED)
}

/// Whether two views show one lamp at a place, as far as its size says.
fn are_alike(a: &Bearing, b: &Bearing, place: Vec3) -> bool {
    let is_enough = |bearing: &Bearing| bearing.num_pixels >= MIN_PIXELS_OF_FEW as f32;
    let ratio = a.radius_at(place) / b.radius_at(place);
    is_enough(a) && is_enough(b) && ratio.max(ratio.recip()) <= MAX_RATIO_OF_TWO
}

/// Whether the lines of sight of three or more views of a small lamp do not agree on a place, neither
/// where they meet nor where the trained scene has the lamp of `group`: it may be on what is behind
/// several lamps, each of which some of the views show there.
fn is_mixed(evidence: &Evidence, group: &Group) -> bool {
    let bearings = bearings(evidence, group);
    let is_sure = |place: Vec3| {
        let near = |line: &&Bearing| line.miss(place) <= MAX_CHANCE_MISS;
        bearings.iter().filter(near).count() >= MIN_VIEWS
    };
    let trained = || extent(&points(evidence, group)).map(|(centre, _)| centre);
    bearings.len() >= MIN_VIEWS
        && may_lack(&bearings)
        && !meeting(&bearings).is_some_and(is_sure)
        && !trained().is_some_and(is_sure)
}

/// Groups of pixels whose place in the trained scene no three views agree on, joined where their
/// lines of sight meet, those of three or more first; the others are as they were.
pub(crate) fn joined(evidence: &Evidence, groups: Vec<Group>) -> Vec<Group> {
    let is_open = |group: &Group| group.by_view().count() < MIN_VIEWS || is_mixed(evidence, group);
    let (open, mut found): (Vec<Group>, Vec<Group>) = groups.into_iter().partition(is_open);
    let mut lines: Vec<(usize, Group, Bearing)> = Vec::new();
    for (of, group) in open.iter().enumerate() {
        for part in group.views_apart() {
            let bearing = bearings(evidence, &part).first().copied();
            lines.extend(bearing.map(|bearing| (of, part, bearing)));
        }
    }
    let mut taken: BTreeSet<usize> = BTreeSet::new();
    let mut take = |lines: &mut Vec<(usize, Group, Bearing)>, own: Vec<usize>| {
        Group::together(own.into_iter().rev().map(|line| {
            let (of, part, _) = lines.remove(line);
            taken.insert(of);
            part
        }))
    };
    while let Some(own) = largest(&lines) {
        found.push(take(&mut lines, own));
    }
    // Where two views show a lamp, the scene has it in one place.
    lines.retain(|(of, ..)| open[*of].is_of_one_view());
    while let Some(own) = nearest_pair(&lines) {
        found.push(take(&mut lines, own));
    }
    let left = open.into_iter().enumerate();
    let left = left.filter(|(of, _)| !taken.contains(of));
    found.extend(left.map(|(_, group)| group));
    found
}

/// The lines, by their numbers, of the two that miss each other by least where they meet.
fn nearest_pair(lines: &[(usize, Group, Bearing)]) -> Option<Vec<usize>> {
    let pairs = (0..lines.len()).flat_map(|i| (i + 1..lines.len()).map(move |k| [i, k]));
    let meeting = pairs.filter_map(|pair| {
        let [(_, group, a), (_, other, b)] = pair.map(|line| &lines[line]);
        let miss = miss_of_two(a, b).filter(|miss| *miss <= MAX_CHANCE_MISS)?;
        (!group.is_unlike(other)).then_some((miss, pair))
    });
    let nearest = meeting.min_by(|a, b| a.0.total_cmp(&b.0));
    nearest.map(|(_, pair)| pair.to_vec())
}

/// By how much two lines of sight to one lamp miss where they meet; `None` if they do not.
fn miss_of_two(a: &Bearing, b: &Bearing) -> Option<f32> {
    let place = meeting(&[*a, *b])?;
    (a.view != b.view && are_alike(a, b, place)).then(|| a.miss(place).max(b.miss(place)))
}

/// The lines, by their numbers, of the place where those of most views meet.
fn largest(lines: &[(usize, Group, Bearing)]) -> Option<Vec<usize>> {
    let mut best: (usize, f32, Vec<usize>) = (MIN_VIEWS - 1, 0.0, Vec::new());
    for (i, (_, group, a)) in lines.iter().enumerate() {
        for (_, other, b) in &lines[i + 1..] {
            if a.view == b.view || group.is_unlike(other) {
                continue;
            }
            let Some(place) = meeting(&[*a, *b]) else {
                continue;
            };
            let radius = a.radius_at(place);
            let is_like = |bearing: &Bearing| {
                let ratio = bearing.radius_at(place) / radius;
                (1.0 / MAX_RATIO..MAX_RATIO).contains(&ratio)
            };
            // Of each view the line that goes through the place.
            let mut own: Vec<(usize, f32, usize)> = (lines.iter().enumerate())
                .filter(|(_, (_, part, line))| is_like(line) && !part.is_unlike(group))
                .map(|(k, (_, _, line))| (line.view, line.miss(place), k))
                .filter(|(_, miss, _)| *miss <= 1.0)
                .collect();
            own.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
            own.dedup_by_key(|line| line.0);
            let miss: f32 = own.iter().map(|line| line.1).sum();
            if own.len() > best.0 || (own.len() == best.0 && miss < best.1) {
                let mut numbers: Vec<usize> = own.iter().map(|line| line.2).collect();
                numbers.sort_unstable();
                best = (own.len(), miss, numbers);
            }
        }
    }
    let (_, _, lines) = best;
    (!lines.is_empty()).then_some(lines)
}

/// The place that lines of sight are nearest to, by angles; `None` where they are too near to
/// parallel to have one. Lines that miss it by far hardly count (Cauchy).
fn meeting(bearings: &[Bearing]) -> Option<Vec3> {
    let first = bearings.first()?.direction;
    let angle = |bearing: &Bearing| bearing.direction.cross(first).length();
    if bearings.iter().map(angle).fold(0.0, f32::max) < MIN_ANGLE {
        return None;
    }
    let mut weights = vec![1.0; bearings.len()];
    let mut place = Vec3::ZERO;
    for _ in 0..NUM_ROUNDS {
        let (mut all, mut sum) = (Mat3::ZERO, Vec3::ZERO);
        for (bearing, weight) in bearings.iter().zip(&weights) {
            let d = bearing.direction;
            let across = Mat3::IDENTITY - Mat3::from_cols(d * d.x, d * d.y, d * d.z);
            all += across * *weight;
            sum += across * bearing.origin * *weight;
        }
        place = all.inverse() * sum;
        if !place.is_finite() {
            return None;
        }
        for (bearing, weight) in bearings.iter().zip(&mut weights) {
            let distance = place.distance_squared(bearing.origin);
            *weight = 1.0 / (distance * (1.0 + bearing.miss(place).powi(2))).max(f32::MIN_POSITIVE);
        }
    }
    Some(place)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bearing(view: usize, origin: Vec3, direction: Vec3) -> Bearing {
        Bearing {
            view,
            origin,
            direction: direction.normalize(),
            pixel: 0.01,
            radius: 0.02,
            num_pixels: 12.0,
        }
    }

    #[test]
    fn lines_meet_where_most_of_them_go() {
        let place = Vec3::new(0.3, -0.2, 1.9);
        let origins = [
            Vec3::new(1.5, 0.0, 1.0),
            Vec3::new(-1.0, 1.2, 1.1),
            Vec3::new(0.2, -1.6, 1.3),
            Vec3::new(-1.1, -0.9, 0.9),
            Vec3::new(0.4, 1.5, 1.2),
        ];
        let mut lines: Vec<Bearing> = (0..)
            .zip(origins)
            .map(|(view, origin)| bearing(view, origin, place - origin))
            .collect();
        assert!(meeting(&lines).unwrap().distance(place) < 1e-4);
        // Another lamp's, of the last view.
        lines[4].direction = (place + Vec3::X - lines[4].origin).normalize();
        assert!(meeting(&lines).unwrap().distance(place) < 0.01);
        let alike = [0, 1].map(|view| bearing(view, origins[view], Vec3::X));
        assert_eq!(meeting(&alike), None);
    }
}
