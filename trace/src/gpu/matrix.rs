//! Entries of the light-transport matrix on the device; [`TransportRays::trace`] is all of it, from
//! receivers to entries.
//!
//! A pass follows one direction of one receiver in each invocation, another one adds up the light
//! they have found. Light is added in the order of samples, those towards emitters first, so that
//! the bits depend neither on the size of dispatches nor on which receivers are traced together. The
//! CPU has a tree for each realization and takes receivers in groups; here one tree serves all
//! realizations.

use super::device::Device;
use super::error::GpuError;
use super::kernels::{self, groups};
use super::layout::{Layout, layout};
use super::light::TreeBuffers;
use super::rays::RayQuery;
use super::scene::SceneBuffers;
use crate::cpu::realizations::{SCENE_SEED, realized_radius_squared};
use crate::surfel::{Surfel, SurfelSet};
use crate::transport::EMISSION_THRESHOLD;
use crate::transport::lights::Lights;
use crate::transport::matrix::{Directions, NUM_REALIZATIONS, Receiver, TransportMatrix};
use bytemuck::Zeroable as _;
use eagpt_scene::rng::RandomKey;
use glam::Vec3;
use rayon::prelude::*;
use std::ops::Range;

/// Directions of a dispatch, at most: a kernel that runs for seconds is stopped by the driver.
const DIRECTIONS_PER_DISPATCH: u32 = 1 << 18;

/// Samples that an invocation adds up, at most. Software adapters (Mesa's llvmpipe) end all loops
/// of an invocation after 65,535 turns in sum.
const SAMPLES_PER_DISPATCH: u32 = 1 << 14;

/// Dispatches that are under way at once.
const DISPATCHES_AHEAD: u32 = 16;

/// Parameters of the kernels.
#[derive(Debug, Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(super) struct TransportParameters {
    /// Key of the random numbers.
    key: [u32; 4],
    emission_threshold: f32,
    num_emitters: u32,
    scene_root: u32,
    light_root: u32,
    /// Cosine samples of each receiver, in all.
    num_cosine: u32,
    /// Directions towards emitters of each receiver, in all.
    num_to_lights: u32,
    num_receivers: u32,
    /// 1 for directions towards emitters, 0 for cosine samples.
    is_towards_lights: u32,
    first_sample: u32,
    end_sample: u32,
    padding: [u32; 2],
}

