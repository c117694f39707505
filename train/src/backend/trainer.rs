//! Training, whatever blends the rays: parameters, targets, losses and what the stages remember are
//! on the host.

use super::engine::Engine;
use super::irradiance::GaussianIrradiance;
use super::lit::{self, LitView, LitViews};
use super::{AlbedoStep, Backend, RadianceStep, StepOutcome, Taken, TrainingView};
use crate::densify::{self, Attribution, Densified};
use crate::error::Result;
use crate::loss::target::Target;
use crate::loss::{LossTerms, PixelLight, albedo_loss, radiance_loss};
use crate::options::Gather;
use crate::params::ParameterState;
use eagpt_eval::KnownPixels;
use eagpt_scene::color::pq_from_linear;
use eagpt_scene::rng::{Purpose, RandomKey};
use eagpt_scene::{Camera, Gaussians};
use eagpt_trace::Tracer;
use eagpt_trace::blend::{LocalGradient, grad_lane};
use eagpt_trace::cpu::{CpuScene, GradientMask};
use eagpt_trace::features::{Features, GBuffer, lane};
use eagpt_trace::surfel::SurfelSet;
use eagpt_trace::transport::matrix::Directions;
use glam::{Vec3, Vec4};
use rayon::prelude::*;
use std::collections::HashMap;
use std::ops::Range;
use std::sync::Arc;

/// Training with the rays of an [`Engine`]; all else by all threads of the current rayon pool.
pub struct Trainer<E> {
    pub(super) engine: E,
    pub(super) state: ParameterState,
    gaussians: Gaussians,
    set: SurfelSet,
    /// What views said since Gaussians were last split.
    attribution: Option<Attribution>,
    /// Built when stage 1 first gathers for pixels; geometry does not move from then on.
    scene: Option<CpuScene>,
    /// What light is gathered with for Gaussians, until stage 1 takes its first step.
    tracer: Option<Box<dyn Tracer>>,
    gathered: Option<GaussianIrradiance>,
    /// Views with that light, made when one is first needed.
    lit: Option<LitViews>,
    targets: HashMap<usize, Arc<Target>>,
    /// Bytes that prepared targets may still take.
    target_budget: usize,
}

