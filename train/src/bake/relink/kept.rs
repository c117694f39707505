//! The file in which a bake keeps its matrix for the next one.

use super::rows::{KeptReceiver, Rows};
use crate::bake::gaussians::LONE;
use crate::error::Result;
use crate::sealed::Kind;
use crate::surfaces::Seen;
use eagpt_scene::{Gaussian, Gaussians, Harmonics, SceneError};
use eagpt_trace::transport::matrix::NOTHING;
use eagpt_trace::transport::start::Surface;
use glam::{Quat, Vec2, Vec3};
use serde::{Deserialize, Serialize};
use std::path::Path;

const KIND: Kind = Kind {
    magic: b"EAGPTLNK",
    version: 1,
    noun: "file of matrix",
};

/// What matrix depend on beside the scene.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Setup {
    /// Digest of the cameras' file.
    pub(super) cameras: String,
    /// Which of them count.
    pub(super) frames: Vec<usize>,
    /// Directions about the normal, and towards emitters.
    pub(super) directions: [u32; 2],
    pub(super) seed: u64,
}

#[derive(Serialize, Deserialize)]
struct Header {
    #[serde(flatten)]
    setup: Setup,
    num_gaussians: usize,
    num_lights: usize,
    num_receivers: usize,
}

/// Numbers of a [`Shape`].
const SHAPE: usize = 10;
/// Numbers of an emitter: its shape, radiance and emission.
const LIGHT: usize = SHAPE + 4;
/// Numbers of a receiver beside its targets: index, element, camera, position, normal, offset and
/// weight.
const RECEIVER: usize = 11;

/// Bits of the geometry of a Gaussian: position, scale, rotation, opacity.
pub(super) type Shape = [u32; SHAPE];

/// The geometry of `g`.
pub(super) fn shape(g: &Gaussian) -> Shape {
    let mut values = [0.0; SHAPE];
    values[..3].copy_from_slice(&g.position.to_array());
    values[3..5].copy_from_slice(&g.scale.to_array());
    values[5..9].copy_from_slice(&g.rotation.to_array());
    values[9] = g.opacity;
    values.map(f32::to_bits)
}

/// A Gaussian of that geometry, without light.
pub(super) fn shaped(shape: &Shape) -> Gaussian {
    let values = shape.map(f32::from_bits);
    Gaussian {
        position: Vec3::from_slice(&values[..3]),
        scale: Vec2::from_slice(&values[3..5]),
        rotation: Quat::from_slice(&values[5..9]),
        opacity: values[9],
        radiance: Vec3::ZERO,
        harmonics: Harmonics::NONE,
        emission: 0.0,
        albedo: Vec3::ZERO,
    }
}

/// TransportMatrix of a bake, direction by direction.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Kept {
    pub(super) setup: Setup,
    /// Geometry of the scene, `[n]`.
    pub(super) shapes: Vec<Shape>,
    /// The emitters that directions look for.
    pub(super) lights: Gaussians,
    pub(super) rows: Rows,
}

impl Kept {
    /// What is known before the first bake.
    pub(super) fn nothing(setup: Setup) -> Self {
        Self {
            setup,
            shapes: Vec::new(),
            lights: Gaussians::default(),
            rows: Rows::default(),
        }
    }

    /// Writes the file.
    pub(super) fn write(&self, path: &Path) -> Result<()> {
        let header = Header {
            setup: self.setup.clone(),
            num_gaussians: self.shapes.len(),
            num_lights: self.lights.len(),
            num_receivers: self.rows.receivers.len(),
        };
        let Rows {
            receivers,
            targets,
            weights,
        } = &self.rows;
        let float = |bits: &u32| f32::from_bits(*bits);
        let shapes: Vec<f32> = self.shapes.iter().flatten().map(float).collect();
        let lights: Vec<f32> = self.lights.iter().flat_map(|g| light_values(&g)).collect();
        let rows: Vec<f32> = receivers.iter().flat_map(row_values).collect();
        let targets: Vec<f32> = targets.iter().map(float).collect();
        let arrays: [&[f32]; 5] = [&shapes, &lights, &rows, &targets, weights];
        KIND.write(path, &header, &arrays)
    }

