//! The light-transport matrix on a device; [`crate::transport::matrix`] is its CPU counterpart.
//!
//! A dispatch follows one direction of one receiver in each invocation; another one adds up their
//! light. It is added in the order of samples, light samples first (on the CPU, in the order of
//! realizations), so that the bits depend neither on the size of dispatches nor on which receivers
//! are traced together.

use super::device::{Device, Step};
use super::error::GpuError;
use super::layout::{Layout, layout};
use super::light::TreeBuffers;
use super::scene::SceneBuffers;
use super::wgsl;
use crate::cpu::realizations::{SCENE_SEED, realized_radius_squared};
use crate::surfel::{Surfel, SurfelSet};
use crate::transport::EMISSION_THRESHOLD;
use crate::transport::lights::Lights;
use crate::transport::matrix::{Directions, NOTHING, NUM_REALIZATIONS, Receiver, TransportMatrix};
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
    /// BSDF samples of each receiver, in all.
    num_bsdf: u32,
    /// Light samples of each receiver, in all.
    num_to_lights: u32,
    num_receivers: u32,
    /// An [`Aim`].
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
            num_bsdf: "u32",
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

/// Result of one direction.
#[derive(Debug, Clone, Copy)]
#[repr(C)]
#[allow(dead_code, reason = "lives on the device alone; Rust knows its size")]
pub(super) struct FoundEntry {
    /// Of an emitter, weighted.
    light: [f32; 3],
    /// Entry of the matrix, or [`super::bvh::NO_NODE`] where no ray was traced.
    target: u32,
}

impl FoundEntry {
    pub(super) fn layout() -> Layout {
        layout!(FoundEntry {
            light: "vec3f",
            target: "u32",
        })
    }
}

/// Light that the directions of a receiver have found.
#[derive(Debug, Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(super) struct ArrivedLight {
    light: [f32; 3],
    num_rays: u32,
}

impl ArrivedLight {
    pub(super) fn layout() -> Layout {
        layout!(ArrivedLight {
            light: "vec3f",
            num_rays: "u32",
        })
    }
}

/// Buffers of a scene that tracing needs, beside its Gaussians.
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

/// Traces rows of the matrix through a scene on a device.
pub(super) struct TransportRays<'a> {
    pub(super) device: &'a Device,
    pub(super) scene: &'a SceneBuffers,
    pub(super) matrix: &'a TransportBuffers,
}

/// Kind of the directions of a dispatch.
#[derive(Clone, Copy)]
enum Aim {
    /// BSDF samples.
    Normal = 0,
    /// Light samples.
    Lights = 1,
}

/// Buffers for some receivers at once.
struct Piece {
    num_receivers: u32,
    samples_at_once: u32,
    uniform: wgpu::Buffer,
    receivers: wgpu::Buffer,
    found: wgpu::Buffer,
    matrix: wgpu::Buffer,
    arrived: wgpu::Buffer,
}

