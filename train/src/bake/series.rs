//! The Neumann series of the light of a scene on its Gaussians, see [`super::gaussians`].

use super::BakeProgress;
use crate::irradiance::NoisyLight;
use crate::irradiance::smooth::Smoothing;
use eagpt_trace::transport::matrix::{Directions, Receiver, TransportMatrix};
use glam::Vec3;

/// Who lights whom.
pub(super) struct Exchange<'a> {
    receivers: &'a [Receiver],
    matrix: &'a TransportMatrix,
    directions: Directions,
    smoothing: Smoothing,
}

impl<'a> Exchange<'a> {
    /// The rows of `matrix` are those of `receivers`.
    pub(super) fn new(
        receivers: &'a [Receiver],
        matrix: &'a TransportMatrix,
        directions: Directions,
    ) -> Self {
        Self {
            receivers,
            matrix,
            directions,
            smoothing: Smoothing::new(receivers),
        }
    }
}

/// The sum of the bounces so far.
#[derive(Debug, Clone, PartialEq)]
struct Series {
    /// Bounces done.
    bounce: u32,
    /// Reflected radiance of all bounces, `[n]`; zero for what emits.
    total: Vec<Vec3>,
    /// That of the last bounce alone, `[n]`.
    last: Vec<Vec3>,
}

impl Series {
    fn new(num: usize) -> Self {
        Self {
            bounce: 0,
            total: vec![Vec3::ZERO; num],
            last: vec![Vec3::ZERO; num],
        }
    }

    /// Adds a bounce: what `receivers` reflect of the light of emitters, then of that of the last
    /// bounce.
    fn add(&mut self, albedos: &[Vec3], light: &Exchange<'_>) {
        let &Exchange {
            matrix, directions, ..
        } = light;
        let noisy = if self.bounce == 0 {
            NoisyLight::direct(matrix, directions)
        } else {
            NoisyLight::indirect(matrix, directions, &self.last)
        };
        let irradiance = noisy.smoothed(&light.smoothing);
        self.last.fill(Vec3::ZERO);
        for ((i, _), light) in light.receivers.iter().zip(irradiance) {
            let i = *i as usize;
            self.last[i] = albedos[i] * light;
            self.total[i] += self.last[i];
        }
        self.bounce += 1;
    }

    /// Light of the last bounce as a share of all.
    fn share(&self) -> f64 {
        let sum = |of: &[Vec3]| -> f64 { of.iter().map(|l| f64::from(l.element_sum())).sum() };
        sum(&self.last) / sum(&self.total).max(f64::MIN_POSITIVE)
    }
}

/// Reflected radiance of all Gaussians, `[n]`, after so many bounces; zero for what emits.
pub(super) fn sum_of_bounces(
    albedos: &[Vec3],
    light: &Exchange<'_>,
    max_bounces: u32,
    told: &mut dyn FnMut(BakeProgress),
) -> Vec<Vec3> {
    let mut series = Series::new(albedos.len());
    while series.bounce < max_bounces {
        series.add(albedos, light);
        told(BakeProgress::Bounced {
            bounce: series.bounce,
            share: series.share(),
        });
    }
    series.total
}

#[cfg(test)]
mod tests {
    use super::super::{emits, with_emitters};
    use super::*;
    use eagpt_scene::rng::{Purpose, RandomKey};
    use eagpt_testkit::gaussians::{material, sphere};
    use eagpt_trace::cpu::CpuScene;
    use eagpt_trace::transport::start::Surface;

    /// Inside a sphere every patch sees every other at the same `cos cos / r²`: light from a cap of
    /// area share f is spread evenly, and with albedo a the radiance of the rest after K bounces is
    /// `a L f Σ_{k<K} (a (1 − f))^k`.
    #[test]
    fn bounces_inside_a_sphere_follow_the_geometric_series() {
        let (share, albedo, radiance) = (0.25_f32, 0.6_f32, 3.0_f32);
        // Archimedes: the cap above z = 1 − 2f has the share f of the area.
        let scene = sphere(6000, 2.0, |direction| {
            if direction.z > 1.0 - 2.0 * share {
                material(Vec3::splat(radiance), 1.0, Vec3::ZERO)
            } else {
                // Radiance that must not count.
                material(Vec3::splat(50.0), 0.0, Vec3::splat(albedo))
            }
        });
        let receivers: Vec<Receiver> = (0..scene.len() as u32)
            .filter(|&i| !emits(scene.emissions[i as usize]))
            .map(|i| {
                let g = scene.get(i as usize);
                let surface = Surface {
                    position: g.position,
                    normal: -g.position.normalize(),
                    offset: 0.3 * g.scale.x,
                };
                (i, surface)
            })
            .collect();
        let rays = Directions {
            bsdf: 32,
            to_lights: 16,
        };
        let key = RandomKey::new(1, Purpose::Bake, 1);
        let matrix = TransportMatrix::trace(&CpuScene::new(&scene), &receivers, rays, key);
        let light = Exchange::new(&receivers, &matrix, rays);
        let mut series = Series::new(scene.len());
        let mut expected = 0.0;
        for bounce in 1..=4 {
            series.add(&scene.albedos, &light);
            expected += albedo * radiance * share * (albedo * (1.0 - share)).powi(bounce - 1);
            let mean: f32 = receivers
                .iter()
                .map(|(i, _)| series.total[*i as usize].x)
                .sum::<f32>()
                / receivers.len() as f32;
            // 6000 × 32 directions leave 0.3 %; the soft rim of the cap and discs that do not quite
            // close 1 %.
            assert!(
                (mean / expected - 1.0).abs() < 0.015,
                "bounce {bounce}: {mean} instead of {expected}"
            );
        }
        let baked = with_emitters(&scene, &series.total);
        assert_eq!(baked[0], scene.radiances[0]);
    }
}
