//! Steps of training on the host, for a scene on any device: targets, losses and the parameters are
//! on the host; rays and their adjoint are the scene's.

use super::irradiance::{self, GaussianIrradiance, LitGaussians};
use super::irradiance_cache::{CachedView, IrradianceCache};
use super::{AlbedoStep, RadianceStep, StepOutcome, Taken, TrainingView};
use crate::densify::{self, Attribution, Densified};
use crate::error::Result;
use crate::loss::target::Target;
use crate::loss::{LossTerms, PixelLight, albedo_loss, radiance_loss};
use crate::options::Gather;
use crate::params::ParameterState;
use eagpt_eval::KnownPixels;
use eagpt_scene::color::pq_from_linear;
use eagpt_scene::rng::{Purpose, RandomKey};
use eagpt_scene::{Camera, Gaussians, SceneEdit};
use eagpt_trace::Tracer;
use eagpt_trace::blend::{GradientMask, LocalGradient, grad_lane};
use eagpt_trace::cpu::CpuScene;
use eagpt_trace::features::{Features, lane};
use glam::{Vec3, Vec4};
use rayon::prelude::*;
use std::collections::{BTreeMap, HashMap};
use std::ops::Range;
use std::sync::Arc;

/// The parameters while they are on the host.
pub(super) struct HostParameters {
    pub(super) state: ParameterState,
    /// The Gaussians that follow from `state`.
    pub(super) gaussians: Gaussians,
}

impl HostParameters {
    pub(super) fn new(state: ParameterState) -> Self {
        let gaussians = state.gaussians();
        Self { state, gaussians }
    }

    /// Makes the Gaussians follow changed parameters.
    fn refresh(&mut self) {
        if self.gaussians.len() == self.state.len() {
            self.state.write_gaussians(&mut self.gaussians);
        } else {
            self.gaussians = self.state.gaussians();
        }
    }
}

/// Everything of a run but the parameters: the scene with their Gaussians, and data that is
/// prepared once. Host code runs on all threads of the current rayon pool.
pub(super) struct Trainer<S> {
    pub(super) scene: S,
    /// Errors of views since Gaussians were last split.
    attribution: Option<Attribution>,
    /// For stage 1 with [`Gather::Pixels`], whose single rays are the CPU's; geometry and light do
    /// not change from its first step on.
    pixel_gathering: Option<CpuScene>,
    /// For gathering the irradiance of Gaussians, until stage 1 takes its first step.
    gathering: Option<Box<dyn Tracer>>,
    /// By light.
    irradiance: BTreeMap<usize, GaussianIrradiance>,
    pub(super) cache: Option<IrradianceCache>,
    targets: HashMap<usize, Arc<Target>>,
    /// Bytes that further prepared targets may take.
    target_budget: usize,
}

impl<S: Tracer> Trainer<S> {
    /// Training of the Gaussians of `scene`; prepared images may take `target_budget` bytes.
    pub(super) fn new(scene: S, target_budget: usize) -> Self {
        Self {
            scene,
            attribution: None,
            pixel_gathering: None,
            gathering: None,
            irradiance: BTreeMap::new(),
            cache: None,
            targets: HashMap::new(),
            target_budget,
        }
    }

    pub(super) fn target(&mut self, view: &TrainingView) -> Arc<Target> {
        if let Some(target) = self.targets.get(&view.index) {
            return Arc::clone(target);
        }
        let target = Arc::new(Target::new(&view.view.radiance));
        if let Some(left) = self.target_budget.checked_sub(target.num_bytes()) {
            self.target_budget = left;
            self.targets.insert(view.index, Arc::clone(&target));
        }
        target
    }

    /// Brings changed parameters to the scene.
    fn refresh(&mut self, parameters: &mut HostParameters) -> Result<()> {
        parameters.refresh();
        Ok(self.scene.update(&parameters.gaussians)?)
    }

