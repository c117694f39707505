//! The yaw of the walls.
//!
//! Seen from above, the points of walls and of furniture along them lie on lines of two directions.
//! At the right yaw, their coordinates concentrate in few bins: the sum of squared counts is
//! maximal. Lines fitted to the fullest bins refine the yaw.

use super::{Evidence, Plane, numeric};
use glam::{DVec2, DVec3};
use serde::Serialize;

/// Findings about the walls.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct WallReport {
    /// Direction along a wall, in the model's world, unit length, level.
    pub direction: [f64; 3],
    /// Concentration on lines at this yaw over its median at all yaws; 1 is none.
    pub contrast: f64,
    /// Number of lines the yaw was fitted to.
    pub num_lines: usize,
    /// Standard deviation of the yaw, from the lines' residuals, degrees.
    pub yaw_std_deg: f64,
}

/// Width of a bin, in sizes of the scene.
const BIN: f64 = 0.005;
/// Points that are used.
const MAX_POINTS: usize = 20_000;
/// Points lower than this above the floor, in sizes of the scene, belong to it.
const MIN_HEIGHT: f64 = 0.01;
/// Concentration below which there are no walls. Unstructured points reach 1.1.
const MIN_CONTRAST: f64 = 1.2;
const NUM_COARSE: u32 = 180;
/// Share of all points that a bin needs to count as a line.
const LINE_SHARE: f64 = 0.01;

/// Finds the direction of the walls; `None` if the points concentrate on no lines.
pub(super) fn find(evidence: &Evidence, floor: Plane) -> Option<WallReport> {
    let [a, b] = numeric::tangents(floor.normal);
    let standing: Vec<DVec3> = evidence
        .points
        .iter()
        .copied()
        .filter(|p| floor.height(*p) > MIN_HEIGHT * evidence.size)
        .collect();
    let centre = evidence.centres.iter().sum::<DVec3>() / evidence.centres.len().max(1) as f64;
    let flat: Vec<DVec2> = numeric::thinned(&standing, MAX_POINTS)
        .into_iter()
        .map(|p| DVec2::new((p - centre).dot(a), (p - centre).dot(b)))
        // Points far outside are seen through windows, and their depth is unreliable.
        .filter(|p| p.length() < evidence.size)
        .collect();
    if flat.len() < super::MIN_POINTS {
        return None;
    }
    let bin = BIN * evidence.size;
    let quarter = std::f64::consts::FRAC_PI_2;
    let step = quarter / f64::from(NUM_COARSE);
    let scores: Vec<f64> = (0..NUM_COARSE)
        .map(|i| concentration(&flat, f64::from(i) * step, bin))
        .collect();
    let best = (0..scores.len()).max_by(|i, j| scores[*i].total_cmp(&scores[*j]))?;
    let contrast = scores[best] / numeric::median(scores.clone());
    if contrast < MIN_CONTRAST {
        return None;
    }
    let mut yaw = best as f64 * step;
    let mut fitted = None;
    for _ in 0..5 {
        let lines = fit_lines(&flat, yaw, bin);
        if let Some(lines) = &lines {
            yaw += lines.turn;
        }
        fitted = lines.or(fitted);
    }
    let direction = a * yaw.cos() + b * yaw.sin();
    Some(WallReport {
        direction: direction.to_array(),
        contrast,
        num_lines: fitted.as_ref().map_or(0, |lines| lines.num),
        yaw_std_deg: fitted.map_or(step, |lines| lines.std).to_degrees(),
    })
}

fn turned(p: DVec2, yaw: f64) -> DVec2 {
    DVec2::from_angle(-yaw).rotate(p)
}

/// Counts along an axis, points shared between the two nearest bins.
struct Histogram {
    counts: Vec<f64>,
    low: f64,
    bin: f64,
}

impl Histogram {
    fn new(values: impl Iterator<Item = f64> + Clone, bin: f64) -> Self {
        // An empty bin on either side: a wall at the end is a peak too.
        let low = values.clone().fold(f64::INFINITY, f64::min) - bin;
        let high = values.clone().fold(f64::NEG_INFINITY, f64::max);
        // Points are within a size of the scene, a bin is a fraction of it: a few hundred bins.
        let mut counts = vec![0.0; ((high - low) / bin) as usize + 3];
        for value in values {
            let at = (value - low) / bin;
            let (index, share) = (at as usize, at.fract());
            counts[index] += 1.0 - share;
            counts[index + 1] += share;
        }
        Self { counts, low, bin }
    }
}

fn concentration(points: &[DVec2], yaw: f64, bin: f64) -> f64 {
    let turned: Vec<DVec2> = points.iter().map(|p| turned(*p, yaw)).collect();
    let squares = |values: &mut dyn Iterator<Item = f64>| -> f64 {
        let values: Vec<f64> = values.collect();
        let histogram = Histogram::new(values.iter().copied(), bin);
        histogram.counts.iter().map(|count| count * count).sum()
    };
    squares(&mut turned.iter().map(|p| p.x)) + squares(&mut turned.iter().map(|p| p.y))
}

struct Lines {
    turn: f64,
    std: f64,
    num: usize,
}

/// The rotation that aligns the points of the fullest bins: least squares over all lines at once.
fn fit_lines(points: &[DVec2], yaw: f64, bin: f64) -> Option<Lines> {
    let (mut moment, mut weight, mut squares, mut num_points) = (0.0, 0.0, 0.0, 0.0);
    let mut num = 0;
    for axis in 0..2 {
        // Lines along `axis`: their offset is the other coordinate, and its slope along them is the
        // correction.
        let sign = if axis == 0 { 1.0 } else { -1.0 };
        let pairs: Vec<[f64; 2]> = points
            .iter()
            .map(|p| turned(*p, yaw))
            .map(|p| [p[axis], p[1 - axis]])
            .collect();
        let histogram = Histogram::new(pairs.iter().map(|pair| pair[1]), bin);
        let counts = &histogram.counts;
        for at in 1..counts.len() - 1 {
            let is_peak = counts[at] >= counts[at - 1] && counts[at] > counts[at + 1];
            if !is_peak || counts[at] < LINE_SHARE * points.len() as f64 {
                continue;
            }
            let offset = histogram.low + at as f64 * histogram.bin;
            let line: Vec<[f64; 2]> = pairs
                .iter()
                .copied()
                .filter(|pair| (pair[1] - offset).abs() <= bin)
                .collect();
            let share = 1.0 / line.len() as f64;
            let mean = [0, 1].map(|i| line.iter().map(|pair| pair[i]).sum::<f64>() * share);
            for pair in &line {
                let [along, off] = [pair[0] - mean[0], pair[1] - mean[1]];
                moment += sign * along * off;
                weight += along * along;
                squares += off * off;
                num_points += 1.0;
            }
            num += 1;
        }
    }
    if num == 0 || weight <= 0.0 {
        return None;
    }
    Some(Lines {
        turn: moment / weight,
        std: (squares / num_points / weight).sqrt(),
        num,
    })
}
