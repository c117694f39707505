//! Memory of a device: buffers, what is written to them, and what is read back.

use super::{Commands, Device};
use crate::gpu::error::GpuError;
use std::marker::PhantomData;
use std::ops::Range;
use std::sync::mpsc::Receiver;
use std::time::Duration;
use wgpu::util::DeviceExt as _;

/// Bytes of the largest thing that buffers are arrays of, or more.
const LARGEST_ELEMENT: u64 = 128;

/// Time in which the thread that has waited for the device passes on to others that it is done.
const MAPPED_WITHIN: Duration = Duration::from_secs(60);

impl Device {
    /// A buffer that kernels use, all zeros.
    ///
    /// # Errors
    /// [`GpuError::Limit`] if it is larger than buffers may be, or if the device fails.
    pub fn buffer(&self, what: &'static str, size: u64) -> Result<wgpu::Buffer, GpuError> {
        // No binding may be smaller than one element, and no element is larger than this.
        let size = size.max(LARGEST_ELEMENT).next_multiple_of(4);
        let limit = self.max_bytes;
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

    /// Replaces the start of a buffer. Work submitted before sees the old content, work submitted
    /// from now on the new.
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

    /// Elements of a buffer, after all work submitted so far; waits for it.
    ///
    /// # Errors
    /// If the device fails.
    pub fn read<T: bytemuck::AnyBitPattern>(
        &self,
        buffer: &wgpu::Buffer,
        elements: Range<usize>,
    ) -> Result<Vec<T>, GpuError> {
        if elements.is_empty() {
            return Ok(Vec::new());
        }
        self.submit_and_read(self.commands(), buffer, elements)?
            .wait(self)
    }

    /// Hands `commands` to the device and returns at once with elements of a buffer as they are
    /// then, for later, when that is done. There must be some.
    ///
    /// # Errors
    /// The first failure so far.
    pub fn submit_and_read<T: bytemuck::AnyBitPattern>(
        &self,
        mut commands: Commands,
        buffer: &wgpu::Buffer,
        elements: Range<usize>,
    ) -> Result<Reading<T>, GpuError> {
        let size = (elements.len() * size_of::<T>()) as u64;
        let staging = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("readback"),
            size,
            usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        self.check()?;
        let start = (elements.start * size_of::<T>()) as u64;
        commands.copy_buffer_to_buffer(buffer, start, &staging, 0, size);
        let submission = self.queue.submit([commands.finish()]);
        self.check()?;
        let (sender, mapped) = std::sync::mpsc::channel();
        staging.map_async(wgpu::MapMode::Read, .., move |outcome| {
            // Nobody listens after the time below.
            sender.send(outcome).ok();
        });
        Ok(Reading {
            staging,
            submission,
            mapped,
            elements: PhantomData,
        })
    }
}

/// A copy on its way from a device to the host.
#[derive(Debug)]
pub struct Reading<T> {
    staging: wgpu::Buffer,
    submission: wgpu::SubmissionIndex,
    mapped: Receiver<Result<(), wgpu::BufferAsyncError>>,
    elements: PhantomData<T>,
}

impl<T: bytemuck::AnyBitPattern> Reading<T> {
    /// The elements; waits for the work they come from, not for what was submitted since.
    ///
    /// # Errors
    /// If the `device`, from which they are read, fails.
    pub fn wait(self, device: &Device) -> Result<Vec<T>, GpuError> {
        device.wait_for(self.submission)?;
        // Of two threads that wait at once, one is told of both buffers, and the other may be
        // through before it passes that on.
        match self.mapped.recv_timeout(MAPPED_WITHIN) {
            Ok(Ok(())) => {}
            Ok(Err(error)) => return Err(device.lost(&error.to_string())),
            Err(_) => return Err(device.lost("a buffer was not mapped")),
        }
        let view = self
            .staging
            .get_mapped_range(..)
            .map_err(|error| device.lost(&error.to_string()))?;
        // Bytes of a mapping need not be aligned as T is.
        Ok(view
            .chunks_exact(size_of::<T>())
            .map(bytemuck::pod_read_unaligned)
            .collect())
    }
}
