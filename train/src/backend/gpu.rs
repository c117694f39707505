//! Training on a device.
//!
//! - [`params`]: parameters, moments and Gaussians; the chain rule and Adam.
//! - [`rows`]: what these are rows of.
//! - [`lights`]: the values of lights that are not shown.
//! - [`target`]: views that steps are compared with, on the device.
//! - [`loss`]: the losses of both stages, their features over pixels and their derivatives by the
//!   features of rays.
//! - [`report`]: what the host reads after a step.
//! - [`structures`]: what these exchange with their kernels.
//! - [`kernels`]: the modules of these.
//! - [`task`], [`steps`]: steps of these, several of them under way at once.

mod kernels;
mod lights;
mod loss;
mod params;
mod report;
mod rows;
mod steps;
mod structures;
mod target;
mod task;

use super::step::{AlbedoStep, Backend, RadianceStep, Taken, TrainingView};
use super::trainer::{HostParameters, Trainer};
use crate::densify::Densified;
use crate::error::Result;
use crate::loss::target::Target;
use crate::options::Gather;
use crate::params::ParameterState;
use eagpt_scene::{Camera, SceneEdit};
use eagpt_trace::Tracer as _;
use eagpt_trace::features::GBuffer;
use eagpt_trace::gpu::kernel::Buffer;
use eagpt_trace::gpu::{Device, GpuScene};
use eagpt_trace::transport::matrix::Receiver;
use glam::Vec3;
use loss::LossBuffers;
use params::ResidentState;
use std::collections::{HashMap, VecDeque};
use std::ops::Range;
use std::sync::Arc;
use target::TargetView;
use task::{PendingStep, StepLoss, StepTask};

/// Views that stay on the device take at most so much of its memory, which nothing tells the size
/// of; others come anew each time.
const MOST_VIEW_BYTES: usize = 1 << 30;

/// The parameters, in one place at a time.
enum Parameters {
    /// On the host, whose Gaussians the scene has.
    Host(HostParameters),
    /// On the device, where kernels move them together with the Gaussians of the scene.
    Device(ResidentState),
}

/// Training on a GPU. Of a step the host reads the report alone. Rare work is traced on the device
/// and decided on the host: the choice of Gaussians to split, the view that shows each Gaussian
/// best, and the irradiance of the pixels of a view in stage 1. With [`Gather::Pixels`], irradiance
/// is sampled on the CPU.
pub(crate) struct GpuBackend {
    device: Arc<Device>,
    parameters: Parameters,
    trainer: Trainer<GpuScene>,
    /// Steps submitted to the device, in order.
    under_way: VecDeque<PendingStep>,
    /// Steps that are finished and not reported yet.
    over: Vec<Taken>,
    loss: Option<LossBuffers>,
    views: HashMap<usize, TargetView>,
    /// Irradiance of views in stage 1.
    lit: HashMap<usize, Buffer>,
    /// Bytes that further views and their irradiance may take.
    view_budget: usize,
}

impl GpuBackend {
    /// A backend that starts from `state`; prepared images may take `target_budget` bytes of the
    /// host's memory, and as much of the device's, but no more than 1 GiB.
    ///
    /// # Errors
    /// If the device fails or has not enough memory.
    pub(crate) fn new(
        device: &Arc<Device>,
        state: ParameterState,
        target_budget: usize,
    ) -> Result<Self> {
        let parameters = HostParameters::new(state);
        let scene = GpuScene::new(device, &parameters.gaussians)?;
        Ok(Self {
            device: Arc::clone(device),
            parameters: Parameters::Host(parameters),
            trainer: Trainer::new(scene, target_budget),
            under_way: VecDeque::new(),
            over: Vec::new(),
            loss: None,
            views: HashMap::new(),
            lit: HashMap::new(),
            view_budget: target_budget.min(MOST_VIEW_BYTES),
        })
    }

    /// The trainer of the host with the parameters, brought there when all steps are finished.
    fn host(&mut self) -> Result<(&mut Trainer<GpuScene>, &mut HostParameters)> {
        self.catch_up(0)?;
        if let Parameters::Device(resident) = &self.parameters {
            let parameters = HostParameters::new(resident.state()?);
            self.trainer.scene.update(&parameters.gaussians)?;
            self.parameters = Parameters::Host(parameters);
        }
        match &mut self.parameters {
            Parameters::Host(parameters) => Ok((&mut self.trainer, parameters)),
            Parameters::Device(_) => unreachable!("brought to the host above"),
        }
    }

    /// Index of the light shown.
    fn light(&self) -> usize {
        match &self.parameters {
            Parameters::Host(parameters) => parameters.state.lights.current,
            Parameters::Device(resident) => resident.light(),
        }
    }

    fn target(&mut self, view: &TrainingView) -> Result<TargetView> {
        if let Some(target) = self.views.get(&view.index) {
            return Ok(target.clone());
        }
        let size = TargetView::num_bytes(view.view.camera.num_pixels());
        let Some(left) = self.view_budget.checked_sub(size) else {
            let target = self.trainer.target(view);
            return TargetView::new(&self.device, view, &target);
        };
        let target = TargetView::new(&self.device, view, &Target::new(&view.view.radiance))?;
        self.view_budget = left;
        self.views.insert(view.index, target.clone());
        Ok(target)
    }

