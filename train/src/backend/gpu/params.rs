//! Raw parameters and their moments on the device: the twin of [`crate::params::ParameterState::step`].

use super::kernels;
use super::report::{self, Report};
use crate::error::Result;
use crate::params::{Adam, BadGradient, NUM_PARAMETERS, ParameterState, Raw, StepSizes};
use eagpt_trace::gpu::kernel::{Buffer, Layout, Step, layout};
use eagpt_trace::gpu::{Device, Frame, GpuFit};
use std::sync::Arc;

/// One step's constants.
#[derive(Debug, Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(super) struct AdamParameters {
    sizes: [[f32; 4]; 5],
    correction_1: f32,
    correction_2: f32,
    num_gaussians: u32,
    /// Room for entries and chunks: with more of them, gradients are worth nothing.
    entries: u32,
    chunks: u32,
    padding_a: u32,
    padding_b: u32,
    padding_c: u32,
}

impl AdamParameters {
    pub(super) fn layout() -> Layout {
        layout!(AdamParameters {
            sizes: "array<vec4f, 5>",
            correction_1: "f32",
            correction_2: "f32",
            num_gaussians: "u32",
            entries: "u32",
            chunks: "u32",
            padding_a: "u32",
            padding_b: "u32",
            padding_c: "u32",
        })
    }
}

/// The state of an optimisation on a device.
#[derive(Debug)]
pub(super) struct ResidentState {
    device: Arc<Device>,
    /// `[n, 17]` each.
    values: Buffer,
    first: Buffer,
    second: Buffer,
    raw_gradients: Buffer,
    report: Buffer,
    num_gaussians: usize,
    num_steps: u32,
}

impl ResidentState {
    /// Brings `state` to the device.
    pub(super) fn new(device: &Arc<Device>, state: &ParameterState) -> Result<Self> {
        let bytes = |rows: &[Raw]| bytemuck::cast_slice(rows.as_flattened()).to_vec();
        let size = (size_of::<Raw>() * state.len()) as u64;
        Ok(Self {
            values: device.upload("parameters", &bytes(&state.values))?,
            first: device.upload("first moments", &bytes(&state.first))?,
            second: device.upload("second moments", &bytes(&state.second))?,
            raw_gradients: device.buffer("gradients by parameters", size)?,
            report: device.buffer("report", 4 * report::NUM_WORDS as u64)?,
            num_gaussians: state.len(),
            num_steps: state.num_steps,
            device: Arc::clone(device),
        })
    }

    /// Where kernels leave what the host reads after a step.
    pub(super) fn report(&self) -> &Buffer {
        &self.report
    }

    /// Empties the report, before the first kernel of a step.
    pub(super) fn begin(&self) {
        self.device
            .write(&self.report, bytemuck::cast_slice(&report::EMPTY));
    }

    /// The kernels of a step along the gradients of `frame`, which moves the Gaussians of `fit`.
    pub(super) fn steps(&self, fit: &GpuFit, frame: &Frame, sizes: &StepSizes) -> Vec<Step> {
        let mut padded = [0.0; 20];
        padded[..NUM_PARAMETERS].copy_from_slice(&sizes.0);
        let adam = Adam::new(*sizes, self.num_steps + 1);
        let (rows, _) = padded.as_chunks();
        let parameters = AdamParameters {
            sizes: std::array::from_fn(|k| rows[k]),
            correction_1: adam.correction_1,
            correction_2: adam.correction_2,
            num_gaussians: self.num_gaussians as u32,
            entries: frame.room.entries,
            chunks: frame.room.chunks,
            ..bytemuck::Zeroable::zeroed()
        };
        let parameters = self.device.uniform("Adam", &parameters);
        let groups = (self.num_gaussians as u32).div_ceil(64);
        let chain = [
            (0, &parameters),
            (1, &self.values),
            (4, &frame.gradients),
            (5, &self.raw_gradients),
            (6, &self.report),
        ];
        let adam = [
            (0, &parameters),
            (1, &self.values),
            (2, &self.first),
            (3, &self.second),
            (5, &self.raw_gradients),
            (6, &self.report),
            (7, fit.surfels()),
            (8, fit.payloads()),
            (9, &frame.totals),
        ];
        [("chain_rule", &chain[..]), ("adam_step", &adam[..])]
            .map(|(entry, buffers)| self.device.step(&kernels::PARAMS, entry, buffers, groups))
            .to_vec()
    }

    /// The report of the step that was submitted last; waits for it.
    pub(super) fn read_report(&self) -> Result<Report> {
        let words = self
            .device
            .read::<u32>(&self.report, 0..report::NUM_WORDS)?;
        let mut all = report::EMPTY;
        all.copy_from_slice(&words);
        Ok(Report(all))
    }

    /// Notes that the step was taken, or says why the device has not taken it.
    pub(super) fn finish(
        &mut self,
        report: &Report,
    ) -> Result<std::result::Result<(), BadGradient>> {
        let Some(index) = report.first_bad() else {
            self.num_steps += 1;
            return Ok(Ok(()));
        };
        let rows = self
            .device
            .read::<Raw>(&self.raw_gradients, index..index + 1)?;
        let bad = rows.first().and_then(|row| BadGradient::find(index, row));
        // The kernel has found it by the sum of the row.
        Ok(Err(bad.unwrap_or(BadGradient {
            class: "all parameters",
            index,
            value: f32::INFINITY,
        })))
    }

    /// The state, read back.
    pub(super) fn state(&self) -> Result<ParameterState> {
        let read = |buffer: &Buffer| -> Result<Vec<Raw>> {
            Ok(self.device.read::<Raw>(buffer, 0..self.num_gaussians)?)
        };
        Ok(ParameterState {
            values: read(&self.values)?,
            first: read(&self.first)?,
            second: read(&self.second)?,
            num_steps: self.num_steps,
        })
    }
}
