//! The floor among the points below the cameras.
//!
//! Horizontal planes are found one after the other by RANSAC (Fischler and Bolles, CACM 1981) with
//! a truncated squared loss and a fit to the inliers of every better hypothesis. Tables, seats and
//! sills are planes as well, but the floor lies below them. A polished floor reflects the room, and
//! the mirrored ceiling lies lower still; but each mirrored point has its original above the floor.

mod planes;

use super::gravity::{Gravity, shown};
use super::{AlignOptions, Evidence, Plane, numeric};
use crate::error::{ColmapError, Result};
use glam::DVec3;
use planes::{Candidate, extent, planes, stands_out};
use serde::Serialize;
use std::collections::HashSet;

/// Findings about the floor.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FloorReport {
    /// Points on it.
    pub num_inliers: usize,
    /// Points that were considered.
    pub num_points: usize,
    /// Root mean square distance of the inliers, model units.
    pub residual: f64,
    /// Largest distance of an inlier, model units.
    pub tolerance: f64,
    /// Angle between the floor and the cameras' level, degrees.
    pub tilt_from_gravity_deg: f64,
    /// Standard deviation of the floor's tilt, from residuals and spread, degrees.
    pub residual_tilt_deg: f64,
    /// Standard deviation of its height, model units.
    pub height_std: f64,
    /// Share of the room's area in which the floor was seen.
    pub coverage: f64,
    /// Points below the floor that are not seen in it as in a mirror.
    pub num_below: usize,
    /// Points below the floor that are.
    pub num_mirrored: usize,
    /// Horizontal planes that were found below the cameras, the floor included.
    pub num_planes: usize,
    /// 0 to 1.
    pub confidence: f64,
}

/// Half the thickness of a plane, in sizes of the scene.
const TOLERANCE: f64 = 0.005;
/// Fewest points of a plane,
const MIN_INLIERS: usize = 12;
/// and their least share of all.
const MIN_SHARE: f64 = 0.01;
/// Least smaller standard deviation of a plane's points along it, in sizes of the scene.
const MIN_EXTENT: f64 = 0.03;
/// Share of a plane's points that are seen higher up as well if it is a mirror image.
const MIRRORED_SHARE: f64 = 0.6;
/// Cells along each axis of the map that coverage is measured on.
const NUM_CELLS: usize = 12;
/// Coverage that counts as full: furniture covers the rest.
const FULL_COVERAGE: f64 = 0.2;
/// Share of points below a plane that rules it out as floor.
const MAX_BELOW: f64 = 0.125;
/// Roll that photographers do not notice, radians: cameras are not taken as more level than that.
const MIN_ROLL: f64 = 1.0 / 180.0 * std::f64::consts::PI;
/// Share of cameras that have to be above the floor.
const CAMERAS_ABOVE: f64 = 0.95;

/// Finds the floor and its confidence.
///
/// # Errors
/// [`ColmapError::Align`] if no plane can be it.
pub(super) fn find(
    evidence: &Evidence,
    gravity: &Gravity,
    options: &AlignOptions,
) -> Result<(Plane, FloorReport)> {
    let tolerance = TOLERANCE * evidence.size;
    let heights = evidence.centres.iter().map(|c| c.dot(gravity.up)).collect();
    let lowest_camera = numeric::quantile(heights, 1.0 - CAMERAS_ABOVE);
    let below: Vec<DVec3> = evidence
        .points
        .iter()
        .copied()
        .filter(|p| p.dot(gravity.up) < lowest_camera - 2.0 * tolerance)
        .collect();
    let num_needed = MIN_INLIERS.max((MIN_SHARE * evidence.points.len() as f64) as usize);
    let candidates = planes(&below, gravity.up, tolerance, num_needed, options.seed);
    let num_level = candidates.len();
    let largest = candidates.iter().map(|of| of.inliers.len()).max();
    let wide: Vec<Candidate> = candidates
        .into_iter()
        .filter(|candidate| {
            extent(candidate) >= MIN_EXTENT * evidence.size
                && stands_out(candidate, &below, tolerance)
        })
        .collect();
    let chosen = choose(evidence, &wide, tolerance).ok_or_else(|| {
        ColmapError::Align(format!(
            "no floor: among {} points below the cameras no level plane (up is {}) has {num_needed} points that spread; {}; \
             name points of the floor, or say what is up",
            below.len(),
            shown(gravity.up),
            match largest {
                Some(num) => format!(
                    "of {num_level} level planes, the largest with {num} points, none is wide and stands out"
                ),
                None => "no level plane was found".to_owned(),
            }
        ))
    })?;
    let refined = refine(evidence, gravity, &wide[chosen.index].plane, tolerance);
    let mut report = report(evidence, gravity, &refined, chosen.is_mirror);
    report.num_planes = wide.len();
    Ok((refined.plane, report))
}