    /// The cache of stage 1, empty, with the irradiance gathered for `gaussians`. Made by the first
    /// step, not when the stage begins: a resumed run gathers as well, and continues in the middle.
    pub(super) fn new_cache(&mut self, gaussians: &Gaussians) -> Result<IrradianceCache> {
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

    /// A step of stage 0.
    pub(super) fn radiance_step(
        &mut self,
        parameters: &mut HostParameters,
        view: &TrainingView,
        step: &RadianceStep<'_>,
    ) -> Result<Taken> {
        let target = self.target(view).pq();
        let factor = step.rays_per_axis;
        let camera = view.view.camera.magnified(factor);
        let mut features = self.scene.record(&camera)?;
        if factor > 1 {
            features = features.averaged(factor);
        }
        let (terms, d_features) =
            radiance_loss(&features, &view.view, &target, step.weights, step.normals);
        let d_rays = adjoint_of_mean(d_features, features.width, factor);
        let mask = if step.sizes.move_geometry() {
            GradientMask::Everything
        } else {
            GradientMask::LightAndMaterial
        };
        let gradients = self.scene.adjoint(&camera, &d_rays, mask)?;
        let HostParameters { state, gaussians } = parameters;
        let moved = state.step(gaussians, camera.origin(), &gradients, &step.sizes);
        if moved.is_ok() {
            self.refresh(parameters)?;
        }
        Ok(taken(step.iteration, view, moved.map(|()| terms)))
    }

    /// A step of stage 1.
    pub(super) fn albedo_step(
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
                (self.scene.record(camera)?, cached)
            }
            Gather::Pixels => {
                let features = self.scene.record(camera)?;
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
        Ok((terms, self.scene.adjoint(camera, &d_features, mask)?))
    }

    /// See [`super::Backend::show_light`].
    pub(super) fn show_light(
        &mut self,
        parameters: &mut HostParameters,
        light: usize,
    ) -> Result<()> {
        if light == parameters.state.lights.current {
            return Ok(());
        }
        parameters.state.show_light(light);
        self.forget_light();
        self.refresh(parameters)
    }

    /// Forgets scenes of the light that was shown.
    pub(super) fn forget_light(&mut self) {
        self.gathering = None;
        self.pixel_gathering = None;
    }

    /// See [`super::Backend::begin_harmonics`].
    pub(super) fn begin_harmonics(&mut self, parameters: &mut HostParameters) -> Result<()> {
        parameters.state.begin_harmonics();
        self.refresh(parameters)
    }

    /// See [`super::Backend::attribute`].
    pub(super) fn attribute(
        &mut self,
        parameters: &HostParameters,
        view: &TrainingView,
    ) -> Result<()> {
        let target = self.target(view).pq();
        let camera = &view.view.camera;
        let known = view.view.valid.as_ref().map(KnownPixels::new);
        let mask = view.view.emission.as_ref();
        let clipped = view.view.clipped.as_ref();
        let error = |pixel: usize, features: &Features| {
            if known.as_ref().is_some_and(|known| !known.has(pixel)) {
                return 0.0;
            }
            let shown = features.radiance().to_array().map(pq_from_linear);
            let wanted = target.pixels()[pixel];
            let color: f32 = (0..3)
                .map(|c| match clipped {
                    Some(mask) if mask.pixels()[pixel][c] > 0.0 => (wanted[c] - shown[c]).max(0.0),
                    _ => (shown[c] - wanted[c]).abs(),
                })
                .sum();
            let emission = mask.map_or(0.0, |mask| {
                (features.emission() - mask.pixels()[pixel][0]).abs()
            });
            color + emission
        };
        let (_, contributions) = self.scene.contributions(camera, &error)?;
        self.attribution
            .get_or_insert_with(|| Attribution::new(parameters.state.len()))
            .add(&contributions);
        Ok(())
    }

    /// See [`super::Backend::densify`].
    pub(super) fn densify(
        &mut self,
        parameters: &mut HostParameters,
        target: usize,
    ) -> Result<Densified> {
        let HostParameters { state, gaussians } = parameters;
        let seen = self.attribution.take();
        let seen = seen.unwrap_or_else(|| Attribution::new(state.len()));
        let densified = densify::densify(state, gaussians, &seen, target);
        state.sort_in_space();
        self.refresh(parameters)?;
        Ok(densified)
    }

    /// See [`super::Backend::edit`].
    pub(super) fn edit(
        &mut self,
        parameters: &mut HostParameters,
        edit: &SceneEdit,
        radiances: &[Vec<Option<Vec3>>],
    ) -> Result<()> {
        self.attribution = None;
        let state = &mut parameters.state;
        if state.lights.num() > 1 {
            let before = state.in_lights();
            state.edit(edit);
            state.light_last(radiances, &before);
        } else {
            state.edit(edit);
        }
        self.refresh(parameters)
    }

    /// See [`super::Backend::mark_emitting`].
    pub(super) fn mark_emitting(
        &mut self,
        parameters: &mut HostParameters,
        emitting: &[Vec<(usize, bool)>],
    ) -> Result<()> {
        parameters.state.mark_emitting(emitting);
        self.refresh(parameters)
    }

    /// See [`super::Backend::begin_gathering`].
    pub(super) fn begin_gathering(
        &mut self,
        parameters: &HostParameters,
        cameras: &[Camera],
    ) -> Result<usize> {
        let gaussians = &parameters.gaussians;
        let scene = (self.gathering).insert(self.scene.device().scene(gaussians)?);
        let irradiance = GaussianIrradiance::new(&**scene, gaussians.len(), cameras)?;
        let num = irradiance.len();
        self.cache = None;
        let light = parameters.state.lights.current;
        self.irradiance.insert(light, irradiance);
        Ok(num)
    }

    /// See [`super::Backend::gather`].
    pub(super) fn gather(
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
        let radiances = &parameters.gaussians.radiances;
        let key = RandomKey::new(seed, Purpose::Albedo, 0);
        irradiance.gather(&**scene, radiances, range, num_samples, key)
    }

    /// See [`super::Backend::begin_albedo`].
    pub(super) fn begin_albedo(
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
}

fn taken(iteration: u32, view: &TrainingView, outcome: StepOutcome) -> Taken {
    Taken {
        iteration,
        view: view.clone(),
        outcome,
    }
}

/// Gradient of every ray's features, given those of the means over `factor` × `factor` rays;
/// `width` is that of the means.
fn adjoint_of_mean(d_means: Vec<Features>, width: u32, factor: u32) -> Vec<Features> {
    if factor == 1 {
        return d_means;
    }
    let share = 1.0 / (factor * factor) as f32;
    let (factor, width) = (factor as usize, width as usize);
    let fine_width = width * factor;
    (0..d_means.len() * factor * factor)
        .into_par_iter()
        .with_min_len(1024)
        .map(|i| {
            let (x, y) = (i % fine_width / factor, i / fine_width / factor);
            Features(d_means[y * width + x].0.map(|d| d * share))
        })
        .collect()
}

/// The albedo that the released code of EAG-PT starts from.
fn reference_albedo(radiance: Vec3) -> Vec3 {
    radiance
        .clamp(Vec3::splat(0.01), Vec3::splat(0.99))
        .normalize()
}

#[cfg(test)]
mod tests {
    use super::*;
    use eagpt_trace::features::GBuffer;

    /// ⟨d, mean(x)⟩ = ⟨adjoint(d), x⟩, which defines the adjoint of a linear map.
    #[test]
    fn adjoint_of_the_mean_is_its_transpose() {
        let value = |i: usize| Features([((i * 37 + 11) % 101) as f32 / 101.0; 16]);
        let (width, height, factor) = (3, 2, 2);
        let rays = GBuffer {
            width: width * factor,
            height: height * factor,
            pixels: (0..24).map(value).collect(),
        };
        let d_means: Vec<Features> = (0..6).map(|i| value(i + 50)).collect();
        // The lanes of first hit and spread are not means, and have no gradient.
        let dot = |a: &[Features], b: &[Features]| -> f32 {
            a.iter().zip(b).map(|(a, b)| a.0[3] * b.0[3]).sum()
        };
        let forward = dot(&d_means, &rays.averaged(factor).pixels);
        let backward = dot(&adjoint_of_mean(d_means, width, factor), &rays.pixels);
        assert!((forward - backward).abs() < 1e-5, "{forward} {backward}");
    }
}
