//! Planes, and those through points.

use glam::{DVec3, Vec3};
use nalgebra::{Matrix3, SymmetricEigen, Vector3};

/// An oriented plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plane {
    /// Unit normal, towards its front.
    pub normal: Vec3,
    /// Signed distance from the origin along the normal, scene units.
    pub offset: f32,
}

impl Plane {
    /// Signed distance of a point, positive before the front.
    pub fn height(self, point: Vec3) -> f32 {
        self.normal.dot(point) - self.offset
    }

    /// Distance along a ray that meets its front; `None` for others. The direction is a unit
    /// vector.
    pub fn meet(self, origin: Vec3, direction: Vec3) -> Option<f32> {
        let (height, fall) = (self.height(origin), -self.normal.dot(direction));
        (height > 0.0 && fall > 0.0).then(|| height / fall)
    }

    /// A direction, mirrored.
    pub fn mirrored(self, direction: Vec3) -> Vec3 {
        direction - 2.0 * self.normal.dot(direction) * self.normal
    }
}

/// The least-squares plane through some points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FittedPlane {
    /// Unit normal, the direction of the smallest variance, of either sign; `None` where the points
    /// have no such direction.
    pub normal: Option<Vec3>,
    /// Mean of the points.
    pub centre: Vec3,
    /// Variances times the sum of the weights of the points along the principal directions,
    /// ascending; the first is how thick the points are.
    pub variances: [f64; 3],
}

impl FittedPlane {
    /// Fits a plane; sums run in the order of the points, in double precision.
    pub fn through(points: impl Iterator<Item = Vec3> + Clone) -> Self {
        Self::weighted(points.map(|point| (point, 1.0)))
    }

    /// Fits a plane to points with weights, of which one at least is positive.
    pub fn weighted(points: impl Iterator<Item = (Vec3, f64)> + Clone) -> Self {
        let total: f64 = points.clone().map(|(_, weight)| weight).sum();
        let weighted = points
            .clone()
            .map(|(point, weight)| weight * point.as_dvec3());
        let mean = weighted.sum::<DVec3>() / total;
        let mut covariance = Matrix3::<f64>::zeros();
        for (point, weight) in points {
            let d = point.as_dvec3() - mean;
            let d = Vector3::new(d.x, d.y, d.z);
            covariance += weight * d * d.transpose();
        }
        let eigen = SymmetricEigen::new(covariance);
        let normal = eigen.eigenvectors.column(eigen.eigenvalues.imin());
        let mut variances: [f64; 3] = eigen.eigenvalues.into();
        variances.sort_unstable_by(f64::total_cmp);
        Self {
            centre: mean.as_vec3(),
            normal: Vec3::new(normal[0] as f32, normal[1] as f32, normal[2] as f32).try_normalize(),
            variances,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plane_has_its_normal_and_the_variances_of_its_points() {
        // Two by four by a hundredth, turned so that the normal is (1, 2, 2) / 3.
        let axes = [
            Vec3::new(2.0, -2.0, 1.0) / 3.0,
            Vec3::new(2.0, 1.0, -2.0) / 3.0,
            Vec3::new(1.0, 2.0, 2.0) / 3.0,
        ];
        let corners = (0..8).map(|i| {
            let sign = |bit: u32| if i & (1 << bit) == 0 { -1.0 } else { 1.0 };
            Vec3::ONE + axes[0] * sign(0) + axes[1] * 2.0 * sign(1) + axes[2] * 0.01 * sign(2)
        });
        let plane = FittedPlane::through(corners);
        assert!(plane.normal.unwrap().dot(axes[2]).abs() > 1.0 - 1e-6);
        // Single precision of the corners.
        for (own, wanted) in plane.variances.iter().zip([8e-4, 8.0, 32.0]) {
            assert!((own - wanted).abs() < 1e-5, "{own} {wanted}");
        }
    }

    #[test]
    fn rays_meet_the_front_of_a_plane() {
        let wall = Plane {
            normal: Vec3::NEG_Z,
            offset: -3.0,
        };
        let towards = Vec3::new(0.5, 0.2, 1.0).normalize();
        assert_eq!(wall.height(Vec3::Z), 2.0);
        let distance = wall.meet(Vec3::ZERO, towards).unwrap();
        assert!((distance * towards.z - 3.0).abs() < 1e-6);
        assert_eq!(wall.meet(Vec3::ZERO, -towards), None);
        assert_eq!(wall.meet(Vec3::Z * 4.0, -towards), None);
        let mirrored = towards * Vec3::new(1.0, 1.0, -1.0);
        assert_eq!(wall.mirrored(towards), mirrored);
    }
}
