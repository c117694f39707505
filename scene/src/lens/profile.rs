//! Projection profiles: from the angle off the optical axis to the distance in the image plane,
//! before distortion. The closed-form part of a lens.
//!
//! Points of the plane are in focal lengths. All profiles agree with the pinhole near the axis, but
//! for [`Profile::Fov`], whose scale there is 2 tan(ω/2) / ω, and [`Profile::Equirectangular`],
//! which is no function of the angle.

use glam::{DVec2, DVec3};
use std::f64::consts::{FRAC_PI_2, PI};

/// The kind of a profile.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Profile {
    /// ρ / z
    Perspective,
    /// θ = atan2(ρ, z); Kannala and Brandt, "A Generic Camera Model and Calibration Method" (PAMI
    /// 2006)
    Equidistant,
    /// atan(2 tan(ω/2) ρ/z) / ω; Devernay and Faugeras, "Straight Lines Have to Be Straight" (2001)
    Fov,
    /// The r with r / (1 + k r²) = ρ/z; Fitzgibbon, "Simultaneous Linear Estimation of Multiple
    /// View Geometry and Lens Distortion" (CVPR 2001)
    Division,
    /// ρ / (α √(β ρ² + z²) + (1 − α) z); Khomutenko, Garcia and Martinet, "An Enhanced Unified
    /// Camera Model" (2016)
    Eucm,
    /// Longitude and latitude, radians
    Equirectangular,
}

/// Parameters of a profile: ω; k; α and β; nothing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Shape {
    pub(super) profile: Profile,
    pub(super) params: [f64; 2],
}

/// Below this |ω| the lens is a pinhole to double precision: the correction is ω²/12.
const MIN_OMEGA: f64 = 1e-9;

impl Shape {
    /// The problem with the parameters, if any.
    pub(super) fn problem(&self) -> Option<String> {
        let [a, b] = self.params;
        match self.profile {
            Profile::Fov if a.abs() >= PI => Some(format!("omega is {a:?} rad, not below pi")),
            Profile::Eucm if !(0.0..=1.0).contains(&a) => {
                Some(format!("alpha is {a:?}, not 0 to 1"))
            }
            Profile::Eucm if b <= 0.0 => Some(format!("beta is {b:?}, not above 0")),
            _ => None,
        }
    }

    /// The plane's point of a point in camera space; `None` where the profile has no image of it.
    pub(super) fn plane_from_point(&self, point: DVec3) -> Option<DVec2> {
        let (rho, z) = (point.truncate().length(), point.z);
        if point == DVec3::ZERO || point.is_nan() {
            return None;
        }
        let [a, b] = self.params;
        let scale = match self.profile {
            Profile::Perspective => (z > 0.0).then(|| z.recip())?,
            Profile::Equidistant => {
                if z < 0.0 && rho == 0.0 {
                    // Straight behind: every direction of the plane would do.
                    return None;
                }
                per_radius(rho.atan2(z), rho, z)
            }
            Profile::Fov if a.abs() < MIN_OMEGA => (z > 0.0).then(|| z.recip())?,
            Profile::Fov => {
                let slope = 2.0 * (0.5 * a).tan();
                let at_axis = slope / a / (z > 0.0).then_some(z)?;
                if rho > 0.0 {
                    (slope * rho / z).atan() / a / rho
                } else {
                    at_axis
                }
            }
            Profile::Division => {
                let root = (z * z - 4.0 * a * rho * rho).sqrt();
                // For a ≥ 0 only what is ahead; NaN where no r fulfils the equation.
                let sum = z + root;
                (sum > 0.0).then(|| 2.0 / sum)?
            }
            Profile::Eucm => {
                let d = (b * rho * rho + z * z).sqrt();
                let limit = if a <= 0.5 {
                    a / (1.0 - a)
                } else {
                    (1.0 - a) / a
                };
                let sum = a * d + (1.0 - a) * z;
                (z > -limit * d && sum > 0.0).then(|| sum.recip())?
            }
            Profile::Equirectangular => {
                let longitude = point.x.atan2(z);
                let latitude = point.y.atan2(point.x.hypot(z));
                return Some(DVec2::new(longitude, latitude));
            }
        };
        Some(point.truncate() * scale).filter(|plane| plane.is_finite())
    }

    /// The direction, of unit length, that the plane's point shows; `None` outside of the profile's
    /// image.
    pub(super) fn ray_from_plane(&self, plane: DVec2) -> Option<DVec3> {
        let r = plane.length();
        let [a, b] = self.params;
        let ray = match self.profile {
            Profile::Perspective => plane.extend(1.0),
            Profile::Equidistant => {
                let (sin, cos) = (r < PI).then(|| r.sin_cos())?;
                (plane * if r > 0.0 { sin / r } else { 1.0 }).extend(cos)
            }
            Profile::Fov if a.abs() < MIN_OMEGA => plane.extend(1.0),
            Profile::Fov => {
                let (angle, slope) = (r * a.abs(), 2.0 * (0.5 * a.abs()).tan());
                let tan = (angle < FRAC_PI_2).then(|| angle.tan())?;
                let scale = if r > 0.0 {
                    tan / slope / r
                } else {
                    a.abs() / slope
                };
                (plane * scale).extend(1.0)
            }
            Profile::Division => {
                let z = 1.0 + a * r * r;
                (a * r * r < 1.0).then(|| plane.extend(z))?
            }
            Profile::Eucm => {
                let inside = 1.0 - (2.0 * a - 1.0) * b * r * r;
                let root = (inside >= 0.0).then(|| inside.sqrt())?;
                plane.extend((1.0 - b * a * a * r * r) / (a * root + 1.0 - a))
            }
            Profile::Equirectangular => {
                if plane.x.abs() > PI || plane.y.abs() > FRAC_PI_2 {
                    return None;
                }
                let ((sin_x, cos_x), (sin_y, cos_y)) = (plane.x.sin_cos(), plane.y.sin_cos());
                DVec3::new(cos_y * sin_x, sin_y, cos_y * cos_x)
            }
        };
        // Also what is not a number.
        ray.try_normalize()
    }

    /// Radius in the plane of directions `angle` off the axis.
    pub(super) fn radius_at(&self, angle: f64) -> Option<f64> {
        let (sin, cos) = angle.sin_cos();
        self.plane_from_point(DVec3::new(sin, 0.0, cos))
            .map(DVec2::length)
    }
}

/// `angle / rho`, which near the axis is `1 / z`.
fn per_radius(angle: f64, rho: f64, z: f64) -> f64 {
    if rho > 0.0 { angle / rho } else { z.recip() }
}
