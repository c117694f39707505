//! The file of a traced transport: a sealed header, and arrays of it.

use super::super::bright::{self, BrightSurfaces};
use super::super::receivers::{Faint, NO_SOURCE, NUM_SOURCES, Receivers, Sources};
use super::{TracedTransport, emitters};
use crate::error::Result;
use eagpt_scene::files::{Key, SealedFormat};
use eagpt_scene::lamps::emits;
use eagpt_scene::{Gaussians, SceneError};
use eagpt_trace::transport::matrix::{
    Directions, EMITTER, Front, NOTHING, Receiver, TransportMatrix,
};
use eagpt_trace::transport::start::Surface;
use glam::Vec3;
use serde::{Deserialize, Serialize};
use std::path::Path;

const FORMAT: SealedFormat = SealedFormat {
    magic: b"EAGPTTRA",
    version: 6,
    noun: "transport matrix",
};

#[derive(Serialize, Deserialize)]
struct Header {
    key: Key,
    directions: [u32; 2],
    num_lights: usize,
    num_receivers: usize,
    num_faint: usize,
    num_fronts: usize,
    num_rows: usize,
    /// `None` before bright surfaces are known.
    num_bright: Option<usize>,
}

/// Values of a receiver: index, position, normal, offset.
const RECEIVER: usize = 8;
/// Values of a bright surface: index, radiance.
const BRIGHT: usize = 4;
/// Values of a faint Gaussian: index, sources.
const FAINT: usize = 1 + NUM_SOURCES;

impl TracedTransport {
    /// Writes the file at `path`.
    ///
    /// # Errors
    /// If it cannot be written.
    pub(in crate::bake) fn write(&self, path: &Path) -> Result<()> {
        let header = Header {
            key: self.key.clone(),
            directions: [self.directions.bsdf, self.directions.to_lights],
            num_lights: self.lights.len(),
            num_receivers: self.receivers.traced.len(),
            num_faint: self.receivers.faint.len(),
            num_fronts: self.receivers.fronts.len(),
            num_rows: self.num_rows(),
            num_bright: self.bright.as_ref().map(|bright| bright.surfaces.len()),
        };
        let receivers: Vec<f32> = (self.receivers.traced.iter())
            .flat_map(|(index, surface)| {
                let [x, y, z] = surface.position.to_array();
                let [u, v, w] = surface.normal.to_array();
                [f32::from_bits(*index), x, y, z, u, v, w, surface.offset]
            })
            .collect();
        let faint: Vec<f32> = (self.receivers.faint.iter())
            .flat_map(|one| [one.gaussian].into_iter().chain(one.sources.0))
            .map(f32::from_bits)
            .collect();
        let direct: Vec<f32> = self.matrix.direct.iter().flat_map(Vec3::to_array).collect();
        let fronts: Vec<f32> = self.receivers.fronts.iter().map(|f| f.sign()).collect();
        let floats = |of: &[u32]| of.iter().map(|&i| f32::from_bits(i)).collect::<Vec<f32>>();
        let targets = floats(&self.matrix.targets);
        let light_targets = floats(&self.matrix.light_targets);
        let surfaces = self.bright.iter().flat_map(|bright| &bright.surfaces);
        let bright: Vec<f32> = surfaces
            .flat_map(|(index, radiance)| {
                [f32::from_bits(*index)]
                    .into_iter()
                    .chain(radiance.to_array())
            })
            .collect();
        let bright_targets = self.bright.as_ref().map(|bright| floats(&bright.targets));
        FORMAT.write(
            path,
            &header,
            &[
                self.lights.as_flattened(),
                &receivers,
                &faint,
                &fronts,
                &direct,
                &self.matrix.direct_squares,
                &targets,
                &light_targets,
                &bright,
                bright_targets.as_deref().unwrap_or_default(),
            ],
        )?;
        Ok(())
    }

