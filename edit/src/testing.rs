//! Helpers of several tests.

use eagpt_scene::{Gaussian, Gloss, Harmonics};
use glam::{Quat, Vec2, Vec3};

/// A level, grey disc.
pub(crate) fn disc(position: Vec3) -> Gaussian {
    Gaussian {
        position,
        scale: Vec2::splat(0.1),
        rotation: Quat::IDENTITY,
        opacity: 0.9,
        radiance: Vec3::splat(0.5),
        harmonics: Harmonics::NONE,
        gloss: Gloss::NONE,
        emission: 0.0,
        albedo: Vec3::splat(0.5),
    }
}
