//! Training on a device.
//!
//! - [`params`]: parameters, moments and Gaussians; the chain rule and Adam.
//! - [`wanted`]: what views should look like.
//! - [`loss`]: the losses of both stages, their features over pixels and their derivatives by the
//!   features of rays.
//! - [`report`]: what the host reads after a step: twelve numbers.
//! - [`kernels`]: the modules of these.
//! - [`steps`]: steps of these, several of them under way at once.

mod kernels;
mod loss;
mod params;
mod report;
mod steps;
mod target;

use super::engine::Engine;
use super::trainer::Trainer;
use super::{AlbedoStep, Backend, RadianceStep, Taken, TrainDevice, TrainingView};
use crate::densify::Densified;
use crate::error::Result;
use crate::loss::target::Target;
use crate::options::Gather;
use crate::params::ParameterState;
use eagpt_scene::{Camera, Gaussians};
use eagpt_trace::Tracer;
use eagpt_trace::blend::{Contribution, LocalGradient, PixelValue};
use eagpt_trace::cpu::GradientMask;
use eagpt_trace::cpu::weights::BlendWeights;
use eagpt_trace::features::{Features, GBuffer};
use eagpt_trace::gpu::kernel::Buffer;
use eagpt_trace::gpu::{Device, GpuFit};
use eagpt_trace::surfel::SurfelSet;
use loss::LossBuffers;
use params::ResidentState;
use std::collections::{HashMap, VecDeque};
use std::ops::Range;
use std::sync::Arc;
use steps::{Kind, Task, UnderWay};
use target::TargetView;

/// The rays of a device.
struct GpuEngine {
    fit: GpuFit,
}

impl GpuEngine {
    fn place(&self) -> TrainDevice {
        TrainDevice::Gpu(Arc::clone(self.fit.device()))
    }
}

impl Engine for GpuEngine {
    fn device(&self) -> String {
        self.place().name()
    }

    fn update(&mut self, set: &SurfelSet) -> Result<()> {
        Ok(self.fit.update(set)?)
    }

    fn trace(&mut self, _: &SurfelSet, camera: &Camera) -> Result<GBuffer> {
        Ok(self.fit.gbuffer(camera)?)
    }

    fn adjoint(
        &mut self,
        _: &SurfelSet,
        camera: &Camera,
        d_features: &[Features],
        _: GradientMask,
    ) -> Result<Vec<LocalGradient>> {
        Ok(self.fit.camera_adjoint(camera, d_features)?)
    }

    fn contributions(
        &mut self,
        _: &SurfelSet,
        camera: &Camera,
        value: PixelValue<'_>,
    ) -> Result<Vec<Contribution>> {
        Ok(self.fit.contributions(camera, value)?.1)
    }

    fn weights(&self, _: f32) -> Option<BlendWeights> {
        None
    }

    fn gbuffer(&self, _: &SurfelSet, camera: &Camera) -> Result<GBuffer> {
        Ok(self.fit.gbuffer(camera)?)
    }

    fn tracer(&self, gaussians: &Gaussians) -> Result<Box<dyn Tracer>> {
        self.place().tracer(gaussians)
    }
}

/// Views that stay on the device take at most so much of its memory, which nothing tells the size
/// of; others come anew each time.
const MOST_VIEW_BYTES: usize = 1 << 30;

/// Training on a device. A step passes through the host with its report alone. What comes once in a
/// while is traced on the device and decided on the host: which Gaussians are split, where each is
/// seen best, and what light the pixels of a view receive in stage 1. Where light is gathered anew
/// for every pixel ([`Gather::Pixels`]), that is done on the CPU.
pub struct GpuBackend {
    device: Arc<Device>,
    /// The rays; while a [`ResidentState`] is there, its other parts are behind.
    host: Trainer<GpuEngine>,
    resident: Option<ResidentState>,
    /// Steps that the device has been given, in order.
    under_way: VecDeque<UnderWay>,
    /// Steps that are over and that nobody has been told of.
    over: Vec<Taken>,
    loss: Option<LossBuffers>,
    views: HashMap<usize, TargetView>,
    /// The light of views in stage 1.
    lit: HashMap<usize, Buffer>,
    /// Bytes that views and their light may still take.
    view_budget: usize,
}

impl GpuBackend {
    /// A backend that starts from `state`; prepared images may take `target_budget` bytes of the
    /// host's memory, and as much of the device's, but no more than 1 GiB.
    ///
    /// # Errors
    /// If the device gives up, or has not enough memory.
    pub fn new(device: &Arc<Device>, state: ParameterState, target_budget: usize) -> Result<Self> {
        let set = SurfelSet::new(&state.gaussians());
        let fit = GpuFit::new(device, &set)?;
        let engine = GpuEngine { fit };
        Ok(Self {
            device: Arc::clone(device),
            host: Trainer::with_engine(state, target_budget, engine),
            resident: None,
            under_way: VecDeque::new(),
            over: Vec::new(),
            loss: None,
            views: HashMap::new(),
            lit: HashMap::new(),
            view_budget: target_budget.min(MOST_VIEW_BYTES),
        })
    }

