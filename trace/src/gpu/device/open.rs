//! Opening devices.

use super::{Device, note};
use crate::gpu::adapter::{self, Adapter, AdapterKind};
use crate::gpu::error::{GpuError, one_line};
use crate::selector::DeviceSelector;
use std::sync::{Arc, Mutex};

impl Device {
    /// Opens a device with all the memory limits it has, and what WebGPU guarantees otherwise.
    ///
    /// # Errors
    /// [`GpuError::NotFound`] if it does not exist, [`GpuError::Open`] if its driver refuses.
    pub fn open(selector: &DeviceSelector) -> Result<Arc<Self>, GpuError> {
        Self::open_one(selector).map(Arc::new)
    }

    /// The same with smaller buffers than the device could have.
    #[cfg(test)]
    pub(in crate::gpu) fn open_limited(
        selector: &DeviceSelector,
        max_bytes: u64,
    ) -> Result<Arc<Self>, GpuError> {
        let mut device = Self::open_one(selector)?;
        device.max_bytes = max_bytes;
        Ok(Arc::new(device))
    }

    fn open_one(selector: &DeviceSelector) -> Result<Self, GpuError> {
        let mut found = adapter::found();
        let described: Vec<Adapter> = found.iter().map(adapter::describe).collect();
        let at = choose(selector, &described)?;
        Self::open_adapter(&found.swap_remove(at), described[at].clone())
    }

    fn open_adapter(adapter: &wgpu::Adapter, described: Adapter) -> Result<Self, GpuError> {
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("eagpt"),
            required_features: adapter.features() & wgpu::Features::TIMESTAMP_QUERY,
            required_limits: wgpu::Limits {
                max_storage_buffer_binding_size: described.max_binding,
                max_buffer_size: described.max_buffer,
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
            max_bytes: described.max_binding.min(described.max_buffer),
            adapter: described,
            device,
            queue,
            failure,
            pipelines: Mutex::default(),
            recording: Mutex::default(),
        })
    }
}

fn failure_of(device: &str, error: &wgpu::Error) -> GpuError {
    let (device, problem) = (device.to_owned(), one_line(&error.to_string()));
    match error {
        wgpu::Error::OutOfMemory { .. } => GpuError::OutOfMemory { device, problem },
        wgpu::Error::Internal { .. } => GpuError::Lost { device, problem },
        wgpu::Error::Validation { .. } => GpuError::Rejected { device, problem },
    }
}

fn choose(selector: &DeviceSelector, found: &[Adapter]) -> Result<usize, GpuError> {
    let hardware = || found.iter().position(|a| a.kind != AdapterKind::Software);
    let any = (!found.is_empty()).then_some(0);
    let at = match selector {
        DeviceSelector::Cpu => None,
        DeviceSelector::Auto => hardware(),
        DeviceSelector::Gpu => hardware().or(any),
        DeviceSelector::Index(index) => (*index < found.len()).then_some(*index),
        DeviceSelector::Name(name) => found
            .iter()
            .position(|a| a.name.to_lowercase().contains(&name.to_lowercase())),
    };
    at.ok_or_else(|| GpuError::NotFound {
        wanted: match selector {
            DeviceSelector::Auto => "gpu".to_owned(),
            DeviceSelector::Index(index) => format!("number {index}"),
            DeviceSelector::Name(name) => name.clone(),
            selector => selector.to_string(),
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

    fn adapter(name: &str, kind: AdapterKind) -> Adapter {
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
            adapter("llvmpipe (LLVM)", AdapterKind::Software),
            adapter("Radeon 780M", AdapterKind::Integrated),
        ];
        assert_eq!(choose(&DeviceSelector::Auto, &found), Ok(1));
        assert_eq!(choose(&DeviceSelector::Gpu, &found), Ok(1));
        assert_eq!(choose(&DeviceSelector::Gpu, &found[..1]), Ok(0));
        assert_eq!(choose(&DeviceSelector::Index(1), &found), Ok(1));
        assert_eq!(
            choose(&DeviceSelector::Name("LLVMPipe".to_owned()), &found),
            Ok(0)
        );
        let missing = choose(&DeviceSelector::Index(2), &found).unwrap_err();
        assert_eq!(
            missing.to_string(),
            "device number 2: not found; there is llvmpipe (LLVM), Radeon 780M"
        );
        let none = choose(&DeviceSelector::Auto, &found[..1]).unwrap_err();
        assert_eq!(
            none.to_string(),
            "device gpu: not found; there is llvmpipe (LLVM)"
        );
    }
}
