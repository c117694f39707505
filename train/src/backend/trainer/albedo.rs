//! Stage 1 on the host: the irradiance of Gaussians gathered, albedos to start from, and steps.

use super::{HostParameters, Trainer, taken};
use crate::backend::irradiance::{self, GaussianIrradiance, LitGaussians};
use crate::backend::irradiance_cache::{CachedView, IrradianceCache};
use crate::backend::step::{AlbedoStep, Taken, TrainingView};
use crate::error::Result;
use crate::loss::{LossTerms, PixelLight, albedo_loss};
use crate::options::Gather;
use eagpt_eval::KnownPixels;
use eagpt_scene::rng::{Purpose, RandomKey};
use eagpt_scene::{Camera, Gaussians};
use eagpt_trace::blend::{GradientMask, LocalGradient, grad_lane};
use eagpt_trace::cpu::CpuScene;
use eagpt_trace::features::{Features, lane};
use eagpt_trace::transport::matrix::Receiver;
use eagpt_trace::{CameraRays, Tracer};
use glam::{Vec3, Vec4};
use std::ops::Range;
use std::sync::Arc;

impl<S: Tracer> Trainer<S> {
    /// See [`crate::backend::Backend::begin_gathering`].
    pub(in crate::backend) fn begin_gathering(
        &mut self,
        parameters: &HostParameters,
        cameras: &[Camera],
    ) -> Result<usize> {
        let gaussians = &parameters.gaussians;
        let lit = irradiance::with_bright_as_emitters(gaussians);
        let scene = (self.gathering).insert(self.scene.device().scene(&lit)?);
        let irradiance = GaussianIrradiance::new(&**scene, gaussians, cameras)?;
        let num = irradiance.len();
        self.cache = None;
        let light = parameters.state.lights.current;
        self.irradiance.insert(light, irradiance);
        Ok(num)
    }

    /// See [`crate::backend::Backend::gather`].
    pub(in crate::backend) fn gather(
        &mut self,
        parameters: &HostParameters,
        range: Range<usize>,
        num_samples: u32,
        seed: u64,
    ) -> Result<()> {
        let irradiance = self.irradiance.get_mut(&parameters.state.lights.current);
        let (Some(irradiance), Some(scene)) = (irradiance, &self.gathering) else {
            return Ok(());
        };
        let key = RandomKey::new(seed, Purpose::Albedo, 0);
        irradiance.gather((&**scene, &parameters.gaussians), range, num_samples, key)
    }

    /// See [`crate::backend::Backend::gathered`].
    pub(in crate::backend) fn gathered(&self, light: usize) -> Vec<(Receiver, Vec3)> {
        let irradiance = self.irradiance.get(&light);
        irradiance.map_or(Vec::new(), GaussianIrradiance::received)
    }

    /// See [`crate::backend::Backend::begin_albedo`].
    pub(in crate::backend) fn begin_albedo(
        &mut self,
        parameters: &mut HostParameters,
        shares: &[Vec<f32>],
    ) -> Result<()> {
        let HostParameters { state, gaussians } = parameters;
        state.reset_moments();
        let albedos = match self.irradiance.is_empty() {
            false => {
                let lights = state.in_lights();
                let gathered = self
                    .irradiance
                    .iter()
                    .map(|(&light, irradiance)| LitGaussians {
                        gaussians: &lights[light],
                        irradiance,
                        shares: shares.get(light).map_or(&[], Vec::as_slice),
                    });
                irradiance::albedos(&gathered.collect::<Vec<_>>())
            }
            true => gaussians
                .radiances
                .iter()
                .map(|r| reference_albedo(*r))
                .collect(),
        };
        state.set_albedos(&albedos);
        self.refresh(parameters)
    }

    /// The cache of stage 1, empty, with the irradiance gathered for `gaussians`. Made by the first
    /// step, not when the stage begins: a resumed run gathers as well, and continues in the middle.
    pub(in crate::backend) fn new_cache(
        &mut self,
        gaussians: &Gaussians,
    ) -> Result<IrradianceCache> {
        self.gathering = None;
        let num = gaussians.len();
        let by_light = match self.irradiance.is_empty() {
            false => (self.irradiance.values())
                .map(|gathered| gathered.by_gaussian(num))
                .collect(),
            true => vec![vec![Vec4::ZERO; num]],
        };
        IrradianceCache::new(&self.scene.device(), gaussians, by_light)
    }

