//! An open device: what it can do, its memory, its kernels, and what went wrong with it.

use super::adapter::{self, Adapter, Kind};
use super::error::{GpuError, one_line};
use super::wgsl;
use std::collections::HashMap;
use std::ops::Range;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use wgpu::util::DeviceExt as _;

/// Which device is meant.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Wanted {
    /// The first that is no program on the processor.
    Hardware,
    /// The first there is, programs on the processor included.
    Any,
    /// The one at this place of [`super::adapters`].
    Index(usize),
    /// The first whose name contains this, in any case.
    Name(String),
}

/// What kernels may count on, detected once. Kernels keep to [`Tier::BASELINE`], which is what WebGPU guarantees; what a device offers beyond
/// makes buffers larger, and tells where faster ways are open.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Tier {
    /// Largest binding of a storage buffer, bytes.
    pub max_binding: u64,
    /// Largest buffer, bytes.
    pub max_buffer: u64,
    /// Storage buffers that a kernel may have.
    pub max_storage_buffers: u32,
    /// Whether 32-bit floats are added atomically.
    pub has_float_atomics: bool,
    /// Whether invocations of a subgroup see each other's values.
    pub has_subgroups: bool,
    /// Whether kernels can be timed.
    pub has_timestamps: bool,
}

impl Tier {
    /// What every device has.
    pub const BASELINE: Self = Self {
        max_binding: 128 << 20,
        max_buffer: 256 << 20,
        max_storage_buffers: 8,
        has_float_atomics: false,
        has_subgroups: false,
        has_timestamps: false,
    };

    fn of(adapter: &Adapter) -> Self {
        Self {
            max_binding: adapter.max_binding,
            max_buffer: adapter.max_buffer,
            max_storage_buffers: adapter.max_storage_buffers,
            has_float_atomics: adapter.has_float_atomics,
            has_subgroups: adapter.subgroups.is_some(),
            has_timestamps: adapter.has_timestamps,
        }
    }

    /// Bytes that one buffer may have and be bound whole.
    pub fn max_bytes(&self) -> u64 {
        self.max_binding.min(self.max_buffer)
    }
}

/// Workgroups along the first dimension of a dispatch; WebGPU allows 65,535.
const MAX_GROUPS_X: u32 = 32_768;

/// Bytes of the largest thing that buffers are arrays of, or more.
const LARGEST_ELEMENT: u64 = 128;

/// Steps that are handed to the driver at once.
const STEPS_PER_SUBMISSION: usize = 32;

/// Time in which the thread that has waited for the device tells others what it knows: that it is there.
const MAPPED_WITHIN: Duration = Duration::from_secs(60);

/// A device that computes. Cheap to share behind an [`Arc`].
#[derive(Debug)]
pub struct Device {
    adapter: Adapter,
    tier: Tier,
    device: wgpu::Device,
    queue: wgpu::Queue,
    failure: Arc<Mutex<Option<GpuError>>>,
    kernels: Mutex<HashMap<(&'static str, &'static str), wgpu::ComputePipeline>>,
}

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
    pub(super) fn record(&self, commands: &mut wgpu::CommandEncoder) {
        if self.groups == 0 {
            return;
        }
        let mut pass = commands.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some(self.label),
            timestamp_writes: None,
        });
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &self.buffers, &[]);
        let x = self.groups.min(MAX_GROUPS_X);
        pass.dispatch_workgroups(x, self.groups.div_ceil(x), 1);
    }
}

impl Device {
    /// Opens a device with all the memory limits it has, and [`Tier::BASELINE`] otherwise.
    ///
    /// # Errors
    /// [`GpuError::NotFound`] if it does not exist, [`GpuError::Open`] if its driver refuses.
    pub fn open(wanted: &Wanted) -> Result<Arc<Self>, GpuError> {
        Self::open_one(wanted).map(Arc::new)
    }

    /// The same with smaller buffers than the device could have.
    #[cfg(test)]
    pub(super) fn open_limited(wanted: &Wanted, max_bytes: u64) -> Result<Arc<Self>, GpuError> {
        let mut device = Self::open_one(wanted)?;
        device.tier.max_binding = max_bytes;
        Ok(Arc::new(device))
    }

    fn open_one(wanted: &Wanted) -> Result<Self, GpuError> {
        let mut found = adapter::found();
        let described: Vec<Adapter> = found.iter().map(adapter::describe).collect();
        let at = choose(wanted, &described)?;
        Self::open_adapter(&found.swap_remove(at), described[at].clone())
    }

