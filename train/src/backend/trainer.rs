//! Training, whatever blends the rays: parameters, targets, losses and what the stages remember are on the host.

use super::irradiance::{self, GaussianIrradiance};
use super::{AlbedoStep, Backend, RadianceStep, StepOutcome, TrainingView};
use crate::densify::{self, Attribution, Densified};
use crate::error::Result;
use crate::loss::{LossTerms, albedo_loss, color::pq_image, radiance_loss};
use crate::options::{AlbedoOptions, Gather};
use crate::params::{ParameterState, StepSizes};
use eagpt_eval::KnownPixels;
use eagpt_scene::rng::{Purpose, RandomKey};
use eagpt_scene::{Camera, Gaussians, Image};
use eagpt_trace::blend::LocalGradient;
use eagpt_trace::cpu::CpuScene;
use eagpt_trace::cpu::camera::{self, HitSearch, Keep};
use eagpt_trace::sums::{SumImage, Sums};
use eagpt_trace::surfel::SurfelSet;
use eagpt_trace::transport::lights::BounceSampler;
use eagpt_trace::transport::points::Points;
use eagpt_trace::transport::start::Surface;
use eagpt_trace::transport::{LIGHT_SHARE, RayTracer, irradiance_over_pi};
use glam::{Vec2, Vec3};
use rayon::prelude::*;
use std::collections::HashMap;
use std::ops::Range;
use std::sync::Arc;

/// What blends the rays of cameras, and goes back from derivatives by their sums to gradients.
pub trait Engine {
    /// What the way back needs of the way there.
    type Record;

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
    fn trace(&self, set: &SurfelSet, camera: &Camera) -> Result<(SumImage, Self::Record)>;

    /// Gradients by all Gaussians, of these in-plane `scales`; `d_sums` = dL/dV for every pixel.
    ///
    /// # Errors
    /// If the device gives up.
    fn adjoint(
        &self,
        set: &SurfelSet,
        scales: &[Vec2],
        record: &Self::Record,
        d_sums: &[Sums],
    ) -> Result<Vec<LocalGradient>>;

    /// Blended sums alone.
    ///
    /// # Errors
    /// If the device gives up.
    fn camera_sums(&self, set: &SurfelSet, camera: &Camera) -> Result<SumImage>;
}

