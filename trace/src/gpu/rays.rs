//! Single rays on the device, of any origin and direction, many at a time.

use super::declarations::light::{LightParameters, RayQuery};
use super::device::Device;
use super::error::GpuError;
use super::kernels::{self, Kernel, groups};
use super::light::TreeBuffers;
use super::scene_buffers::SceneBuffers;
use crate::features::{Features, NUM_LANES};
use crate::ray::Ray;
use bytemuck::Zeroable as _;
use eagpt_scene::{Camera, Gloss};
use glam::Vec3;

/// Rays of one dispatch: a kernel that runs for seconds is stopped by the driver.
const RAYS_PER_DISPATCH: u32 = 1 << 20;

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
        let features = self.features(queries.len())?;
        let (scene, found) = ([&self.scene.attributes], [&features]);
        self.run(kernel, queries, (&scene, &found))?;
        self.read_features(&features, queries.len())
    }

    /// Whether more than half of the light passes along each ray up to its distance.
    pub(super) fn are_free(&self, rays: &[Ray], distances: &[f32]) -> Result<Vec<bool>, GpuError> {
        let queries: Vec<RayQuery> = rays.iter().map(|ray| RayQuery::new(ray, 0)).collect();
        let distances = (self.device).upload("distances", bytemuck::cast_slice(distances))?;
        let size = (rays.len() * size_of::<u32>()) as u64;
        let is_free = self.device.buffer("free rays", size)?;
        self.run(
            &kernels::FREE_RAYS,
            &queries,
            (&[], &[&distances, &is_free]),
        )?;
        let is_free = (self.device).read::<u32>(&is_free, 0..rays.len())?;
        Ok(is_free.into_iter().map(|one| one == 1).collect())
    }

    /// Blended features and gloss along each ray, of a glossy scene.
    pub(super) fn trace_glossy(&self, rays: &[Ray]) -> Result<Vec<(Features, Gloss)>, GpuError> {
        let Some(glosses) = &self.scene.glosses else {
            return Ok(Vec::new());
        };
        let queries: Vec<RayQuery> = rays.iter().map(|ray| RayQuery::new(ray, 0)).collect();
        let features = self.features(rays.len())?;
        let size = (rays.len() * size_of::<[f32; 4]>()) as u64;
        let found = self.device.buffer("gloss of rays", size)?;
        let buffers = [&features, glosses, &found];
        let kernel = &kernels::BLEND_GLOSSY_RAYS;
        self.run(kernel, &queries, (&[&self.scene.attributes], &buffers))?;
        let rows = (self.device).read::<[f32; 4]>(&found, 0..rays.len())?;
        let gloss = rows.into_iter().map(|[r, g, b, roughness]| Gloss {
            specular: Vec3::new(r, g, b),
            roughness,
        });
        let features = self.read_features(&features, rays.len())?;
        Ok(features.into_iter().zip(gloss).collect())
    }

    /// The same of the rays through the pixel centres of `camera`. Radiance is that without what
    /// harmonics add.
    pub(super) fn of_camera(&self, camera: &Camera) -> Result<Vec<(Features, Gloss)>, GpuError> {
        let frame = camera.ray_frame();
        let ray = |pixel: usize| {
            let (x, y) = (pixel as u32 % camera.width, pixel as u32 / camera.width);
            let direction = frame.direction(x as f32 + 0.5, y as f32 + 0.5);
            Ray::free(frame.origin.to_array(), direction.to_array())
        };
        let pixels: Vec<usize> = (0..camera.num_pixels()).collect();
        let some = pixels.chunks(RAYS_PER_DISPATCH as usize).map(|some| {
            let rays: Vec<Ray> = some.iter().map(|&pixel| ray(pixel)).collect();
            self.trace_glossy(&rays)
        });
        Ok(some.collect::<Result<Vec<_>, _>>()?.concat())
    }

    fn features(&self, num_rays: usize) -> Result<wgpu::Buffer, GpuError> {
        let size = (num_rays * size_of::<Features>()) as u64;
        self.device.buffer("features of rays", size)
    }

    fn read_features(
        &self,
        features: &wgpu::Buffer,
        num_rays: usize,
    ) -> Result<Vec<Features>, GpuError> {
        let lanes = (self.device).read::<[f32; NUM_LANES]>(features, 0..num_rays)?;
        Ok(lanes.into_iter().map(Features).collect())
    }

    /// Runs a kernel of rays, with these buffers after that of the surfels and after the rays.
    fn run(
        &self,
        kernel: &'static Kernel,
        queries: &[RayQuery],
        (of_scene, found): (&[&wgpu::Buffer], &[&wgpu::Buffer]),
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
            let parameters = LightParameters {
                scene_root: light.scene_root,
                light_root: light.light_root,
                start_pixel: first,
                end_pixel: end,
                ..LightParameters::zeroed()
            };
            let uniform = device.uniform("light", &parameters);
            let of_rays = [&light.nodes, &light.leaf_indices, &queries];
            let buffers = [&[&uniform, &scene.surfels], of_scene, &of_rays, found].concat();
            passes.push(device.pass(kernel, &buffers, groups(end - first)));
        }
        device.run(&passes)
    }
}
