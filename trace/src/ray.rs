//! Rays.

/// A ray that may leave from a surface made of Gaussians.
#[derive(Debug, Clone, Copy)]
pub struct Ray {
    /// Origin, world space.
    pub origin: [f32; 3],
    /// Unit direction.
    pub direction: [f32; 3],
    /// Distance up to which Gaussians that lie along the surface the ray leaves from do not count;
    /// 0 for a ray from free space.
    pub t_min: f32,
    /// Unit normal of that surface.
    pub own_normal: [f32; 3],
}

impl Ray {
    /// A ray from free space: every hit in front of the origin counts.
    pub fn free(origin: [f32; 3], direction: [f32; 3]) -> Self {
        Self {
            origin,
            direction,
            t_min: 0.0,
            own_normal: [0.0; 3],
        }
    }
}
