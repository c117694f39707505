//! The light-transport matrix on a device; [`TransportRays::trace`] is all of it, from receivers to
//! rows.
//!
//! A pass follows one direction of one receiver in each invocation; another one adds up their
//! light. It is added in the order of samples, light samples first, so that the bits depend neither
//! on the size of dispatches nor on which receivers are traced together. The CPU
//! ([`crate::transport::matrix`]) adds light in the order of realizations, of which each has a
//! tree; here one tree serves all.

use super::declarations::matrix::{DirectLight, FoundEntry, ReceiverOnDevice, TransportParameters};
use super::device::Device;
use super::error::GpuError;
use super::kernels::{self, groups};
use super::light_list::LightListBuffers;
use super::scene_buffers::SceneBuffers;
use crate::cpu::realizations::{NUM_REALIZATIONS, SCENE_SEED, realized_radius_squared};
use crate::surfel::{Surfel, SurfelSet};
use crate::transport::EMISSION_THRESHOLD;
use crate::transport::light_list::LightList;
use crate::transport::matrix::{Directions, NOTHING, Receiver, TransportMatrix};
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

/// Buffers of a scene that tracing needs, beside its Gaussians.
#[derive(Debug)]
pub(super) struct TransportBuffers {
    /// Of discs that are as large as the largest of all realizations.
    lights: LightListBuffers,
    /// Squared radii of discs in standard deviations, `[n, NUM_REALIZATIONS]`: as many bytes as the
    /// Gaussians themselves.
    radii: wgpu::Buffer,
}

impl TransportBuffers {
    pub(super) fn new(
        device: &Device,
        set: &SurfelSet,
        lights: Option<&LightList>,
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
            lights: LightListBuffers::new(device, &largest, lights)?,
            radii: device.upload("radii of discs", bytemuck::cast_slice(&realized))?,
        })
    }
}

/// Traces rows of the matrix through a scene on a device.
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

    /// `num` samples, as many in a dispatch as fit.
    fn samples(&self, num: u32) -> impl Iterator<Item = Range<u32>> {
        let at_once = self.samples_at_once;
        (0..num)
            .step_by(at_once as usize)
            .map(move |first| first..first.saturating_add(at_once).min(num))
    }
}

impl TransportRays<'_> {
    /// Rows of `receivers`; see [`TransportMatrix::trace`].
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
        let TransportBuffers { lights, radii } = self.matrix;
        let (device, scene) = (self.device, self.scene);
        // As many receivers and samples at once as a buffer holds entries.
        let samples = directions.bsdf.max(directions.to_lights);
        let max_entries = device.max_bytes() / size_of::<FoundEntry>() as u64;
        let directions_at_once = max_entries.min(u64::from(DIRECTIONS_PER_DISPATCH)) as u32;
        let samples_at_once = samples.clamp(1, SAMPLES_PER_DISPATCH.min(directions_at_once));
        let receivers_at_once = (directions_at_once / samples_at_once) as usize;
        let num_receivers = receivers_at_once.min(receivers.len());
        let piece = Piece::new(device, num_receivers, samples_at_once)?;
        let follow = [
            &piece.uniform,
            &scene.surfels,
            &scene.attributes,
            &lights.nodes,
            &lights.leaf_indices,
            &lights.discs,
            radii,
            &piece.receivers,
            &piece.found,
            &lights.clusters,
        ];
        let add = [&piece.uniform, &piece.found, &piece.targets, &piece.direct];
        for some in receivers.chunks(receivers_at_once) {
            let on_device: Vec<ReceiverOnDevice> = some.iter().map(ReceiverOnDevice::new).collect();
            device.write(&piece.receivers, bytemuck::cast_slice(&on_device));
            let dark = vec![DirectLight::zeroed(); some.len()];
            device.write(&piece.direct, bytemuck::cast_slice(&dark));
            // Light samples, then BSDF samples.
            for (is_towards_lights, num_samples, targets) in [
                (1, directions.to_lights, &mut matrix.light_targets),
                (0, directions.bsdf, &mut matrix.targets),
            ] {
                let start = targets.len();
                targets.resize(start + some.len() * num_samples as usize, NOTHING);
                if is_towards_lights == 1 && lights.num_clusters == 0 {
                    continue;
                }
                for samples in piece.samples(num_samples) {
                    let parameters = TransportParameters {
                        key: key.words(),
                        emission_threshold: EMISSION_THRESHOLD,
                        num_clusters: lights.num_clusters,
                        scene_root: lights.scene_root,
                        light_root: lights.light_root,
                        num_bsdf: directions.bsdf,
                        num_to_lights: directions.to_lights,
                        num_receivers: some.len() as u32,
                        is_towards_lights,
                        first_sample: samples.start,
                        end_sample: samples.end,
                        ..TransportParameters::zeroed()
                    };
                    device.write(&piece.uniform, bytemuck::bytes_of(&parameters));
                    let num_entries = some.len() * samples.len();
                    let (each_entry, each_receiver) =
                        (groups(num_entries as u32), groups(some.len() as u32));
                    device.run(&[
                        // First hit of each direction, and the light of emitters.
                        device.pass(&kernels::FOLLOW_DIRECTIONS, &follow, each_entry),
                        // The light of each receiver.
                        device.pass(&kernels::ADD_UP, &add, each_receiver),
                    ])?;
                    let found: Vec<u32> = device.read(&piece.targets, 0..num_entries)?;
                    let (first, end) = (samples.start as usize, samples.end as usize);
                    let rows = targets[start..].chunks_exact_mut(num_samples as usize);
                    for (row, found) in rows.zip(found.chunks_exact(samples.len())) {
                        row[first..end].copy_from_slice(found);
                    }
                }
            }
            for one in device.read::<DirectLight>(&piece.direct, 0..some.len())? {
                matrix.direct.push(Vec3::from_array(one.light));
                matrix.direct_squares.push(one.squares);
                matrix.num_rays += u64::from(one.num_rays);
            }
        }
        Ok(matrix)
    }
}
