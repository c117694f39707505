//! The devices of this machine.

use serde::Serialize;

/// A device, not opened.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Adapter {
    /// Its name.
    pub name: String,
    /// Its kind.
    pub kind: AdapterKind,
    /// Interface of its driver: `vulkan`, `metal`, `dx12`.
    pub backend: String,
    /// Name and version of the driver.
    pub driver: String,
    /// Largest binding of a storage buffer, bytes.
    pub max_binding: u64,
    /// Largest buffer, bytes.
    pub max_buffer: u64,
    /// Storage buffers that a kernel may have.
    pub max_storage_buffers: u32,
    /// Sizes of a subgroup, smallest and largest; `None` without subgroups.
    pub subgroups: Option<[u32; 2]>,
    /// Whether 32-bit floats are added atomically.
    pub has_float_atomics: bool,
    /// Whether kernels can be timed.
    pub has_timestamps: bool,
}

/// Kind of a device.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum AdapterKind {
    /// A GPU with memory of its own.
    Discrete,
    /// A GPU that shares the processor's memory.
    Integrated,
    /// A GPU of a virtual machine.
    Virtual,
    /// A software adapter, which computes on the processor: good for tests, slower than the CPU
    /// engine.
    Software,
    /// Something else.
    Other,
}

/// All devices, in the order in which wgpu finds them; none where no driver is installed.
pub fn adapters() -> Vec<Adapter> {
    found().iter().map(describe).collect()
}

/// All devices as wgpu has them.
pub(super) fn found() -> Vec<wgpu::Adapter> {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    pollster::block_on(instance.enumerate_adapters(wgpu::Backends::PRIMARY))
}

pub(super) fn describe(adapter: &wgpu::Adapter) -> Adapter {
    let (info, limits, features) = (adapter.get_info(), adapter.limits(), adapter.features());
    let driver = [info.driver.trim(), info.driver_info.trim()];
    let driver: Vec<&str> = driver.into_iter().filter(|text| !text.is_empty()).collect();
    Adapter {
        name: info.name,
        kind: match info.device_type {
            wgpu::DeviceType::DiscreteGpu => AdapterKind::Discrete,
            wgpu::DeviceType::IntegratedGpu => AdapterKind::Integrated,
            wgpu::DeviceType::VirtualGpu => AdapterKind::Virtual,
            wgpu::DeviceType::Cpu => AdapterKind::Software,
            wgpu::DeviceType::Other => AdapterKind::Other,
        },
        backend: info.backend.to_string(),
        driver: driver.join(" "),
        max_binding: limits.max_storage_buffer_binding_size,
        max_buffer: limits.max_buffer_size,
        max_storage_buffers: limits.max_storage_buffers_per_shader_stage,
        subgroups: features
            .contains(wgpu::Features::SUBGROUP)
            .then_some([info.subgroup_min_size, info.subgroup_max_size]),
        has_float_atomics: features.contains(wgpu::Features::SHADER_FLOAT32_ATOMIC),
        has_timestamps: features.contains(wgpu::Features::TIMESTAMP_QUERY),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whatever there is: a machine without a driver has none, and that is no error.
    #[test]
    fn devices_are_told_with_limits_that_kernels_can_live_with() {
        let found = adapters();
        if found.is_empty() {
            eprintln!(
                "skipped: limits of devices: no adapter (Debian: apt-get install mesa-vulkan-drivers)"
            );
        }
        for adapter in found {
            // Guaranteed by WebGPU.
            assert!(adapter.max_binding >= 128 << 20, "{adapter:?}");
            assert!(adapter.max_buffer >= adapter.max_binding, "{adapter:?}");
            assert!(adapter.max_storage_buffers >= 8, "{adapter:?}");
            assert!(!adapter.name.is_empty(), "{adapter:?}");
        }
    }
}
