//! Training on the CPU.

use super::step::{AlbedoStep, Backend, RadianceStep, Taken, TrainingView};
use super::trainer::{HostParameters, Trainer};
use crate::densify::Densified;
use crate::error::Result;
use crate::params::ParameterState;
use eagpt_scene::{Camera, SceneEdit};
use eagpt_trace::Tracer as _;
use eagpt_trace::cpu::CpuScene;
use eagpt_trace::features::GBuffer;
use eagpt_trace::transport::matrix::Receiver;
use glam::Vec3;
use std::ops::Range;

/// Training on the CPU, with all threads of the current rayon pool.
pub(crate) struct CpuBackend {
    parameters: HostParameters,
    trainer: Trainer<CpuScene>,
}

impl CpuBackend {
    /// A backend that starts from `state`; prepared images may take `target_budget` bytes.
    pub(crate) fn new(state: ParameterState, target_budget: usize) -> Self {
        let parameters = HostParameters::new(state);
        let scene = CpuScene::new(&parameters.gaussians);
        Self {
            parameters,
            trainer: Trainer::new(scene, target_budget),
        }
    }
}

impl Backend for CpuBackend {
    fn show_light(&mut self, light: usize) -> Result<()> {
        self.trainer.show_light(&mut self.parameters, light)
    }

    fn begin_harmonics(&mut self) -> Result<()> {
        self.trainer.begin_harmonics(&mut self.parameters)
    }

    fn radiance_step(
        &mut self,
        view: &TrainingView,
        step: &RadianceStep<'_>,
    ) -> Result<Vec<Taken>> {
        let taken = (self.trainer).radiance_step(&mut self.parameters, view, step)?;
        Ok(vec![taken])
    }

    fn albedo_step(&mut self, view: &TrainingView, step: &AlbedoStep<'_>) -> Result<Vec<Taken>> {
        let taken = (self.trainer).albedo_step(&mut self.parameters, view, step)?;
        Ok(vec![taken])
    }

    fn finish(&mut self) -> Result<Vec<Taken>> {
        Ok(Vec::new())
    }

    fn attribute(&mut self, view: &TrainingView) -> Result<()> {
        self.trainer.attribute(&self.parameters, view)
    }

    fn densify(&mut self, target: usize) -> Result<Densified> {
        self.trainer.densify(&mut self.parameters, target)
    }

    fn edit(&mut self, edit: &SceneEdit, radiances: &[Vec<Option<Vec3>>]) -> Result<()> {
        self.trainer.edit(&mut self.parameters, edit, radiances)
    }

    fn mark_emitting(&mut self, emitting: &[Vec<(usize, bool)>]) -> Result<()> {
        (self.trainer).mark_emitting(&mut self.parameters, emitting)
    }

    fn brighten(&mut self, factors: &[(usize, f32)]) -> Result<()> {
        self.trainer.brighten(&mut self.parameters, factors)
    }

    fn begin_gathering(&mut self, cameras: &[Camera]) -> Result<usize> {
        self.trainer.begin_gathering(&self.parameters, cameras)
    }

    fn gather(&mut self, range: Range<usize>, num_samples: u32, seed: u64) -> Result<()> {
        (self.trainer).gather(&self.parameters, range, num_samples, seed)
    }

    fn gathered(&self, light: usize) -> Vec<(Receiver, Vec3)> {
        self.trainer.gathered(light)
    }

    fn begin_albedo(&mut self, shares: &[Vec<f32>]) -> Result<()> {
        self.trainer.begin_albedo(&mut self.parameters, shares)
    }

    fn gbuffer(&mut self, camera: &Camera) -> Result<GBuffer> {
        Ok(self.trainer.scene.gbuffer(camera)?)
    }

    fn state(&mut self) -> Result<ParameterState> {
        Ok(self.parameters.state.clone())
    }
}
