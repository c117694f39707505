//! The traced part of a bake, kept on disk: receivers and their rows of the transport matrix.
//!
//! One rule says what a file is good for. Rays depend on the geometry (positions, scales,
//! rotations, opacities), on which Gaussians emit, and on cameras, samples and seed. As long as all
//! of these are the same to the bit, the rays are; everything else is traced anew. Albedos are not
//! among them, nor is the light of emitters: new light of the same emitters is weighted as light of
//! those that directions were chosen for ([`TransportMatrix::relight`]). Light samples are shared
//! among emitters by the light they give, so that an emitter that has become much brighter beside
//! others would be sampled too little: then, too, all is traced anew.
//!
//! The same file holds a bake under way, with the rows done so far.

use super::bright::{self, BrightSurfaces};
use super::emitters::emits;
use super::receivers::{Faint, NO_SOURCE, NUM_SOURCES, Receivers, Sources};
use crate::error::Result;
use eagpt_scene::files::{Key, SealedFormat};
use eagpt_scene::rng::RandomKey;
use eagpt_scene::{Gaussian, Gaussians, LightGroups, SceneError};
use eagpt_trace::surfel::SurfelSet;
use eagpt_trace::transport::light_list::LightList;
use eagpt_trace::transport::lights;
use eagpt_trace::transport::matrix::{
    Directions, EMITTER, Front, Groups, NOTHING, Receiver, Tracing, TransportMatrix,
};
use eagpt_trace::transport::start::Surface;
use glam::Vec3;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Light samples are kept as long as no emitter has more than this times the share of the light
/// that it had when they were chosen. The noise that it adds is at most that of as many times fewer
/// samples.
const MAX_UNDERRATED: f64 = 4.0;

/// Receivers traced between two checks for a request to stop.
pub(super) const PIECE: usize = 4096;

const FORMAT: SealedFormat = SealedFormat {
    magic: b"EAGPTTRA",
    version: 6,
    noun: "transport matrix",
};

/// Radiance and emission of an emitter.
type EmitterLight = [f32; 4];

/// Receivers, and as many rows of their matrix as are traced.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct TracedTransport {
    /// Everything that decides rays: parts "geometry", "cameras", "samples" and "seed".
    pub(super) key: Key,
    directions: Directions,
    /// Light of the emitters that light samples were chosen for, in the order of their indices.
    lights: Vec<EmitterLight>,
    pub(super) receivers: Receivers,
    pub(super) matrix: TransportMatrix,
    /// Samples to what is bright, once all rows are there.
    pub(super) bright: Option<BrightSurfaces>,
}

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
    /// Nothing traced yet for `receivers` of `scene`.
    pub(super) fn new(
        key: Key,
        directions: Directions,
        scene: &Gaussians,
        receivers: Receivers,
    ) -> Self {
        Self {
            key,
            directions,
            lights: emitters(scene).map(|g| light(&g)).collect(),
            receivers,
            matrix: TransportMatrix::default(),
            bright: None,
        }
    }

    pub(super) fn num_rows(&self) -> usize {
        self.matrix.direct.len()
    }

    /// True if light samples suit the light of the emitters of `scene`, whose geometry is the same.
    pub(super) fn suits(&self, scene: &Gaussians) -> bool {
        let now: Vec<f64> = emitters(scene).map(|g| lights::power(&g)).collect();
        let then: Vec<f64> = self.sampled(scene).map(|g| lights::power(&g)).collect();
        let (total_now, total_then) = (now.iter().sum::<f64>(), then.iter().sum::<f64>());
        (now.iter().zip(&then))
            .all(|(now, then)| now / total_now <= MAX_UNDERRATED * (then / total_then))
    }

    /// True if the rows may be given the light of the emitters of `scene`, whose geometry is the
    /// same. Rows that are not all there are only for the light that they were begun with.
    pub(super) fn serves(&self, scene: &Gaussians) -> bool {
        let is_whole = self.num_rows() == self.receivers.traced.len();
        self.has_light_of(scene) || (is_whole && self.suits(scene))
    }

    /// Gives the rows, all of which are there with the light that they were traced with by random
    /// numbers of `key`, that of the emitters of `scene`.
    pub(super) fn relight(&mut self, scene: &Gaussians, key: RandomKey) {
        if self.has_light_of(scene) {
            return;
        }
        let lights = self.sampled_lights(scene);
        let tracing = Tracing {
            receivers: &self.receivers.traced,
            directions: self.directions,
            key,
            lights: lights.as_ref(),
        };
        self.matrix.relight(&tracing, &scene.radiances);
    }

    /// True if light samples were chosen for the light of `scene`.
    fn has_light_of(&self, scene: &Gaussians) -> bool {
        let now = emitters(scene).map(|g| light(&g));
        now.eq(self.lights.iter().copied())
    }

    /// The direct light of all rows, traced with random numbers of `key`, by lights:
    /// `[receivers, lights]`.
    pub(super) fn direct_of(
        &self,
        scene: &Gaussians,
        key: RandomKey,
        lights: &LightGroups,
    ) -> Vec<Vec3> {
        let sampled = self.sampled_lights(scene);
        let tracing = Tracing {
            receivers: &self.receivers.traced,
            directions: self.directions,
            key,
            lights: sampled.as_ref(),
        };
        let groups = Groups {
            num: lights.names.len(),
            of: &lights.of,
        };
        self.matrix
            .direct_of_groups(&tracing, &scene.radiances, groups)
    }

    /// The lights that light samples were chosen from.
    fn sampled_lights(&self, scene: &Gaussians) -> Option<LightList> {
        let mut sampled = scene.clone();
        let emitting = (0..scene.len()).filter(|&i| emits(scene.emissions[i]));
        for (i, g) in emitting.zip(self.sampled(scene)) {
            (sampled.radiances[i], sampled.emissions[i]) = (g.radiance, g.emission);
        }
        LightList::new(&SurfelSet::new(&sampled))
    }

    /// The emitters of `scene` with the light that light samples were chosen for.
    fn sampled(&self, scene: &Gaussians) -> impl Iterator<Item = Gaussian> {
        emitters(scene)
            .zip(&self.lights)
            .map(|(g, &[r, green, b, emission])| Gaussian {
                radiance: Vec3::new(r, green, b),
                emission,
                ..g
            })
    }

    /// Writes the file at `path`.
    ///
    /// # Errors
    /// If it cannot be written.
    pub(super) fn write(&self, path: &Path) -> Result<()> {
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
    pub(super) fn read(path: &Path) -> Result<Self> {
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
    pub(super) fn fits(&self, scene: &Gaussians) -> bool {
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

fn emitters(scene: &Gaussians) -> impl Iterator<Item = Gaussian> {
    scene.iter().filter(|g| emits(g.emission))
}

fn light(g: &Gaussian) -> EmitterLight {
    let [r, green, b] = g.radiance.to_array();
    [r, green, b, g.emission]
}
