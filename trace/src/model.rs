//! Constants of the blending model. A GPU kernel takes them from here.

/// Hits farther than this many standard deviations from the centre do not count: the reference's
/// quads end there.
pub const MAX_RADIUS: f32 = 3.0;

/// Hits of lower opacity do not count: one step of an 8-bit display, the usual cut of Gaussian
/// renderers. Faint Gaussians become smaller than [`MAX_RADIUS`] by it.
pub const MIN_ALPHA: f32 = 1.0 / 255.0;

/// Hits of lower weight are skipped (the reference's constant).
pub const MIN_WEIGHT: f32 = 1e-6;

/// A ray ends with the hit that brings its transmittance under this value (the reference's
/// constant).
pub const MIN_TRANSMITTANCE: f32 = 1e-4;

/// A ray that passes no more than this share of the light is not free.
pub(crate) const FREE: f32 = 0.5;

/// Hits on planes seen more edge-on than this cosine do not count: the distance `(p−o)·n / (ω·n)`
/// has lost its digits there (a relative rounding error of 6e-8 in the numerator grows beyond
/// 1e-3), and a disc this thin covers nothing.
pub const MIN_COSINE: f32 = 5e-5;

/// Near the start of a bounce, Gaussians tilted against the surface by less than 60° (this is the
/// cosine) are taken to be part of it: reconstructed walls have tilts of some 10°, walls of a room
/// meet at 90°.
pub(crate) const OWN_COSINE: f32 = 0.5;

/// Squared radius, in standard deviations, inside which a Gaussian of peak `opacity` counts;
/// negative if nowhere.
pub(crate) fn cut_radius_squared(opacity: f32) -> f32 {
    (2.0 * (opacity / MIN_ALPHA).ln()).min(MAX_RADIUS * MAX_RADIUS)
}
