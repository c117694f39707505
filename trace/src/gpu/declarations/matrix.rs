//! The light-transport matrix: structures that its kernels share with Rust.

use crate::cpu::realizations::NUM_REALIZATIONS;
use crate::gpu::layout::{Layout, layout};
use crate::surfel::Surfel;
use crate::transport::light_list::{Cluster, Disc};
use crate::transport::matrix::Receiver;
use bytemuck::Zeroable as _;

const REALIZATIONS: usize = NUM_REALIZATIONS as usize;

/// See [`Cluster`].
#[derive(Debug, Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(in crate::gpu) struct LightCluster {
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
    pub(in crate::gpu) fn layout() -> Layout {
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

    pub(in crate::gpu) fn new(cluster: &Cluster) -> Self {
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
pub(in crate::gpu) struct LightDisc {
    pub(in crate::gpu) surfel: Surfel,
    radii: [f32; REALIZATIONS],
    cumulative: [f32; REALIZATIONS],
    luminance: f32,
    cluster: u32,
    padding: [u32; 2],
}

impl LightDisc {
    pub(in crate::gpu) fn layout() -> Layout {
        layout!(LightDisc {
            surfel: "Surfel",
            radii: "array<vec4f, 4>",
            cumulative: "array<vec4f, 4>",
            luminance: "f32",
            cluster: "u32",
            padding: "vec2u",
        })
    }

    pub(in crate::gpu) fn new((disc, surfel): (&Disc, &Surfel)) -> Self {
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

/// Parameters of the kernels.
#[derive(Debug, Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(in crate::gpu) struct TransportParameters {
    /// Key of the random numbers.
    pub(in crate::gpu) key: [u32; 4],
    pub(in crate::gpu) emission_threshold: f32,
    pub(in crate::gpu) num_clusters: u32,
    pub(in crate::gpu) scene_root: u32,
    pub(in crate::gpu) light_root: u32,
    /// BSDF samples of each receiver, in all.
    pub(in crate::gpu) num_bsdf: u32,
    /// Light samples of each receiver, in all.
    pub(in crate::gpu) num_to_lights: u32,
    pub(in crate::gpu) num_receivers: u32,
    /// 1 for light samples, 0 for BSDF samples.
    pub(in crate::gpu) is_towards_lights: u32,
    pub(in crate::gpu) first_sample: u32,
    pub(in crate::gpu) end_sample: u32,
    pub(in crate::gpu) padding: [u32; 2],
}

impl TransportParameters {
    pub(in crate::gpu) fn layout() -> Layout {
        layout!(TransportParameters {
            key: "vec4u",
            emission_threshold: "f32",
            num_clusters: "u32",
            scene_root: "u32",
            light_root: "u32",
            num_bsdf: "u32",
            num_to_lights: "u32",
            num_receivers: "u32",
            is_towards_lights: "u32",
            first_sample: "u32",
            end_sample: "u32",
            padding: "vec2u",
        })
    }
}

/// A [`Receiver`] as kernels know it.
#[derive(Debug, Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(in crate::gpu) struct ReceiverOnDevice {
    position: [f32; 3],
    offset: f32,
    normal: [f32; 3],
    element: u32,
}

impl ReceiverOnDevice {
    pub(in crate::gpu) fn layout() -> Layout {
        layout!(ReceiverOnDevice {
            position: "vec3f",
            offset: "f32",
            normal: "vec3f",
            element: "u32",
        })
    }

    pub(in crate::gpu) fn new((element, surface): &Receiver) -> Self {
        Self {
            position: surface.position.to_array(),
            offset: surface.offset,
            normal: surface.normal.to_array(),
            element: *element,
        }
    }
}

/// Result of one direction.
#[derive(Debug, Clone, Copy)]
#[repr(C)]
#[allow(dead_code, reason = "lives on the device alone; Rust knows its size")]
pub(in crate::gpu) struct FoundEntry {
    /// Of an emitter, weighted.
    light: [f32; 3],
    /// Entry of the matrix, or [`crate::gpu::bvh::NO_NODE`] where no ray was traced.
    gaussian: u32,
}

impl FoundEntry {
    pub(in crate::gpu) fn layout() -> Layout {
        layout!(FoundEntry {
            light: "vec3f",
            gaussian: "u32",
        })
    }
}

/// Light that the directions of a receiver have found.
#[derive(Debug, Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(in crate::gpu) struct DirectLight {
    pub(in crate::gpu) light: [f32; 3],
    pub(in crate::gpu) num_rays: u32,
    /// Sum of squared luminances.
    pub(in crate::gpu) squares: f32,
    padding: [u32; 3],
}

impl DirectLight {
    pub(in crate::gpu) fn layout() -> Layout {
        layout!(DirectLight {
            light: "vec3f",
            num_rays: "u32",
            squares: "f32",
            padding: "array<u32, 3>",
        })
    }
}
