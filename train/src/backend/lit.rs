//! Views as stage 1 sees them. Geometry and light stay as they are there: what albedos are
//! multiplied with is found out once.

use super::TrainingView;
use super::engine::Engine;
use super::irradiance;
use crate::error::Result;
use crate::loss::PixelLight;
use crate::options::AlbedoOptions;
use eagpt_scene::machine::available_memory;
use eagpt_scene::rng::RandomKey;
use eagpt_scene::{Camera, Gaussians};
use eagpt_trace::Tracer;
use eagpt_trace::cpu::CpuScene;
use eagpt_trace::cpu::weights::BlendWeights;
use eagpt_trace::features::{Features, GBuffer};
use eagpt_trace::surfel::SurfelSet;
use eagpt_trace::transport::lights::BounceSampler;
use eagpt_trace::transport::points::Points;
use eagpt_trace::transport::start::Surface;
use eagpt_trace::transport::{LIGHT_SHARE, RayTracer, irradiance_over_pi};
use glam::{Vec3, Vec4};
use rayon::prelude::*;
use std::collections::HashMap;
use std::sync::Arc;

/// What part of the free memory, 1/n, views with their light may take; those that do not fit are
/// traced again.
const LIT_SHARE: u64 = 4;

/// Weights that stage 1 keeps are at least this: what is lighter is a third of the hits of a
/// trained room, and less than a fiftieth of a pixel.
const LEAST_WEIGHT: f32 = 1e-3;

/// A view as stage 1 sees it.
pub(super) struct LitView {
    /// Of the blend, where the engine keeps them.
    pub(super) weights: Option<BlendWeights>,
    /// Light that arrives or is emitted.
    pub(super) light: PixelLight,
}

impl LitView {
    fn num_bytes(&self) -> u64 {
        let weights = self.weights.as_ref().map_or(0, BlendWeights::num_bytes);
        (weights + self.light.num_bytes()) as u64
    }
}

/// Views with the light that was gathered for Gaussians, as far as they fit into memory.
pub(super) struct LitViews {
    /// Light of each Gaussian; see [`irradiance::GaussianIrradiance::by_gaussian`].
    lights: Vec<Vec4>,
    /// Gaussians that show their light in place of their radiance, for an engine that does not keep
    /// weights; made when first needed.
    shining: Option<Box<dyn Tracer>>,
    views: HashMap<usize, Arc<LitView>>,
    /// Bytes that they may still take.
    budget: u64,
}

impl LitViews {
    /// No view yet; `lights` are those of all Gaussians.
    pub(super) fn new(lights: Vec<Vec4>) -> Self {
        Self {
            lights,
            shining: None,
            views: HashMap::new(),
            budget: available_memory().unwrap_or(0) / LIT_SHARE,
        }
    }

    /// `view`, in which emission beyond `threshold` is an emitter's. The `engine` has the
    /// Gaussians.
    ///
    /// # Errors
    /// If the device gives up.
    pub(super) fn view(
        &mut self,
        view: &TrainingView,
        engine: &mut impl Engine,
        (gaussians, set): (&Gaussians, &SurfelSet),
        threshold: f32,
    ) -> Result<Arc<LitView>> {
        if let Some(known) = self.views.get(&view.index) {
            return Ok(Arc::clone(known));
        }
        let camera = &view.view.camera;
        let features = engine.trace(set, camera)?;
        let weights = engine.weights(LEAST_WEIGHT);
        let blended = match &weights {
            Some(weights) => weights.blend(|i| self.lights[i as usize]),
            None => {
                let shining = match &self.shining {
                    Some(shining) => shining,
                    None => {
                        let made = engine.tracer(&shining(gaussians, &self.lights))?;
                        self.shining.insert(made)
                    }
                };
                let seen = shining.gbuffer(camera)?;
                let light = |features: &Features| features.radiance().extend(features.emission());
                seen.pixels.iter().map(light).collect()
            }
        };
        let arriving = irradiance::of_pixels(&blended);
        let light = PixelLight::new(&features, arriving, threshold);
        let lit = Arc::new(LitView { weights, light });
        if let Some(left) = self.budget.checked_sub(lit.num_bytes()) {
            self.budget = left;
            self.views.insert(view.index, Arc::clone(&lit));
        }
        Ok(lit)
    }
}

/// Gaussians with `lights` as their radiance, in all directions, and whether they are known as
/// their emission.
fn shining(gaussians: &Gaussians, lights: &[Vec4]) -> Gaussians {
    let mut shining = gaussians.clone();
    shining.harmonics.clear();
    shining.radiances = lights.iter().map(|light| light.truncate()).collect();
    shining.emissions = lights.iter().map(|light| light.w).collect();
    shining
}

/// Irradiance over π of every pixel of `camera`, whose `features` are given, gathered anew as in
/// the paper; nothing arrives where emitters are seen.
pub(super) fn gather_pixels(
    scene: &CpuScene,
    camera: &Camera,
    features: &GBuffer,
    options: &AlbedoOptions,
    key: RandomKey,
) -> Vec<Vec3> {
    let frame = camera.ray_frame();
    let sampler = BounceSampler::new(scene.lights(), LIGHT_SHARE);
    (0..camera.num_pixels())
        .into_par_iter()
        .map(|pixel| {
            let seen = &features.pixels[pixel];
            if seen.emission() > options.emission_threshold {
                return Vec3::ZERO;
            }
            let (x, y) = (pixel as u32 % camera.width, pixel as u32 / camera.width);
            let direction = frame.direction(x as f32 + 0.5, y as f32 + 0.5);
            Surface::at(frame.origin, direction, seen).map_or(Vec3::ZERO, |surface| {
                let points = Points::new(key, pixel as u32);
                irradiance_over_pi(scene, &sampler, &surface, options.num_samples, &points)
            })
        })
        .collect()
}
