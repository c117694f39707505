//! One training step on a device.
//!
//! The loop above decides what to do next; a [`Backend`] owns everything that changes at every step — parameters, moments,
//! prepared images — for the whole run, and hands back scalars. Full state crosses the seam only for checkpoints.

mod closed_form;

use crate::error::Result;
use crate::loss::{
    LossTerms, NormalTerms, ViewIrradiance, albedo_loss, color::pq_image, radiance_loss,
};
use crate::options::{AlbedoOptions, LossWeights};
use crate::params::{BadGradient, ParameterState, StepSizes};
use eagpt_scene::rng::{Purpose, RandomKey};
use eagpt_scene::{Camera, Gaussians, Image, View};
use eagpt_trace::cpu::CpuScene;
use eagpt_trace::cpu::camera::{self, HitSearch, Keep};
use eagpt_trace::sums::{SumImage, Sums};
use eagpt_trace::surfel::SurfelSet;
use eagpt_trace::transport::lights::BounceSampler;
use eagpt_trace::transport::start::Surface;
use eagpt_trace::transport::{LIGHT_SHARE, RayTracer, irradiance_over_pi};
use rayon::prelude::*;
use std::collections::HashMap;
use std::sync::Arc;

/// A training view with the index by which a backend may keep prepared copies.
#[derive(Debug, Clone)]
pub struct TrainingView {
    /// Index of the frame in the dataset.
    pub index: usize,
    /// The images.
    pub view: Arc<View>,
}

/// One iteration of stage 0.
#[derive(Debug, Clone, Copy)]
pub struct RadianceStep<'a> {
    /// Loss weights.
    pub weights: &'a LossWeights,
    /// Whether the normal terms take part yet.
    pub normals: NormalTerms,
    /// Step sizes.
    pub sizes: StepSizes,
}

/// One iteration of stage 1.
#[derive(Debug, Clone, Copy)]
pub struct AlbedoStep<'a> {
    /// Options of the stage.
    pub options: &'a AlbedoOptions,
    /// Weights of the colour term.
    pub ssim_share: f64,
    /// Seed of the run.
    pub seed: u64,
    /// Iteration, counted from 1.
    pub iteration: u32,
    /// Step sizes.
    pub sizes: StepSizes,
}

/// What a step found out.
pub type StepOutcome = std::result::Result<LossTerms, BadGradient>;

/// A device that trains.
pub trait Backend {
    /// What computes: recorded beside the result.
    fn device(&self) -> String;

    /// Takes one step of stage 0; parameters stay as they are if a gradient is not finite.
    ///
    /// # Errors
    /// If the device gives up.
    fn radiance_step(
        &mut self,
        view: &TrainingView,
        step: &RadianceStep<'_>,
    ) -> Result<StepOutcome>;

    /// Takes one step of stage 1; parameters stay as they are if a gradient is not finite.
    ///
    /// # Errors
    /// If the device gives up.
    fn albedo_step(&mut self, view: &TrainingView, step: &AlbedoStep<'_>) -> Result<StepOutcome>;

    /// Begins stage 1: forgets Adam's moments, and starts albedos at the closed form `ρ = π r / E` from one gathering of the light that
    /// arrives at every Gaussian.
    ///
    /// # Errors
    /// If the device gives up.
    fn begin_albedo(&mut self, options: &AlbedoOptions, seed: u64) -> Result<()>;

    /// Blended sums of a camera, for previews.
    ///
    /// # Errors
    /// If the device gives up.
    fn camera_sums(&self, camera: &Camera) -> Result<SumImage>;

    /// The full state, read back.
    ///
    /// # Errors
    /// If the device gives up.
    fn state(&self) -> Result<ParameterState>;
}

/// Training on the CPU, with all threads of the current rayon pool.
pub struct CpuBackend {
    state: ParameterState,
    gaussians: Gaussians,
    set: SurfelSet,
    /// Built when stage 1 first needs it; geometry does not move from then on.
    scene: Option<CpuScene>,
    irradiance: HashMap<usize, Arc<ViewIrradiance>>,
    targets: HashMap<usize, Arc<Image<3>>>,
    /// Bytes that prepared targets may still take.
    target_budget: usize,
}

impl CpuBackend {
    /// A backend that starts from `state`; prepared images may take `target_budget` bytes.
    pub fn new(state: ParameterState, target_budget: usize) -> Self {
        let gaussians = state.gaussians();
        let set = SurfelSet::new(&gaussians);
        Self {
            state,
            gaussians,
            set,
            scene: None,
            irradiance: HashMap::new(),
            targets: HashMap::new(),
            target_budget,
        }
    }