impl TransportParameters {
    pub(super) fn layout() -> Layout {
        layout!(TransportParameters {
            key: "vec4u",
            emission_threshold: "f32",
            num_emitters: "u32",
            scene_root: "u32",
            light_root: "u32",
            num_cosine: "u32",
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
pub(super) struct ReceiverOnDevice {
    position: [f32; 3],
    offset: f32,
    normal: [f32; 3],
    element: u32,
}

impl ReceiverOnDevice {
    pub(super) fn layout() -> Layout {
        layout!(ReceiverOnDevice {
            position: "vec3f",
            offset: "f32",
            normal: "vec3f",
            element: "u32",
        })
    }

    fn new((element, surface): &Receiver) -> Self {
        Self {
            position: surface.position.to_array(),
            offset: surface.offset,
            normal: surface.normal.to_array(),
            element: *element,
        }
    }
}

/// The entry of one direction.
#[derive(Debug, Clone, Copy)]
#[repr(C)]
#[allow(dead_code, reason = "lives on the device alone; Rust knows its size")]
pub(super) struct FoundEntry {
    /// Of an emitter, weighted.
    light: [f32; 3],
    /// A Gaussian, [`crate::transport::matrix::NOTHING`], or [`super::bvh::NO_NODE`] where no ray
    /// was traced.
    gaussian: u32,
}

impl FoundEntry {
    pub(super) fn layout() -> Layout {
        layout!(FoundEntry {
            light: "vec3f",
            gaussian: "u32",
        })
    }
}

/// Light of emitters that the directions of a receiver have found.
#[derive(Debug, Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(super) struct DirectLight {
    light: [f32; 3],
    num_rays: u32,
}

impl DirectLight {
    pub(super) fn layout() -> Layout {
        layout!(DirectLight {
            light: "vec3f",
            num_rays: "u32",
        })
    }
}

/// Buffers of a scene for transport, beside its Gaussians.
#[derive(Debug)]
pub(super) struct TransportBuffers {
    /// Of discs that are as large as the largest of all realizations.
    trees: TreeBuffers,
    /// Squared radii of discs in standard deviations, `[n, NUM_REALIZATIONS]`: as many bytes as the
    /// Gaussians themselves.
    radii: wgpu::Buffer,
}

impl TransportBuffers {
    pub(super) fn new(
        device: &Device,
        set: &SurfelSet,
        lights: Option<&Lights>,
    ) -> Result<Self, GpuError> {
        let realized: Vec<[f32; NUM_REALIZATIONS as usize]> = (0..set.len())
            .into_par_iter()
            .with_min_len(1024)
            .map(|i| {
                let radius = |realization: usize| {
                    realized_radius_squared(
                        &set.surfels[i],
                        i as u32,
                        SCENE_SEED,
                        realization as u32,
                    )
                };
                std::array::from_fn(radius)
            })
            .collect();
        let largest: Vec<Surfel> = (set.surfels.iter())
            .zip(&realized)
            .map(|(surfel, radii)| Surfel {
                cut2: radii.iter().fold(-1.0, |most, &radius| most.max(radius)),
                ..*surfel
            })
            .collect();
        Ok(Self {
            trees: TreeBuffers::new(device, &largest, lights)?,
            radii: device.upload("radii of discs", bytemuck::cast_slice(&realized))?,
        })
    }
}

/// Traces matrix entries through a scene on a device.
pub(super) struct TransportRays<'a> {
    pub(super) device: &'a Device,
    pub(super) scene: &'a SceneBuffers,
    pub(super) matrix: &'a TransportBuffers,
}

/// Buffers for some receivers at once.
struct Piece {
    samples_at_once: u32,
    uniform: wgpu::Buffer,
    receivers: wgpu::Buffer,
    found: wgpu::Buffer,
    targets: wgpu::Buffer,
    direct: wgpu::Buffer,
}

impl Piece {
    fn new(device: &Device, num_receivers: usize, samples_at_once: u32) -> Result<Self, GpuError> {
        let of_receivers = |what, size: usize| device.buffer(what, (num_receivers * size) as u64);
        let num_samples = samples_at_once as usize;
        Ok(Self {
            samples_at_once,
            uniform: device.uniform("matrix", &TransportParameters::zeroed()),
            receivers: of_receivers("receivers", size_of::<ReceiverOnDevice>())?,
            found: of_receivers("found entries", num_samples * size_of::<FoundEntry>())?,
            targets: of_receivers("targets of entries", num_samples * size_of::<u32>())?,
            direct: of_receivers("light of emitters", size_of::<DirectLight>())?,
        })
    }

    /// `num` samples, as many in a dispatch as the buffers hold.
    fn samples(&self, num: u32) -> impl Iterator<Item = Range<u32>> {
        let at_once = self.samples_at_once;
        (0..num)
            .step_by(at_once as usize)
            .map(move |first| first..first.saturating_add(at_once).min(num))
    }
}

impl TransportRays<'_> {
    /// The matrix entries of `receivers`; see [`TransportMatrix::trace`].
    pub(super) fn trace(
        &self,
        receivers: &[Receiver],
        directions: Directions,
        key: RandomKey,
    ) -> Result<TransportMatrix, GpuError> {
        let mut matrix = TransportMatrix::default();
        if receivers.is_empty() {
            return Ok(matrix);
        }
        let device = self.device;
        // As many receivers and samples at once as one buffer holds entries.
        let samples = directions.plain.max(directions.to_lights);
        let max_entries = device.tier().max_bytes() / size_of::<FoundEntry>() as u64;
        let directions_at_once = max_entries.min(u64::from(DIRECTIONS_PER_DISPATCH)) as u32;
        let samples_at_once = samples.clamp(1, SAMPLES_PER_DISPATCH.min(directions_at_once));
        let receivers_at_once = (directions_at_once / samples_at_once) as usize;
        let num_receivers = receivers_at_once.min(receivers.len());
        let piece = Piece::new(device, num_receivers, samples_at_once)?;
        let trees = &self.matrix.trees;
        let num_to_lights = match trees.num_emitters {
            0 => 0,
            _ => directions.to_lights,
        };
        let num_cosine = directions.plain as usize;
        for some in receivers.chunks(receivers_at_once) {
            let parameters = TransportParameters {
                key: key.words(),
                emission_threshold: EMISSION_THRESHOLD,
                num_emitters: trees.num_emitters,
                scene_root: trees.scene_root,
                light_root: trees.light_root,
                num_cosine: directions.plain,
                num_to_lights: directions.to_lights,
                num_receivers: some.len() as u32,
                ..TransportParameters::zeroed()
            };
            let on_device: Vec<ReceiverOnDevice> = some.iter().map(ReceiverOnDevice::new).collect();
            device.write(&piece.receivers, bytemuck::cast_slice(&on_device));
            let dark = vec![DirectLight::zeroed(); some.len()];
            device.write(&piece.direct, bytemuck::cast_slice(&dark));
            // Towards emitters, whose light is all that counts.
            for (number, samples) in (1_u32..).zip(piece.samples(num_to_lights)) {
                let parameters = TransportParameters {
                    is_towards_lights: 1,
                    ..parameters
                };
                self.follow(&piece, parameters, samples)?;
                if number.is_multiple_of(DISPATCHES_AHEAD) {
                    device.wait()?;
                }
            }
            // Cosine samples: an entry each, or light where an emitter was met.
            let start = matrix.targets.len();
            matrix.targets.resize(start + some.len() * num_cosine, 0);
            for samples in piece.samples(directions.plain) {
                self.follow(&piece, parameters, samples.clone())?;
                let num_entries = some.len() * samples.len();
                let found: Vec<u32> = device.read(&piece.targets, 0..num_entries)?;
                let (first, end) = (samples.start as usize, samples.end as usize);
                let rows = matrix.targets[start..].chunks_exact_mut(num_cosine);
                for (row, found) in rows.zip(found.chunks_exact(samples.len())) {
                    row[first..end].copy_from_slice(found);
                }
            }
            for one in device.read::<DirectLight>(&piece.direct, 0..some.len())? {
                matrix.direct.push(Vec3::from_array(one.light));
                matrix.num_rays += u64::from(one.num_rays);
            }
        }
        Ok(matrix)
    }

    /// Follows `samples` of all receivers of `piece`: their entries, and the light of emitters.
    fn follow(
        &self,
        piece: &Piece,
        parameters: TransportParameters,
        samples: Range<u32>,
    ) -> Result<(), GpuError> {
        let TransportBuffers { trees, radii } = self.matrix;
        let (device, scene) = (self.device, self.scene);
        let num_receivers = parameters.num_receivers;
        let num_directions = num_receivers * samples.len() as u32;
        let parameters = TransportParameters {
            first_sample: samples.start,
            end_sample: samples.end,
            ..parameters
        };
        device.write(&piece.uniform, bytemuck::bytes_of(&parameters));
        let follow = [
            &piece.uniform,
            &scene.surfels,
            &scene.attributes,
            &trees.nodes,
            &trees.leaf_indices,
            &trees.emitters,
            radii,
            &piece.receivers,
            &piece.found,
        ];
        let add = [&piece.uniform, &piece.found, &piece.targets, &piece.direct];
        device.run(&[
            device.pass(&kernels::FOLLOW_DIRECTIONS, &follow, groups(num_directions)),
            device.pass(&kernels::ADD_UP, &add, groups(num_receivers)),
        ])
    }

    /// What each ray meets first in the realization that is its seed; see
    /// [`crate::Tracer::realization_hits`].
    pub(super) fn first_hits(&self, queries: &[RayQuery]) -> Result<Vec<u32>, GpuError> {
        let mut hits = Vec::with_capacity(queries.len());
        let max_rays = self.device.tier().max_bytes() / size_of::<RayQuery>() as u64;
        let at_once = max_rays.min(u64::from(DIRECTIONS_PER_DISPATCH)) as usize;
        let device = self.device;
        for some in queries.chunks(at_once) {
            let rays = device.upload("rays", bytemuck::cast_slice(some))?;
            let found = device.buffer("first hits", (some.len() * size_of::<u32>()) as u64)?;
            let parameters = TransportParameters {
                scene_root: self.matrix.trees.scene_root,
                num_receivers: some.len() as u32,
                ..TransportParameters::zeroed()
            };
            let uniform = device.uniform("matrix", &parameters);
            let buffers = [
                &uniform,
                &self.scene.surfels,
                &self.matrix.trees.nodes,
                &self.matrix.trees.leaf_indices,
                &self.matrix.radii,
                &found,
                &rays,
            ];
            let groups = groups(some.len() as u32);
            device.run(&[device.pass(&kernels::FIRST_HITS, &buffers, groups)])?;
            hits.extend(device.read::<u32>(&found, 0..some.len())?);
        }
        Ok(hits)
    }
}
