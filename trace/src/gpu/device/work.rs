//! Work of a device: passes and their submission.

use super::{Device, lock};
use crate::gpu::error::GpuError;
use crate::gpu::kernels::Kernel;

/// Workgroups along the first dimension of a dispatch; WebGPU allows 65,535.
const MAX_GROUPS_X: u32 = 32_768;

/// Passes that are handed to the driver at once.
const PASSES_PER_SUBMISSION: usize = 32;

/// Work that is recorded for one submission.
pub type Commands = wgpu::CommandEncoder;

/// A kernel with its buffers: recorded once, run as often as needed.
#[derive(Debug, Clone)]
pub struct Pass {
    label: &'static str,
    pipeline: wgpu::ComputePipeline,
    buffers: wgpu::BindGroup,
    groups: u32,
}

impl Pass {
    fn dispatch(&self, into: &mut wgpu::ComputePass<'_>) {
        into.set_pipeline(&self.pipeline);
        into.set_bind_group(0, &self.buffers, &[]);
        let x = self.groups.min(MAX_GROUPS_X);
        into.dispatch_workgroups(x, self.groups.div_ceil(x), 1);
    }
}

impl Device {
    /// `kernel` on `buffers`, in the order of its bindings, in `groups` workgroups.
    pub fn pass(&self, kernel: &'static Kernel, buffers: &[&wgpu::Buffer], groups: u32) -> Pass {
        let pipeline = self.pipeline(kernel);
        let entries: Vec<wgpu::BindGroupEntry<'_>> = (kernel.bindings.iter())
            .zip(buffers)
            .map(|(binding, buffer)| wgpu::BindGroupEntry {
                binding: binding.number,
                resource: buffer.as_entire_binding(),
            })
            .collect();
        let buffers = self.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(kernel.entry),
            layout: &pipeline.get_bind_group_layout(0),
            entries: &entries,
        });
        Pass {
            label: kernel.entry,
            pipeline,
            buffers,
            groups,
        }
    }

    /// Compiles a kernel, once.
    fn pipeline(&self, kernel: &'static Kernel) -> wgpu::ComputePipeline {
        let mut pipelines = lock(&self.pipelines);
        let key = (kernel.file, kernel.entry, kernel.defines);
        let pipeline = pipelines.entry(key).or_insert_with(|| {
            let source = kernel.source().expect("a test follows all imports");
            let shader = self
                .device
                .create_shader_module(wgpu::ShaderModuleDescriptor {
                    label: Some(kernel.file),
                    source: wgpu::ShaderSource::Wgsl(source.into()),
                });
            self.device
                .create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                    label: Some(kernel.entry),
                    layout: None,
                    module: &shader,
                    entry_point: Some(kernel.entry),
                    compilation_options: wgpu::PipelineCompilationOptions {
                        // Kernels write before they read.
                        zero_initialize_workgroup_memory: false,
                        ..Default::default()
                    },
                    cache: None,
                })
        });
        pipeline.clone()
    }

    /// New commands.
    pub fn commands(&self) -> Commands {
        self.device.create_command_encoder(&Default::default())
    }

    /// Appends `passes` to `commands`. Each sees what earlier ones have written.
    pub fn record(&self, passes: &[Pass], commands: &mut Commands) {
        let mut passes = passes.iter().filter(|pass| pass.groups > 0).peekable();
        if passes.peek().is_none() {
            return;
        }
        let mut recording = lock(&self.recording);
        let Some(recording) = &mut *recording else {
            let mut all = commands.begin_compute_pass(&Default::default());
            passes.for_each(|pass| pass.dispatch(&mut all));
            return;
        };
        // Timestamps stand between what wgpu calls passes.
        for pass in passes {
            let mut timed = commands.begin_compute_pass(&wgpu::ComputePassDescriptor {
                label: Some(pass.label),
                timestamp_writes: recording.time(pass.label),
            });
            pass.dispatch(&mut timed);
        }
    }

    /// Hands commands to the device and returns at once.
    ///
    /// # Errors
    /// The first failure so far.
    pub fn submit(&self, commands: Commands) -> Result<(), GpuError> {
        self.queue.submit([commands.finish()]);
        self.check()
    }

    /// Runs passes one after the other, a few in each submission: long work is not one long piece
    /// to the driver.
    ///
    /// # Errors
    /// The first failure so far.
    pub fn run(&self, passes: &[Pass]) -> Result<(), GpuError> {
        for some in passes.chunks(PASSES_PER_SUBMISSION) {
            let mut commands = self.commands();
            self.record(some, &mut commands);
            self.submit(commands)?;
        }
        Ok(())
    }

    /// Waits until all work is done.
    ///
    /// # Errors
    /// The first failure so far.
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