    fn target(&mut self, view: &TrainingView) -> Arc<Image<3>> {
        if let Some(target) = self.targets.get(&view.index) {
            return Arc::clone(target);
        }
        let target = Arc::new(pq_image(&view.view.radiance));
        if let Some(left) = self.target_budget.checked_sub(target.num_bytes()) {
            self.target_budget = left;
            self.targets.insert(view.index, Arc::clone(&target));
        }
        target
    }

    fn update(
        &mut self,
        record: &camera::CameraRecord,
        d_sums: &[Sums],
        sizes: &StepSizes,
        terms: LossTerms,
    ) -> StepOutcome {
        let gradients = record.adjoint(&self.set, &self.gaussians.scales, d_sums);
        self.state.step(&self.gaussians, &gradients, sizes)?;
        self.gaussians = self.state.gaussians();
        self.set.update(&self.gaussians);
        Ok(terms)
    }

    fn irradiance(
        &mut self,
        view: &TrainingView,
        sums: &SumImage,
        step: &AlbedoStep<'_>,
    ) -> Arc<ViewIrradiance> {
        if !step.options.resample
            && let Some(known) = self.irradiance.get(&view.index)
        {
            return Arc::clone(known);
        }
        let scene = self
            .scene
            .get_or_insert_with(|| CpuScene::new(&self.gaussians));
        // Samples of a view that is computed once are keyed by the view, others by the iteration: either way a resumed run draws
        // what an uninterrupted one would.
        let iteration = if step.options.resample {
            step.iteration
        } else {
            u32::MAX - view.index as u32
        };
        let key = RandomKey::new(step.seed, Purpose::Albedo, iteration);
        let arriving = gather_irradiance(scene, &view.view.camera, sums, step.options, key);
        let arriving = Arc::new(ViewIrradiance { arriving });
        if !step.options.resample {
            self.irradiance.insert(view.index, Arc::clone(&arriving));
        }
        arriving
    }
}

fn gather_irradiance(
    scene: &CpuScene,
    camera: &Camera,
    sums: &SumImage,
    options: &AlbedoOptions,
    key: RandomKey,
) -> Vec<Option<glam::Vec3>> {
    let frame = camera.ray_frame();
    let sampler = BounceSampler::new(scene.lights(), LIGHT_SHARE);
    (0..camera.num_pixels())
        .into_par_iter()
        .map(|pixel| {
            let seen = &sums.pixels[pixel];
            if seen.emission() > options.emission_threshold {
                return None;
            }
            let (x, y) = (pixel as u32 % camera.width, pixel as u32 / camera.width);
            let direction = frame.direction(x as f32 + 0.5, y as f32 + 0.5);
            Some(
                Surface::at(frame.origin, direction, seen).map_or(glam::Vec3::ZERO, |surface| {
                    irradiance_over_pi(scene, &sampler, &surface, options.num_samples, |s| {
                        key.stream(pixel as u32, s)
                    })
                }),
            )
        })
        .collect()
}

impl Backend for CpuBackend {
    fn device(&self) -> String {
        "cpu".to_owned()
    }

    fn radiance_step(
        &mut self,
        view: &TrainingView,
        step: &RadianceStep<'_>,
    ) -> Result<StepOutcome> {
        let target = self.target(view);
        let (sums, record) =
            camera::trace(&self.set, &view.view.camera, HitSearch::Tiles, Keep::Record);
        let (terms, d_sums) = radiance_loss(&sums, &view.view, &target, step.weights, step.normals);
        Ok(self.update(&record, &d_sums, &step.sizes, terms))
    }

    fn albedo_step(&mut self, view: &TrainingView, step: &AlbedoStep<'_>) -> Result<StepOutcome> {
        let target = self.target(view);
        let (sums, record) =
            camera::trace(&self.set, &view.view.camera, HitSearch::Tiles, Keep::Record);
        let irradiance = self.irradiance(view, &sums, step);
        let (terms, d_sums) = albedo_loss(&sums, &irradiance, &target, step.ssim_share);
        Ok(self.update(&record, &d_sums, &step.sizes, terms))
    }

    fn begin_albedo(&mut self, options: &AlbedoOptions, seed: u64) -> Result<()> {
        self.state.reset_moments();
        if options.num_start_samples > 0 {
            let scene = CpuScene::new(&self.gaussians);
            let albedos =
                closed_form::albedos(&scene, &self.gaussians, options.num_start_samples, seed);
            self.state.set_albedos(&albedos);
            self.gaussians = self.state.gaussians();
            self.set.update(&self.gaussians);
        }
        Ok(())
    }

    fn camera_sums(&self, camera: &Camera) -> Result<SumImage> {
        Ok(camera::trace(&self.set, camera, HitSearch::Tiles, Keep::Nothing).0)
    }

    fn state(&self) -> Result<ParameterState> {
        Ok(self.state.clone())
    }
}
