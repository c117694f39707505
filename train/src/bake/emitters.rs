//! Emitters keep their light, whatever is baked.

use eagpt_scene::lamps::emits;
use eagpt_scene::{Gaussians, Harmonics};
use glam::Vec3;

/// Makes the radiance of what reflects the same in all directions; emitters keep their harmonics.
pub(super) fn forget_directions(scene: &mut Gaussians) {
    for (harmonics, &emission) in scene.harmonics.iter_mut().zip(&scene.emissions) {
        if !emits(emission) {
            *harmonics = Harmonics::NONE;
        }
    }
    if scene.harmonics.iter().all(|h| *h == Harmonics::NONE) {
        scene.harmonics.clear();
    }
}

/// `radiances` of what reflects, and the scene's own of what emits. `[n]`
pub(super) fn with_emitters(scene: &Gaussians, radiances: &[Vec3]) -> Vec<Vec3> {
    (scene.radiances.iter())
        .zip(&scene.emissions)
        .zip(radiances)
        .map(|((own, &e), reflected)| if emits(e) { *own } else { *reflected })
        .collect()
}
