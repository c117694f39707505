//! Where a bounce starts.
//!
//! A surface made of Gaussians has a thickness: discs overlap at slightly different heights and
//! tilts, and a ray that leaves from the mean distance would hit them again. The reference ignores
//! all hits closer than 0.2 scene units, which loses contact shadows, leaks light through corners
//! and ties the result to the unit of length. Here a ray ignores hits within the thickness of the
//! surface it leaves, and only on Gaussians that lie along it; the thickness comes from the hits
//! that were blended: the spread of their distances, and their size.

use crate::features::Features;
use crate::ray::Ray;
use glam::Vec3;

/// Half the offset, in standard deviations of the hits' heights.
pub(crate) const OFFSET_DEVIATIONS: f32 = 3.0;
/// The offset is taken no thicker than this many mean sizes of the hit Gaussians: where a ray
/// grazes an edge the spread is that of two surfaces and says nothing about either.
pub(crate) const MAX_OFFSET_SIZES: f32 = 1.0;
/// The offset is taken no thinner than this many mean sizes: discs of a flat wall still differ in
/// tilt.
pub(crate) const MIN_OFFSET_SIZES: f32 = 0.1;
/// A ray that leaves at a grazing angle ignores hits on its own surface for at most this many
/// offset thicknesses: farther away, even of a wall like this one, it may be another wall.
pub(crate) const MAX_SLANT: f32 = 8.0;
/// Opacity below which a ray has met nothing that light could bounce off.
pub(crate) const MIN_ALPHA: f32 = 1e-3;

/// A point from which light bounces on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Surface {
    /// X = o + D̃ω, world space.
    pub position: Vec3,
    /// Ñ, unit length, turned to where the ray came from.
    pub normal: Vec3,
    /// Height above the tangent plane up to which hits belong to the surface itself; scene units.
    pub offset: f32,
}

impl Surface {
    /// The surface that a ray met, or `None` if it met nothing.
    pub fn at(origin: Vec3, direction: Vec3, met: &Features) -> Option<Self> {
        let normal = met.unit_normal();
        if met.alpha() < MIN_ALPHA || normal == Vec3::ZERO {
            return None;
        }
        let size = met.mean_size();
        let spread = met.distance_deviation() * direction.dot(normal).abs();
        Some(Self {
            position: origin + direction * met.mean_distance(),
            normal,
            offset: (OFFSET_DEVIATIONS * spread)
                .clamp(MIN_OFFSET_SIZES * size, MAX_OFFSET_SIZES * size),
        })
    }

    /// The ray that leaves in unit `direction`.
    pub fn ray(&self, direction: Vec3) -> Ray {
        let slant = (1.0 / direction.dot(self.normal).max(f32::MIN_POSITIVE)).min(MAX_SLANT);
        Ray {
            origin: self.position.to_array(),
            direction: direction.to_array(),
            t_min: self.offset * slant,
            own_normal: self.normal.to_array(),
        }
    }
}
