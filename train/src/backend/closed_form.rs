//! Albedo in closed form: what a diffuse Gaussian sends out over what arrives, `ρ = π r / E`.
//!
//! One gathering of light for each Gaussian, instead of one for each pixel of each view. It ignores that pixels blend several
//! Gaussians, which is what the image loss of stage 1 then mends.

use eagpt_scene::Gaussians;
use eagpt_scene::rng::{Purpose, RandomKey};
use eagpt_trace::cpu::CpuScene;
use eagpt_trace::ray::Ray;
use eagpt_trace::transport::lights::BounceSampler;
use eagpt_trace::transport::start::Surface;
use eagpt_trace::transport::{LIGHT_SHARE, RayTracer, irradiance_over_pi};
use glam::Vec3;
use rayon::prelude::*;

/// Where a Gaussian is looked at from, above its centre, in standard deviations: outside the slab it belongs to.
const PROBE_HEIGHT: f32 = 4.0;
/// Albedos of natural surfaces stay inside.
const RANGE: (f32, f32) = (0.02, 0.95);
/// Share of its light that a Gaussian must receive for the quotient to mean something.
const MIN_ARRIVING: f32 = 1e-4;

/// Albedos of all Gaussians, `[n]`. Gaussians that light cannot reach keep the albedo they have.
pub(super) fn albedos(
    scene: &CpuScene,
    gaussians: &Gaussians,
    num_samples: u32,
    seed: u64,
) -> Vec<Vec3> {
    let sampler = BounceSampler::new(scene.lights(), LIGHT_SHARE);
    // The gathering of stage 1 uses keys of views and iterations; this one is the stage's iteration 0.
    let key = RandomKey::new(seed, Purpose::Albedo, 0);
    (0..gaussians.len())
        .into_par_iter()
        .map(|i| {
            let g = gaussians.get(i);
            let normal = g.rotation * Vec3::Z;
            let height = PROBE_HEIGHT * g.scale.max_element();
            // Nothing says which side is the outside; the one that more light reaches is.
            let arriving = [normal, -normal]
                .into_iter()
                .enumerate()
                .filter_map(|(side, up)| {
                    let probe = Ray::free((g.position + up * height).to_array(), (-up).to_array());
                    let surface = Surface::at(probe.origin.into(), -up, &scene.trace(&probe))?;
                    Some(irradiance_over_pi(
                        scene,
                        &sampler,
                        &surface,
                        num_samples,
                        |sample| key.stream(i as u32, 2 * sample + side as u32),
                    ))
                })
                .fold(Vec3::ZERO, |a, b| {
                    if b.element_sum() > a.element_sum() {
                        b
                    } else {
                        a
                    }
                });
            if arriving.min_element() < MIN_ARRIVING * g.radiance.max_element() {
                return g.albedo;
            }
            (g.radiance / arriving).clamp(Vec3::splat(RANGE.0), Vec3::splat(RANGE.1))
        })
        .collect()
}
