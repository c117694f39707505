//! The list of emitters that light samples of the transport matrix choose from, on the device.

use super::bvh::Trees;
use super::device::Device;
use super::error::GpuError;
use super::layout::{Layout, layout};
use crate::surfel::Surfel;
use crate::transport::light_list::{Cluster, Disc, LightList, MAX_CLUSTERS};
use crate::transport::matrix::NUM_REALIZATIONS;
use bytemuck::Zeroable as _;

const REALIZATIONS: usize = NUM_REALIZATIONS as usize;

/// See [`Cluster`].
#[derive(Debug, Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(super) struct LightCluster {
    centre: [f32; 3],
    radius: f32,
    squares: [f32; 3],
    spread: f32,
    products: [f32; 3],
    first: u32,
    powers: [f32; REALIZATIONS],
    end: u32,
    padding_a: u32,
    padding_b: [u32; 2],
}

impl LightCluster {
    pub(super) fn layout() -> Layout {
        layout!(LightCluster {
            centre: "vec3f",
            radius: "f32",
            squares: "vec3f",
            spread: "f32",
            products: "vec3f",
            first: "u32",
            powers: "array<vec4f, 4>",
            end: "u32",
            padding_a: "u32",
            padding_b: "vec2u",
        })
    }

    fn new(cluster: &Cluster) -> Self {
        Self {
            centre: cluster.centre.to_array(),
            radius: cluster.radius,
            squares: cluster.squares.to_array(),
            spread: cluster.spread,
            products: cluster.products.to_array(),
            first: cluster.first,
            powers: cluster.powers,
            end: cluster.end,
            ..Self::zeroed()
        }
    }
}

/// See [`Disc`].
#[derive(Debug, Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(super) struct LightDisc {
    surfel: Surfel,
    radii: [f32; REALIZATIONS],
    cumulative: [f32; REALIZATIONS],
    luminance: f32,
    cluster: u32,
    padding: [u32; 2],
}

impl LightDisc {
    pub(super) fn layout() -> Layout {
        layout!(LightDisc {
            surfel: "Surfel",
            radii: "array<vec4f, 4>",
            cumulative: "array<vec4f, 4>",
            luminance: "f32",
            cluster: "u32",
            padding: "vec2u",
        })
    }

    fn new((disc, surfel): (&Disc, &Surfel)) -> Self {
        Self {
            surfel: *surfel,
            radii: disc.radii,
            cumulative: disc.cumulative,
            luminance: disc.luminance,
            cluster: disc.cluster,
            padding: [0; 2],
        }
    }
}

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