impl<E: Engine> Trainer<E> {
    /// A backend that starts from `state`, whose Gaussians `engine` has; prepared images may take
    /// `target_budget` bytes.
    pub(super) fn with_engine(state: ParameterState, target_budget: usize, engine: E) -> Self {
        let gaussians = state.gaussians();
        let set = SurfelSet::new(&gaussians);
        Self {
            engine,
            state,
            gaussians,
            set,
            attribution: None,
            scene: None,
            tracer: None,
            gathered: None,
            lit: None,
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

    /// Goes on from other parameters, those of the Gaussians that the engine has.
    #[cfg(feature = "gpu")]
    pub(super) fn take_back(&mut self, state: ParameterState) {
        self.state = state;
        self.prepare();
    }

    /// Prepares the Gaussians of the parameters.
    fn prepare(&mut self) {
        if self.gaussians.len() == self.state.len() {
            self.state.write_gaussians(&mut self.gaussians);
        } else {
            self.gaussians = self.state.gaussians();
        }
        self.set.update(&self.gaussians);
    }

    fn scene(&mut self) -> &CpuScene {
        self.scene
            .get_or_insert_with(|| CpuScene::new(&self.gaussians))
    }

    /// `view` with the light that was gathered; emission beyond `threshold` is an emitter's.
    pub(super) fn lit_view(&mut self, view: &TrainingView, threshold: f32) -> Result<Arc<LitView>> {
        // Not when the stage begins: a resumed run gathers as well, and then goes on in the middle.
        let lit = match &mut self.lit {
            Some(lit) => lit,
            none => {
                self.tracer = None;
                let num = self.set.len();
                let gathered = self.gathered.as_ref();
                let lights = gathered.map(|gathered| gathered.by_gaussian(num));
                none.insert(LitViews::new(lights.unwrap_or(vec![Vec4::ZERO; num])))
            }
        };
        let scene = (&self.gaussians, &self.set);
        lit.view(view, &mut self.engine, scene, threshold)
    }

    /// A step of stage 0.
    fn fit_radiance(
        &mut self,
        view: &TrainingView,
        step: &RadianceStep<'_>,
    ) -> Result<StepOutcome> {
        let target = self.target(view).pq();
        let factor = step.rays_per_axis;
        let camera = view.view.camera.magnified(factor);
        let mut features = self.engine.trace(&self.set, &camera)?;
        if factor > 1 {
            features = features.averaged(factor);
        }
        let (terms, d_features) =
            radiance_loss(&features, &view.view, &target, step.weights, step.normals);
        let d_rays = adjoint_of_mean(d_features, features.width, factor);
        let wanted = if step.sizes.move_geometry() {
            GradientMask::Everything
        } else {
            GradientMask::LightAndMaterial
        };
        let gradients = self.engine.adjoint(&self.set, &camera, &d_rays, wanted)?;
        let eye = camera.origin();
        if let Err(bad) = self
            .state
            .step(&self.gaussians, eye, &gradients, &step.sizes)
        {
            return Ok(Err(bad));
        }
        self.prepare();
        self.engine.update(&self.set)?;
        Ok(Ok(terms))
    }

    /// A step of stage 1.
    fn fit_albedos(&mut self, view: &TrainingView, step: &AlbedoStep<'_>) -> Result<StepOutcome> {
        let (terms, gradients) = self.albedo_gradient(view, step)?;
        let eye = view.view.camera.origin();
        if let Err(bad) = self
            .state
            .step(&self.gaussians, eye, &gradients, &step.sizes)
        {
            return Ok(Err(bad));
        }
        self.state.write_albedos(&mut self.gaussians.albedos);
        self.set.set_albedos(&self.gaussians.albedos);
        self.engine.update(&self.set)?;
        Ok(Ok(terms))
    }

    /// Loss of stage 1, and its gradient with respect to the albedo of each Gaussian, `[n]`, in a
    /// gradient of everything.
    fn albedo_gradient(
        &mut self,
        view: &TrainingView,
        step: &AlbedoStep<'_>,
    ) -> Result<(LossTerms, Vec<LocalGradient>)> {
        let target = self.target(view).pq();
        let known = view.view.valid.as_ref().map(KnownPixels::new);
        let loss = |albedos: &[Vec3], light: &PixelLight| {
            albedo_loss(albedos, light, &target, step.ssim_share, known.as_ref())
        };
        let threshold = step.options.emission_threshold;
        let camera = &view.view.camera;
        let (features, lit) = match step.options.gather {
            Gather::Gaussians => {
                let lit = self.lit_view(view, threshold)?;
                if let Some(weights) = &lit.weights {
                    let own = &self.gaussians.albedos;
                    let (terms, d_pixels) = loss(&weights.blend(|i| own[i as usize]), &lit.light);
                    let d_albedos = weights.adjoint(&d_pixels, own.len());
                    let gradient = |d: Vec3| {
                        let mut lanes = LocalGradient::default();
                        lanes.0[grad_lane::ALBEDO..].copy_from_slice(&d.to_array());
                        lanes
                    };
                    return Ok((terms, d_albedos.into_iter().map(gradient).collect()));
                }
                (self.engine.trace(&self.set, camera)?, lit)
            }
            Gather::Pixels => {
                let features = self.engine.trace(&self.set, camera)?;
                let key = RandomKey::new(step.seed, Purpose::Albedo, step.iteration);
                let arriving =
                    lit::gather_pixels(self.scene(), camera, &features, step.options, key);
                let light = PixelLight::new(&features, arriving, threshold);
                let weights = None;
                (features, Arc::new(LitView { weights, light }))
            }
        };
        let albedos: Vec<Vec3> = features.pixels.iter().map(Features::albedo).collect();
        let (terms, d_pixels) = loss(&albedos, &lit.light);
        let of_albedo = |d: &Vec3| {
            let mut lanes = Features::default();
            lanes.0[lane::ALBEDO..][..3].copy_from_slice(&d.to_array());
            lanes
        };
        let d_features: Vec<Features> = d_pixels.iter().map(of_albedo).collect();
        let wanted = GradientMask::LightAndMaterial;
        let gradients = (self.engine).adjoint(&self.set, camera, &d_features, wanted)?;
        Ok((terms, gradients))
    }
}

/// One in so many directions looks for emitters. Measured on a room lit through a window: with half
/// of the directions the light that arrives is noisier by an eighth, for most of it comes from
/// walls.
const LIGHTS_EVERY: u32 = 4;

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

impl<E: Engine> Backend for Trainer<E> {
    fn device(&self) -> String {
        self.engine.device()
    }

    fn begin_harmonics(&mut self) -> Result<()> {
        self.state.begin_harmonics();
        self.prepare();
        self.engine.update(&self.set)
    }

    fn radiance_step(
        &mut self,
        view: &TrainingView,
        step: &RadianceStep<'_>,
    ) -> Result<Vec<Taken>> {
        let outcome = self.fit_radiance(view, step)?;
        Ok(vec![Taken {
            iteration: step.iteration,
            view: view.clone(),
            outcome,
        }])
    }

    fn albedo_step(&mut self, view: &TrainingView, step: &AlbedoStep<'_>) -> Result<Vec<Taken>> {
        let outcome = self.fit_albedos(view, step)?;
        Ok(vec![Taken {
            iteration: step.iteration,
            view: view.clone(),
            outcome,
        }])
    }

    fn finish(&mut self) -> Result<Vec<Taken>> {
        Ok(Vec::new())
    }

    fn attribute(&mut self, view: &TrainingView) -> Result<()> {
        let target = self.target(view).pq();
        let camera = &view.view.camera;
        let known = view.view.valid.as_ref().map(KnownPixels::new);
        let mask = view.view.emission.as_ref();
        let error = |pixel: usize, features: &Features| {
            if known.as_ref().is_some_and(|known| !known.has(pixel)) {
                return 0.0;
            }
            let shown = features.radiance().to_array().map(pq_from_linear);
            let wanted = target.pixels()[pixel];
            let color: f32 = (0..3).map(|c| (shown[c] - wanted[c]).abs()).sum();
            let emission = mask.map_or(0.0, |mask| {
                (features.emission() - mask.pixels()[pixel][0]).abs()
            });
            color + emission
        };
        let contributions = self.engine.contributions(&self.set, camera, &error)?;
        self.attribution
            .get_or_insert_with(|| Attribution::new(self.state.len()))
            .add(&contributions);
        Ok(())
    }

    fn densify(&mut self, target: usize) -> Result<Densified> {
        let seen = self
            .attribution
            .take()
            .unwrap_or_else(|| Attribution::new(self.state.len()));
        let outcome = densify::densify(&mut self.state, &self.gaussians, &seen, target);
        self.state.sort_in_space();
        self.prepare();
        self.engine.update(&self.set)?;
        Ok(outcome)
    }

    fn begin_gathering(&mut self, cameras: &[Camera]) -> Result<usize> {
        let tracer = self.tracer.insert(self.engine.tracer(&self.gaussians)?);
        let gathered = GaussianIrradiance::new(&**tracer, self.gaussians.len(), cameras)?;
        let num = gathered.len();
        self.lit = None;
        self.gathered = Some(gathered);
        Ok(num)
    }

    fn gather(&mut self, range: Range<usize>, num_samples: u32, seed: u64) -> Result<()> {
        let (Some(gathered), Some(tracer)) = (&mut self.gathered, &self.tracer) else {
            return Ok(());
        };
        let radiances = &self.gaussians.radiances;
        let directions = Directions::divided(num_samples, LIGHTS_EVERY);
        let key = RandomKey::new(seed, Purpose::Albedo, 0);
        gathered.gather(&**tracer, radiances, range, directions, key)
    }

    fn begin_albedo(&mut self) -> Result<()> {
        self.state.reset_moments();
        let albedos = match &self.gathered {
            Some(gathered) => gathered.albedos(&self.gaussians),
            None => self
                .gaussians
                .radiances
                .iter()
                .map(|r| reference_albedo(*r))
                .collect(),
        };
        self.state.set_albedos(&albedos);
        self.prepare();
        self.engine.update(&self.set)?;
        Ok(())
    }

    fn gbuffer(&mut self, camera: &Camera) -> Result<GBuffer> {
        self.engine.gbuffer(&self.set, camera)
    }

    fn state(&mut self) -> Result<ParameterState> {
        Ok(self.state.clone())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
