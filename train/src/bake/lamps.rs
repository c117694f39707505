//! Light of lamps apart: rays are shared out so that weak lamps beside strong ones get enough.

use eagpt_scene::light_basis::NO_LIGHT;
use eagpt_scene::{Gaussians, LightGroups};
use eagpt_trace::transport::lights::power;

/// Least power of a lamp that light samples are chosen by, in an equal share of all power.
const LEAST_SHARE: f64 = 0.5;

/// `scene` with the light that light samples are chosen by where that of each of `lights` is asked
/// for. By their power, a lamp with a hundredth of it would get a hundredth of the samples, and
/// alone a hundred times the variance. The samples of strong ones become fewer by a third at most.
pub(super) fn evened(scene: &Gaussians, lights: &LightGroups) -> Gaussians {
    let emitting = || (0..scene.len()).filter(|&i| lights.of[i] != NO_LIGHT);
    let mut powers = vec![0.0; lights.names.len()];
    for i in emitting() {
        powers[lights.of[i] as usize] += power(&scene.get(i));
    }
    let least = LEAST_SHARE * powers.iter().sum::<f64>() / powers.len() as f64;
    let mut sampled = scene.clone();
    for i in emitting() {
        let power = powers[lights.of[i] as usize];
        if power > 0.0 && power < least {
            sampled.radiances[i] *= (least / power) as f32;
        }
    }
    sampled
}

#[cfg(test)]
mod tests {
    use super::*;
    use eagpt_scene::{Gaussian, Gloss, Harmonics};
    use glam::{Quat, Vec2, Vec3};

    #[test]
    fn no_lamp_has_less_than_half_of_an_equal_share() {
        let disc = |radiance: f32, emission: f32| Gaussian {
            position: Vec3::ZERO,
            scale: Vec2::splat(0.1),
            rotation: Quat::IDENTITY,
            opacity: 0.9,
            radiance: Vec3::splat(radiance),
            harmonics: Harmonics::NONE,
            gloss: Gloss::NONE,
            emission,
            albedo: Vec3::ZERO,
        };
        // A wall, a strong lamp, a weak one of two discs, one that is off.
        let scene: Gaussians = [(3.0, 0.0), (97.0, 1.0), (1.0, 1.0), (2.0, 1.0), (0.0, 1.0)]
            .map(|(radiance, emission)| disc(radiance, emission))
            .into_iter()
            .collect();
        let lights = LightGroups {
            names: ["strong", "weak", "off"].map(str::to_owned).to_vec(),
            of: vec![NO_LIGHT, 0, 1, 1, 2],
        };
        let sampled = evened(&scene, &lights);
        let radiances: Vec<f32> = sampled.radiances.iter().map(|r| r.x).collect();
        // 100 / 3 / 2 for the weak one, in the ratio of its discs.
        let expected = [3.0, 97.0, 100.0 / 18.0, 100.0 / 9.0, 0.0];
        for (found, expected) in radiances.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-4, "{radiances:?}");
        }
    }
}