    /// Reads a file.
    pub(super) fn read(path: &Path) -> Result<Self> {
        let (header, values): (Header, _) = KIND.read(path)?;
        let damaged = || SceneError::invalid(path, "arrays", "the file of matrix is damaged");
        let setup = header.setup;
        let num_directions: usize = setup.directions.iter().map(|&num| num as usize).sum();
        let lengths = [
            header.num_gaussians.checked_mul(SHAPE),
            header.num_lights.checked_mul(LIGHT),
            header.num_receivers.checked_mul(RECEIVER),
            header.num_receivers.checked_mul(num_directions),
            header.num_receivers.checked_mul(num_directions),
        ];
        let mut rest = values.as_slice();
        let mut take = |length: Option<usize>| {
            let (array, left) = length
                .and_then(|length| rest.split_at_checked(length))
                .ok_or_else(damaged)?;
            rest = left;
            Ok::<_, SceneError>(array)
        };
        let [shapes, lights, rows, targets, weights] = lengths.map(&mut take);
        let (shapes, lights, rows) = (shapes?, lights?, rows?);
        let (targets, weights) = (targets?, weights?);
        let kept = Self {
            setup,
            shapes: (shapes.as_chunks::<SHAPE>().0.iter())
                .map(|values| values.map(f32::to_bits))
                .collect(),
            lights: lights.as_chunks().0.iter().map(light).collect(),
            rows: Rows {
                receivers: rows.as_chunks().0.iter().map(row).collect(),
                targets: targets.iter().map(|value| value.to_bits()).collect(),
                weights: weights.to_vec(),
            },
        };
        let is_index = |&i: &u32| (i as usize) < kept.shapes.len();
        let is_camera = |i: u32| i == LONE || (i as usize) < kept.setup.frames.len();
        let is_whole = rest.is_empty()
            && (kept.rows.receivers.iter())
                .all(|one| is_index(&one.index) && is_camera(one.seen.camera))
            && (kept.rows.targets.iter()).all(|target| *target == NOTHING || is_index(target));
        if is_whole {
            Ok(kept)
        } else {
            Err(damaged().into())
        }
    }
}

fn light_values(g: &Gaussian) -> [f32; LIGHT] {
    let mut values = [0.0; LIGHT];
    values[..SHAPE].copy_from_slice(&shape(g).map(f32::from_bits));
    values[SHAPE..SHAPE + 3].copy_from_slice(&g.radiance.to_array());
    values[SHAPE + 3] = g.emission;
    values
}

fn light(values: &[f32; LIGHT]) -> Gaussian {
    let (shape, light) = values.split_first_chunk().expect("a shape comes first");
    Gaussian {
        radiance: Vec3::from_slice(&light[..3]),
        emission: light[3],
        ..shaped(&shape.map(f32::to_bits))
    }
}

fn row_values(one: &KeptReceiver) -> [f32; RECEIVER] {
    let mut values = [0.0; RECEIVER];
    let Seen {
        surface,
        weight,
        camera,
    } = one.seen;
    values[..3].copy_from_slice(&[one.index, one.element, camera].map(f32::from_bits));
    values[3..6].copy_from_slice(&surface.position.to_array());
    values[6..9].copy_from_slice(&surface.normal.to_array());
    values[9..].copy_from_slice(&[surface.offset, weight]);
    values
}

fn row(values: &[f32; RECEIVER]) -> KeptReceiver {
    let surface = Surface {
        position: Vec3::from_slice(&values[3..6]),
        normal: Vec3::from_slice(&values[6..9]),
        offset: values[9],
    };
    KeptReceiver {
        index: values[0].to_bits(),
        element: values[1].to_bits(),
        seen: Seen {
            surface,
            weight: values[10],
            camera: values[2].to_bits(),
        },
    }
}
