//! Pinhole cameras.

use glam::{DAffine3, DMat3, DVec3, Vec3};

/// A pinhole camera. In memory the camera's axes are OpenCV's: x right, y down, z forward.
///
/// Stored in double precision so that poses survive a round trip through a file; rays are single
/// precision.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Camera {
    /// Image width, pixels.
    pub width: u32,
    /// Image height, pixels.
    pub height: u32,
    /// Focal length along x, pixels.
    pub fx: f64,
    /// Focal length along y, pixels.
    pub fy: f64,
    /// Principal point, pixels from the left edge of the image (the first pixel's centre is 0.5).
    pub cx: f64,
    /// Principal point, pixels from the top edge of the image.
    pub cy: f64,
    /// Rigid transform to the world from the camera (OpenCV axes).
    pub world_from_camera: DAffine3,
}

/// The quantities of a [`Camera`] that rays need, in single precision: `direction = base + x·step_x
/// + y·step_y`, not normalised, for pixel coordinates with centres at +0.5.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RayFrame {
    /// Centre of projection, world space.
    pub origin: Vec3,
    /// Direction through the image corner (0, 0); its length along the optical axis is 1.
    pub base: Vec3,
    /// Change of direction for one pixel to the right.
    pub step_x: Vec3,
    /// Change of direction for one pixel down.
    pub step_y: Vec3,
}

impl RayFrame {
    /// The unit direction through the continuous pixel position (`x`, `y`).
    #[inline]
    pub fn direction(&self, x: f32, y: f32) -> Vec3 {
        (self.base + self.step_x * x + self.step_y * y).normalize()
    }
}

impl Camera {
    /// A camera of square pixels whose optical axis meets the middle of the image; `fov_x_rad` is
    /// the horizontal field of view, between 0 and pi.
    pub fn centred([width, height]: [u32; 2], fov_x_rad: f64, world_from_camera: DAffine3) -> Self {
        let focal = 0.5 * f64::from(width) / (0.5 * fov_x_rad).tan();
        Self {
            width,
            height,
            fx: focal,
            fy: focal,
            cx: 0.5 * f64::from(width),
            cy: 0.5 * f64::from(height),
            world_from_camera,
        }
    }

    /// Pose of a camera at `eye` that looks along the unit vector `forward`, which is not vertical,
    /// with the horizon (z is up) level.
    pub fn level_pose(eye: DVec3, forward: DVec3) -> DAffine3 {
        let right = forward.cross(DVec3::Z).normalize();
        DAffine3 {
            matrix3: DMat3::from_cols(right, forward.cross(right), forward),
            translation: eye,
        }
    }

    /// Number of pixels.
    pub fn num_pixels(&self) -> usize {
        self.width as usize * self.height as usize
    }

    /// The same picture with `factor` times as many pixels along each axis.
    pub fn magnified(&self, factor: u32) -> Self {
        let by = f64::from(factor);
        Self {
            width: self.width * factor,
            height: self.height * factor,
            fx: self.fx * by,
            fy: self.fy * by,
            cx: self.cx * by,
            cy: self.cy * by,
            ..*self
        }
    }

    /// The same camera for an image of another size: the vertical field of view stays, pixels keep
    /// their shape.
    pub fn resized(&self, width: u32, height: u32) -> Self {
        let by = f64::from(height) / f64::from(self.height);
        let centre =
            |at: f64, old: u32, new: u32| 0.5 * f64::from(new) + by * (at - 0.5 * f64::from(old));
        Self {
            width,
            height,
            fx: self.fx * by,
            fy: self.fy * by,
            cx: centre(self.cx, self.width, width),
            cy: centre(self.cy, self.height, height),
            ..*self
        }
    }

    /// The same camera with another vertical field of view, in radians, between 0 and pi; pixels
    /// keep their shape.
    pub fn with_vertical_fov(&self, angle_rad: f64) -> Self {
        let fy = 0.5 * f64::from(self.height) / (0.5 * angle_rad).tan();
        Self {
            fx: self.fx * fy / self.fy,
            fy,
            ..*self
        }
    }

