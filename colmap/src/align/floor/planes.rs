//! Horizontal planes among points, by RANSAC.

use super::TOLERANCE;
use crate::align::{Plane, numeric};
use eagpt_scene::rng::{Purpose, RandomKey};
use glam::DVec3;

/// Largest angle between a plane and the cameras' level, radians.
const MAX_TILT: f64 = 12.0 / 180.0 * std::f64::consts::PI;
/// Points of one hypothesis lie in a layer of this thickness, in sizes of the scene: 6° over half
/// the size.
const LAYER: f64 = 0.05;
/// Most points used to score hypotheses.
const MAX_POINTS: usize = 20_000;
const NUM_HYPOTHESES: u32 = 1500;
const MAX_PLANES: usize = 12;
/// Least ratio of a plane's points to those of a layer right above it.
const MIN_CONTRAST: f64 = 2.5;

pub(super) struct Candidate {
    pub(super) plane: Plane,
    pub(super) inliers: Vec<DVec3>,
}

/// Level planes, those with most points first.
pub(super) fn planes(
    below: &[DVec3],
    up: DVec3,
    tolerance: f64,
    num_needed: usize,
    seed: u64,
) -> Vec<Candidate> {
    let mut left = below.to_vec();
    left.sort_by(|a, b| a.dot(up).total_cmp(&b.dot(up)));
    let mut found = Vec::new();
    while found.len() < MAX_PLANES && left.len() >= num_needed.max(3) {
        let key = RandomKey::new(seed, Purpose::Align, found.len() as u32);
        let judged = numeric::thinned(&left, MAX_POINTS);
        let Some(plane) = best_plane(&judged, up, tolerance, key) else {
            break;
        };
        let inliers: Vec<DVec3> = below
            .iter()
            .copied()
            .filter(|p| plane.height(*p).abs() <= tolerance)
            .collect();
        let num_left = left.len();
        left.retain(|p| plane.height(*p).abs() > 2.0 * tolerance);
        if inliers.len() < num_needed || left.len() == num_left {
            break;
        }
        found.push(Candidate { plane, inliers });
    }
    found
}

/// The plane of the best hypothesis; `points` are in the order of their heights.
fn best_plane(points: &[DVec3], up: DVec3, tolerance: f64, key: RandomKey) -> Option<Plane> {
    let layer = LAYER / TOLERANCE * tolerance;
    let mut best: Option<(f64, Plane)> = None;
    for index in 0..NUM_HYPOTHESES {
        let words = key.stream(index, 0).next_words();
        let first = words[0] as usize % points.len();
        let height = points[first].dot(up);
        let low = points.partition_point(|p| p.dot(up) < height - layer);
        let high = points.partition_point(|p| p.dot(up) <= height + layer);
        let other = |word: u32| points[low + word as usize % (high - low)];
        let Some(plane) = through(points[first], other(words[1]), other(words[2]), up) else {
            continue;
        };
        let score = score(points, &plane, tolerance);
        if best.is_none_or(|(earlier, _)| score > earlier) {
            let fitted = fit(points, &plane, tolerance, up).unwrap_or(plane);
            let refitted = self::score(points, &fitted, tolerance);
            best = Some(if refitted > score {
                (refitted, fitted)
            } else {
                (score, plane)
            });
        }
    }
    best.map(|(_, plane)| plane)
}

fn through(a: DVec3, b: DVec3, c: DVec3, up: DVec3) -> Option<Plane> {
    let normal = (b - a).cross(c - a).try_normalize()?;
    level(a, normal, up)
}

/// The plane with its normal up, if it is level.
fn level(point: DVec3, normal: DVec3, up: DVec3) -> Option<Plane> {
    let normal = if normal.dot(up) < 0.0 {
        -normal
    } else {
        normal
    };
    (normal.dot(up) >= MAX_TILT.cos()).then_some(Plane { point, normal })
}

fn score(points: &[DVec3], plane: &Plane, tolerance: f64) -> f64 {
    points
        .iter()
        .map(|p| (plane.height(*p) / tolerance).powi(2))
        .map(|square| (1.0 - square).max(0.0))
        .sum()
}

/// Least squares on the inliers.
fn fit(points: &[DVec3], plane: &Plane, tolerance: f64, up: DVec3) -> Option<Plane> {
    let inliers = || {
        points
            .iter()
            .filter(|p| plane.height(**p).abs() <= tolerance)
    };
    let num = inliers().count();
    let mean = inliers().sum::<DVec3>() / num.max(1) as f64;
    let [(_, normal), ..] = numeric::eigen(inliers().map(|p| (1.0, *p - mean)));
    level(mean, normal, up).filter(|_| num >= 3)
}

/// The smaller standard deviation of a candidate's points along it.
pub(super) fn extent(candidate: &Candidate) -> f64 {
    let num = candidate.inliers.len() as f64;
    let mean = candidate.inliers.iter().sum::<DVec3>() / num;
    let [_, (minor, _), _] = numeric::eigen(candidate.inliers.iter().map(|p| (1.0, *p - mean)));
    (minor / num).sqrt()
}

/// Whether a candidate has more points than the layer right above it: walls have as many at every
/// height.
pub(super) fn stands_out(candidate: &Candidate, below: &[DVec3], tolerance: f64) -> bool {
    let heights = below.iter().map(|p| candidate.plane.height(*p) / tolerance);
    let num_above = heights.filter(|h| (2.0..6.0).contains(h)).count();
    // That layer is twice as thick.
    candidate.inliers.len() as f64 >= MIN_CONTRAST * 0.5 * num_above as f64
}
