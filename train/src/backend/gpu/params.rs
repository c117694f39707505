//! Raw parameters and their moments on the device, which [`crate::params::ParameterState::step`]
//! moves on the host: the same formulas in single precision.

use super::kernels;
use super::report::Report;
use crate::error::Result;
use crate::params::{
    Adam, BadGradient, Learned, Lights, NUM_PARAMETERS, ParameterState, Raw, StepSizes,
};
use eagpt_scene::harmonics::NUM_COEFFICIENTS;
use eagpt_trace::gpu::kernel::{Buffer, Layout, Pass, groups, layout};
use eagpt_trace::gpu::{Device, Frame, GpuScene, Reading};
use glam::Vec3;
use std::sync::Arc;

/// One step's constants.
#[derive(Debug, Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(super) struct AdamParameters {
    sizes: [[f32; 4]; 5],
    /// Of each coefficient of one channel.
    harmonics: [[f32; 4]; 2],
    /// Centre of the camera.
    eye: [f32; 3],
    harmonics_decay: f32,
    correction_1: f32,
    correction_2: f32,
    harmonics_correction_1: f32,
    harmonics_correction_2: f32,
    /// Those that the kernels are about, the first ones; what is fixed is behind them.
    num_gaussians: u32,
    padding: u32,
    more_padding: [u32; 2],
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
            padding: "u32",
            more_padding: "vec2u",
        })
    }
}

/// [`Learned`] on a device, `[n, K]` each.
#[derive(Debug)]
struct ResidentRows<const K: usize> {
    values: Buffer,
    first: Buffer,
    second: Buffer,
    num_steps: u32,
}

fn bytes<const K: usize>(rows: &[[f32; K]]) -> Vec<u8> {
    bytemuck::cast_slice(rows.as_flattened()).to_vec()
}

impl<const K: usize> ResidentRows<K> {
    /// Brings the moments of `rows` to the device, which has their `values`.
    fn new(device: &Device, rows: &Learned<K>, values: Buffer) -> Result<Self> {
        Ok(Self {
            values,
            first: device.upload("first moments", &bytes(&rows.first))?,
            second: device.upload("second moments", &bytes(&rows.second))?,
            num_steps: rows.num_steps,
        })
    }

    /// Read back.
    fn learned(&self, device: &Device, num_rows: usize) -> Result<Learned<K>> {
        let rows = |buffer: &Buffer| device.read::<[f32; K]>(buffer, 0..num_rows);
        Ok(Learned {
            values: rows(&self.values)?,
            first: rows(&self.first)?,
            second: rows(&self.second)?,
            num_steps: self.num_steps,
        })
    }
}

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
}

impl ResidentState {
    /// Brings `state` to the device, where `fit` has its Gaussians. They are put there again as
    /// steps put them: what a run goes on with has the bits of what it stopped with.
    pub(super) fn new(
        device: &Arc<Device>,
        state: &ParameterState,
        fit: &GpuScene,
    ) -> Result<Self> {
        let values = device.upload("parameters", &bytes(&state.raw.values))?;
        let harmonics = fit.harmonics().cloned();
        let harmonics = harmonics.map(|values| ResidentRows::new(device, &state.harmonics, values));
        let size = (size_of::<Raw>() * state.len()) as u64;
        let resident = Self {
            raw: ResidentRows::new(device, &state.raw, values)?,
            raw_gradients: device.buffer("gradients by parameters", size)?,
            harmonics: harmonics.transpose()?,
            report: device.buffer("report", size_of::<Report>() as u64)?,
            num_gaussians: state.len(),
            num_fixed: state.num_fixed,
            device: Arc::clone(device),
        };
        let parameters = AdamParameters {
            num_gaussians: resident.num_gaussians as u32,
            ..bytemuck::Zeroable::zeroed()
        };
        let buffers = [
            &device.uniform("Adam", &parameters),
            &resident.raw.values,
            fit.surfels(),
            fit.attributes(),
        ];
        let each_gaussian = groups(resident.num_gaussians as u32);
        device.run(&[device.pass(&kernels::ACTIVATE, &buffers, each_gaussian)])?;
        Ok(resident)
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

    /// After a step that moved nothing: `num_steps` as they were before it.
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
        let parameters = AdamParameters {
            sizes: std::array::from_fn(|k| rows[k]),
            harmonics: std::array::from_fn(|k| std::array::from_fn(|l| of_functions[4 * k + l][0])),
            eye: eye.to_array(),
            harmonics_decay: sizes.harmonics_decay,
            correction_1: adam.correction_1,
            correction_2: adam.correction_2,
            harmonics_correction_1: of_harmonics.correction_1,
            harmonics_correction_2: of_harmonics.correction_2,
            num_gaussians: sizes.num_moving(self.num_gaussians, self.num_fixed) as u32,
            ..bytemuck::Zeroable::zeroed()
        };
        let parameters = &self.device.uniform("Adam", &parameters);
        let (device, report, gradients) = (&self.device, &self.report, &self.raw_gradients);
        let (surfels, attributes, counters) = (fit.surfels(), fit.attributes(), &frame.counters);
        let each_gaussian = groups(self.num_gaussians as u32);
        let mut passes = Vec::with_capacity(3);
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
            passes.push(device.pass(&kernels::HARMONICS_STEP, &buffers, each_gaussian));
        }
        let buffers = [
            parameters, values, first, second, gradients, report, surfels, attributes, counters,
        ];
        passes.push(device.pass(&kernels::ADAM_STEP, &buffers, each_gaussian));
        passes
    }

    /// The report of the step that was submitted last, when it is done.
    pub(super) fn read_report(&self) -> Result<Reading<Report>> {
        Ok(self.device.read_later(&self.report, 0..1)?)
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
            lights: Lights::default(),
        })
    }
}