    /// The host's trainer, with the state that the device has.
    fn host(&mut self) -> Result<&mut Trainer<GpuEngine>> {
        self.catch_up(0)?;
        if let Some(resident) = self.resident.take() {
            self.host.take_back(resident.state()?);
        }
        Ok(&mut self.host)
    }

    fn wanted(&mut self, view: &TrainingView) -> Result<TargetView> {
        if let Some(wanted) = self.views.get(&view.index) {
            return Ok(wanted.clone());
        }
        let size = TargetView::num_bytes(view.view.camera.num_pixels());
        let Some(left) = self.view_budget.checked_sub(size) else {
            let target = self.host.target(view);
            return TargetView::new(&self.device, &view.view, &target);
        };
        let wanted = TargetView::new(&self.device, &view.view, &Target::new(&view.view.radiance))?;
        self.view_budget = left;
        self.views.insert(view.index, wanted.clone());
        Ok(wanted)
    }

    /// The light of a view in stage 1; emission beyond `threshold` is an emitter's.
    fn lit(&mut self, view: &TrainingView, threshold: f32) -> Result<Buffer> {
        if let Some(lit) = self.lit.get(&view.index) {
            return Ok(lit.clone());
        }
        // Views are traced as steps have put the Gaussians, in the first step of a run as in all
        // others.
        resident(&mut self.resident, &self.host)?;
        let known = self.host.lit_view(view, threshold)?;
        let lit = loss::lit_pixels(&self.device, &known.light)?;
        if let Some(left) = self.view_budget.checked_sub(lit.size() as usize) {
            self.view_budget = left;
            self.lit.insert(view.index, lit.clone());
        }
        Ok(lit)
    }
}

/// The state on the device, brought there from the `host` if it is not there yet.
fn resident<'a>(
    place: &'a mut Option<ResidentState>,
    host: &Trainer<GpuEngine>,
) -> Result<&'a mut ResidentState> {
    let fit = &host.engine.fit;
    Ok(match place {
        Some(resident) => resident,
        none => none.insert(ResidentState::new(fit.device(), &host.state, fit)?),
    })
}

impl Backend for GpuBackend {
    fn device(&self) -> String {
        self.host.device()
    }

    fn begin_harmonics(&mut self) -> Result<()> {
        self.host()?.begin_harmonics()
    }

    fn radiance_step(
        &mut self,
        view: &TrainingView,
        step: &RadianceStep<'_>,
    ) -> Result<Vec<Taken>> {
        self.begin(Task {
            iteration: step.iteration,
            view: view.clone(),
            sizes: step.sizes,
            kind: Kind::Radiance {
                weights: *step.weights,
                normals: step.normals,
                rays_per_axis: step.rays_per_axis,
            },
        })
    }

    fn albedo_step(&mut self, view: &TrainingView, step: &AlbedoStep<'_>) -> Result<Vec<Taken>> {
        if step.options.gather == Gather::Pixels {
            return self.host()?.albedo_step(view, step);
        }
        let lit = self.lit(view, step.options.emission_threshold)?;
        self.begin(Task {
            iteration: step.iteration,
            view: view.clone(),
            sizes: step.sizes,
            kind: Kind::Albedo {
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
        self.host()?.attribute(view)
    }

    fn densify(&mut self, target: usize) -> Result<Densified> {
        self.host()?.densify(target)
    }

    fn begin_gathering(&mut self, cameras: &[Camera]) -> Result<usize> {
        let freed = self.lit.drain().map(|(_, lit)| lit.size() as usize);
        self.view_budget += freed.sum::<usize>();
        self.host()?.begin_gathering(cameras)
    }

    fn gather(&mut self, range: Range<usize>, num_samples: u32, seed: u64) -> Result<()> {
        self.host()?.gather(range, num_samples, seed)
    }

    fn begin_albedo(&mut self) -> Result<()> {
        self.host()?.begin_albedo()
    }

    fn gbuffer(&mut self, camera: &Camera) -> Result<GBuffer> {
        self.catch_up(0)?;
        self.host.gbuffer(camera)
    }

    fn state(&mut self) -> Result<ParameterState> {
        self.catch_up(0)?;
        match &self.resident {
            Some(resident) => resident.state(),
            None => self.host.state(),
        }
    }
}

#[cfg(test)]
mod tests;
