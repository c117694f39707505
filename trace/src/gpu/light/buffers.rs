//! Trees of a scene on the device, for single rays.

use crate::gpu::bvh::Trees;
use crate::gpu::declarations::light::Emitter;
use crate::gpu::device::Device;
use crate::gpu::error::GpuError;
use crate::surfel::Surfel;
use crate::transport::lights::Lights;

/// The tree of a scene, and its emitters with theirs.
#[derive(Debug)]
pub(in crate::gpu) struct TreeBuffers {
    pub(in crate::gpu) nodes: wgpu::Buffer,
    pub(in crate::gpu) leaf_indices: wgpu::Buffer,
    pub(in crate::gpu) emitters: wgpu::Buffer,
    pub(in crate::gpu) num_emitters: u32,
    pub(in crate::gpu) scene_root: u32,
    pub(in crate::gpu) light_root: u32,
}

impl TreeBuffers {
    /// Builds the trees of `surfels` and of what emits among `lights`.
    pub(in crate::gpu) fn new(
        device: &Device,
        surfels: &[Surfel],
        lights: Option<&Lights>,
    ) -> Result<Self, GpuError> {
        let emitters = Emitter::all(lights);
        let emitting: Vec<Surfel> = emitters.iter().map(|emitter| emitter.surfel).collect();
        let mut trees = Trees::default();
        let scene_root = trees.add(surfels);
        let light_root = trees.add(&emitting);
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
