//! Albedos with which light does not grow from bounce to bounce.
//!
//! Albedos of single Gaussians may exceed 1 ([`eagpt_scene::gaussians::MAX_ALBEDO`]), and so may
//! those of neighbours, as in the housing of a lamp that the scene lacks. Cameras see them among
//! darker ones, but rays from one meet the other, and their light grows without end. It does not if
//! some radiance is larger everywhere than what is reflected of it (Collatz 1942; Wielandt 1950):
//! that of many bounces is held against the next.

use super::Exchange;
use eagpt_light::energy::MAX_SURFACE;
use eagpt_light::irradiance::NoisyLight;
use eagpt_scene::Gaussians;
use eagpt_scene::lamps::emits;
use eagpt_trace::transport::MAX_BOUNCES;
use eagpt_trace::transport::bsdf::equivalent_albedo;
use glam::Vec3;

/// Bounces before any is limited. Light that is alike everywhere at first settles meanwhile: what is
/// bright among darker Gaussians reflects more than it gets of the first bounce, and no more later.
const NUM_SETTLING: u32 = 4;

/// Darkens the Gaussians of `scene` whose albedo is above [`MAX_SURFACE`], and whose light is more
/// than that share of the last bounce's, until neither is so of both; returns how many.
pub(in crate::bake) fn limit_growth(scene: &mut Gaussians, light: &Exchange<'_>) -> usize {
    let reflects = |emission: &f32| if emits(*emission) { 0.0 } else { 1.0 };
    let mut last: Vec<Vec3> = scene
        .emissions
        .iter()
        .map(reflects)
        .map(Vec3::splat)
        .collect();
    let before = scene.albedos.clone();
    for bounce in 0..MAX_BOUNCES {
        let noisy = NoisyLight::indirect(light.matrix, light.directions, &last);
        let irradiance = noisy.smoothed(&light.smoothing);
        for (i, sources) in light.receivers.each() {
            let albedo = |scene: &Gaussians| equivalent_albedo(scene.albedos[i], scene.gloss_of(i));
            let received = sources.mean(|row| irradiance[row]);
            let most = MAX_SURFACE * last[i];
            let reflected = albedo(scene) * received;
            let grows = reflected.cmpgt(most);
            if bounce >= NUM_SETTLING && grows.any() {
                let allowed = Vec3::select(grows, most / reflected, Vec3::ONE).min_element();
                let white = MAX_SURFACE / albedo(scene).max_element();
                scene.albedos[i] *= allowed.max(white).min(1.0);
            }
            last[i] = albedo(scene) * received;
        }
    }
    (scene.albedos.iter().zip(&before))
        .filter(|(now, before)| now != before)
        .count()
}
