//! Light of camera pixels on the device, as [`crate::transport`] defines it. The CPU takes all
//! samples of a pixel together; here a dispatch takes one ray of one sample of
//! a path, or a few samples of a single bounce, for many pixels, and adds them to what was gathered
//! before, in the order of samples: it is short, so that no driver takes it for hung.

mod buffers;
mod steps;

use super::camera::CameraTracer;
use super::declarations::light::{
    FIRST_RAY, GATHER, Gathered, LAST_BOUNCE, LightParameters, ROULETTE, TOWARDS_LIGHT, gloss_rows,
};
use super::device::{Device, Pass};
use super::error::GpuError;
use super::kernels::groups;
use super::scene_buffers::SceneBuffers;
use crate::transport::{Hits, Integrator, LIGHT_SHARE, LightOptions, Sampling};
pub(super) use buffers::TreeBuffers;
use bytemuck::Zeroable as _;
use eagpt_scene::Gloss;
use eagpt_scene::rng::{Purpose, RandomKey};
use steps::{GatherKernel, Steps};

/// Pixels of a dispatch: a kernel that runs for seconds is stopped by the driver.
const PIXELS_PER_DISPATCH: u32 = 1 << 18;

/// Samples of a dispatch, at most. Software adapters (Mesa's llvmpipe) end all loops of an
/// invocation after 65,535 turns in sum.
const SAMPLES_PER_DISPATCH: u32 = 8;

/// First bounce at which paths end at random, at the earliest: here nothing is expected of the rest
/// of a path, and the bounces before bring most of the light.
const FIRST_ROULETTE: u32 = 3;

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
    /// Run one after the other; a pair: where rays are blended, and where they take one hit.
    kernels: [Vec<GatherKernel>; 2],
    hits: Hits,
    /// F0 and roughness of the pixels of a band, of a glossy scene.
    pixel_glosses: Option<wgpu::Buffer>,
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
    /// `None` if `integrator` samples nothing. A gather is of a glossy scene.
    pub(super) fn new(
        device: &Device,
        (scene, light): (&SceneBuffers, &TreeBuffers),
        tracer: &CameraTracer,
        integrator: &Integrator,
        options: &LightOptions,
    ) -> Result<Option<Self>, GpuError> {
        let (num_samples, kind) = match *integrator {
            Integrator::ZeroBounce => return Ok(None),
            Integrator::Gather { num_samples } | Integrator::OneBounce { num_samples } => {
                (num_samples, GatherKind::OneBounce)
            }
            Integrator::Path {
                num_samples,
                max_bounces,
                roulette_from,
            } => {
                let kind = GatherKind::Path {
                    max_bounces,
                    roulette_from: roulette_from.map(|from| from.max(FIRST_ROULETTE)),
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
            flags: match integrator {
                Integrator::Gather { .. } => GATHER,
                _ => 0,
            },
            ..LightParameters::zeroed()
        };
        let num_pixels = tracer.pixels_at_once();
        let of_pixels = |what, size: usize| device.buffer(what, (num_pixels * size) as u64);
        let gathered = of_pixels("light", size_of::<Gathered>())?;
        let uniform = device.uniform("light", &parameters);
        let pixel_glosses = match &scene.glosses {
            Some(_) => Some(of_pixels("gloss of pixels", size_of::<[f32; 4]>())?),
            None => None,
        };
        let steps = Steps {
            device,
            scene,
            light,
            tracer,
            uniform: &uniform,
            gathered: &gathered,
            pixel_glosses: pixel_glosses.as_ref(),
        };
        let kernels = match kind {
            GatherKind::OneBounce => steps.of_bounces(),
            GatherKind::Path { .. } => steps.of_paths()?,
        };
        Ok(Some(Self {
            parameters,
            kind,
            num_samples,
            uniform,
            gathered,
            kernels,
            hits: options.hits,
            pixel_glosses,
        }))
    }

    /// Number of samples of each pixel.
    pub(super) fn num_samples(&self) -> u32 {
        self.num_samples
    }

    /// Light of `num_pixels` pixels from `first_pixel` of the image on, whose camera rays have just
    /// been traced, and whose gloss is `glosses` in a glossy scene.
    pub(super) fn gather(
        &self,
        device: &Device,
        first_pixel: u32,
        num_pixels: u32,
        glosses: &[Gloss],
    ) -> Result<Vec<Gathered>, GpuError> {
        if let Some(buffer) = &self.pixel_glosses {
            device.write(buffer, bytemuck::cast_slice(&gloss_rows(glosses)));
        }
        let mut num_dispatches = 0_u32;
        for start_pixel in (0..num_pixels).step_by(PIXELS_PER_DISPATCH as usize) {
            let end_pixel = (start_pixel + PIXELS_PER_DISPATCH).min(num_pixels);
            let pixels = LightParameters {
                first_pixel,
                start_pixel,
                end_pixel,
                ..self.parameters
            };
            let groups = groups(end_pixel - start_pixel);
            let [blended, sampled] =
                (self.kernels.each_ref()).map(|kernels| passes(device, kernels, groups));
            for parameters in self.turns(pixels) {
                device.write(&self.uniform, bytemuck::bytes_of(&parameters));
                let passes = match self.hits {
                    Hits::Blended => &blended,
                    Hits::Sampled => &sampled,
                };
                device.run(passes)?;
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
                        flags: pixels.flags
                            | kind
                            | when(bounce == 0 && number == 0, FIRST_RAY)
                            | when(has_roulette, ROULETTE)
                            | when(bounce + 1 == max_bounces, LAST_BOUNCE),
                        ..pixels
                    }
                })
            })
        })
    }
}

fn passes(device: &Device, kernels: &[GatherKernel], groups: u32) -> Vec<Pass> {
    let pass = |one: &GatherKernel| {
        let buffers: Vec<&wgpu::Buffer> = one.buffers.iter().collect();
        device.pass(one.kernel, &buffers, groups)
    };
    kernels.iter().map(pass).collect()
}
