//! Training on the CPU.

use super::trainer::{Engine, Trainer};
use crate::error::Result;
use crate::params::ParameterState;
use eagpt_scene::Camera;
use eagpt_trace::blend::LocalGradient;
use eagpt_trace::cpu::camera::{self, CameraRecord, HitSearch, Keep};
use eagpt_trace::sums::{SumImage, Sums};
use eagpt_trace::surfel::SurfelSet;
use glam::Vec2;

/// The rays of the CPU engine.
pub struct CpuEngine;

/// Training on the CPU, with all threads of the current rayon pool.
pub type CpuBackend = Trainer<CpuEngine>;

impl CpuBackend {
    /// A backend that starts from `state`; prepared images may take `target_budget` bytes.
    pub fn new(state: ParameterState, target_budget: usize) -> Self {
        Self::with_engine(state, target_budget, CpuEngine)
    }
}

impl Engine for CpuEngine {
    type Record = CameraRecord;

    fn device(&self) -> String {
        "cpu".to_owned()
    }

    fn update(&mut self, _: &SurfelSet) -> Result<()> {
        Ok(())
    }

    fn trace(&self, set: &SurfelSet, camera: &Camera) -> Result<(SumImage, CameraRecord)> {
        Ok(camera::trace(set, camera, HitSearch::Tiles, Keep::Record))
    }

    fn adjoint(
        &self,
        set: &SurfelSet,
        scales: &[Vec2],
        record: &CameraRecord,
        d_sums: &[Sums],
    ) -> Result<Vec<LocalGradient>> {
        Ok(record.adjoint(set, scales, d_sums))
    }

    fn camera_sums(&self, set: &SurfelSet, camera: &Camera) -> Result<SumImage> {
        Ok(camera::trace(set, camera, HitSearch::Tiles, Keep::Nothing).0)
    }
}
