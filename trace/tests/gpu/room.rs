//! A room that tests of light share.

use eagpt_scene::{Gaussian, Gaussians};
use eagpt_testkit::gaussians::{cube, material, rectangle};
use glam::Vec3;

/// A room with coloured walls and a lamp whose rim fades.
pub(crate) fn lit_room() -> Gaussians {
    let walls = cube(1.0, 0.14, |side| {
        let color = Vec3::new(0.6, 0.5 + 0.3 * side.x, 0.5 - 0.3 * side.y);
        material(Vec3::splat(0.3) + 0.1 * side, 0.0, color)
    });
    let lamp = rectangle(
        Vec3::Z * 0.95,
        Vec3::X * 0.4,
        Vec3::Y * 0.4,
        0.1,
        material(Vec3::splat(5.0), 1.0, Vec3::ZERO),
    );
    let soft = |g: Gaussian| Gaussian {
        emission: (1.2 - 3.0 * g.position.x.abs()).clamp(0.0, 1.0),
        ..g
    };
    walls
        .into_iter()
        .chain(lamp.into_iter().map(soft))
        .collect()
}
