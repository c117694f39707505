//! Training on the CPU.

use super::TrainDevice;
use super::engine::Engine;
use super::trainer::Trainer;
use crate::error::Result;
use crate::params::ParameterState;
use eagpt_scene::{Camera, Gaussians};
use eagpt_trace::Tracer;
use eagpt_trace::blend::{Contribution, LocalGradient, PixelValue};
use eagpt_trace::cpu::camera::{self, HitSearch, Keep};
use eagpt_trace::cpu::weights::BlendWeights;
use eagpt_trace::cpu::{CameraRecord, GradientMask};
use eagpt_trace::features::{Features, GBuffer};
use eagpt_trace::surfel::SurfelSet;

/// The rays of the CPU engine.
#[derive(Default)]
pub struct CpuEngine {
    /// Of the view that was traced last: memory for the next.
    record: CameraRecord,
}

/// Training on the CPU, with all threads of the current rayon pool.
pub type CpuBackend = Trainer<CpuEngine>;

impl CpuBackend {
    /// A backend that starts from `state`; prepared images may take `target_budget` bytes.
    pub fn new(state: ParameterState, target_budget: usize) -> Self {
        Self::with_engine(state, target_budget, CpuEngine::default())
    }
}

impl Engine for CpuEngine {
    fn device(&self) -> String {
        TrainDevice::Cpu.name()
    }

    fn update(&mut self, _: &SurfelSet) -> Result<()> {
        Ok(())
    }

    fn trace(&mut self, set: &SurfelSet, camera: &Camera) -> Result<GBuffer> {
        Ok(self
            .record
            .trace(set, camera, HitSearch::Tiles, Keep::Record))
    }

    fn adjoint(
        &mut self,
        set: &SurfelSet,
        _: &Camera,
        d_features: &[Features],
        wanted: GradientMask,
    ) -> Result<Vec<LocalGradient>> {
        Ok(self.record.adjoint(set, d_features, wanted))
    }

    fn contributions(
        &mut self,
        set: &SurfelSet,
        camera: &Camera,
        value: PixelValue<'_>,
    ) -> Result<Vec<Contribution>> {
        self.trace(set, camera)?;
        Ok(self.record.contributions(value))
    }

    fn weights(&self, least: f32) -> Option<BlendWeights> {
        Some(self.record.weights(least))
    }

    fn gbuffer(&self, set: &SurfelSet, camera: &Camera) -> Result<GBuffer> {
        Ok(camera::trace(set, camera, HitSearch::Tiles, Keep::Nothing).0)
    }

    fn tracer(&self, gaussians: &Gaussians) -> Result<Box<dyn Tracer>> {
        TrainDevice::Cpu.tracer(gaussians)
    }
}
