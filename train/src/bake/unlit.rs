//! Light that emitters reflect of others: it shows once their own lamp is off.
//!
//! In photographs an emitter has one radiance, of what it sends out and what it reflects together.
//! A basis of lights has both apart, so that a lamp at the factor 0 is a surface like others.
//! Lamps are convex: what discs of a lamp seem to receive of their own lamp is left out.

use super::receivers::Receivers;
use super::transport::TracedTransport;
use crate::error::Result;
use eagpt_light::irradiance::smooth::Smoothing;
use eagpt_light::irradiance::{self, NoisyLight, PIECE};
use eagpt_light::surfaces;
use eagpt_scene::files::Key;
use eagpt_scene::rng::RandomKey;
use eagpt_scene::{Camera, Gaussians, LightGroups, light_basis::NO_LIGHT};
use eagpt_trace::Tracer;
use eagpt_trace::transport::matrix::{Directions, Front, Receiver};
use glam::Vec3;

/// Rays to and from the emitters of a scene.
pub(super) struct Unlit<'a> {
    /// Has the Gaussians of the scene, with the light of `sampled`.
    pub(super) tracer: &'a dyn Tracer,
    /// The scene with the light that light samples are chosen by.
    pub(super) sampled: &'a Gaussians,
    pub(super) lights: &'a LightGroups,
    /// Cameras that see the emitters.
    pub(super) cameras: &'a [Camera],
    /// The sides from which Gaussians are seen, `[n]`.
    pub(super) fronts: &'a [Front],
    pub(super) directions: Directions,
    pub(super) key: RandomKey,
}

impl Unlit<'_> {
    /// Adds to `reflected`, what the other Gaussians of `scene` reflect of each light, `[n, lights]`,
    /// what emitters of these `albedos`, `[n]`, do. Returns the number of rays traced.
    ///
    /// # Errors
    /// If the device fails.
    pub(super) fn add(
        &self,
        scene: &Gaussians,
        albedos: &[Vec3],
        reflected: &mut [Vec3],
    ) -> Result<u64> {
        let receivers = self.receivers(scene)?;
        if receivers.is_empty() {
            return Ok(0);
        }
        let rows = TracedTransport::new(
            Key::new(),
            self.directions,
            self.sampled,
            Receivers {
                traced: receivers.clone(),
                faint: Vec::new(),
                fronts: self.fronts.to_vec(),
            },
        );
        let rows = self.traced(rows)?;
        let num = self.lights.names.len();
        let own = |(i, _): &Receiver| self.lights.of[*i as usize] as usize;
        let direct = rows.direct_of(scene, self.key, self.lights);
        let mut parts = rows
            .matrix
            .from_others_of_groups(self.directions, reflected, num);
        for (row, receiver) in receivers.iter().enumerate() {
            let part = num * row..num * (row + 1);
            for (sum, direct) in parts[part.clone()].iter_mut().zip(&direct[part.clone()]) {
                *sum += *direct;
            }
            parts[part][own(receiver)] = Vec3::ZERO;
        }
        let variances = rows.matrix.variance_of_direct(self.directions);
        let noisy = NoisyLight {
            irradiance: parts
                .chunks_exact(num)
                .map(|row| row.iter().sum())
                .collect(),
            variances,
        };
        let parts = noisy.smoothed_parts(&Smoothing::new(&receivers), &parts, num);
        for ((i, _), light) in receivers.iter().zip(parts.chunks_exact(num)) {
            let i = *i as usize;
            for (sum, light) in reflected[num * i..][..num].iter_mut().zip(light) {
                *sum = albedos[i] * *light;
            }
        }
        Ok(rows.matrix.num_rays)
    }

    /// The emitters, each on its own plane, seen by a camera.
    fn receivers(&self, scene: &Gaussians) -> Result<Vec<Receiver>> {
        let emitting = (0..scene.len()).filter(|&i| self.lights.of[i] != NO_LIGHT);
        let emitting: Vec<usize> = emitting.collect();
        let eyes: Vec<Vec3> = self.cameras.iter().map(Camera::origin).collect();
        let emitters = emitting.iter().map(|&i| scene.get(i));
        let surfaces = surfaces::lone(self.tracer, emitters, &eyes)?;
        Ok(emitting.iter().map(|&i| i as u32).zip(surfaces).collect())
    }

    fn traced(&self, mut rows: TracedTransport) -> Result<TracedTransport> {
        for piece in rows.receivers.traced.chunks(PIECE) {
            let among = (self.tracer, self.sampled, rows.receivers.fronts.as_slice());
            let more = irradiance::rows(among, piece, self.directions, self.key)?;
            rows.matrix.append(more);
        }
        Ok(rows)
    }
}
