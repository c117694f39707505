//! Single rays on the device, of any origin and direction, many at a time.

use super::device::Device;
use super::error::GpuError;
use super::kernels::{self, Kernel, groups};
use super::layout::{Layout, layout};
use super::light::{LightParameters, TreeBuffers};
use super::scene::SceneBuffers;
use crate::features::{Features, NUM_LANES};
use crate::ray::Ray;

/// Rays of one dispatch: a kernel that runs for seconds is stopped by the driver.
const RAYS_PER_DISPATCH: u32 = 1 << 20;

/// A ray as kernels know it.
#[derive(Debug, Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(super) struct RayQuery {
    origin: [f32; 3],
    t_min: f32,
    direction: [f32; 3],
    /// Of the choice of a hit.
    seed: u32,
    own_normal: [f32; 3],
    /// 1 where there is nothing to trace.
    is_idle: u32,
}

impl RayQuery {
    pub(super) fn layout() -> Layout {
        layout!(RayQuery {
            origin: "vec3f",
            t_min: "f32",
            direction: "vec3f",
            seed: "u32",
            own_normal: "vec3f",
            is_idle: "u32",
        })
    }

    pub(super) fn new(ray: &Ray, seed: u32) -> Self {
        Self {
            origin: ray.origin,
            t_min: ray.t_min,
            direction: ray.direction,
            seed,
            own_normal: ray.own_normal,
            is_idle: 0,
        }
    }
}

/// Rays on a device, to be traced through a scene.
pub(super) struct Rays<'a> {
    pub(super) device: &'a Device,
    pub(super) scene: &'a SceneBuffers,
    pub(super) light: &'a TreeBuffers,
}

impl Rays<'_> {
    /// Composited features along each ray.
    pub(super) fn blend(&self, queries: &[RayQuery]) -> Result<Vec<Features>, GpuError> {
        let size = (queries.len() * size_of::<Features>()) as u64;
        let features = self.device.buffer("features of rays", size)?;
        self.run(
            &kernels::BLEND_RAYS,
            queries,
            Some(&self.scene.attributes),
            &features,
        )?;
        let lanes = self
            .device
            .read::<[f32; NUM_LANES]>(&features, 0..queries.len())?;
        Ok(lanes.into_iter().map(Features).collect())
    }

    /// The Gaussian of one hit of each ray, chosen by its weight; [`super::bvh::NO_NODE`] where
    /// nothing is met.
    pub(super) fn choose(&self, queries: &[RayQuery]) -> Result<Vec<u32>, GpuError> {
        let size = (queries.len() * size_of::<u32>()) as u64;
        let chosen = self.device.buffer("chosen hits", size)?;
        self.run(&kernels::CHOOSE_HITS, queries, None, &chosen)?;
        self.device.read(&chosen, 0..queries.len())
    }

    fn run(
        &self,
        kernel: &'static Kernel,
        queries: &[RayQuery],
        attributes: Option<&wgpu::Buffer>,
        results: &wgpu::Buffer,
    ) -> Result<(), GpuError> {
        let Self {
            device,
            scene,
            light,
        } = self;
        let num_rays = queries.len() as u32;
        let queries = device.upload("rays", bytemuck::cast_slice(queries))?;
        let mut passes = Vec::new();
        for first in (0..num_rays).step_by(RAYS_PER_DISPATCH as usize) {
            let end = first.saturating_add(RAYS_PER_DISPATCH).min(num_rays);
            let uniform = device.uniform("light", &LightParameters::of_rays(light, first..end));
            let tree = [&light.nodes, &light.leaf_indices, &queries, results];
            let mut buffers = vec![&uniform, &scene.surfels];
            buffers.extend(attributes);
            buffers.extend_from_slice(&tree);
            passes.push(device.pass(kernel, &buffers, groups(end - first)));
        }
        device.run(&passes)
    }
}