/// The candidate that is the floor.
struct Chosen {
    index: usize,
    /// Whether a lower candidate is a mirror image in it.
    is_mirror: bool,
}

/// The lowest candidate that is not the image of something in a mirror above it.
fn choose(evidence: &Evidence, candidates: &[Candidate], tolerance: f64) -> Option<Chosen> {
    let centre = evidence.centres.iter().sum::<DVec3>() / evidence.centres.len().max(1) as f64;
    let mut order: Vec<usize> = (0..candidates.len()).collect();
    // Cameras are higher above a lower plane.
    order.sort_by(|a, b| {
        let height = |i: &usize| candidates[*i].plane.height(centre);
        height(b).total_cmp(&height(a))
    });
    let is_image = |low: usize, mirror: usize| {
        let plane = &candidates[mirror].plane;
        let points = Points::above(evidence, plane, tolerance);
        let inliers = &candidates[low].inliers;
        let num_beyond = inliers
            .iter()
            .filter(|p| plane.height(**p) < -3.0 * tolerance)
            .count();
        let num_twice = inliers
            .iter()
            .filter(|p| points.has_near(plane.mirrored(**p)))
            .count();
        num_beyond * 2 > inliers.len() && num_twice as f64 >= MIRRORED_SHARE * inliers.len() as f64
    };
    let mut from_below = order.iter().enumerate();
    let floor = |(at, low): &(usize, &usize)| {
        !order[at + 1..]
            .iter()
            .any(|mirror| is_image(**low, *mirror))
    };
    from_below.find(floor).map(|(at, index)| Chosen {
        index: *index,
        is_mirror: at > 0,
    })
}

/// Points in a grid, to ask whether there is one near a place.
struct Points {
    cells: HashSet<[i64; 3]>,
    cell: f64,
}

impl Points {
    fn above(evidence: &Evidence, plane: &Plane, tolerance: f64) -> Self {
        // Mirrored points double the error of the plane.
        let cell = 3.0 * tolerance;
        let above = evidence
            .points
            .iter()
            .filter(|p| plane.height(**p) > 3.0 * tolerance);
        Self {
            cells: above.map(|p| Self::key(*p, cell)).collect(),
            cell,
        }
    }

    fn key(p: DVec3, cell: f64) -> [i64; 3] {
        // The cast saturates, far beyond any point that counts.
        (p / cell).floor().to_array().map(|c| c as i64)
    }

    fn has_near(&self, p: DVec3) -> bool {
        let [x, y, z] = Self::key(p, self.cell);
        (-1..=1).any(|i| {
            (-1..=1).any(|j| {
                (-1..=1).any(|k| {
                    let beside = [
                        x.saturating_add(i),
                        y.saturating_add(j),
                        z.saturating_add(k),
                    ];
                    self.cells.contains(&beside)
                })
            })
        })
    }
}

/// A floor with its final normal.
struct Refined {
    plane: Plane,
    inliers: Vec<DVec3>,
    residual: f64,
    tolerance: f64,
}

