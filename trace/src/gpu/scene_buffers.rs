//! Prepared Gaussians in the memory of a device.

use super::declarations::light::gloss_rows;
use super::device::Device;
use super::error::GpuError;
use crate::attributes::Attributes;
use crate::features::NUM_LANES;
use crate::surfel::{Surfel, SurfelSet};
use eagpt_scene::Harmonics;

/// Prepared Gaussians in the memory of a device.
#[derive(Debug)]
pub(super) struct SceneBuffers {
    /// [`Surfel`], `[n]`.
    pub(super) surfels: wgpu::Buffer,
    /// [`Attributes`], `[n]`.
    pub(super) attributes: wgpu::Buffer,
    /// Coefficients of [`eagpt_scene::Harmonics`], `[n, 24]`, where radiance differs with the
    /// direction.
    pub(super) harmonics: Option<wgpu::Buffer>,
    /// F0 and roughness, `[n, 4]`, where anything is glossy.
    pub(super) glosses: Option<wgpu::Buffer>,
    num_surfels: u32,
}

impl SceneBuffers {
    pub(super) fn new(device: &Device, set: &SurfelSet) -> Result<Self, GpuError> {
        let limit = device.max_bytes();
        let num_surfels = u32::try_from(set.len()).map_err(|_| GpuError::Limit {
            device: device.adapter().name.clone(),
            what: "Gaussians".to_owned(),
            needed: (set.len() * size_of::<Surfel>()) as u64,
            limit,
        })?;
        let size = |one: usize| (set.len() * one) as u64;
        let buffers = Self {
            surfels: device.buffer("Gaussians", size(size_of::<Surfel>()))?,
            attributes: device.buffer("attributes", size(size_of::<Attributes>()))?,
            harmonics: match set.harmonics.is_empty() {
                true => None,
                false => Some(device.buffer("harmonics", size(size_of::<Harmonics>()))?),
            },
            glosses: match set.gloss.is_empty() {
                true => None,
                false => Some(device.buffer("gloss", size(size_of::<[f32; 4]>()))?),
            },
            num_surfels,
        };
        buffers.write(device, set);
        Ok(buffers)
    }

    /// Whether the buffers have the size of `set`.
    pub(super) fn fit(&self, set: &SurfelSet) -> bool {
        set.len() == self.num_surfels as usize
            && set.harmonics.is_empty() == self.harmonics.is_none()
            && set.gloss.is_empty() == self.glosses.is_none()
    }

    /// Replaces the Gaussians by others that fit.
    pub(super) fn write(&self, device: &Device, set: &SurfelSet) {
        let lanes: Vec<[f32; NUM_LANES]> = set
            .attributes
            .iter()
            .map(|attributes| attributes.0)
            .collect();
        device.write(&self.surfels, bytemuck::cast_slice(&set.surfels));
        device.write(&self.attributes, bytemuck::cast_slice(&lanes));
        if let Some(harmonics) = &self.harmonics {
            device.write(harmonics, bytemuck::cast_slice(&set.harmonics));
        }
        if let Some(glosses) = &self.glosses {
            device.write(glosses, bytemuck::cast_slice(&gloss_rows(&set.gloss)));
        }
    }

    /// Number of Gaussians.
    pub(super) fn num_surfels(&self) -> u32 {
        self.num_surfels
    }
}
