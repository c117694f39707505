//! Training, whatever blends the rays: parameters, targets, losses and what the stages remember are on the host.

use super::irradiance::{self, GaussianIrradiance};
use super::{AlbedoStep, Backend, RadianceStep, StepOutcome, TrainingView};
use crate::densify::{self, Attribution, Densified};
use crate::error::Result;
use crate::loss::target::Target;
use crate::loss::{LossTerms, PixelLight, albedo_loss, color::pq_image, radiance_loss};
use crate::options::{AlbedoOptions, Gather};
use crate::params::ParameterState;
use eagpt_eval::KnownPixels;
use eagpt_scene::machine::available_memory;
use eagpt_scene::rng::{Purpose, RandomKey};
use eagpt_scene::{Camera, Gaussians};
use eagpt_trace::Tracer;
use eagpt_trace::blend::{LocalGradient, grad_lane};
use eagpt_trace::cpu::camera::{HitSearch, Keep};
use eagpt_trace::cpu::weights::BlendWeights;
use eagpt_trace::cpu::{CameraRecord, CpuScene, Wanted};
use eagpt_trace::sums::{SumImage, Sums, lane};
use eagpt_trace::surfel::SurfelSet;
use eagpt_trace::transport::lights::BounceSampler;
use eagpt_trace::transport::links::Directions;
use eagpt_trace::transport::points::Points;
use eagpt_trace::transport::start::Surface;
use eagpt_trace::transport::{LIGHT_SHARE, RayTracer, irradiance_over_pi};
use glam::{Vec3, Vec4};
use rayon::prelude::*;
use std::collections::HashMap;
use std::ops::Range;
use std::sync::Arc;

/// What blends the rays of cameras, and goes back from derivatives by their sums to gradients.
pub trait Engine {
    /// What computes: recorded beside the result.
    fn device(&self) -> String;

    /// Takes note that Gaussians have changed.
    ///
    /// # Errors
    /// If the device gives up.
    fn update(&mut self, set: &SurfelSet) -> Result<()>;

    /// Blended sums of one ray through every pixel centre, to be followed by [`Self::adjoint`].
    ///
    /// # Errors
    /// If the device gives up.
    fn trace(&mut self, set: &SurfelSet, camera: &Camera) -> Result<SumImage>;

    /// Gradients by all Gaussians; `d_sums` = dL/dV for every pixel of `camera`, which was traced last.
    ///
    /// # Errors
    /// If the device gives up.
    fn adjoint(
        &mut self,
        set: &SurfelSet,
        camera: &Camera,
        d_sums: &[Sums],
        wanted: Wanted,
    ) -> Result<Vec<LocalGradient>>;

    /// Blended sums alone.
    ///
    /// # Errors
    /// If the device gives up.
    fn camera_sums(&self, set: &SurfelSet, camera: &Camera) -> Result<SumImage>;

    /// A scene where this computes, for rays that are not those of cameras.
    ///
    /// # Errors
    /// If the device gives up, or has not enough memory.
    fn tracer(&self, gaussians: &Gaussians) -> Result<Box<dyn Tracer>>;
}

/// Training with the rays of an [`Engine`]; all else by all threads of the current rayon pool.
pub struct Trainer<E> {
    pub(super) engine: E,
    pub(super) state: ParameterState,
    gaussians: Gaussians,
    set: SurfelSet,
    /// Of the view whose weights were asked for last, which the CPU alone knows: memory for the next.
    record: CameraRecord,
    /// What views said since Gaussians were last split.
    attribution: Option<Attribution>,
    /// Built when stage 1 first gathers for pixels; geometry does not move from then on.
    scene: Option<CpuScene>,
    /// What light is gathered with for Gaussians, until stage 1 takes its first step.
    tracer: Option<Box<dyn Tracer>>,
    gathered: Option<GaussianIrradiance>,
    /// The gathered light by Gaussian, made when a view first needs it.
    lights: Vec<Vec4>,
    /// Views as stage 1 sees them, as far as they fit.
    lit_views: HashMap<usize, Arc<LitView>>,
    /// Bytes that they may still take.
    lit_budget: u64,
    targets: HashMap<usize, Arc<Target>>,
    /// Bytes that prepared targets may still take.
    target_budget: usize,
}