    /// Reads a file.
    ///
    /// # Errors
    /// If it cannot be read or is damaged.
    pub(in crate::bake) fn read(path: &Path) -> Result<Self> {
        let (header, values): (Header, _) = FORMAT.read(path)?;
        let damaged = || SceneError::invalid(path, "arrays", "the transport matrix is damaged");
        let [bsdf, to_lights] = header.directions;
        let directions = Directions { bsdf, to_lights };
        let num_bright = header.num_bright.unwrap_or(0);
        let to_bright = match num_bright {
            0 => 0,
            _ => bright::num_samples(directions) as usize,
        };
        let lengths = [
            header.num_lights.checked_mul(4),
            header.num_receivers.checked_mul(RECEIVER),
            header.num_faint.checked_mul(FAINT),
            Some(header.num_fronts),
            header.num_rows.checked_mul(3),
            Some(header.num_rows),
            header.num_rows.checked_mul(bsdf as usize),
            header.num_rows.checked_mul(to_lights as usize),
            num_bright.checked_mul(BRIGHT),
            header.num_rows.checked_mul(to_bright),
        ];
        let mut rest = values.as_slice();
        let mut arrays = [&rest[..0]; 10];
        for (array, length) in arrays.iter_mut().zip(lengths) {
            (*array, rest) = length
                .and_then(|length| rest.split_at_checked(length))
                .ok_or_else(damaged)?;
        }
        let [
            lights,
            receivers,
            faint,
            fronts,
            direct,
            squares,
            targets,
            light_targets,
            surfaces,
            bright_targets,
        ] = arrays;
        let bits = |of: &[f32]| of.iter().map(|value| value.to_bits()).collect::<Vec<u32>>();
        let traced = Self {
            key: header.key,
            directions,
            lights: lights.as_chunks().0.to_vec(),
            receivers: Receivers {
                traced: receivers.as_chunks().0.iter().map(receiver).collect(),
                faint: (bits(faint).as_chunks().0.iter())
                    .map(|&[gaussian, ref sources @ ..]: &[u32; FAINT]| Faint {
                        gaussian,
                        sources: Sources(*sources),
                    })
                    .collect(),
                fronts: fronts.iter().map(|&sign| Front::of_sign(sign)).collect(),
            },
            matrix: TransportMatrix {
                direct: direct
                    .as_chunks()
                    .0
                    .iter()
                    .map(|l| Vec3::from_array(*l))
                    .collect(),
                direct_squares: squares.to_vec(),
                targets: bits(targets),
                light_targets: bits(light_targets),
                ..TransportMatrix::default()
            },
            bright: header.num_bright.map(|_| BrightSurfaces {
                surfaces: (surfaces.as_chunks().0.iter())
                    .map(|&[index, r, g, b]: &[f32; BRIGHT]| (index.to_bits(), Vec3::new(r, g, b)))
                    .collect(),
                targets: bits(bright_targets),
                num_rays: 0,
            }),
        };
        if !rest.is_empty() || header.num_rows > header.num_receivers {
            return Err(damaged().into());
        }
        Ok(traced)
    }

    /// True if all indices are of Gaussians of `scene`, and there is light for each emitter.
    pub(in crate::bake) fn fits(&self, scene: &Gaussians) -> bool {
        let is_index = |i: u32| (i as usize) < scene.len();
        let is_emitter = |i: u32| is_index(i) && emits(scene.emissions[i as usize]);
        let is_target = |&target: &u32| match target & EMITTER {
            0 => target == NOTHING || is_index(target),
            _ => is_emitter(target & !EMITTER),
        };
        let reflects = |i: u32| is_index(i) && !emits(scene.emissions[i as usize]);
        let is_bright_target = |&target: &u32| match target & EMITTER {
            0 => target == NOTHING || is_index(target),
            _ => reflects(target & !EMITTER),
        };
        let num_traced = self.receivers.traced.len();
        let is_source = |&row: &u32| row == NO_SOURCE || (row as usize) < num_traced;
        let has_sources = |faint: &Faint| {
            let sources = &faint.sources.0;
            is_index(faint.gaussian) && sources[0] != NO_SOURCE && sources.iter().all(is_source)
        };
        self.lights.len() == emitters(scene).count()
            && self.receivers.fronts.len() == scene.len()
            && (self.receivers.traced.iter()).all(|(index, _)| is_index(*index))
            && self.receivers.faint.iter().all(has_sources)
            && self.matrix.targets.iter().all(is_target)
            && self.matrix.light_targets.iter().all(is_target)
            && self.bright.iter().all(|bright| {
                bright.surfaces.iter().all(|(i, _)| reflects(*i))
                    && bright.targets.iter().all(is_bright_target)
            })
    }
}

fn receiver(&[index, x, y, z, u, v, w, offset]: &[f32; RECEIVER]) -> Receiver {
    let surface = Surface {
        position: Vec3::new(x, y, z),
        normal: Vec3::new(u, v, w),
        offset,
    };
    (index.to_bits(), surface)
}
