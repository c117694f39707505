//! Work of a device: kernels, steps and their submission.

use super::{Device, lock};
use crate::gpu::error::GpuError;
use crate::gpu::wgsl;

/// Workgroups along the first dimension of a dispatch; WebGPU allows 65,535.
const MAX_GROUPS_X: u32 = 32_768;

/// Steps that are handed to the driver at once.
const STEPS_PER_SUBMISSION: usize = 32;

/// A kernel with its buffers: recorded once, run as often as needed.
#[derive(Debug, Clone)]
pub struct Step {
    label: &'static str,
    pipeline: wgpu::ComputePipeline,
    buffers: wgpu::BindGroup,
    groups: u32,
}

impl Step {
    /// Appends the step to `commands`. Steps see what earlier ones have written.
    pub(in crate::gpu) fn record(&self, device: &Device, commands: &mut wgpu::CommandEncoder) {
        if self.groups == 0 {
            return;
        }
        let mut recording = lock(&device.recording);
        let timestamps = recording.as_mut().and_then(|some| some.time(self.label));
        let mut pass = commands.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some(self.label),
            timestamp_writes: timestamps,
        });
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &self.buffers, &[]);
        let x = self.groups.min(MAX_GROUPS_X);
        pass.dispatch_workgroups(x, self.groups.div_ceil(x), 1);
    }
}

impl Device {
    /// Entry point `entry` of `module` on `buffers`, binding by binding, in `groups` workgroups.
    pub fn step(
        &self,
        module: &'static wgsl::Module,
        entry: &'static str,
        buffers: &[(u32, &wgpu::Buffer)],
        groups: u32,
    ) -> Step {
        let pipeline = self.kernel(module, entry);
        let entries: Vec<wgpu::BindGroupEntry<'_>> = buffers
            .iter()
            .map(|&(binding, buffer)| wgpu::BindGroupEntry {
                binding,
                resource: buffer.as_entire_binding(),
            })
            .collect();
        let buffers = self.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(entry),
            layout: &pipeline.get_bind_group_layout(0),
            entries: &entries,
        });
        Step {
            label: entry,
            pipeline,
            buffers,
            groups,
        }
    }

    /// Compiles a kernel, once.
    fn kernel(&self, module: &'static wgsl::Module, entry: &'static str) -> wgpu::ComputePipeline {
        let mut kernels = lock(&self.kernels);
        let kernel = kernels.entry((module.name, entry)).or_insert_with(|| {
            let shader = self
                .device
                .create_shader_module(wgpu::ShaderModuleDescriptor {
                    label: Some(module.name),
                    source: wgpu::ShaderSource::Wgsl(module.source().into()),
                });
            self.device
                .create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                    label: Some(entry),
                    layout: None,
                    module: &shader,
                    entry_point: Some(entry),
                    compilation_options: wgpu::PipelineCompilationOptions {
                        // Kernels write before they read.
                        zero_initialize_workgroup_memory: false,
                        ..Default::default()
                    },
                    cache: None,
                })
        });
        kernel.clone()
    }

    /// New commands.
    pub fn commands(&self) -> wgpu::CommandEncoder {
        self.device.create_command_encoder(&Default::default())
    }

    /// Hands commands to the device and returns at once.
    ///
    /// # Errors
    /// What went wrong so far.
    pub fn submit(&self, commands: wgpu::CommandEncoder) -> Result<(), GpuError> {
        self.queue.submit([commands.finish()]);
        self.check()
    }

    /// Runs steps one after the other, a few in each submission: what takes long is not one long
    /// piece to the driver.
    ///
    /// # Errors
    /// What went wrong so far.
    pub fn run(&self, steps: &[Step]) -> Result<(), GpuError> {
        for some in steps.chunks(STEPS_PER_SUBMISSION) {
            let mut commands = self.commands();
            for step in some {
                step.record(self, &mut commands);
            }
            self.submit(commands)?;
        }
        Ok(())
    }

    /// Waits until all work is done.
    ///
    /// # Errors
    /// What went wrong so far.
    pub fn wait(&self) -> Result<(), GpuError> {
        self.poll(wgpu::PollType::wait_indefinitely())
    }

    /// Waits until a submission and those before it are done.
    pub(super) fn wait_for(&self, submission: wgpu::SubmissionIndex) -> Result<(), GpuError> {
        self.poll(wgpu::PollType::Wait {
            submission_index: Some(submission),
            timeout: None,
        })
    }

    fn poll(&self, until: wgpu::PollType) -> Result<(), GpuError> {
        let waited = self.device.poll(until);
        self.check()?;
        waited.map_err(|error| self.lost(&error.to_string()))?;
        Ok(())
    }
}
