//! Light of camera pixels on the device: the twin of [`crate::transport::render`].
//!
//! A dispatch takes one ray of one sample of a path, or a few samples of a single bounce, for many
//! pixels, and adds them to what was gathered before, in the order of samples: it is short, so that
//! no driver takes it for hung.

mod buffers;
mod parameters;

use super::camera::CameraTracer;
use super::device::{Device, Step};
use super::error::GpuError;
use super::rays::RayQuery;
use super::scene::SceneBuffers;
use super::wgsl;
use crate::features::Features;
use crate::transport::{Hits, Integrator, LIGHT_SHARE, LightOptions, Sampling};
pub(super) use buffers::TreeBuffers;
use bytemuck::Zeroable as _;
use eagpt_scene::rng::{Purpose, RandomKey};
pub(super) use parameters::{
    Emitter, FIRST_RAY, Gathered, LAST_BOUNCE, LightParameters, PathState, ROULETTE, TOWARDS_LIGHT,
};

/// Pixels of a dispatch: a kernel that runs for seconds is stopped by the driver.
const PIXELS_PER_DISPATCH: u32 = 1 << 18;

/// Samples of a dispatch, at most. Software adapters (Mesa's llvmpipe) end all loops of an
/// invocation after 65,535 turns in sum.
const SAMPLES_PER_DISPATCH: u32 = 8;

/// Dispatches that are under way at once.
const DISPATCHES_AHEAD: u32 = 16;

/// Gathers light for the pixels of bands.
#[derive(Debug)]
pub(super) struct LightGatherer {
    parameters: LightParameters,
    kind: GatherKind,
    num_samples: u32,
    uniform: wgpu::Buffer,
    gathered: wgpu::Buffer,
    /// Run one after the other.
    kernels: Vec<GatherKernel>,
}

/// A kernel and its buffers.
#[derive(Debug)]
struct GatherKernel {
    module: &'static wgsl::Module,
    entry: &'static str,
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
        (scene, light): (&SceneBuffers, &TreeBuffers),
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
        let kernel = |module, entry, buffers: &[(u32, &wgpu::Buffer)]| GatherKernel {
            module,
            entry,
            buffers: buffers
                .iter()
                .map(|&(binding, buffer)| (binding, buffer.clone()))
                .collect(),
        };
        let view = (0, &tracer.bins.view);
        let (uniform_at, surfels, attributes) =
            ((1, &uniform), (2, &scene.surfels), (3, &scene.attributes));
        let (nodes, leaves, emitters) = (
            (4, &light.nodes),
            (5, &light.leaf_indices),
            (6, &light.emitters),
        );
        let (features, total) = ((7, &tracer.features), (8, &gathered));
        let kernels = match kind {
            GatherKind::OneBounce => {
                let buffers = [
                    view, uniform_at, surfels, attributes, nodes, leaves, emitters, features, total,
                ];
                vec![kernel(&wgsl::BOUNCE, "gather_bounces", &buffers)]
            }
            GatherKind::Path { .. } => {
                let paths = room("paths", size_of::<PathState>())?;
                let rays = room("rays of paths", size_of::<RayQuery>())?;
                let met = room("features of paths", size_of::<Features>())?;
                let aim = [
                    view,
                    uniform_at,
                    emitters,
                    features,
                    total,
                    (9, &paths),
                    (10, &rays),
                ];
                let meet = [
                    uniform_at,
                    surfels,
                    attributes,
                    nodes,
                    leaves,
                    (6, &rays),
                    (7, &met),
                ];
                let shade = [
                    uniform_at,
                    nodes,
                    leaves,
                    emitters,
                    total,
                    (9, &paths),
                    (10, &rays),
                    (11, &met),
                ];
                let meet_rays = match options.hits {
                    Hits::Blended => "blend_rays",
                    Hits::Sampled => "sample_rays",
                };
                vec![
                    kernel(&wgsl::PATH, "aim_rays", &aim),
                    kernel(&wgsl::RAYS, meet_rays, &meet),
                    kernel(&wgsl::PATH, "shade_rays", &shade),
                ]
            }
        };
        Ok(Some(Self {
            parameters,
            kind,
            num_samples,
            uniform,
            gathered,
            kernels,
        }))
    }

    /// Number of samples of each pixel.
    pub(super) fn num_samples(&self) -> u32 {
        self.num_samples
    }

    /// Light of `num_pixels` pixels from `first_pixel` of the image on, whose camera rays have just
    /// been traced.
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
            let steps = self.steps(device, (end_pixel - start_pixel).div_ceil(64));
            for parameters in self.turns(pixels) {
                device.write(&self.uniform, bytemuck::bytes_of(&parameters));
                device.run(&steps)?;
                num_dispatches += 1;
                if num_dispatches.is_multiple_of(DISPATCHES_AHEAD) {
                    device.wait()?;
                }
            }
        }
        device.read(&self.gathered, 0..num_pixels as usize)
    }

    /// The parameters of all turns of the kernels for some pixels, in order.
    fn turns(&self, pixels: LightParameters) -> impl Iterator<Item = LightParameters> {
        let (samples_at_once, max_bounces, roulette_from) = match self.kind {
            GatherKind::OneBounce => (SAMPLES_PER_DISPATCH, 1, None),
            GatherKind::Path {
                max_bounces,
                roulette_from,
            } => (1, max_bounces, roulette_from),
        };
        let looks_for_light = pixels.light_share > 0.0;
        let num_samples = self.num_samples;
        let samples = (0..num_samples).step_by(samples_at_once as usize);
        let is_path = matches!(self.kind, GatherKind::Path { .. });
        // Towards the light first.
        let kinds: &[u32] = match (is_path, looks_for_light) {
            (true, true) => &[TOWARDS_LIGHT, 0],
            _ => &[0],
        };
        samples.flat_map(move |first_sample| {
            (0..max_bounces).flat_map(move |bounce| {
                kinds.iter().enumerate().map(move |(number, kind)| {
                    let when = |is_so: bool, flag: u32| if is_so { flag } else { 0 };
                    let has_roulette = roulette_from.is_some_and(|from| bounce + 1 >= from);
                    LightParameters {
                        first_sample,
                        end_sample: first_sample
                            .saturating_add(samples_at_once)
                            .min(num_samples),
                        bounce,
                        flags: kind
                            | when(bounce == 0 && number == 0, FIRST_RAY)
                            | when(has_roulette, ROULETTE)
                            | when(bounce + 1 == max_bounces, LAST_BOUNCE),
                        ..pixels
                    }
                })
            })
        })
    }

    fn steps(&self, device: &Device, groups: u32) -> Vec<Step> {
        let step = |kernel: &GatherKernel| {
            let buffers: Vec<(u32, &wgpu::Buffer)> = kernel
                .buffers
                .iter()
                .map(|(binding, buffer)| (*binding, buffer))
                .collect();
            device.step(kernel.module, kernel.entry, &buffers, groups)
        };
        self.kernels.iter().map(step).collect()
    }
}