impl<E: Engine> Trainer<E> {
    /// A backend that starts from `state`, whose Gaussians `engine` has; prepared images may take `target_budget` bytes.
    pub(super) fn with_engine(state: ParameterState, target_budget: usize, engine: E) -> Self {
        let gaussians = state.gaussians();
        let set = SurfelSet::new(&gaussians);
        Self {
            engine,
            state,
            gaussians,
            set,
            record: CameraRecord::default(),
            attribution: None,
            scene: None,
            tracer: None,
            gathered: None,
            lights: Vec::new(),
            lit_views: HashMap::new(),
            lit_budget: 0,
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

    /// Traces a camera on the CPU, for its record.
    fn look(&mut self, camera: &Camera) -> SumImage {
        let record = &mut self.record;
        record.trace(&self.set, camera, HitSearch::Tiles, Keep::Record)
    }

    fn scene(&mut self) -> &CpuScene {
        self.scene
            .get_or_insert_with(|| CpuScene::new(&self.gaussians))
    }

    /// `view` with the light that was gathered.
    fn lit_view(&mut self, view: &TrainingView, threshold: f32) -> Arc<LitView> {
        if let Some(known) = self.lit_views.get(&view.index) {
            return Arc::clone(known);
        }
        // Not when the stage begins: a resumed run gathers as well, and then goes on in the middle.
        if self.lights.len() != self.set.len() {
            self.lights = match &self.gathered {
                Some(gathered) => gathered.by_gaussian(self.set.len()),
                None => vec![Vec4::ZERO; self.set.len()],
            };
            self.tracer = None;
            self.lit_budget = available_memory().unwrap_or(0) / LIT_SHARE;
        }
        let camera = &view.view.camera;
        let sums = self.look(camera);
        let weights = self.record.weights(LEAST_WEIGHT);
        let arriving = irradiance::of_pixels(&weights, &self.lights);
        let light = PixelLight::new(&sums, arriving, threshold);
        let lit = Arc::new(LitView { weights, light });
        let num_bytes = (lit.weights.num_bytes() + lit.light.num_bytes()) as u64;
        if let Some(left) = self.lit_budget.checked_sub(num_bytes) {
            self.lit_budget = left;
            self.lit_views.insert(view.index, Arc::clone(&lit));
        }
        lit
    }

    /// Loss of stage 1, and its gradient with respect to the albedo of each Gaussian, `[n]`, in a gradient of everything.
    fn albedo_gradient(
        &mut self,
        view: &TrainingView,
        step: &AlbedoStep<'_>,
    ) -> (LossTerms, Vec<LocalGradient>) {
        let target = self.target(view).pq();
        let known = view.view.valid.as_ref().map(KnownPixels::new);
        let loss = |albedos: &[Vec3], light: &PixelLight| {
            albedo_loss(albedos, light, &target, step.ssim_share, known.as_ref())
        };
        let threshold = step.options.emission_threshold;
        match step.options.gather {
            Gather::Gaussians => {
                let LitView { weights, light } = &*self.lit_view(view, threshold);
                let own = &self.gaussians.albedos;
                let (terms, d_pixels) = loss(&weights.blend(|i| own[i as usize]), light);
                let d_albedos = weights.adjoint(&d_pixels, own.len());
                let gradient = |d: Vec3| {
                    let mut lanes = LocalGradient::default();
                    lanes.0[grad_lane::ALBEDO..].copy_from_slice(&d.to_array());
                    lanes
                };
                (terms, d_albedos.into_iter().map(gradient).collect())
            }
            Gather::Pixels => {
                let camera = &view.view.camera;
                let sums = self.look(camera);
                let key = RandomKey::new(step.seed, Purpose::Albedo, step.iteration);
                let arriving = gather_pixels(self.scene(), camera, &sums, step.options, key);
                let albedos: Vec<Vec3> = sums.pixels.iter().map(Sums::albedo).collect();
                let light = PixelLight::new(&sums, arriving, threshold);
                let (terms, d_pixels) = loss(&albedos, &light);
                let of_albedo = |d: &Vec3| {
                    let mut lanes = Sums::default();
                    lanes.0[lane::ALBEDO..][..3].copy_from_slice(&d.to_array());
                    lanes
                };
                let d_sums: Vec<Sums> = d_pixels.iter().map(of_albedo).collect();
                let wanted = Wanted::LightAndMaterial;
                (terms, self.record.adjoint(&self.set, &d_sums, wanted))
            }
        }
    }
}

/// A view as stage 1 sees it: geometry and light do not change.
struct LitView {
    weights: BlendWeights,
    light: PixelLight,
}

/// One in so many directions looks for emitters. Measured on a room lit through a window: with half of the directions the light that
/// arrives is noisier by an eighth, for most of it comes from walls.
const LIGHTS_EVERY: u32 = 4;

/// What part of the free memory, 1/n, views with their light may take; those that do not fit are traced again.
const LIT_SHARE: u64 = 4;

/// Weights that stage 1 keeps are at least this: what is lighter is a third of the hits of a trained room, and less than a fiftieth of a pixel.
const LEAST_WEIGHT: f32 = 1e-3;

fn gather_pixels(
    scene: &CpuScene,
    camera: &Camera,
    sums: &SumImage,
    options: &AlbedoOptions,
    key: RandomKey,
) -> Vec<Vec3> {
    let frame = camera.ray_frame();
    let sampler = BounceSampler::new(scene.lights(), LIGHT_SHARE);
    (0..camera.num_pixels())
        .into_par_iter()
        .map(|pixel| {
            let seen = &sums.pixels[pixel];
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

/// Gradient of every ray's sums, given those of the means over `factor` × `factor` rays; `width` is that of the means.
fn adjoint_of_mean(d_means: Vec<Sums>, width: u32, factor: u32) -> Vec<Sums> {
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
            Sums(d_means[y * width + x].0.map(|d| d * share))
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
    ) -> Result<StepOutcome> {
        let target = self.target(view).pq();
        let factor = step.rays_per_axis;
        let camera = view.view.camera.magnified(factor);
        let mut sums = self.engine.trace(&self.set, &camera)?;
        if factor > 1 {
            sums = sums.averaged(factor);
        }
        let (terms, d_sums) = radiance_loss(&sums, &view.view, &target, step.weights, step.normals);
        let d_rays = adjoint_of_mean(d_sums, sums.width, factor);
        let wanted = if step.sizes.move_geometry() {
            Wanted::Everything
        } else {
            Wanted::LightAndMaterial
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

    fn albedo_step(&mut self, view: &TrainingView, step: &AlbedoStep<'_>) -> Result<StepOutcome> {
        let (terms, gradients) = self.albedo_gradient(view, step);
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

    fn attribute(&mut self, view: &TrainingView) -> Result<()> {
        let target = self.target(view).pq();
        let sums = self.look(&view.view.camera);
        let shown = pq_image(&sums.radiance());
        let known = view.view.valid.as_ref().map(KnownPixels::new);
        let contributions = self.record.contributions(|pixel| {
            if known.as_ref().is_some_and(|known| !known.has(pixel)) {
                return 0.0;
            }
            let (a, b) = (shown.pixels()[pixel], target.pixels()[pixel]);
            let color: f32 = (0..3).map(|c| (a[c] - b[c]).abs()).sum();
            let mask = view.view.emission.as_ref();
            let emission = mask.map_or(0.0, |mask| {
                (sums.pixels[pixel].emission() - mask.pixels()[pixel][0]).abs()
            });
            color + emission
        });
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
        let gathered = GaussianIrradiance::new(&self.set, cameras);
        let num = gathered.len();
        self.lights.clear();
        self.lit_views.clear();
        self.gathered = Some(gathered);
        Ok(num)
    }

    fn gather(&mut self, range: Range<usize>, num_samples: u32, seed: u64) -> Result<()> {
        let Some(gathered) = &mut self.gathered else {
            return Ok(());
        };
        let tracer = match &self.tracer {
            Some(tracer) => tracer,
            None => self.tracer.insert(self.engine.tracer(&self.gaussians)?),
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

    fn camera_sums(&self, camera: &Camera) -> Result<SumImage> {
        self.engine.camera_sums(&self.set, camera)
    }

    fn state(&self) -> Result<ParameterState> {
        Ok(self.state.clone())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// ⟨d, mean(x)⟩ = ⟨adjoint(d), x⟩, which defines the adjoint of a linear map.
    #[test]
    fn adjoint_of_the_mean_is_its_transpose() {
        let value = |i: usize| Sums([((i * 37 + 11) % 101) as f32 / 101.0; 16]);
        let (width, height, factor) = (3, 2, 2);
        let rays = SumImage {
            width: width * factor,
            height: height * factor,
            pixels: (0..24).map(value).collect(),
        };
        let d_means: Vec<Sums> = (0..6).map(|i| value(i + 50)).collect();
        // The lanes of first hit and spread are not means, and have no gradient.
        let dot =
            |a: &[Sums], b: &[Sums]| -> f32 { a.iter().zip(b).map(|(a, b)| a.0[3] * b.0[3]).sum() };
        let forward = dot(&d_means, &rays.averaged(factor).pixels);
        let backward = dot(&adjoint_of_mean(d_means, width, factor), &rays.pixels);
        assert!((forward - backward).abs() < 1e-5, "{forward} {backward}");
    }
}