    /// A step of stage 1.
    pub(in crate::backend) fn albedo_step(
        &mut self,
        parameters: &mut HostParameters,
        view: &TrainingView,
        step: &AlbedoStep<'_>,
    ) -> Result<Taken> {
        let (terms, gradients) = self.albedo_gradient(parameters, view, step)?;
        let HostParameters { state, gaussians } = parameters;
        let eye = view.view.camera.origin();
        let moved = state.step(gaussians, eye, &gradients, &step.sizes);
        if moved.is_ok() {
            state.write_albedos(&mut gaussians.albedos);
            self.scene.set_albedos(&gaussians.albedos)?;
        }
        Ok(taken(step.iteration, view, moved.map(|()| terms)))
    }

    /// Loss of stage 1, and its gradient with respect to the albedo of each Gaussian, `[n]`, in a
    /// gradient of everything.
    fn albedo_gradient(
        &mut self,
        parameters: &HostParameters,
        view: &TrainingView,
        step: &AlbedoStep<'_>,
    ) -> Result<(LossTerms, Vec<LocalGradient>)> {
        let target = self.target(view).pq();
        let known = view.view.valid.as_ref().map(KnownPixels::new);
        let clipped = view.view.clipped.as_ref();
        let share = step.ssim_share;
        let loss = |albedos: &[Vec3], light: &PixelLight| {
            albedo_loss(albedos, light, &target, share, known.as_ref(), clipped)
        };
        let threshold = step.options.emission_threshold;
        let camera = &view.view.camera;
        let rays = CameraRays::from(*camera);
        let gaussians = &parameters.gaussians;
        let (features, cached) = match step.options.gather {
            Gather::Gaussians => {
                let mut cache = match self.cache.take() {
                    Some(cache) => cache,
                    None => self.new_cache(gaussians)?,
                };
                let cached = cache.view(view, &mut self.scene, threshold)?;
                self.cache = Some(cache);
                if let Some(weights) = &cached.weights {
                    let own = &gaussians.albedos;
                    let (terms, d_pixels) =
                        loss(&weights.blend(|i| own[i as usize]), &cached.light);
                    let d_albedos = weights.adjoint(&d_pixels, own.len());
                    let gradient = |d: Vec3| {
                        let mut lanes = LocalGradient::default();
                        lanes.0[grad_lane::ALBEDO..].copy_from_slice(&d.to_array());
                        lanes
                    };
                    return Ok((terms, d_albedos.into_iter().map(gradient).collect()));
                }
                (self.scene.record(&rays)?, cached)
            }
            Gather::Pixels => {
                let features = self.scene.record(&rays)?;
                let key = RandomKey::new(step.seed, Purpose::Albedo, step.iteration);
                let scene = (self.pixel_gathering).get_or_insert_with(|| CpuScene::new(gaussians));
                let num_samples = step.options.num_samples;
                let irradiance = scene.irradiance(camera, &features, threshold, num_samples, key);
                let light = PixelLight::new(&features, irradiance, threshold);
                let weights = None;
                (features, Arc::new(CachedView { weights, light }))
            }
        };
        let albedos: Vec<Vec3> = features.pixels.iter().map(Features::albedo).collect();
        let (terms, d_pixels) = loss(&albedos, &cached.light);
        let of_albedo = |d: &Vec3| {
            let mut lanes = Features::default();
            lanes.0[lane::ALBEDO..][..3].copy_from_slice(&d.to_array());
            lanes
        };
        let d_features: Vec<Features> = d_pixels.iter().map(of_albedo).collect();
        let mask = GradientMask::LightAndMaterial;
        Ok((terms, self.scene.adjoint(&rays, &d_features, mask)?))
    }
}

/// The albedo that the released code of EAG-PT starts from.
fn reference_albedo(radiance: Vec3) -> Vec3 {
    radiance
        .clamp(Vec3::splat(0.01), Vec3::splat(0.99))
        .normalize()
}
