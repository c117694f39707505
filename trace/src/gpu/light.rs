//! Light of camera pixels on the device: the twin of [`crate::transport::render`].
//!
//! A dispatch takes one bounce of one sample, or a few samples of a single bounce, for many pixels, and adds them to what was gathered before,
//! in the order of samples: it is short, so that no driver takes it for hung.

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

/// Pixels of a dispatch: a kernel that runs for seconds is stopped by the driver.
const PIXELS_PER_DISPATCH: u32 = 1 << 18;

/// Samples of a dispatch, at most. Software adapters (Mesa's llvmpipe) end all loops of an invocation after 65,535 turns in sum.
const SAMPLES_PER_DISPATCH: u32 = 8;

/// Flag of a path's bounce: no other one follows.
pub(super) const LAST_BOUNCE: u32 = 1;
/// Flag of a path's bounce: the path may be ended at random.
pub(super) const ROULETTE: u32 = 2;

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
    /// Number of the bounce that paths are extended by.
    bounce: u32,
    /// [`LAST_BOUNCE`] and [`ROULETTE`].
    flags: u32,
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
            bounce: "u32",
            flags: "u32",
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
    padding: [u32; 3],
}

/// A path that is under way.
#[derive(Debug, Clone, Copy)]
#[repr(C)]
#[allow(dead_code, reason = "lives on the device alone; Rust knows its size")]
pub(super) struct PathState {
    /// The surface it has come to.
    position: [f32; 3],
    slab: f32,
    normal: [f32; 3],
    num_rays: u32,
    throughput: [f32; 3],
    is_alive: u32,
    /// Light so far.
    brought: [f32; 3],
    padding: u32,
}

impl PathState {
    pub(super) fn layout() -> Layout {
        layout!(PathState {
            position: "vec3f",
            slab: "f32",
            normal: "vec3f",
            num_rays: "u32",
            throughput: "vec3f",
            is_alive: "u32",
            brought: "vec3f",
            padding: "u32",
        })
    }
}

impl Gathered {
    pub(super) fn layout() -> Layout {
        layout!(Gathered {
            total: "vec3f",
            squares: "f32",
            num_rays: "u32",
            padding: "array<u32, 3>",
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
    kind: GatherKind,
    num_samples: u32,
    uniform: wgpu::Buffer,
    gathered: wgpu::Buffer,
    buffers: Vec<(u32, wgpu::Buffer)>,
}

#[derive(Debug)]
enum GatherKind {
    OneBounce,
    Path {
        max_bounces: u32,
        roulette_from: Option<u32>,
    },
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
        let (num_samples, kind) = match *integrator {
            Integrator::ZeroBounce => return Ok(None),
            Integrator::OneBounce { num_samples } => (num_samples, GatherKind::OneBounce),
            Integrator::Path {
                num_samples,
                max_bounces,
                roulette_from,
            } => {
                let kind = GatherKind::Path {
                    max_bounces,
                    roulette_from,
                };
                (num_samples, kind)
            }
        };
        let has_lights = light.num_emitters > 0 && options.sampling == Sampling::NextEvent;
        let parameters = LightParameters {
            key: RandomKey::new(options.seed, Purpose::Render, 0).words(),
            emission_threshold: options.emission_threshold,
            light_share: if has_lights { LIGHT_SHARE } else { 0.0 },
            num_emitters: light.num_emitters,
            scene_root: light.scene_root,
            light_root: light.light_root,
            ..LightParameters::zeroed()
        };
        let room = |what, size: usize| device.buffer(what, (tracer.pixels_at_once() * size) as u64);
        let gathered = room("light", size_of::<Gathered>())?;
        let uniform = device.uniform("light", &parameters);
        let mut buffers = vec![
            (0, tracer.bins.view.clone()),
            (1, uniform.clone()),
            (2, scene.surfels.clone()),
            (3, scene.payloads.clone()),
            (4, light.nodes.clone()),
            (5, light.leaf_indices.clone()),
            (6, light.emitters.clone()),
            (7, tracer.sums.clone()),
            (8, gathered.clone()),
        ];
        if let GatherKind::Path { .. } = kind {
            buffers.push((9, room("paths", size_of::<PathState>())?));
        }
        Ok(Some(Self {
            parameters,
            kind,
            num_samples,
            uniform,
            gathered,
            buffers,
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
        let mut num_dispatches = 0_u32;
        for start_pixel in (0..num_pixels).step_by(PIXELS_PER_DISPATCH as usize) {
            let end_pixel = (start_pixel + PIXELS_PER_DISPATCH).min(num_pixels);
            let pixels = LightParameters {
                first_pixel,
                start_pixel,
                end_pixel,
                ..self.parameters
            };
            let step = self.step(device, (end_pixel - start_pixel).div_ceil(64));
            for parameters in self.dispatches(pixels) {
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

    /// The parameters of all dispatches for some pixels, in order.
    fn dispatches(&self, pixels: LightParameters) -> impl Iterator<Item = LightParameters> {
        let (samples_at_once, max_bounces, roulette_from) = match self.kind {
            GatherKind::OneBounce => (SAMPLES_PER_DISPATCH, 1, None),
            GatherKind::Path {
                max_bounces,
                roulette_from,
            } => (1, max_bounces, roulette_from),
        };
        let num_samples = self.num_samples;
        let samples = (0..num_samples).step_by(samples_at_once as usize);
        samples.flat_map(move |first_sample| {
            (0..max_bounces).map(move |bounce| {
                let is_last = bounce + 1 == max_bounces;
                let has_roulette = roulette_from.is_some_and(|from| bounce + 1 >= from);
                LightParameters {
                    first_sample,
                    end_sample: first_sample
                        .saturating_add(samples_at_once)
                        .min(num_samples),
                    bounce,
                    flags: u32::from(is_last) * LAST_BOUNCE + u32::from(has_roulette) * ROULETTE,
                    ..pixels
                }
            })
        })
    }

    fn step(&self, device: &Device, groups: u32) -> Step {
        let buffers: Vec<(u32, &wgpu::Buffer)> = self
            .buffers
            .iter()
            .map(|(binding, buffer)| (*binding, buffer))
            .collect();
        match self.kind {
            GatherKind::OneBounce => device.step(&wgsl::BOUNCE, "gather_bounces", &buffers, groups),
            GatherKind::Path { .. } => device.step(&wgsl::PATH, "extend_paths", &buffers, groups),
        }
    }
}