    /// The irradiance of a view in stage 1; emission beyond `threshold` is an emitter's.
    fn lit(&mut self, view: &TrainingView, threshold: f32) -> Result<Buffer> {
        if let Some(lit) = self.lit.get(&view.index) {
            return Ok(lit.clone());
        }
        let mut cache = match self.trainer.cache.take() {
            Some(cache) => cache,
            None => {
                let (trainer, parameters) = self.host()?;
                trainer.new_cache(&parameters.gaussians)?
            }
        };
        // Views are traced with the Gaussians as the device computes them, in the first step of a
        // run as in all others.
        resident(&mut self.parameters, &mut self.trainer.scene)?;
        let cached = cache.view(view, &mut self.trainer.scene, threshold)?;
        self.trainer.cache = Some(cache);
        let lit = loss::lit_pixels(&self.device, &cached.light)?;
        if let Some(left) = self.view_budget.checked_sub(lit.size() as usize) {
            self.view_budget = left;
            self.lit.insert(view.index, lit.clone());
        }
        Ok(lit)
    }
}

/// The state on the device, brought there with the Gaussians of `scene` if it is not there yet.
fn resident<'a>(
    parameters: &'a mut Parameters,
    scene: &mut GpuScene,
) -> Result<&'a mut ResidentState> {
    if let Parameters::Host(host) = parameters {
        let state = ResidentState::new(scene.gpu_device(), &host.state, scene)?;
        scene.release_host_copy();
        *parameters = Parameters::Device(state);
    }
    match parameters {
        Parameters::Device(state) => Ok(state),
        Parameters::Host(_) => unreachable!("brought to the device above"),
    }
}

impl Backend for GpuBackend {
    fn show_light(&mut self, light: usize) -> Result<()> {
        match &mut self.parameters {
            Parameters::Host(parameters) => self.trainer.show_light(parameters, light),
            Parameters::Device(resident) if resident.light() == light => Ok(()),
            Parameters::Device(resident) => {
                self.trainer.forget_light();
                resident.show_light(light, &self.trainer.scene)
            }
        }
    }

    fn begin_harmonics(&mut self) -> Result<()> {
        let (trainer, parameters) = self.host()?;
        trainer.begin_harmonics(parameters)
    }

    fn radiance_step(
        &mut self,
        view: &TrainingView,
        step: &RadianceStep<'_>,
    ) -> Result<Vec<Taken>> {
        let target = self.target(view)?;
        self.begin(StepTask {
            iteration: step.iteration,
            view: view.clone(),
            rays: step.rays(view.view.camera, &target.edges),
            target,
            sizes: step.sizes,
            loss: StepLoss::Radiance {
                weights: *step.weights,
                normals: step.normals,
            },
        })
    }

    fn albedo_step(&mut self, view: &TrainingView, step: &AlbedoStep<'_>) -> Result<Vec<Taken>> {
        if step.options.gather == Gather::Pixels {
            let (trainer, parameters) = self.host()?;
            return Ok(vec![trainer.albedo_step(parameters, view, step)?]);
        }
        let lit = self.lit(view, step.options.emission_threshold)?;
        let target = self.target(view)?;
        self.begin(StepTask {
            iteration: step.iteration,
            view: view.clone(),
            target,
            rays: view.view.camera.into(),
            sizes: step.sizes,
            loss: StepLoss::Albedo {
                options: step.options.clone(),
                ssim_share: step.ssim_share,
                seed: step.seed,
                lit,
            },
        })
    }

    fn finish(&mut self) -> Result<Vec<Taken>> {
        self.catch_up(0)?;
        Ok(std::mem::take(&mut self.over))
    }

    fn attribute(&mut self, view: &TrainingView) -> Result<()> {
        let (trainer, parameters) = self.host()?;
        trainer.attribute(parameters, view)
    }

    fn densify(&mut self, target: usize) -> Result<Densified> {
        let (trainer, parameters) = self.host()?;
        trainer.densify(parameters, target)
    }

    fn edit(&mut self, edit: &SceneEdit, radiances: &[Vec<Option<Vec3>>]) -> Result<()> {
        let (trainer, parameters) = self.host()?;
        trainer.edit(parameters, edit, radiances)
    }

    fn mark_emitting(&mut self, emitting: &[Vec<(usize, bool)>]) -> Result<()> {
        let (trainer, parameters) = self.host()?;
        trainer.mark_emitting(parameters, emitting)
    }

    fn brighten(&mut self, factors: &[(usize, f32)]) -> Result<()> {
        let (trainer, parameters) = self.host()?;
        trainer.brighten(parameters, factors)
    }

    fn begin_gathering(&mut self, cameras: &[Camera]) -> Result<usize> {
        let freed = self.lit.drain().map(|(_, lit)| lit.size() as usize);
        self.view_budget += freed.sum::<usize>();
        let (trainer, parameters) = self.host()?;
        trainer.begin_gathering(parameters, cameras)
    }

    fn gather(&mut self, range: Range<usize>, num_samples: u32, seed: u64) -> Result<()> {
        let (trainer, parameters) = self.host()?;
        trainer.gather(parameters, range, num_samples, seed)
    }

    fn gathered(&self, light: usize) -> Vec<(Receiver, Vec3)> {
        self.trainer.gathered(light)
    }

    fn begin_albedo(&mut self, shares: &[Vec<f32>]) -> Result<()> {
        let (trainer, parameters) = self.host()?;
        trainer.begin_albedo(parameters, shares)
    }

    fn gbuffer(&mut self, camera: &Camera) -> Result<GBuffer> {
        self.catch_up(0)?;
        Ok(self.trainer.scene.gbuffer(camera)?)
    }

    fn state(&mut self) -> Result<ParameterState> {
        self.catch_up(0)?;
        match &self.parameters {
            Parameters::Device(resident) => resident.state(),
            Parameters::Host(parameters) => Ok(parameters.state.clone()),
        }
    }
}

#[cfg(test)]
mod tests;
