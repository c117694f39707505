//! Rotations along a path.

use glam::{DMat3, DQuat, DVec3};

/// The rotation vector (axis times angle in radians, at most pi) of a unit quaternion: the shorter
/// way round.
pub(super) fn log(rotation: DQuat) -> DVec3 {
    let rotation = if rotation.w < 0.0 {
        -rotation
    } else {
        rotation
    };
    rotation.to_scaled_axis()
}

/// The step from one rotation to the next in the frame of either: `from · exp(step) = to`.
pub(super) fn step(from: DQuat, to: DQuat) -> DVec3 {
    log(from.conjugate() * to)
}

/// The unit quaternion of a matrix that is a rotation up to rounding in a file.
pub(super) fn from_matrix(matrix: &DMat3) -> DQuat {
    DQuat::from_mat3(matrix).normalize()
}

/// A cubic segment of rotations: the cumulative Bézier curve of Kim, Kim and Shin 1995, which has
/// the same ends and the same angular velocities at its ends as a Hermite segment of points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct RotationSegment {
    start: DQuat,
    /// Steps between the four control rotations.
    steps: [DVec3; 3],
}

impl RotationSegment {
    /// A segment between two rotations; `tangents` are the rotation vectors for the whole segment,
    /// if the angular velocity of each end lasted, in the frame of that end.
    pub(super) fn new(ends: [DQuat; 2], tangents: [DVec3; 2]) -> Self {
        let [first, last] = tangents.map(|tangent| tangent / 3.0);
        let inner = [
            ends[0] * DQuat::from_scaled_axis(first),
            ends[1] * DQuat::from_scaled_axis(-last),
        ];
        Self {
            start: ends[0],
            steps: [first, step(inner[0], inner[1]), last],
        }
    }

    /// The rotation at `s` from 0 to 1; a unit quaternion.
    pub(super) fn at(&self, s: f64) -> DQuat {
        let r = 1.0 - s;
        // Cumulative Bernstein polynomials.
        let weights = [1.0 - r * r * r, s * s * (3.0 - 2.0 * s), s * s * s];
        let turned = self
            .steps
            .iter()
            .zip(weights)
            .fold(self.start, |rotation, (step, weight)| {
                rotation * DQuat::from_scaled_axis(*step * weight)
            });
        turned.normalize()
    }
}