/// Training with the rays of an [`Engine`]; all else by all threads of the current rayon pool.
pub struct Trainer<E> {
    pub(super) engine: E,
    pub(super) state: ParameterState,
    gaussians: Gaussians,
    set: SurfelSet,
    /// What views said since Gaussians were last split.
    attribution: Option<Attribution>,
    /// Built when stage 1 first needs it; geometry does not move from then on.
    scene: Option<CpuScene>,
    gathered: Option<GaussianIrradiance>,
    /// Gaussians that carry the gathered light, made when it is complete.
    lit: Option<SurfelSet>,
    /// Light of the views, blended from the gathered one.
    irradiance: HashMap<usize, Arc<Vec<Vec3>>>,
    targets: HashMap<usize, Arc<Image<3>>>,
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
            attribution: None,
            scene: None,
            gathered: None,
            lit: None,
            irradiance: HashMap::new(),
            targets: HashMap::new(),
            target_budget,
        }
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

    /// The radiance of `view` as PQ values.
    pub(super) fn target(&mut self, view: &TrainingView) -> Arc<Image<3>> {
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
        record: &E::Record,
        d_sums: &[Sums],
        sizes: &StepSizes,
        terms: LossTerms,
    ) -> Result<StepOutcome> {
        let scales = &self.gaussians.scales;
        let gradients = self.engine.adjoint(&self.set, scales, record, d_sums)?;
        if let Err(bad) = self.state.step(&self.gaussians, &gradients, sizes) {
            return Ok(Err(bad));
        }
        self.prepare();
        self.engine.update(&self.set)?;
        Ok(Ok(terms))
    }

    fn scene(&mut self) -> &CpuScene {
        self.scene
            .get_or_insert_with(|| CpuScene::new(&self.gaussians))
    }

    /// Irradiance over π of every pixel, as the options want it.
    fn irradiance(
        &mut self,
        view: &TrainingView,
        sums: &SumImage,
        step: &AlbedoStep<'_>,
    ) -> Arc<Vec<Vec3>> {
        let camera = &view.view.camera;
        match step.options.gather {
            Gather::Gaussians => {
                if let Some(known) = self.irradiance.get(&view.index) {
                    return Arc::clone(known);
                }
                let lit = self.lit.get_or_insert_with(|| {
                    self.gathered
                        .as_ref()
                        .map_or_else(SurfelSet::default, |light| light.carried_by(&self.set))
                });
                let arriving = Arc::new(irradiance::of_camera(lit, camera));
                self.irradiance.insert(view.index, Arc::clone(&arriving));
                arriving
            }
            Gather::Pixels => {
                let key = RandomKey::new(step.seed, Purpose::Albedo, step.iteration);
                Arc::new(gather_pixels(self.scene(), camera, sums, step.options, key))
            }
        }
    }
}

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
fn adjoint_of_mean(d_means: &[Sums], width: u32, factor: u32) -> Vec<Sums> {
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

    fn radiance_step(
        &mut self,
        view: &TrainingView,
        step: &RadianceStep<'_>,
    ) -> Result<StepOutcome> {
        let target = self.target(view);
        let factor = step.rays_per_axis;
        let camera = view.view.camera.magnified(factor);
        let (sums, record) = self.engine.trace(&self.set, &camera)?;
        let sums = sums.averaged(factor);
        let (terms, d_sums) = radiance_loss(&sums, &view.view, &target, step.weights, step.normals);
        let d_rays = adjoint_of_mean(&d_sums, sums.width, factor);
        self.update(&record, &d_rays, &step.sizes, terms)
    }

    fn albedo_step(&mut self, view: &TrainingView, step: &AlbedoStep<'_>) -> Result<StepOutcome> {
        let target = self.target(view);
        let (sums, record) = self.engine.trace(&self.set, &view.view.camera)?;
        let arriving = self.irradiance(view, &sums, step);
        let threshold = step.options.emission_threshold;
        let known = view.view.valid.as_ref().map(KnownPixels::new);
        let (terms, d_sums) = albedo_loss(
            &sums,
            &arriving,
            threshold,
            &target,
            step.ssim_share,
            known.as_ref(),
        );
        self.update(&record, &d_sums, &step.sizes, terms)
    }

    // What each Gaussian adds to which pixel is known to the CPU's record alone; this is asked for a few times in a run.
    fn attribute(&mut self, view: &TrainingView) -> Result<()> {
        let target = self.target(view);
        let (sums, record) =
            camera::trace(&self.set, &view.view.camera, HitSearch::Tiles, Keep::Record);
        let shown = pq_image(&sums.radiance());
        let known = view.view.valid.as_ref().map(KnownPixels::new);
        let contributions = record.contributions(|pixel| {
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
        self.prepare();
        self.engine.update(&self.set)?;
        Ok(outcome)
    }

    fn begin_gathering(&mut self, cameras: &[Camera]) -> Result<usize> {
        let gathered = GaussianIrradiance::new(&self.set, cameras);
        let num = gathered.len();
        self.gathered = Some(gathered);
        Ok(num)
    }

    fn gather(&mut self, range: Range<usize>, num_samples: u32, seed: u64) -> Result<()> {
        self.scene();
        if let (Some(gathered), Some(scene)) = (&mut self.gathered, &self.scene) {
            gathered.gather(scene, range, num_samples, seed);
        }
        Ok(())
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
        let backward = dot(&adjoint_of_mean(&d_means, width, factor), &rays.pixels);
        assert!((forward - backward).abs() < 1e-5, "{forward} {backward}");
    }
}