/// Fits the plane to all of its points and to the cameras' level axes together, each weighted by
/// its variance.
fn refine(evidence: &Evidence, gravity: &Gravity, start: &Plane, tolerance: f64) -> Refined {
    const NUM_ROUNDS: usize = 8;
    let mut plane = *start;
    let mut tolerance = tolerance;
    let mut residual = tolerance;
    let inliers_of = |plane: &Plane, tolerance: f64| -> Vec<DVec3> {
        let near = |p: &&DVec3| plane.height(**p).abs() <= tolerance;
        evidence.points.iter().filter(near).copied().collect()
    };
    for _ in 0..NUM_ROUNDS {
        let inliers = inliers_of(&plane, tolerance);
        if inliers.len() < MIN_INLIERS {
            break;
        }
        let mean = inliers.iter().sum::<DVec3>() / inliers.len() as f64;
        let squares = inliers
            .iter()
            .map(|p| plane.height(*p).powi(2))
            .sum::<f64>();
        residual = (squares / inliers.len() as f64)
            .sqrt()
            .max(1e-9 * evidence.size);
        let roll = gravity.roll_std.max(MIN_ROLL);
        let points = inliers.iter().map(|p| (residual.powi(-2), *p - mean));
        let cameras = gravity.level.iter().map(|axis| (roll.powi(-2), *axis));
        let [(_, normal), ..] = numeric::eigen(points.chain(cameras));
        plane = Plane {
            point: mean,
            normal: if normal.dot(gravity.up) < 0.0 {
                -normal
            } else {
                normal
            },
        };
        // Points of skirting boards and rugs go, those of the floor stay: three deviations, but no
        // less than a fifth of the start.
        tolerance =
            (3.0 * residual).clamp(0.2 * TOLERANCE * evidence.size, TOLERANCE * evidence.size);
    }
    let inliers = inliers_of(&plane, tolerance);
    // The median is robust against few points above and below.
    let height = numeric::median(inliers.iter().map(|p| p.dot(plane.normal)).collect());
    plane.point += (height - plane.point.dot(plane.normal)) * plane.normal;
    Refined {
        plane,
        inliers,
        residual,
        tolerance,
    }
}

fn report(
    evidence: &Evidence,
    gravity: &Gravity,
    refined: &Refined,
    is_mirror: bool,
) -> FloorReport {
    let Refined {
        plane,
        inliers,
        residual,
        tolerance,
    } = refined;
    let thickness = 3.0 * TOLERANCE * evidence.size;
    let above = Points::above(evidence, plane, TOLERANCE * evidence.size);
    let below = evidence
        .points
        .iter()
        .filter(|p| plane.height(**p) < -thickness);
    let (mut num_below, mut num_mirrored) = (0, 0);
    for point in below {
        let is_mirrored = is_mirror && above.has_near(plane.mirrored(*point));
        *(if is_mirrored {
            &mut num_mirrored
        } else {
            &mut num_below
        }) += 1;
    }
    let num = inliers.len().max(1) as f64;
    let mean = inliers.iter().sum::<DVec3>() / num;
    let [_, (minor, _), _] = numeric::eigen(inliers.iter().map(|p| (1.0, *p - mean)));
    let tilt_std = residual / minor.max(f64::MIN_POSITIVE).sqrt();
    let tilt = plane
        .normal
        .dot(gravity.up)
        .clamp(-1.0, 1.0)
        .acos()
        .to_degrees();
    let coverage = coverage(evidence, plane, inliers);
    let share_below = num_below as f64 / evidence.points.len() as f64;
    let support = num / (num + 20.0);
    let agreement = (-0.5 * (tilt / 5.0).powi(2)).exp();
    let clean = (1.0 - share_below / MAX_BELOW).max(0.0);
    FloorReport {
        num_inliers: inliers.len(),
        num_points: evidence.points.len(),
        residual: *residual,
        tolerance: *tolerance,
        tilt_from_gravity_deg: tilt,
        residual_tilt_deg: tilt_std.to_degrees(),
        height_std: residual / num.sqrt(),
        coverage,
        num_below,
        num_mirrored,
        num_planes: 1,
        confidence: support * agreement * clean * (coverage / FULL_COVERAGE).min(1.0),
    }
}

/// Share of the cells of a map of the room, from the 5th to the 95th percentile of the points, that
/// have a point of the floor.
fn coverage(evidence: &Evidence, plane: &Plane, inliers: &[DVec3]) -> f64 {
    let axes = numeric::tangents(plane.normal);
    let bounds = axes.map(|axis| {
        let along: Vec<f64> = evidence.points.iter().map(|p| p.dot(axis)).collect();
        (
            numeric::quantile(along.clone(), 0.05),
            numeric::quantile(along, 0.95),
        )
    });
    let mut seen = HashSet::new();
    for point in inliers {
        let cell = [0, 1].map(|i| {
            let (low, high) = bounds[i];
            let at = (point.dot(axes[i]) - low) / (high - low).max(f64::MIN_POSITIVE);
            (0.0..1.0)
                .contains(&at)
                .then_some((at * NUM_CELLS as f64) as usize)
        });
        if let [Some(x), Some(y)] = cell {
            seen.insert([x, y]);
        }
    }
    seen.len() as f64 / (NUM_CELLS * NUM_CELLS) as f64
}
