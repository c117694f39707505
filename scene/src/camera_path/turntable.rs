//! An orbit around an axis, looking at a point.

use crate::camera::Camera;
use crate::dataset::UpAxis;
use crate::script::value::{Array, Number, Parsed, Positive};
use glam::{DAffine3, DMat3, DQuat, DVec3};
use serde::{Deserialize, Serialize};

/// Least mean square sine of the angle between the optical axes and their common direction: within
/// 2 degrees of each other they meet anywhere.
const MIN_AGREEMENT: f64 = 1e-3;
/// Sine of the smallest angle between the line of sight and the axis: the camera would not know
/// which way is up.
const MIN_SINE: f64 = 1e-3;
const FULL_TURN: f64 = 360.0;

/// An orbit.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Turntable {
    /// The axis goes through this point, world space.
    pub centre: DVec3,
    /// Distance of the camera from the axis, scene units.
    pub radius: f64,
    /// Height of the camera above the centre, scene units.
    pub height: f64,
    /// Point that it faces, world space.
    pub look_at: DVec3,
    /// Direction of the axis.
    pub up: UpAxis,
    /// Unit vector from the axis to where the camera is at 0 degrees, world space.
    pub zero: DVec3,
    /// Angle of the first frame, degrees.
    pub start: f64,
    /// Angle that it turns by, degrees; counter-clockwise seen from above if positive.
    pub degrees: f64,
}

/// An orbit as a file has it; the cameras of the dataset give the rest.
#[derive(Debug, Clone, Copy, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct TurntableKeys {
    centre: Option<Array<Number, 3>>,
    radius: Option<Positive>,
    height: Option<Number>,
    look_at: Option<Array<Number, 3>>,
    up: Option<Parsed<UpAxis>>,
    start: Option<Number>,
    degrees: Option<Number>,
}

impl TurntableKeys {
    /// The orbit, for cameras of which there is at least one.
    ///
    /// # Errors
    /// In words: no centre is given and the cameras look at no common point, or the camera would
    /// look along the axis.
    pub(super) fn resolve(self, cameras: &[Camera], up: UpAxis) -> Result<Turntable, String> {
        let up = self.up.map_or(up, |up| up.0);
        let axis = up.vector().as_dvec3();
        let centre = match self.centre {
            Some(centre) => centre.into(),
            None => meeting_point(cameras)
                .ok_or("the cameras of the dataset look at no common point: `centre` is needed")?,
        };
        let offsets: Vec<DVec3> = cameras
            .iter()
            .map(|camera| camera.world_from_camera.translation - centre)
            .collect();
        let level: Vec<DVec3> = offsets
            .iter()
            .map(|offset| *offset - axis * offset.dot(axis))
            .collect();
        let mean =
            |values: &mut dyn Iterator<Item = f64>| values.sum::<f64>() / offsets.len() as f64;
        let zero = level[0]
            .try_normalize()
            .unwrap_or_else(|| axis.any_orthonormal_vector());
        let table = Turntable {
            centre,
            radius: (self.radius.map(f64::from))
                .or_else(|| radius_among(&level, axis, zero))
                .unwrap_or_else(|| mean(&mut level.iter().map(|offset| offset.length()))),
            height: self.height.map_or_else(
                || mean(&mut offsets.iter().map(|offset| offset.dot(axis))),
                f64::from,
            ),
            look_at: self.look_at.map_or(centre, DVec3::from),
            up,
            zero,
            start: self.start.map_or(0.0, f64::from),
            degrees: self.degrees.map_or(FULL_TURN, f64::from),
        };
        // On the way around, the line of sight is closest to the axis where the point of interest
        // is closest.
        let target = table.look_at - centre;
        let radius = table.radius;
        let gap = (radius - target.reject_from_normalized(axis).length()).abs();
        let rise = (target.dot(axis) - table.height).abs();
        if radius <= 0.0 || gap <= MIN_SINE * rise.max(radius) {
            return Err(format!(
                "at a radius of {radius} the camera would look straight along the axis at {:?}",
                table.look_at.to_array()
            ));
        }
        Ok(table)
    }
}

impl Turntable {
    /// Ends where it started.
    pub(super) fn is_closed(&self) -> bool {
        self.degrees != 0.0 && self.degrees % FULL_TURN == 0.0
    }

    /// The camera at a time from 0 to 1, with the intrinsics of `lens`.
    pub(super) fn camera(&self, lens: &Camera, time: f64) -> Camera {
        let axis = self.up.vector().as_dvec3();
        let angle = (self.start + time * self.degrees).to_radians();
        let outward = DQuat::from_axis_angle(axis, angle) * self.zero;
        let origin = self.centre + outward * self.radius + axis * self.height;
        let forward = (self.look_at - origin).normalize();
        let right = forward.cross(axis).normalize();
        Camera {
            world_from_camera: DAffine3 {
                matrix3: DMat3::from_cols(right, forward.cross(right), forward),
                translation: origin,
            },
            ..*lens
        }
    }
}

/// Radius of the largest circle about the centre that stays among the cameras, seen from above:
/// within their convex hull, where a room has no walls. `None` if the centre is not among them.
/// `level` are their offsets from the axis.
fn radius_among(level: &[DVec3], axis: DVec3, zero: DVec3) -> Option<f64> {
    const NUM_DIRECTIONS: u32 = 360;
    let directions = (0..NUM_DIRECTIONS).map(|i| {
        let angle = f64::from(i) / f64::from(NUM_DIRECTIONS) * std::f64::consts::TAU;
        DQuat::from_axis_angle(axis, angle) * zero
    });
    // In every direction some camera stands at least that far out.
    let reach = |direction: DVec3| {
        let along = level.iter().map(|offset| offset.dot(direction));
        along.fold(f64::NEG_INFINITY, f64::max)
    };
    let radius = directions.map(reach).fold(f64::INFINITY, f64::min);
    (radius > 0.0).then_some(radius)
}

/// The point nearest to the optical axes of all cameras, in the sense of least squares; `None` if
/// they are parallel.
fn meeting_point(cameras: &[Camera]) -> Option<DVec3> {
    let (mut matrix, mut right) = (DMat3::ZERO, DVec3::ZERO);
    for camera in cameras {
        let pose = &camera.world_from_camera;
        let along = pose.matrix3.z_axis;
        // Projects onto the plane across the axis.
        let across =
            DMat3::IDENTITY - DMat3::from_cols(along * along.x, along * along.y, along * along.z);
        matrix += across;
        right += across * pose.translation;
    }
    // Of eigenvalues of at most 1, the product is at most the least, which is the mean square sine
    // of the nearly parallel.
    let mean = matrix * (1.0 / cameras.len() as f64);
    (mean.determinant() > MIN_AGREEMENT).then(|| matrix.inverse() * right)
}
