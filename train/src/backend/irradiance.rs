//! The light that arrives at every Gaussian, gathered once.
//!
//! Stage 1 of the paper samples the hemisphere above every pixel anew in each iteration, although what arrives never changes while
//! albedos do. Here each Gaussian is gathered for at one point, the one where a training camera sees it best; the light of a
//! pixel is the blend of its Gaussians' light, and the picture is linear in the albedo. What a diffuse Gaussian sends
//! out over what arrives is its albedo in closed form, `ρ = π r / E`: where the image loss starts from.

use crate::surfaces::BestSeen;
use eagpt_scene::rng::{Purpose, RandomKey};
use eagpt_scene::{Camera, Gaussians};
use eagpt_trace::cpu::CpuScene;
use eagpt_trace::cpu::camera::{self, HitSearch, Keep};
use eagpt_trace::sums::lane;
use eagpt_trace::surfel::SurfelSet;
use eagpt_trace::transport::lights::BounceSampler;
use eagpt_trace::transport::points::Points;
use eagpt_trace::transport::start::Surface;
use eagpt_trace::transport::{LIGHT_SHARE, RayTracer, irradiance_over_pi};
use glam::Vec3;
use rayon::prelude::*;
use std::ops::Range;

/// Albedos of natural surfaces stay inside.
const RANGE: (f32, f32) = (0.02, 0.99);
/// Share of its own light that a Gaussian must receive for the quotient to mean something.
const MIN_ARRIVING: f32 = 1e-4;
/// Opacity that gathered Gaussians must have in a pixel to shade it.
const MIN_KNOWN: f32 = 1e-3;

/// The Gaussians that training cameras see, each with a point of the surface it is part of, and the light there.
pub(super) struct GaussianIrradiance {
    /// Indices and surfaces of the Gaussians seen.
    seen: Vec<(u32, Surface)>,
    /// Irradiance over π, of the first of `seen`.
    arriving: Vec<Vec3>,
}

impl GaussianIrradiance {
    /// Looks for each Gaussian's best pixel in all `cameras`.
    pub(super) fn new(set: &SurfelSet, cameras: &[Camera]) -> Self {
        let mut best = BestSeen::new(set.len());
        for camera in cameras {
            best.look(set, camera);
        }
        let seen = (0..)
            .zip(best.finish())
            .filter_map(|(i, found)| Some((i, found?)))
            .collect();
        Self {
            seen,
            arriving: Vec::new(),
        }
    }

    /// Number of Gaussians to gather for.
    pub(super) fn len(&self) -> usize {
        self.seen.len()
    }

    /// Gathers for the next of them, `range`, with `num_samples` directions each.
    pub(super) fn gather(
        &mut self,
        scene: &CpuScene,
        range: Range<usize>,
        num_samples: u32,
        seed: u64,
    ) {
        let sampler = BounceSampler::new(scene.lights(), LIGHT_SHARE);
        let key = RandomKey::new(seed, Purpose::Albedo, 0);
        let light = |(gaussian, surface): &(u32, Surface)| {
            let points = Points::new(key, *gaussian);
            irradiance_over_pi(scene, &sampler, surface, num_samples, &points)
        };
        debug_assert_eq!(range.start, self.arriving.len());
        self.arriving
            .par_extend(self.seen[range].par_iter().map(light));
    }

    /// The closed form for every Gaussian that light reaches; others keep their albedo. `[n]`
    pub(super) fn albedos(&self, gaussians: &Gaussians) -> Vec<Vec3> {
        let mut albedos = gaussians.albedos.clone();
        for ((i, _), arriving) in self.seen.iter().zip(&self.arriving) {
            let radiance = gaussians.radiances[*i as usize];
            if arriving.min_element() > MIN_ARRIVING * radiance.max_element() {
                albedos[*i as usize] =
                    (radiance / arriving).clamp(Vec3::splat(RANGE.0), Vec3::splat(RANGE.1));
            }
        }
        albedos
    }

    /// `set` with light that arrives in place of light that is sent out, and 1 as emission where that is known.
    pub(super) fn carried_by(&self, set: &SurfelSet) -> SurfelSet {
        let mut lit = set.clone();
        for payload in &mut lit.payloads {
            payload.0[lane::RADIANCE..=lane::EMISSION].fill(0.0);
        }
        for ((i, _), arriving) in self.seen.iter().zip(&self.arriving) {
            let lanes = &mut lit.payloads[*i as usize].0;
            lanes[lane::RADIANCE..lane::EMISSION].copy_from_slice(&arriving.to_array());
            lanes[lane::EMISSION] = 1.0;
        }
        lit
    }
}

/// The light at every pixel of `camera`, of a set made by [`GaussianIrradiance::carried_by`].
pub(super) fn of_camera(lit: &SurfelSet, camera: &Camera) -> Vec<Vec3> {
    let (sums, _) = camera::trace(lit, camera, HitSearch::Tiles, Keep::Nothing);
    let light = |known: f32, radiance: Vec3| {
        if known > MIN_KNOWN {
            radiance / known
        } else {
            Vec3::ZERO
        }
    };
    sums.pixels
        .iter()
        .map(|s| light(s.emission(), s.radiance()))
        .collect()
}
