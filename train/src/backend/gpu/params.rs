//! Raw parameters and their moments on the device, which [`crate::params::ParameterState::step`]
//! moves on the host: the same formulas in single precision.

use super::kernels;
use super::lights::ResidentLights;
use super::report::Report;
use super::rows::ResidentRows;
use super::structures::AdamParameters;
use crate::error::Result;
use crate::params::{Adam, BadGradient, NUM_PARAMETERS, ParameterState, Raw, StepSizes};
use eagpt_scene::harmonics::{NUM_COEFFICIENTS, NUM_FUNCTIONS};
use eagpt_trace::gpu::kernel::{Buffer, Commands, Pass, groups};
use eagpt_trace::gpu::{Device, Frame, GpuScene, Reading};
use glam::Vec3;
use std::sync::Arc;

/// The state of an optimisation on a device.
#[derive(Debug)]
pub(super) struct ResidentState {
    device: Arc<Device>,
    raw: ResidentRows<NUM_PARAMETERS>,
    raw_gradients: Buffer,
    /// Coefficients are traced as they are: their values are those of the scene.
    harmonics: Option<ResidentRows<NUM_COEFFICIENTS>>,
    report: Buffer,
    num_gaussians: usize,
    /// See [`ParameterState::num_fixed`].
    num_fixed: usize,
    lights: ResidentLights,
}

impl ResidentState {
    /// Brings `state` to the device, where `fit` has its Gaussians. They are put there again as
    /// steps put them: what a run goes on with has the bits of what it stopped with.
    pub(super) fn new(
        device: &Arc<Device>,
        state: &ParameterState,
        fit: &GpuScene,
    ) -> Result<Self> {
        let harmonics = fit.harmonics().cloned();
        let harmonics = harmonics.map(|values| ResidentRows::new(device, &state.harmonics, values));
        let size = (size_of::<Raw>() * state.len()) as u64;
        let resident = Self {
            raw: ResidentRows::upload(device, &state.raw)?,
            raw_gradients: device.buffer("gradients by parameters", size)?,
            harmonics: harmonics.transpose()?,
            report: device.buffer("report", size_of::<Report>() as u64)?,
            num_gaussians: state.len(),
            num_fixed: state.num_fixed,
            lights: ResidentLights::new(device, &state.lights)?,
            device: Arc::clone(device),
        };
        device.run(&[resident.activate(fit)])?;
        Ok(resident)
    }

    /// Puts the Gaussians of the raw values into `fit`.
    fn activate(&self, fit: &GpuScene) -> Pass {
        let parameters = AdamParameters {
            num_gaussians: self.num_gaussians as u32,
            ..bytemuck::Zeroable::zeroed()
        };
        self.activate_by(&self.device.uniform("Adam", &parameters), fit)
    }

    fn activate_by(&self, parameters: &Buffer, fit: &GpuScene) -> Pass {
        let buffers = [
            parameters,
            &self.raw.values,
            fit.surfels(),
            fit.attributes(),
        ];
        let each_gaussian = groups(self.num_gaussians as u32);
        (self.device).pass(&kernels::ACTIVATE, &buffers, each_gaussian)
    }

    /// Index of the light whose values are current.
    pub(super) fn light(&self) -> usize {
        self.lights.current
    }

    /// Puts the values of another light in the place of the current ones, and into `fit`; nothing
    /// waits, and a step that fails before it makes no difference.
    pub(super) fn show_light(&mut self, light: usize, fit: &GpuScene) -> Result<()> {
        let current = (&self.raw, self.harmonics.as_mut());
        let device = &self.device;
        let mut passes = (self.lights).show(device, light, self.num_gaussians, current);
        if !passes.is_empty() {
            passes.push(self.activate(fit));
        }
        Ok(self.device.run(&passes)?)
    }

    /// The numbers that the host reads after a step.
    pub(super) fn report(&self) -> &Buffer {
        &self.report
    }

    /// Empties the report, before the first kernel of a step.
    pub(super) fn begin(&self) {
        let empty = bytemuck::bytes_of(&Report::EMPTY);
        self.device.write(&self.report, empty);
    }

    /// After a step in the current light that moved nothing: `num_steps` as they were before it.
    pub(super) fn go_back(&mut self, [raw, of_harmonics]: [u32; 2]) {
        self.raw.num_steps = raw;
        if let Some(harmonics) = &mut self.harmonics {
            harmonics.num_steps = of_harmonics;
        }
    }

    /// Steps of the parameters and of the harmonics so far.
    pub(super) fn num_steps(&self) -> [u32; 2] {
        let of_harmonics = self.harmonics.as_ref().map_or(0, |rows| rows.num_steps);
        [self.raw.num_steps, of_harmonics]
    }

