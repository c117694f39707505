//! The kernels of an integrator and their buffers, in the order in which they run.

use super::TreeBuffers;
use crate::features::Features;
use crate::gpu::camera::CameraTracer;
use crate::gpu::declarations::light::{PathState, RayQuery};
use crate::gpu::device::Device;
use crate::gpu::error::GpuError;
use crate::gpu::kernels::{self, Kernel};
use crate::gpu::scene_buffers::SceneBuffers;
use crate::transport::bsdf;

/// A kernel and its buffers.
#[derive(Debug, Clone)]
pub(super) struct GatherKernel {
    pub(super) kernel: &'static Kernel,
    pub(super) buffers: Vec<wgpu::Buffer>,
}

impl GatherKernel {
    fn new(kernel: &'static Kernel, buffers: &[&wgpu::Buffer], more: &[&wgpu::Buffer]) -> Self {
        let all = buffers.iter().chain(more);
        Self {
            kernel,
            buffers: all.map(|&buffer| buffer.clone()).collect(),
        }
    }
}

/// Buffers and more that the kernels of an integrator work on. Those of glossy scenes have more of
/// them, after the others.
pub(super) struct Steps<'a> {
    pub(super) device: &'a Device,
    pub(super) scene: &'a SceneBuffers,
    pub(super) light: &'a TreeBuffers,
    pub(super) tracer: &'a CameraTracer,
    pub(super) uniform: &'a wgpu::Buffer,
    /// [`Gathered`](crate::gpu::declarations::light::Gathered), `[pixels]`.
    pub(super) gathered: &'a wgpu::Buffer,
    /// F0 and roughness, `[pixels, 4]`, of a glossy scene.
    pub(super) pixel_glosses: Option<&'a wgpu::Buffer>,
}

impl Steps<'_> {
    fn lobe_albedos(&self) -> wgpu::Buffer {
        (self.device).uniform("lobe albedos", &bsdf::lobe_albedos())
    }

    /// A single bounce; a pair: where rays are blended, and where they take one hit.
    pub(super) fn of_bounces(&self) -> [Vec<GatherKernel>; 2] {
        let buffers = [
            &self.tracer.bins.view,
            self.uniform,
            &self.scene.surfels,
            &self.scene.attributes,
            &self.light.nodes,
            &self.light.leaf_indices,
            &self.light.emitters,
            &self.tracer.features,
            self.gathered,
        ];
        let kernel = match self.pixel_glosses {
            Some(glosses) => {
                let more = [glosses, &self.lobe_albedos()];
                GatherKernel::new(&kernels::GATHER_GLOSSY_BOUNCES, &buffers, &more)
            }
            None => GatherKernel::new(&kernels::GATHER_BOUNCES, &buffers, &[]),
        };
        [vec![kernel.clone()], vec![kernel]]
    }

    /// A ray of paths: aimed, traced, shaded. A pair as above.
    pub(super) fn of_paths(&self) -> Result<[Vec<GatherKernel>; 2], GpuError> {
        let of_pixels = |what, size: usize| {
            let num_pixels = self.tracer.pixels_at_once();
            self.device.buffer(what, (num_pixels * size) as u64)
        };
        let paths = &of_pixels("paths", size_of::<PathState>())?;
        let rays = &of_pixels("rays of paths", size_of::<RayQuery>())?;
        let met = &of_pixels("features of paths", size_of::<Features>())?;
        let (uniform, gathered) = (self.uniform, self.gathered);
        let TreeBuffers {
            nodes,
            leaf_indices,
            emitters,
            ..
        } = self.light;
        let CameraTracer { bins, features, .. } = self.tracer;
        let SceneBuffers {
            surfels,
            attributes,
            ..
        } = self.scene;
        let aim = [
            &bins.view, uniform, emitters, features, gathered, paths, rays,
        ];
        let meet = [uniform, surfels, attributes, nodes, leaf_indices, rays, met];
        let shade = [
            uniform,
            nodes,
            leaf_indices,
            emitters,
            gathered,
            paths,
            rays,
            met,
        ];
        let (Some(pixel_glosses), Some(glosses)) = (self.pixel_glosses, &self.scene.glosses) else {
            let of = |kernel| {
                vec![
                    GatherKernel::new(&kernels::AIM_RAYS, &aim, &[]),
                    GatherKernel::new(kernel, &meet, &[]),
                    GatherKernel::new(&kernels::SHADE_RAYS, &shade, &[]),
                ]
            };
            return Ok([&kernels::BLEND_RAYS, &kernels::SAMPLE_RAYS].map(of));
        };
        let lobes = &self.lobe_albedos();
        let ray_glosses = &of_pixels("gloss of paths", size_of::<[f32; 4]>())?;
        let of = |kernel| {
            vec![
                GatherKernel::new(&kernels::AIM_GLOSSY_RAYS, &aim, &[pixel_glosses, lobes]),
                GatherKernel::new(kernel, &meet, &[glosses, ray_glosses]),
                GatherKernel::new(&kernels::SHADE_GLOSSY_RAYS, &shade, &[lobes, ray_glosses]),
            ]
        };
        Ok([&kernels::BLEND_GLOSSY_RAYS, &kernels::SAMPLE_GLOSSY_RAYS].map(of))
    }
}
