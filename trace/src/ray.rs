//! Rays.

/// A ray; hits closer than `t_min` do not count.
#[derive(Debug, Clone, Copy)]
pub struct Ray {
    /// Origin, world space.
    pub origin: [f32; 3],
    /// Unit direction.
    pub direction: [f32; 3],
    /// Smallest distance that counts, exclusive.
    pub t_min: f32,
}
