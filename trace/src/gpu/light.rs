//! Light of camera pixels on the device: the twin of [`crate::transport::render`].
//!
//! A kernel gathers some samples of some pixels and adds them to what it has gathered before, in the order of samples; how many at once is
//! limited, so that no driver takes it for hung.

use super::bvh::Trees;
use super::camera::CameraTracer;
use super::device::{Device, Step};
use super::error::GpuError;
use super::layout::{Layout, layout};
use super::scene::SceneBuffers;
use super::wgsl;
use crate::surfel::{Surfel, SurfelSet};
use crate::transport::lights::Lights;
use crate::transport::{Integrator, LIGHT_SHARE, LightOptions, Sampling};
use bytemuck::Zeroable as _;
use eagpt_scene::rng::{Purpose, RandomKey};
use std::ops::Range;

/// Rays that a dispatch traces, about: a fifth of a second where five million are traced in one.
const RAYS_PER_DISPATCH: u32 = 1 << 20;

/// Dispatches that are under way at once.
const DISPATCHES_AHEAD: u32 = 16;

/// Parameters of the kernels.
#[derive(Debug, Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(super) struct LightParameters {
    /// Key of the random numbers.
    key: [u32; 4],
    emission_threshold: f32,
    /// Share of directions towards emitters; above 0 where next-event estimation is on.
    light_share: f32,
    num_emitters: u32,
    scene_root: u32,
    light_root: u32,
    max_bounces: u32,
    roulette_from: u32,
    /// Pixel of the image that buffers begin with.
    first_pixel: u32,
    /// From and to, counted from `first_pixel`.
    start_pixel: u32,
    end_pixel: u32,
    first_sample: u32,
    end_sample: u32,
}

impl LightParameters {
    pub(super) fn layout() -> Layout {
        layout!(LightParameters {
            key: "vec4u",
            emission_threshold: "f32",
            light_share: "f32",
            num_emitters: "u32",
            scene_root: "u32",
            light_root: "u32",
            max_bounces: "u32",
            roulette_from: "u32",
            first_pixel: "u32",
            start_pixel: "u32",
            end_pixel: "u32",
            first_sample: "u32",
            end_sample: "u32",
        })
    }

    /// For rays of `range` through a scene.
    pub(super) fn of_rays(light: &LightBuffers, range: Range<u32>) -> Self {
        Self {
            scene_root: light.scene_root,
            light_root: light.light_root,
            start_pixel: range.start,
            end_pixel: range.end,
            ..Self::zeroed()
        }
    }
}

/// An emissive Gaussian.
#[derive(Debug, Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(super) struct Emitter {
    surfel: Surfel,
    /// Probability that one up to this one is chosen.
    cumulative: f32,
    /// Part of the footprint inside the cut.
    inside: f32,
    /// Probability over the footprint's area.
    density: f32,
    padding: f32,
}

impl Emitter {
    pub(super) fn layout() -> Layout {
        layout!(Emitter {
            surfel: "Surfel",
            cumulative: "f32",
            inside: "f32",
            density: "f32",
            padding: "f32",
        })
    }
}

/// What samples have brought to a pixel.
#[derive(Debug, Clone, Copy, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(super) struct Gathered {
    /// Sum of the light, before the albedo.
    pub(super) total: [f32; 3],
    /// Sum of its squared luminance.
    pub(super) squares: f32,
    pub(super) num_rays: u32,
    padding: u32,
    padding_too: u32,
    and_more: u32,
}

impl Gathered {
    pub(super) fn layout() -> Layout {
        layout!(Gathered {
            total: "vec3f",
            squares: "f32",
            num_rays: "u32",
            padding: "u32",
            padding_too: "u32",
            and_more: "u32",
        })
    }
}

/// What single rays need of a scene.
#[derive(Debug)]
pub(super) struct LightBuffers {
    pub(super) nodes: wgpu::Buffer,
    pub(super) leaf_indices: wgpu::Buffer,
    emitters: wgpu::Buffer,
    num_emitters: u32,
    scene_root: u32,
    light_root: u32,
}

