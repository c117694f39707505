//! A step before and while the device takes it.

use super::loss::LossOptions;
use super::report::Report;
use super::target::TargetView;
use crate::backend::step::TrainingView;
use crate::loss::NormalTerms;
use crate::options::{AlbedoOptions, LossWeights};
use crate::params::StepSizes;
use eagpt_trace::CameraRays;
use eagpt_trace::gpu::kernel::Buffer;
use eagpt_trace::gpu::{Capacity, Reading};

/// A step of a stage, to be taken once or more.
#[derive(Debug, Clone)]
pub(super) struct StepTask {
    pub(super) iteration: u32,
    pub(super) view: TrainingView,
    /// The view on the device.
    pub(super) target: TargetView,
    pub(super) rays: CameraRays,
    pub(super) sizes: StepSizes,
    pub(super) loss: StepLoss,
}

/// The loss of a step.
#[derive(Debug, Clone)]
pub(super) enum StepLoss {
    /// Stage 0.
    Radiance {
        weights: LossWeights,
        normals: NormalTerms,
    },
    /// Stage 1, under light that is known.
    Albedo {
        options: AlbedoOptions,
        ssim_share: f64,
        seed: u64,
        lit: Buffer,
    },
}

impl StepTask {
    pub(super) fn loss_options(&self) -> LossOptions {
        match &self.loss {
            StepLoss::Radiance { weights, normals } => LossOptions {
                weights: *weights,
                normals: *normals,
                antialias: self.rays.split().is_some(),
                lit: None,
            },
            StepLoss::Albedo {
                ssim_share, lit, ..
            } => LossOptions {
                weights: LossWeights {
                    color: 1.0,
                    ssim_share: *ssim_share,
                    normal: 0.0,
                    depth_normal: 0.0,
                    emission: 0.0,
                    alpha: 0.0,
                    depth: 0.0,
                },
                normals: NormalTerms::Off,
                antialias: false,
                lit: Some(lit.clone()),
            },
        }
    }
}

/// A step that the device has been given.
#[derive(Debug)]
pub(super) struct PendingStep {
    pub(super) task: StepTask,
    pub(super) options: LossOptions,
    /// Capacities of the buffers of its rays.
    pub(super) capacity: Capacity,
    /// Steps of the parameters and of the harmonics of its light before it.
    pub(super) num_steps: [u32; 2],
    pub(super) report: Reading<Report>,
}