    /// Centre of projection, world space.
    pub fn origin(&self) -> Vec3 {
        self.world_from_camera.translation.as_vec3()
    }

    /// Viewing direction (the optical axis), world space, unit length.
    pub fn forward(&self) -> Vec3 {
        self.world_from_camera.matrix3.z_axis.as_vec3()
    }

    /// Origin and axes that rays are made from.
    pub fn ray_frame(&self) -> RayFrame {
        let to_world = &self.world_from_camera.matrix3;
        let step_x = to_world.x_axis / self.fx;
        let step_y = to_world.y_axis / self.fy;
        let base = to_world.z_axis - step_x * self.cx - step_y * self.cy;
        RayFrame {
            origin: self.origin(),
            base: base.as_vec3(),
            step_x: step_x.as_vec3(),
            step_y: step_y.as_vec3(),
        }
    }

    /// Projects a world point to continuous pixel coordinates and its depth along the optical axis:
    /// `(x, y, depth)`. `depth` is not positive for points behind the camera, whose x and y mean
    /// nothing.
    pub fn project(&self, point_world: Vec3) -> Vec3 {
        let to_world = &self.world_from_camera;
        let offset = point_world.as_dvec3() - to_world.translation;
        let local: DVec3 = to_world.matrix3.transpose() * offset;
        DVec3::new(
            self.fx * local.x / local.z + self.cx,
            self.fy * local.y / local.z + self.cy,
            local.z,
        )
        .as_vec3()
    }

    /// Whether what [`Self::project`] makes of a point is in the picture.
    pub fn is_in_picture(&self, at: Vec3) -> bool {
        at.z > 0.0
            && (0.0..self.width as f32).contains(&at.x)
            && (0.0..self.height as f32).contains(&at.y)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DMat3, DQuat};

    fn some_camera() -> Camera {
        Camera {
            width: 40,
            height: 30,
            fx: 35.0,
            fy: 33.0,
            cx: 19.0,
            cy: 16.0,
            world_from_camera: DAffine3 {
                matrix3: DMat3::from_quat(DQuat::from_euler(glam::EulerRot::XYZ, 0.3, -1.1, 0.7)),
                translation: DVec3::new(1.0, -2.0, 0.5),
            },
        }
    }

    #[test]
    fn another_size_shows_the_same_height() {
        let camera = some_camera();
        let wide = camera.resized(100, 60);
        assert_eq!(
            (wide.width, wide.height, wide.fx, wide.fy),
            (100, 60, 70.0, 66.0)
        );
        // The principal point stays as far from the centre, in pixels of twice the number.
        assert_eq!((wide.cx, wide.cy), (48.0, 32.0));
        assert_eq!(camera.resized(40, 30), camera);
        let narrow = camera.with_vertical_fov(2.0 * 0.5_f64.atan());
        assert!(
            (narrow.fy - 30.0).abs() < 1e-12 && (narrow.fx / narrow.fy - 35.0 / 33.0).abs() < 1e-12
        );
    }

    #[test]
    fn projection_inverts_ray() {
        let camera = some_camera();
        let frame = camera.ray_frame();
        for (x, y) in [(0.5, 0.5), (39.5, 0.5), (12.25, 29.5)] {
            let direction = frame.direction(x, y);
            let back = camera.project(frame.origin + direction * 3.0);
            // Single-precision rays of a 40-pixel image: errors of 1e-6 relative, 1e-4 pixel is
            // generous.
            assert!(
                (back.x - x).abs() < 1e-4 && (back.y - y).abs() < 1e-4,
                "{back} for {x},{y}"
            );
            assert!((back.z - 3.0 * direction.dot(camera.forward())).abs() < 1e-5);
        }
    }
}
