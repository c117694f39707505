//! Single rays on the device, of any origin and direction, many at a time.

use super::device::Device;
use super::error::GpuError;
use super::kernels::{Kernel, groups};
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
    /// Features along each ray: of all its hits, blended, or of one that is chosen by its weight,
    /// as `kernel` says.
    pub(super) fn trace(
        &self,
        kernel: &'static Kernel,
        queries: &[RayQuery],
    ) -> Result<Vec<Features>, GpuError> {
        let Self {
            device,
            scene,
            light,
        } = self;
        let num_rays = queries.len() as u32;
        let size = (queries.len() * size_of::<Features>()) as u64;
        let features = device.buffer("features of rays", size)?;
        let queries = device.upload("rays", bytemuck::cast_slice(queries))?;
        let mut passes = Vec::new();
        for first in (0..num_rays).step_by(RAYS_PER_DISPATCH as usize) {
            let end = first.saturating_add(RAYS_PER_DISPATCH).min(num_rays);
            let uniform = device.uniform("light", &LightParameters::of_rays(light, first..end));
            let buffers = [
                &uniform,
                &scene.surfels,
                &scene.attributes,
                &light.nodes,
                &light.leaf_indices,
                &queries,
                &features,
            ];
            passes.push(device.pass(kernel, &buffers, groups(end - first)));
        }
        device.run(&passes)?;
        let lanes = device.read::<[f32; NUM_LANES]>(&features, 0..num_rays as usize)?;
        Ok(lanes.into_iter().map(Features).collect())
    }
}
