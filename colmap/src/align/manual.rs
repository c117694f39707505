//! Up direction and floor as given by the user.

use super::gravity::{self, Gravity};
use super::{Evidence, Mode, Plane, numeric};
use crate::error::{ColmapError, Result};
use crate::model::{Model, PointId};
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// Overrides, in the model's world.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Manual {
    /// Up, of any length.
    pub up: Option<[f64; 3]>,
    /// Points of the floor by their numbers, three or more.
    pub floor_points: Vec<PointId>,
    /// Positions on the floor, three or more; one if up is given too.
    pub floor_positions: Vec<[f64; 3]>,
}

/// Floor points this near to a line, as a share of its length, determine no normal.
const MIN_WIDTH: f64 = 1e-3;

impl Manual {
    pub(super) fn up(&self) -> Option<DVec3> {
        self.up.and_then(|up| DVec3::from_array(up).try_normalize())
    }

    fn num_floor(&self) -> usize {
        self.floor_points.len() + self.floor_positions.len()
    }

    pub(super) fn validate(&self, mode: Mode) -> Result<()> {
        if self.up.is_some() && self.up().is_none() {
            return Err(ColmapError::option(
                "up",
                format!("{:?} has no direction", self.up),
            ));
        }
        let finite = |p: &&[f64; 3]| p.iter().any(|value| !value.is_finite());
        if let Some(bad) = self.floor_positions.iter().find(finite) {
            return Err(ColmapError::option(
                "floor",
                format!("{bad:?} is not finite"),
            ));
        }
        let num = self.num_floor();
        let problem = match mode {
            Mode::Manual if num >= 3 || (num >= 1 && self.up.is_some()) => return Ok(()),
            Mode::Manual => {
                "manual alignment needs three points or positions of the floor, or one and the up direction"
            }
            _ if num > 0 => "points of the floor are for manual alignment",
            Mode::None if self.up.is_some() => "without alignment the up direction has no effect",
            _ => return Ok(()),
        };
        Err(ColmapError::option("align", problem))
    }
}

/// The plane that the user gives. Its normal points to the given up direction, else to the cameras.
pub(super) fn plane(
    model: &Model,
    evidence: &Evidence,
    manual: &Manual,
) -> Result<(Plane, Option<Gravity>)> {
    let mut floor: Vec<DVec3> = manual
        .floor_positions
        .iter()
        .copied()
        .map(DVec3::from_array)
        .collect();
    for id in &manual.floor_points {
        let point = model
            .points
            .iter()
            .find(|point| point.id == *id)
            .ok_or_else(|| {
                ColmapError::option("floor_points", format!("the model has no point {id}"))
            })?;
        floor.push(point.position);
    }
    let mean = floor.iter().sum::<DVec3>() / floor.len() as f64;
    if let Some(up) = manual.up()
        && floor.len() < 3
    {
        return Ok((
            Plane {
                point: mean,
                normal: up,
            },
            None,
        ));
    }
    let [(_, normal), (width, _), (length, _)] =
        numeric::eigen(floor.iter().map(|p| (1.0, *p - mean)));
    if width.max(0.0).sqrt() <= MIN_WIDTH * length.max(f64::MIN_POSITIVE).sqrt() {
        let problem = "the points of the floor lie on a line, which has no normal";
        return Err(ColmapError::option("floor", problem));
    }
    let gravity = match manual.up() {
        Some(_) => None,
        None => gravity::find(evidence).ok(),
    };
    let towards_cameras = || {
        let heights = evidence
            .centres
            .iter()
            .map(|c| (*c - mean).dot(normal))
            .collect();
        numeric::median(heights)
    };
    let side = manual
        .up()
        .map_or_else(towards_cameras, |up| up.dot(normal));
    let normal = if side < 0.0 { -normal } else { normal };
    Ok((
        Plane {
            point: mean,
            normal,
        },
        gravity,
    ))
}
