//! The vertical, from the orientation of cameras.

use super::{Evidence, numeric};
use crate::error::{ColmapError, Result};
use glam::{DMat3, DVec3};
use serde::Serialize;

/// The vertical as estimated from cameras.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Gravity {
    /// Unit length, in the model's world.
    pub up: DVec3,
    /// The axis of each camera that should be level; empty if the user gave the vertical.
    pub(super) level: Vec<DVec3>,
    /// Standard deviation of the cameras' roll, radians.
    pub(super) roll_std: f64,
    /// Findings as reported.
    pub report: GravityReport,
    pub(super) warning: Option<String>,
}

/// The vertical as estimated from the cameras.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GravityReport {
    /// Up, in the model's world.
    pub up: [f64; 3],
    /// "upright", or "sideways" if the images lie on their side.
    pub held: &'static str,
    /// Typical roll of the cameras, degrees.
    pub roll_deg: f64,
    /// Share of points below the cameras less that of those above: −1 to 1.
    pub points_below: f64,
    /// Number of cameras.
    pub num_cameras: usize,
}

/// Roll beyond which a camera counts little, radians.
const ROLL_SCALE: f64 = 0.1;
/// If the second smallest mean square is below this, all cameras look the same way and the roll
/// axis is undetermined.
const MIN_TURN: f64 = 0.01;
/// Images count as sideways only if that reduces the mean square to this share.
const SIDEWAYS_FACTOR: f64 = 0.25;
/// Mean cosine between up and the images' tops from which the cameras decide.
const MIN_COSINE: f64 = 0.3;
/// Imbalance of points above and below the cameras from which points decide: furniture stands on
/// floors.
const MIN_IMBALANCE: f64 = 0.15;
/// Imbalance that contradicts the cameras: three quarters of all points above them.
const CONTRADICTION: f64 = -0.5;
/// Points this near to the height of the cameras, in sizes of the scene, count for neither side.
const LEVEL_BAND: f64 = 0.02;

impl Gravity {
    /// The user's statements.
    pub(super) fn said(up: DVec3) -> Self {
        Self {
            up,
            level: Vec::new(),
            roll_std: 0.0,
            report: GravityReport {
                up: up.to_array(),
                held: "said",
                roll_deg: 0.0,
                points_below: 0.0,
                num_cameras: 0,
            },
            warning: None,
        }
    }
}

/// Finds the vertical.
///
/// # Errors
/// [`ColmapError::Align`] if cameras and points leave the vertical undetermined, or contradict each
/// other.
pub(crate) fn find(evidence: &Evidence) -> Result<Gravity> {
    if evidence.axes.is_empty() {
        return Err(ColmapError::Align("the model has no images".to_owned()));
    }
    let right = |axes: &DMat3| axes.x_axis;
    let down = |axes: &DMat3| axes.y_axis;
    let upright = vertical(evidence.axes.iter().map(right).collect());
    let sideways = vertical(evidence.axes.iter().map(down).collect());
    let is_turned = upright.turn >= MIN_TURN;
    let is_sideways = is_turned
        && sideways.turn >= MIN_TURN
        && sideways.mean_square < SIDEWAYS_FACTOR * upright.mean_square;
    let tops = |axis: DVec3| {
        evidence
            .axes
            .iter()
            .map(|axes| -axes.y_axis.dot(axis))
            .sum::<f64>()
            / evidence.axes.len() as f64
    };
    let (mut up, fit) = if is_sideways {
        (sideways.axis, sideways)
    } else if is_turned {
        (upright.axis, upright)
    } else {
        // Cameras that look one way: the mean of their up vectors, including their pitch.
        let mean: DVec3 = evidence.axes.iter().map(|axes| -axes.y_axis).sum();
        let axis = mean
            .try_normalize()
            .ok_or_else(|| undecided(upright.axis, 0.0))?;
        (
            axis,
            Fit {
                axis,
                level: Vec::new(),
                ..upright
            },
        )
    };
    let mut cosine = tops(up);
    let mut below = imbalance(evidence, up);
    let mut warning = None;
    if is_sideways || cosine.abs() < MIN_COSINE {
        // The images' tops point to all sides: the points decide.
        if below.abs() < MIN_IMBALANCE {
            return Err(undecided(up, below));
        }
        if below < 0.0 {
            (up, below) = (-up, -below);
        }
        warning = Some(
            "the images lie on their side; which end is up was told from where most points are"
                .to_owned(),
        );
    } else if cosine < 0.0 {
        (up, cosine, below) = (-up, -cosine, -below);
    }
    if !is_sideways && cosine >= MIN_COSINE && below < CONTRADICTION {
        return Err(ColmapError::Align(format!(
            "the tops of the images say that {} is up, but {:.0} % of the points would be above the cameras: if the images are \
             upside down, {} is up; say which",
            shown(up),
            50.0 - 50.0 * below,
            shown(-up)
        )));
    }
    let roll_std = fit.mean_square.sqrt();
    if !is_turned {
        warning = Some(
            "all cameras look the same way: their vertical is only the mean of the images' tops"
                .to_owned(),
        );
    }
    Ok(Gravity {
        up,
        report: GravityReport {
            up: up.to_array(),
            held: if is_sideways { "sideways" } else { "upright" },
            roll_deg: roll_std.to_degrees(),
            points_below: below,
            num_cameras: evidence.axes.len(),
        },
        level: fit.level,
        roll_std,
        warning,
    })
}

fn undecided(axis: DVec3, below: f64) -> ColmapError {
    ColmapError::Align(format!(
        "the cameras do not tell which end of the axis {} is up, and points above and below them are balanced ({below:+.2}): \
         say what is up",
        shown(axis)
    ))
}

pub(super) fn shown(v: DVec3) -> String {
    format!("{:.3},{:.3},{:.3}", v.x, v.y, v.z)
}

/// The direction most nearly perpendicular to some axes.
struct Fit {
    axis: DVec3,
    level: Vec<DVec3>,
    /// Robust mean of the squared cosines between axis and level.
    mean_square: f64,
    /// The same for the direction that comes second.
    turn: f64,
}

fn vertical(level: Vec<DVec3>) -> Fit {
    const NUM_ROUNDS: usize = 20;
    let mut weights = vec![1.0; level.len()];
    let mut fit = Fit {
        axis: DVec3::Z,
        level: Vec::new(),
        mean_square: 0.0,
        turn: 0.0,
    };
    for _ in 0..NUM_ROUNDS {
        let sum: f64 = weights.iter().sum();
        let [first, second, _] = numeric::eigen(weights.iter().copied().zip(level.iter().copied()));
        fit.axis = first.1;
        fit.mean_square = first.0.max(0.0) / sum;
        fit.turn = second.0 / sum;
        for (weight, axis) in weights.iter_mut().zip(&level) {
            let roll = axis.dot(fit.axis) / ROLL_SCALE;
            *weight = 1.0 / (1.0 + roll * roll);
        }
    }
    fit.level = level;
    fit
}

/// Share of points below the cameras' median height less that of those above.
fn imbalance(evidence: &Evidence, up: DVec3) -> f64 {
    let height = numeric::median(evidence.centres.iter().map(|c| c.dot(up)).collect());
    let band = LEVEL_BAND * evidence.size;
    let (mut below, mut above) = (0_u64, 0_u64);
    for point in &evidence.points {
        let relative = point.dot(up) - height;
        below += u64::from(relative < -band);
        above += u64::from(relative > band);
    }
    (below as f64 - above as f64) / (below + above).max(1) as f64
}