impl Piece {
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
        let samples = directions.bsdf.max(directions.to_lights);
        let room = self.device.tier().max_bytes() / size_of::<FoundEntry>() as u64;
        let directions_at_once = room.min(u64::from(DIRECTIONS_PER_DISPATCH)) as u32;
        let most_samples = SAMPLES_PER_DISPATCH.min(directions_at_once);
        let samples_at_once = samples.clamp(1, most_samples);
        let at_once = (directions_at_once / samples_at_once) as usize;
        let mut piece = self.piece(at_once.min(receivers.len()), samples_at_once)?;
        let trees = &self.matrix.trees;
        let parameters = TransportParameters {
            key: key.words(),
            emission_threshold: EMISSION_THRESHOLD,
            num_emitters: trees.num_emitters,
            scene_root: trees.scene_root,
            light_root: trees.light_root,
            num_bsdf: directions.bsdf,
            num_to_lights: directions.to_lights,
            ..TransportParameters::zeroed()
        };
        for some in receivers.chunks(at_once) {
            let on_device: Vec<ReceiverOnDevice> = some.iter().map(ReceiverOnDevice::new).collect();
            self.device
                .write(&piece.receivers, bytemuck::cast_slice(&on_device));
            piece.num_receivers = some.len() as u32;
            self.trace_piece(&piece, parameters, &mut matrix)?;
        }
        Ok(matrix)
    }

    fn piece(&self, num_receivers: usize, samples_at_once: u32) -> Result<Piece, GpuError> {
        let device = self.device;
        let of_receivers = |size: usize| (num_receivers * size) as u64;
        let of_directions = |size: usize| of_receivers(samples_at_once as usize * size);
        Ok(Piece {
            num_receivers: 0,
            samples_at_once,
            uniform: device.uniform("matrix", &TransportParameters::zeroed()),
            receivers: device.buffer("receivers", of_receivers(size_of::<ReceiverOnDevice>()))?,
            found: device.buffer("found matrix", of_directions(size_of::<FoundEntry>()))?,
            matrix: device.buffer("matrix", of_directions(size_of::<u32>()))?,
            arrived: device.buffer("arrived light", of_receivers(size_of::<ArrivedLight>()))?,
        })
    }

    /// Adds the rows of the receivers that are in `piece`.
    fn trace_piece(
        &self,
        piece: &Piece,
        parameters: TransportParameters,
        matrix: &mut TransportMatrix,
    ) -> Result<(), GpuError> {
        let num_receivers = piece.num_receivers as usize;
        let dispatch = |aim: Aim, samples: &Range<u32>| {
            let parameters = TransportParameters {
                num_receivers: piece.num_receivers,
                is_towards_lights: aim as u32,
                first_sample: samples.start,
                end_sample: samples.end,
                ..parameters
            };
            self.device
                .write(&piece.uniform, bytemuck::bytes_of(&parameters));
            self.device.run(&self.steps(piece, samples.len() as u32))
        };
        let nothing = vec![ArrivedLight::zeroed(); num_receivers];
        self.device
            .write(&piece.arrived, bytemuck::cast_slice(&nothing));
        for (aim, num_samples, targets) in [
            (
                Aim::Lights,
                parameters.num_to_lights,
                &mut matrix.light_targets,
            ),
            (Aim::Normal, parameters.num_bsdf, &mut matrix.targets),
        ] {
            let start = targets.len();
            targets.resize(start + num_receivers * num_samples as usize, NOTHING);
            if matches!(aim, Aim::Lights) && parameters.num_emitters == 0 {
                continue;
            }
            for samples in piece.samples(num_samples) {
                dispatch(aim, &samples)?;
                let found: Vec<u32> = self
                    .device
                    .read(&piece.matrix, 0..num_receivers * samples.len())?;
                let (first, end) = (samples.start as usize, samples.end as usize);
                let rows = targets[start..].chunks_exact_mut(num_samples as usize);
                for (row, found) in rows.zip(found.chunks_exact(samples.len())) {
                    row[first..end].copy_from_slice(found);
                }
            }
        }
        let arrived: Vec<ArrivedLight> = self.device.read(&piece.arrived, 0..num_receivers)?;
        for one in arrived {
            matrix.direct.push(Vec3::from_array(one.light));
            matrix.num_rays += u64::from(one.num_rays);
        }
        Ok(())
    }

    fn steps(&self, piece: &Piece, num_samples: u32) -> [Step; 2] {
        let TransportBuffers { trees, radii } = self.matrix;
        let uniform = (1, &piece.uniform);
        let follow = [
            uniform,
            (2, &self.scene.surfels),
            (3, &self.scene.attributes),
            (4, &trees.nodes),
            (5, &trees.leaf_indices),
            (6, &trees.emitters),
            (7, radii),
            (8, &piece.receivers),
            (9, &piece.found),
        ];
        let add = [
            uniform,
            (9, &piece.found),
            (10, &piece.matrix),
            (11, &piece.arrived),
        ];
        let num_directions = piece.num_receivers * num_samples;
        let step = |entry, buffers: &[(u32, &wgpu::Buffer)], invocations: u32| {
            (self.device).step(&wgsl::LINKS, entry, buffers, invocations.div_ceil(64))
        };
        [
            step("follow_directions", &follow, num_directions),
            step("add_up", &add, piece.num_receivers),
        ]
    }
}