    /// Counts a step of `sizes` that was given to the device.
    pub(super) fn count(&mut self, sizes: &StepSizes) {
        self.raw.num_steps += 1;
        if let Some(harmonics) = self.harmonics.as_mut().filter(|_| sizes.move_harmonics()) {
            harmonics.num_steps += 1;
        }
    }

    /// The passes of a step along the gradients of `frame`, which was traced from `eye`; it moves
    /// the Gaussians of `fit`.
    pub(super) fn passes(
        &self,
        fit: &GpuScene,
        (frame, eye): (&Frame, Vec3),
        sizes: &StepSizes,
    ) -> Vec<Pass> {
        // Steps are the same for all channels.
        let (of_functions, _) = sizes.harmonics.as_chunks::<3>();
        let mut padded = [0.0; 20];
        padded[..NUM_PARAMETERS].copy_from_slice(&sizes.raw);
        let adam = Adam::new(self.raw.num_steps + 1);
        let moving = self.harmonics.as_ref().filter(|_| sizes.move_harmonics());
        let of_harmonics = Adam::new(moving.map_or(0, |h| h.num_steps) + 1);
        let (rows, _) = padded.as_chunks();
        let first_fixed = sizes.num_moving(self.num_gaussians, self.num_fixed);
        let num_moving = match self.lights.num() {
            1 => first_fixed,
            _ => self.num_gaussians,
        };
        let parameters = AdamParameters {
            sizes: std::array::from_fn(|k| rows[k]),
            harmonics: std::array::from_fn(|k| std::array::from_fn(|l| of_functions[4 * k + l][0])),
            eye: eye.to_array(),
            harmonics_decay: sizes.harmonics_decay,
            correction_1: adam.correction_1,
            correction_2: adam.correction_2,
            harmonics_correction_1: of_harmonics.correction_1,
            harmonics_correction_2: of_harmonics.correction_2,
            num_gaussians: num_moving as u32,
            first_fixed: first_fixed as u32,
            ..bytemuck::Zeroable::zeroed()
        };
        let parameters = &self.device.uniform("Adam", &parameters);
        let (device, report, gradients) = (&self.device, &self.report, &self.raw_gradients);
        let (surfels, counters) = (fit.surfels(), &frame.counters);
        let each_gaussian = groups(self.num_gaussians as u32);
        let mut passes = Vec::with_capacity(4);
        // From gradients in the frame of each Gaussian to those by the raw parameters.
        let ResidentRows {
            values,
            first,
            second,
            ..
        } = &self.raw;
        let seen = &frame.attributes;
        let buffers = [
            parameters,
            values,
            &frame.gradients,
            gradients,
            report,
            seen,
            counters,
        ];
        passes.push(device.pass(&kernels::CHAIN_RULE, &buffers, each_gaussian));
        // Before the Gaussians move: directions are those they were seen from.
        if let Some(ResidentRows {
            values,
            first,
            second,
            ..
        }) = moving
        {
            let buffers = [
                parameters, values, first, second, gradients, report, surfels, counters,
            ];
            let each_function = groups((num_moving * NUM_FUNCTIONS) as u32);
            passes.push(device.pass(&kernels::HARMONICS_STEP, &buffers, each_function));
        }
        let buffers = [
            parameters, values, first, second, gradients, report, counters,
        ];
        // The report is written where nothing moves, too.
        let each_parameter = groups((num_moving * NUM_PARAMETERS).max(1) as u32);
        passes.push(device.pass(&kernels::ADAM_STEP, &buffers, each_parameter));
        passes.push(self.activate_by(parameters, fit));
        passes
    }

    /// Hands a step to the device; its report, when it is done.
    pub(super) fn submit(&self, step: Commands) -> Result<Reading<Report>> {
        Ok(self.device.submit_and_read(step, &self.report, 0..1)?)
    }

    /// The first gradient of the step of `report` that is not finite: nothing moved then.
    pub(super) fn bad_gradient(&self, report: &Report) -> Result<Option<BadGradient>> {
        let Some(index) = report.first_bad() else {
            return Ok(None);
        };
        let rows = self
            .device
            .read::<Raw>(&self.raw_gradients, index..index + 1)?;
        let bad = rows.first().and_then(|row| BadGradient::find(index, row));
        // The kernel has found it by the sum of the row.
        Ok(Some(bad.unwrap_or(BadGradient {
            class: "all parameters",
            index,
            value: f32::INFINITY,
        })))
    }

    /// The state, read back.
    pub(super) fn state(&self) -> Result<ParameterState> {
        let (device, num) = (&*self.device, self.num_gaussians);
        let harmonics = self.harmonics.as_ref();
        let harmonics = harmonics
            .map(|rows| rows.learned(device, num))
            .transpose()?;
        Ok(ParameterState {
            raw: self.raw.learned(device, num)?,
            harmonics: harmonics.unwrap_or_default(),
            num_fixed: self.num_fixed,
            lights: self.lights.lights(device, num)?,
        })
    }
}