impl LightBuffers {
    pub(super) fn new(
        device: &Device,
        set: &SurfelSet,
        lights: Option<&Lights>,
    ) -> Result<Self, GpuError> {
        let emitters: Vec<Emitter> = lights.map_or(Vec::new(), |lights| {
            let of = lights.footprints();
            of.map(|footprint| Emitter {
                surfel: *footprint.surfel,
                cumulative: footprint.cumulative,
                inside: footprint.inside,
                density: footprint.density,
                padding: 0.0,
            })
            .collect()
        });
        let mut trees = Trees::default();
        let scene_root = trees.add(&set.surfels);
        let surfels: Vec<Surfel> = emitters.iter().map(|emitter| emitter.surfel).collect();
        let light_root = trees.add(&surfels);
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

/// Gathers light for the pixels of bands.
#[derive(Debug)]
pub(super) struct LightGatherer {
    parameters: LightParameters,
    num_samples: u32,
    rays_per_sample: u32,
    uniform: wgpu::Buffer,
    gathered: wgpu::Buffer,
    kernel: &'static wgsl::Module,
    buffers: Vec<(u32, wgpu::Buffer)>,
}

impl LightGatherer {
    /// `None` if `integrator` samples nothing.
    pub(super) fn new(
        device: &Device,
        (scene, light): (&SceneBuffers, &LightBuffers),
        tracer: &CameraTracer,
        integrator: &Integrator,
        options: &LightOptions,
    ) -> Result<Option<Self>, GpuError> {
        let has_lights = light.num_emitters > 0 && options.sampling == Sampling::NextEvent;
        let share = if has_lights { LIGHT_SHARE } else { 0.0 };
        let mut parameters = LightParameters {
            key: key_words(options.seed),
            emission_threshold: options.emission_threshold,
            light_share: share,
            num_emitters: light.num_emitters,
            scene_root: light.scene_root,
            light_root: light.light_root,
            ..LightParameters::zeroed()
        };
        let (kernel, num_samples, rays_per_sample) = match *integrator {
            Integrator::ZeroBounce => return Ok(None),
            Integrator::OneBounce { num_samples } => (&wgsl::BOUNCE, num_samples, 1),
            Integrator::Path {
                num_samples,
                max_bounces,
                roulette_from,
            } => {
                parameters.max_bounces = max_bounces;
                parameters.roulette_from = roulette_from.unwrap_or(u32::MAX);
                let rays = max_bounces.saturating_mul(1 + u32::from(has_lights));
                (&wgsl::PATH, num_samples, rays)
            }
        };
        let pixels = tracer.pixels_at_once() as u64;
        let gathered = device.buffer("light", pixels * size_of::<Gathered>() as u64)?;
        let uniform = device.uniform("light", &parameters);
        let buffers = [
            (0, &tracer.bins.view),
            (1, &uniform),
            (2, &scene.surfels),
            (3, &scene.payloads),
            (4, &light.nodes),
            (5, &light.leaf_indices),
            (6, &light.emitters),
            (7, &tracer.sums),
            (8, &gathered),
        ];
        Ok(Some(Self {
            parameters,
            num_samples,
            rays_per_sample,
            buffers: buffers
                .map(|(binding, buffer)| (binding, buffer.clone()))
                .to_vec(),
            uniform,
            gathered,
            kernel,
        }))
    }

    /// Number of samples of each pixel.
    pub(super) fn num_samples(&self) -> u32 {
        self.num_samples
    }

    /// Light of `num_pixels` pixels from `first_pixel` of the image on, whose camera rays have just been traced.
    pub(super) fn gather(
        &self,
        device: &Device,
        first_pixel: u32,
        num_pixels: u32,
    ) -> Result<Vec<Gathered>, GpuError> {
        let budget = RAYS_PER_DISPATCH / self.rays_per_sample.max(1);
        let pixels_at_once = num_pixels.min(budget.max(64));
        let samples_at_once = (budget / pixels_at_once.max(1)).max(1);
        let mut num_dispatches = 0_u32;
        for start_pixel in (0..num_pixels).step_by(pixels_at_once.max(1) as usize) {
            let end_pixel = (start_pixel + pixels_at_once).min(num_pixels);
            let groups = (end_pixel - start_pixel).div_ceil(64);
            let step = self.step(device, groups);
            for first_sample in (0..self.num_samples).step_by(samples_at_once as usize) {
                let parameters = LightParameters {
                    first_pixel,
                    start_pixel,
                    end_pixel,
                    first_sample,
                    end_sample: first_sample
                        .saturating_add(samples_at_once)
                        .min(self.num_samples),
                    ..self.parameters
                };
                device.write(&self.uniform, bytemuck::bytes_of(&parameters));
                device.run(std::slice::from_ref(&step))?;
                num_dispatches += 1;
                if num_dispatches.is_multiple_of(DISPATCHES_AHEAD) {
                    device.wait()?;
                }
            }
        }
        device.read(&self.gathered, 0..num_pixels as usize)
    }

    fn step(&self, device: &Device, groups: u32) -> Step {
        let buffers: Vec<(u32, &wgpu::Buffer)> = self
            .buffers
            .iter()
            .map(|(binding, buffer)| (*binding, buffer))
            .collect();
        device.step(self.kernel, "gather", &buffers, groups)
    }
}

/// The words of the key of a rendering's random numbers.
fn key_words(seed: u64) -> [u32; 4] {
    RandomKey::new(seed, Purpose::Render, 0).words()
}
