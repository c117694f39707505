//! A flight through cameras: a centripetal Catmull-Rom spline of positions and its like for
//! rotations.

use super::rotation::{self, RotationSegment};
use super::spline::{self, Lengths, Segment};
use crate::camera::Camera;
use glam::{DAffine3, DMat3, DQuat, DVec3};
use serde::{Deserialize, Serialize};

/// Shortest leg of a flight at constant speed, relative to the longest.
const MIN_LEG: f64 = 1e-6;

/// Speed along a flight.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Pace {
    /// The camera moves at a constant speed.
    #[default]
    Even,
    /// Every leg from view to view takes the same time; the camera may turn in place.
    Views,
}

/// A smooth curve of cameras: position, rotation and their velocities are continuous; the views are
/// met exactly.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Fly {
    /// Of the views; a closed flight has the first one at the end as well.
    lenses: Vec<Camera>,
    intervals: Vec<f64>,
    positions: Vec<Segment>,
    rotations: Vec<RotationSegment>,
    lengths: Lengths,
    closed: bool,
    pace: Pace,
}

impl Fly {
    /// A flight through `keys`, all of one size.
    ///
    /// # Errors
    /// In words: fewer than two views, or views at the same place where the speed is to be
    /// constant.
    pub(super) fn new(keys: &[Camera], closed: bool, pace: Pace) -> Result<Self, String> {
        if keys.len() < 2 {
            return Err(format!(
                "a flight needs 2 views or more, not {}",
                keys.len()
            ));
        }
        let mut lenses = keys.to_vec();
        if closed {
            lenses.push(keys[0]);
        }
        let poses = lenses.iter().map(|camera| camera.world_from_camera);
        let points: Vec<DVec3> = poses.clone().map(|pose| pose.translation).collect();
        let turns: Vec<DQuat> = poses
            .map(|pose| rotation::from_matrix(&pose.matrix3))
            .collect();
        let steps: Vec<DVec3> = points.windows(2).map(|w| w[1] - w[0]).collect();
        let turn_steps: Vec<DVec3> = turns
            .windows(2)
            .map(|w| rotation::step(w[0], w[1]))
            .collect();
        let distances: Vec<f64> = steps.iter().map(|step| step.length()).collect();
        let longest = distances.iter().copied().fold(0.0, f64::max);
        let short = distances.iter().position(|&d| d <= MIN_LEG * longest);
        if pace == Pace::Even
            && let Some(leg) = short
        {
            let (from, to) = (leg, (leg + 1) % keys.len());
            return Err(format!(
                "views[{from}] and views[{to}] stand at the same place: only with the pace `views` can a camera turn in place"
            ));
        }
        let intervals = spline::centripetal_intervals(&distances);
        let velocities = spline::velocities(&steps, &intervals, closed);
        let turn_velocities = spline::velocities(&turn_steps, &intervals, closed);
        let tangents = |velocities: &[DVec3], i: usize| {
            [i, (i + 1) % keys.len()].map(|end| velocities[end] * intervals[i])
        };
        let segments = 0..intervals.len();
        let positions: Vec<Segment> = segments
            .clone()
            .map(|i| Segment {
                ends: [points[i], points[i + 1]],
                tangents: tangents(&velocities, i),
            })
            .collect();
        let turn = |i| {
            let ends = [turns[i], turns[i + 1]];
            RotationSegment::new(ends, tangents(&turn_velocities, i))
        };
        Ok(Self {
            rotations: segments.map(turn).collect(),
            lengths: Lengths::of(&positions),
            positions,
            lenses,
            intervals,
            closed,
            pace,
        })
    }

    /// The camera at a time from 0, the first view, to 1, the last one or the first again.
    pub(super) fn camera(&self, time: f64) -> Camera {
        let num = self.positions.len();
        let place = match self.pace {
            Pace::Even => self.lengths.place_at(time),
            Pace::Views => {
                spline::place_at_even_times(&self.intervals, self.closed, time * num as f64)
            }
        };
        let index = (place.max(0.0) as usize).min(num - 1);
        let s = place - index as f64;
        Camera {
            world_from_camera: DAffine3 {
                matrix3: DMat3::from_quat(self.rotations[index].at(s)),
                translation: self.positions[index].at(s),
            },
            ..between(&self.lenses[index], &self.lenses[index + 1], s)
        }
    }
}

/// Intrinsics from one camera's to another's of the same size. They ease and never overshoot, as a
/// spline might down to a focal length of 0.
fn between(a: &Camera, b: &Camera, s: f64) -> Camera {
    let weight = s * s * (3.0 - 2.0 * s);
    let mix = |a: f64, b: f64| a + weight * (b - a);
    Camera {
        fx: mix(a.fx, b.fx),
        fy: mix(a.fy, b.fy),
        cx: mix(a.cx, b.cx),
        cy: mix(a.cy, b.cy),
        ..*a
    }
}
