//! Unit quaternions with the same bits on every processor.
//!
//! `glam` adds up the squares of a quaternion in another order with NEON than with SSE: trained
//! from the first of these digits on, scenes end up different. Products of quaternions have one
//! order everywhere.

use glam::{Quat, Vec3};

/// Length of a quaternion.
pub fn length(q: Quat) -> f32 {
    ((q.x * q.x + q.z * q.z) + (q.y * q.y + q.w * q.w)).sqrt()
}

/// `q` divided by its length, which is not zero.
pub fn unit(q: Quat) -> Quat {
    let length = length(q);
    Quat::from_xyzw(q.x / length, q.y / length, q.z / length, q.w / length)
}

/// The shortest turn of the z-axis into `normal`, a unit vector.
pub fn from_z_to(normal: Vec3) -> Quat {
    let cosine = Vec3::Z.dot(normal);
    if cosine.abs() > 1.0 - 2.0 * f32::EPSILON {
        return Quat::from_rotation_arc(Vec3::Z, normal);
    }
    let axis = Vec3::Z.cross(normal);
    unit(Quat::from_xyzw(axis.x, axis.y, axis.z, 1.0 + cosine))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quaternions_become_unit() {
        let q = Quat::from_xyzw(0.3, -2.0, 0.5, 0.7);
        // Two roundings of a sum of squares, of their root and of a quotient.
        assert!((length(unit(q)) - 1.0).abs() < 4.0 * f32::EPSILON);
        assert!((length(q) - q.length()).abs() < 4.0 * f32::EPSILON * q.length());
        assert!(unit(q).dot(q.normalize()) > 1.0 - 4.0 * f32::EPSILON);
    }

    #[test]
    fn the_z_axis_turns_into_the_normal() {
        let normals = [
            Vec3::new(0.48, -0.6, 0.64),
            Vec3::new(-0.8, 0.0, -0.6),
            Vec3::X,
            Vec3::Z,
            -Vec3::Z,
        ];
        for normal in normals {
            let turn = from_z_to(normal);
            assert!((turn * Vec3::Z - normal).length() < 1e-6, "{normal}");
            // The shortest: its axis is at a right angle to both. Half a turn has a cosine of
            // nearly zero.
            assert!(turn.z.abs() < 1e-6 && turn.w > -1e-6, "{turn}");
        }
    }
}
