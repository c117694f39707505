//! Raw parameters and their moments on the device: the twin of [`crate::params::ParameterState::step`].

use super::kernels;
use super::report::{self, Report};
use crate::error::Result;
use crate::params::{Adam, BadGradient, Learned, NUM_PARAMETERS, ParameterState, Raw, StepSizes};
use eagpt_trace::gpu::kernel::{Buffer, Layout, Step, layout};
use eagpt_trace::gpu::{Device, Frame, GpuFit};
use glam::Vec3;
use std::sync::Arc;

/// One step's constants.
#[derive(Debug, Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(super) struct AdamParameters {
    sizes: [[f32; 4]; 5],
    /// Of each coefficient of one channel.
    harmonics: [[f32; 4]; 2],
    /// What the camera looks from.
    eye: [f32; 3],
    harmonics_decay: f32,
    correction_1: f32,
    correction_2: f32,
    harmonics_correction_1: f32,
    harmonics_correction_2: f32,
    num_gaussians: u32,
    /// Room for entries and chunks: with more of them, gradients are worth nothing.
    entries: u32,
    chunks: u32,
    padding: u32,
}

impl AdamParameters {
    pub(super) fn layout() -> Layout {
        layout!(AdamParameters {
            sizes: "array<vec4f, 5>",
            harmonics: "array<vec4f, 2>",
            eye: "vec3f",
            harmonics_decay: "f32",
            correction_1: "f32",
            correction_2: "f32",
            harmonics_correction_1: "f32",
            harmonics_correction_2: "f32",
            num_gaussians: "u32",
            entries: "u32",
            chunks: "u32",
            padding: "u32",
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
    harmonics: Option<ResidentHarmonics>,
    report: Buffer,
    num_gaussians: usize,
    num_steps: u32,
}

/// Coefficients on a device, which are traced as they are, and their moments, `[n, 24]` each.
#[derive(Debug)]
struct ResidentHarmonics {
    values: Buffer,
    first: Buffer,
    second: Buffer,
    num_steps: u32,
}

fn bytes<const K: usize>(rows: &[[f32; K]]) -> Vec<u8> {
    bytemuck::cast_slice(rows.as_flattened()).to_vec()
}

impl ResidentState {
    /// Brings `state` to the device, where `fit` has its Gaussians.
    pub(super) fn new(device: &Arc<Device>, state: &ParameterState, fit: &GpuFit) -> Result<Self> {
        let harmonics = match fit.harmonics() {
            None => None,
            Some(values) => Some(ResidentHarmonics {
                values: values.clone(),
                first: device.upload("first moments", &bytes(&state.harmonics.first))?,
                second: device.upload("second moments", &bytes(&state.harmonics.second))?,
                num_steps: state.harmonics.num_steps,
            }),
        };
        let size = (size_of::<Raw>() * state.len()) as u64;
        Ok(Self {
            values: device.upload("parameters", &bytes(&state.raw.values))?,
            first: device.upload("first moments", &bytes(&state.raw.first))?,
            second: device.upload("second moments", &bytes(&state.raw.second))?,
            raw_gradients: device.buffer("gradients by parameters", size)?,
            harmonics,
            report: device.buffer("report", 4 * report::NUM_WORDS as u64)?,
            num_gaussians: state.len(),
            num_steps: state.raw.num_steps,
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

    /// The kernels of a step along the gradients of `frame`, which was traced from `eye`; it moves the Gaussians of `fit`.
    pub(super) fn steps(
        &self,
        fit: &GpuFit,
        (frame, eye): (&Frame, Vec3),
        sizes: &StepSizes,
    ) -> Vec<Step> {
        // Steps are the same for all channels.
        let (of_functions, _) = sizes.harmonics.as_chunks::<3>();
        let mut padded = [0.0; 20];
        padded[..NUM_PARAMETERS].copy_from_slice(&sizes.raw);
        let adam = Adam::new(self.num_steps + 1);
        let moving = self.harmonics.as_ref().filter(|_| sizes.move_harmonics());
        let of_harmonics = Adam::new(moving.map_or(0, |h| h.num_steps) + 1);
        let (rows, _) = padded.as_chunks();
        let parameters = AdamParameters {
            sizes: std::array::from_fn(|k| rows[k]),
            harmonics: std::array::from_fn(|k| std::array::from_fn(|l| of_functions[4 * k + l][0])),
            eye: eye.to_array(),
            harmonics_decay: sizes.harmonics_decay,
            correction_1: adam.correction_1,
            correction_2: adam.correction_2,
            harmonics_correction_1: of_harmonics.correction_1,
            harmonics_correction_2: of_harmonics.correction_2,
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
            (8, &frame.payloads),
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
        let step = |entry, buffers: &[(u32, &Buffer)]| {
            self.device.step(&kernels::PARAMS, entry, buffers, groups)
        };
        let mut steps = vec![step("chain_rule", &chain)];
        if let Some(harmonics) = moving {
            // Before the Gaussians move: directions are those they were seen from.
            let buffers = [
                (0, &parameters),
                (1, &harmonics.values),
                (2, &harmonics.first),
                (3, &harmonics.second),
                (5, &self.raw_gradients),
                (6, &self.report),
                (7, fit.surfels()),
                (9, &frame.totals),
            ];
            steps.push(step("harmonics_step", &buffers));
        }
        steps.push(step("adam_step", &adam));
        steps
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

    /// Notes that the step of `sizes` was taken, or says why the device has not taken it.
    pub(super) fn finish(
        &mut self,
        report: &Report,
        sizes: &StepSizes,
    ) -> Result<std::result::Result<(), BadGradient>> {
        let Some(index) = report.first_bad() else {
            self.num_steps += 1;
            if let Some(harmonics) = self.harmonics.as_mut().filter(|_| sizes.move_harmonics()) {
                harmonics.num_steps += 1;
            }
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

    fn read<const K: usize>(&self, buffers: [&Buffer; 3], num_steps: u32) -> Result<Learned<K>> {
        let rows = |buffer: &Buffer| self.device.read::<[f32; K]>(buffer, 0..self.num_gaussians);
        let [values, first, second] = buffers;
        Ok(Learned {
            values: rows(values)?,
            first: rows(first)?,
            second: rows(second)?,
            num_steps,
        })
    }

    /// The state, read back.
    pub(super) fn state(&self) -> Result<ParameterState> {
        Ok(ParameterState {
            raw: self.read([&self.values, &self.first, &self.second], self.num_steps)?,
            harmonics: match &self.harmonics {
                None => Learned::default(),
                Some(h) => self.read([&h.values, &h.first, &h.second], h.num_steps)?,
            },
        })
    }
}
