//! What single rays need of a scene on the device.

use super::Emitter;
use crate::gpu::bvh::Trees;
use crate::gpu::device::Device;
use crate::gpu::error::GpuError;
use crate::surfel::{Surfel, SurfelSet};
use crate::transport::lights::Lights;

impl Trees {
    /// Adds the tree of `emitters`; see [`Self::add`].
    pub(in crate::gpu) fn add_emitters(&mut self, emitters: &[Emitter]) -> u32 {
        let surfels: Vec<Surfel> = emitters.iter().map(|emitter| emitter.surfel).collect();
        self.add(&surfels)
    }
}

/// What single rays need of a scene.
#[derive(Debug)]
pub(in crate::gpu) struct LightBuffers {
    pub(in crate::gpu) nodes: wgpu::Buffer,
    pub(in crate::gpu) leaf_indices: wgpu::Buffer,
    pub(super) emitters: wgpu::Buffer,
    pub(super) num_emitters: u32,
    pub(super) scene_root: u32,
    pub(super) light_root: u32,
}

impl LightBuffers {
    pub(in crate::gpu) fn new(
        device: &Device,
        set: &SurfelSet,
        lights: Option<&Lights>,
    ) -> Result<Self, GpuError> {
        let emitters = Emitter::all(lights);
        let mut trees = Trees::default();
        let scene_root = trees.add(&set.surfels);
        let light_root = trees.add_emitters(&emitters);
        Ok(Self {
            nodes: device.upload("nodes", bytemuck::cast_slice(&trees.nodes))?,
            leaf_indices: device.upload("leaves", bytemuck::cast_slice(&trees.leaf_indices))?,
            emitters: device.upload("emitters", bytemuck::cast_slice(&emitters))?,
            num_emitters: emitters.len() as u32,
            scene_root,
            light_root,
        })
    }
}
