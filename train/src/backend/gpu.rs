//! Training on a device.

use super::trainer::{Engine, Trainer};
use super::{AlbedoStep, Backend, RadianceStep, StepOutcome, TrainingView};
use crate::densify::Densified;
use crate::error::Result;
use crate::params::ParameterState;
use eagpt_scene::Camera;
use eagpt_trace::blend::LocalGradient;
use eagpt_trace::gpu::{Device, GpuFit};
use eagpt_trace::sums::{SumImage, Sums};
use eagpt_trace::surfel::SurfelSet;
use glam::Vec2;
use std::ops::Range;
use std::sync::Arc;

/// The rays of a device.
struct GpuEngine {
    fit: GpuFit,
}

impl Engine for GpuEngine {
    type Record = Camera;

    fn device(&self) -> String {
        format!("gpu: {}", self.fit.device().adapter().name)
    }

    fn update(&mut self, set: &SurfelSet) -> Result<()> {
        Ok(self.fit.update(set)?)
    }

    fn trace(&self, _: &SurfelSet, camera: &Camera) -> Result<(SumImage, Camera)> {
        Ok((self.fit.camera_sums(camera)?, *camera))
    }

    fn adjoint(
        &self,
        _: &SurfelSet,
        _: &[Vec2],
        camera: &Camera,
        d_sums: &[Sums],
    ) -> Result<Vec<LocalGradient>> {
        Ok(self.fit.camera_adjoint(camera, d_sums)?)
    }

    fn camera_sums(&self, _: &SurfelSet, camera: &Camera) -> Result<SumImage> {
        Ok(self.fit.camera_sums(camera)?)
    }
}

/// Training with the rays of cameras on a device. What stage 1 gathers, and which Gaussians are split, is found out on the CPU.
pub struct GpuBackend {
    host: Trainer<GpuEngine>,
}

impl GpuBackend {
    /// A backend that starts from `state`; prepared images may take `target_budget` bytes.
    ///
    /// # Errors
    /// If the device gives up, or has not enough memory.
    pub fn new(device: &Arc<Device>, state: ParameterState, target_budget: usize) -> Result<Self> {
        let set = SurfelSet::new(&state.gaussians());
        let fit = GpuFit::new(device, &set)?;
        let engine = GpuEngine { fit };
        Ok(Self {
            host: Trainer::with_engine(state, target_budget, engine),
        })
    }
}

impl Backend for GpuBackend {
    fn device(&self) -> String {
        self.host.device()
    }

    fn radiance_step(
        &mut self,
        view: &TrainingView,
        step: &RadianceStep<'_>,
    ) -> Result<StepOutcome> {
        self.host.radiance_step(view, step)
    }

    fn albedo_step(&mut self, view: &TrainingView, step: &AlbedoStep<'_>) -> Result<StepOutcome> {
        self.host.albedo_step(view, step)
    }

    fn attribute(&mut self, view: &TrainingView) -> Result<()> {
        self.host.attribute(view)
    }

    fn densify(&mut self, target: usize) -> Result<Densified> {
        self.host.densify(target)
    }

    fn begin_gathering(&mut self, cameras: &[Camera]) -> Result<usize> {
        self.host.begin_gathering(cameras)
    }

    fn gather(&mut self, range: Range<usize>, num_samples: u32, seed: u64) -> Result<()> {
        self.host.gather(range, num_samples, seed)
    }

    fn begin_albedo(&mut self) -> Result<()> {
        self.host.begin_albedo()
    }

    fn camera_sums(&self, camera: &Camera) -> Result<SumImage> {
        self.host.camera_sums(camera)
    }

    fn state(&self) -> Result<ParameterState> {
        self.host.state()
    }
}