    fn open_adapter(adapter: &wgpu::Adapter, described: Adapter) -> Result<Self, GpuError> {
        let tier = Tier::of(&described);
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("eagpt"),
            required_limits: wgpu::Limits {
                max_storage_buffer_binding_size: tier.max_binding,
                max_buffer_size: tier.max_buffer,
                ..wgpu::Limits::defaults()
            },
            ..Default::default()
        };
        let opened = pollster::block_on(adapter.request_device(&descriptor));
        let (device, queue) = opened.map_err(|error| GpuError::Open {
            device: described.name.clone(),
            problem: one_line(&error.to_string()),
        })?;
        let failure = Arc::new(Mutex::new(None));
        let (name, noted) = (described.name.clone(), Arc::clone(&failure));
        device.on_uncaptured_error(Arc::new(move |error| {
            note(&noted, failure_of(&name, &error));
        }));
        let (name, noted) = (described.name.clone(), Arc::clone(&failure));
        device.set_device_lost_callback(move |reason, problem| {
            if reason != wgpu::DeviceLostReason::Destroyed {
                let (device, problem) = (name.clone(), one_line(&problem));
                note(&noted, GpuError::Lost { device, problem });
            }
        });
        Ok(Self {
            adapter: described,
            tier,
            device,
            queue,
            failure,
            kernels: Mutex::default(),
        })
    }

    /// What it is.
    pub fn adapter(&self) -> &Adapter {
        &self.adapter
    }

    /// What it can do.
    pub fn tier(&self) -> &Tier {
        &self.tier
    }

    /// A buffer that kernels use, all zeros.
    ///
    /// # Errors
    /// [`GpuError::Limit`] if it is larger than buffers may be, or if the device gives up.
    pub fn buffer(&self, what: &'static str, size: u64) -> Result<wgpu::Buffer, GpuError> {
        // No binding may be smaller than one element, and no element is larger than this.
        let size = size.max(LARGEST_ELEMENT).next_multiple_of(4);
        let limit = self.tier.max_bytes();
        if size > limit {
            return Err(GpuError::Limit {
                device: self.adapter.name.clone(),
                what: what.to_owned(),
                needed: size,
                limit,
            });
        }
        let buffer = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(what),
            size,
            usage: wgpu::BufferUsages::STORAGE
                | wgpu::BufferUsages::COPY_SRC
                | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        self.check()?;
        Ok(buffer)
    }

    /// A buffer with `content`.
    ///
    /// # Errors
    /// As [`Self::buffer`].
    pub fn upload(&self, what: &'static str, content: &[u8]) -> Result<wgpu::Buffer, GpuError> {
        let buffer = self.buffer(what, content.len() as u64)?;
        self.queue.write_buffer(&buffer, 0, content);
        Ok(buffer)
    }

    /// Replaces the start of a buffer. Work submitted before sees the old content, work submitted from now on the new.
    pub fn write(&self, buffer: &wgpu::Buffer, content: &[u8]) {
        self.queue.write_buffer(buffer, 0, content);
    }

    /// Parameters of kernels.
    pub fn uniform<T: bytemuck::Pod>(&self, what: &'static str, content: &T) -> wgpu::Buffer {
        self.device
            .create_buffer_init(&wgpu::util::BufferInitDescriptor {
                label: Some(what),
                contents: bytemuck::bytes_of(content),
                usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            })
    }

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

    /// Runs steps one after the other, a few in each submission: what takes long is not one long piece to the driver.
    ///
    /// # Errors
    /// What went wrong so far.
    pub fn run(&self, steps: &[Step]) -> Result<(), GpuError> {
        for some in steps.chunks(STEPS_PER_SUBMISSION) {
            let mut commands = self.commands();
            for step in some {
                step.record(&mut commands);
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
        let waited = self.device.poll(wgpu::PollType::wait_indefinitely());
        self.check()?;
        waited.map_err(|error| self.lost(&error.to_string()))?;
        Ok(())
    }

    /// Elements of a buffer, after all work submitted so far.
    ///
    /// # Errors
    /// If the device gives up.
    pub fn read<T: bytemuck::AnyBitPattern>(
        &self,
        buffer: &wgpu::Buffer,
        elements: Range<usize>,
    ) -> Result<Vec<T>, GpuError> {
        let size = (elements.len() * size_of::<T>()) as u64;
        if size == 0 {
            return Ok(Vec::new());
        }
        let staging = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("readback"),
            size,
            usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        self.check()?;
        let mut commands = self.commands();
        let start = (elements.start * size_of::<T>()) as u64;
        commands.copy_buffer_to_buffer(buffer, start, &staging, 0, size);
        self.submit(commands)?;
        let (sender, mapped) = std::sync::mpsc::channel();
        staging.map_async(wgpu::MapMode::Read, .., move |outcome| {
            // Nobody listens after the time below.
            sender.send(outcome).ok();
        });
        self.wait()?;
        // Of two threads that wait at once, one is told of both buffers, and the other may be through before it passes that on.
        match mapped.recv_timeout(MAPPED_WITHIN) {
            Ok(Ok(())) => {}
            Ok(Err(error)) => return Err(self.lost(&error.to_string())),
            Err(_) => return Err(self.lost("a buffer was not mapped")),
        }
        let view = staging
            .get_mapped_range(..)
            .map_err(|error| self.lost(&error.to_string()))?;
        // Bytes of a mapping need not be aligned as T is.
        Ok(view
            .chunks_exact(size_of::<T>())
            .map(bytemuck::pod_read_unaligned)
            .collect())
    }

    /// What went wrong since the device was opened.
    pub(super) fn check(&self) -> Result<(), GpuError> {
        match &*lock(&self.failure) {
            Some(failure) => Err(failure.clone()),
            None => Ok(()),
        }
    }

    fn lost(&self, problem: &str) -> GpuError {
        GpuError::Lost {
            device: self.adapter.name.clone(),
            problem: one_line(problem),
        }
    }
}

/// A lock whose holder panicked guards nothing that could be half-done here.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The first failure is the one that others follow from.
fn note(failure: &Mutex<Option<GpuError>>, error: GpuError) {
    lock(failure).get_or_insert(error);
}

fn failure_of(device: &str, error: &wgpu::Error) -> GpuError {
    let (device, problem) = (device.to_owned(), one_line(&error.to_string()));
    match error {
        wgpu::Error::OutOfMemory { .. } => GpuError::OutOfMemory { device, problem },
        wgpu::Error::Internal { .. } => GpuError::Lost { device, problem },
        wgpu::Error::Validation { .. } => GpuError::Rejected { device, problem },
    }
}

fn choose(wanted: &Wanted, found: &[Adapter]) -> Result<usize, GpuError> {
    let at = match wanted {
        Wanted::Hardware => found.iter().position(|a| a.kind != Kind::Software),
        Wanted::Any => (!found.is_empty()).then_some(0),
        Wanted::Index(index) => (*index < found.len()).then_some(*index),
        Wanted::Name(name) => found
            .iter()
            .position(|a| a.name.to_lowercase().contains(&name.to_lowercase())),
    };
    at.ok_or_else(|| GpuError::NotFound {
        wanted: match wanted {
            Wanted::Hardware => "gpu".to_owned(),
            Wanted::Any => "any".to_owned(),
            Wanted::Index(index) => format!("number {index}"),
            Wanted::Name(name) => name.clone(),
        },
        found: match found {
            [] => "none".to_owned(),
            _ => {
                let names: Vec<&str> = found.iter().map(|a| a.name.as_str()).collect();
                names.join(", ")
            }
        },
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn adapter(name: &str, kind: Kind) -> Adapter {
        Adapter {
            name: name.to_owned(),
            kind,
            backend: "vulkan".to_owned(),
            driver: String::new(),
            max_binding: 128 << 20,
            max_buffer: 256 << 20,
            max_storage_buffers: 8,
            subgroups: None,
            has_float_atomics: false,
            has_timestamps: false,
        }
    }

    #[test]
    fn devices_are_chosen_by_place_name_and_kind() {
        let found = [
            adapter("llvmpipe (LLVM)", Kind::Software),
            adapter("Radeon 780M", Kind::Integrated),
        ];
        assert_eq!(choose(&Wanted::Hardware, &found), Ok(1));
        assert_eq!(choose(&Wanted::Any, &found), Ok(0));
        assert_eq!(choose(&Wanted::Index(1), &found), Ok(1));
        assert_eq!(choose(&Wanted::Name("LLVMPipe".to_owned()), &found), Ok(0));
        let missing = choose(&Wanted::Index(2), &found).unwrap_err();
        assert_eq!(
            missing.to_string(),
            "device number 2: not found; there is llvmpipe (LLVM), Radeon 780M"
        );
        let none = choose(&Wanted::Hardware, &found[..1]).unwrap_err();
        assert_eq!(
            none.to_string(),
            "device gpu: not found; there is llvmpipe (LLVM)"
        );
    }
}
