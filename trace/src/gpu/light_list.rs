//! The list of emitters that light samples of the transport matrix choose from, on the device.

use super::bvh::Trees;
use super::declarations::matrix::{LightCluster, LightDisc};
use super::device::Device;
use super::error::GpuError;
use crate::surfel::Surfel;
use crate::transport::light_list::{LightList, MAX_CLUSTERS};
use bytemuck::Zeroable as _;

/// The tree of a scene, and its emitters with theirs.
#[derive(Debug)]
pub(super) struct LightListBuffers {
    pub(super) nodes: wgpu::Buffer,
    pub(super) leaf_indices: wgpu::Buffer,
    pub(super) discs: wgpu::Buffer,
    /// A uniform, [`MAX_CLUSTERS`].
    pub(super) clusters: wgpu::Buffer,
    pub(super) num_clusters: u32,
    pub(super) scene_root: u32,
    pub(super) light_root: u32,
}

impl LightListBuffers {
    /// Builds the trees of `surfels` and of what emits among `lights`.
    pub(super) fn new(
        device: &Device,
        surfels: &[Surfel],
        lights: Option<&LightList>,
    ) -> Result<Self, GpuError> {
        let mut clusters = [LightCluster::zeroed(); MAX_CLUSTERS];
        let (mut discs, mut num_clusters) = (Vec::new(), 0);
        if let Some(lights) = lights {
            let (of_scene, in_order) = lights.parts();
            num_clusters = of_scene.len() as u32;
            for (cluster, of_scene) in clusters.iter_mut().zip(of_scene) {
                *cluster = LightCluster::new(of_scene);
            }
            discs = in_order.map(LightDisc::new).collect();
        }
        let emitting: Vec<Surfel> = discs.iter().map(|disc| disc.surfel).collect();
        // A binding holds an element at least.
        discs.resize(discs.len().max(1), LightDisc::zeroed());
        let mut trees = Trees::default();
        let scene_root = trees.add(surfels);
        let light_root = trees.add(&emitting);
        Ok(Self {
            nodes: device.upload("nodes", bytemuck::cast_slice(&trees.nodes))?,
            leaf_indices: device.upload("leaves", bytemuck::cast_slice(&trees.leaf_indices))?,
            discs: device.upload("emitters", bytemuck::cast_slice(&discs))?,
            clusters: device.uniform("clusters of emitters", &clusters),
            num_clusters,
            scene_root,
            light_root,
        })
    }
}
