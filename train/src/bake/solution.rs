//! Light baking in Gaussian space of a scene in memory: nothing is stored, nothing resumes.

use super::emitters::{emits, forget_directions, with_emitters};
use super::highlights::Highlights;
use super::receivers::Receivers;
use super::request::{GaussianBake, Told};
use super::series::{Exchange, sum_of_bounces};
use super::transport::PIECE;
use crate::error::Result;
use crate::irradiance;
use crate::progress::BakeProgress;
use eagpt_scene::rng::{Purpose, RandomKey};
use eagpt_scene::{Camera, Gaussians};
use eagpt_trace::Device;
use eagpt_trace::transport::bsdf::equivalent_albedos;
use eagpt_trace::transport::matrix::TransportMatrix;

/// Options that decide a solution, beside the scene.
#[derive(Debug)]
pub(crate) struct Solution<'a> {
    /// Device that traces rays.
    pub(crate) device: &'a Device,
    /// Cameras that say where the surface of each Gaussian is.
    pub(crate) cameras: &'a [Camera],
    /// Directions at each Gaussian.
    pub(crate) method: GaussianBake,
    /// Maximum path depth, at least 1.
    pub(crate) max_bounces: u32,
    /// Seed of the random numbers.
    pub(crate) seed: u64,
}

impl Solution<'_> {
    /// The scene with its light baked; `None` where nothing emits, or `told` has ended it.
    ///
    /// # Errors
    /// If the device fails or has not enough memory.
    pub(crate) fn of(
        &self,
        mut scene: Gaussians,
        told: &mut Told<'_>,
    ) -> Result<Option<Gaussians>> {
        if !scene.emissions.iter().any(|&e| emits(e)) {
            return Ok(None);
        }
        forget_directions(&mut scene);
        let directions = irradiance::directions(self.method.number(scene.len(), false));
        let key = RandomKey::new(self.seed, Purpose::Bake, 1);
        let mut tracer = self.device.scene(&scene)?;
        let cameras = self.cameras.iter();
        let Some(receivers) = Receivers::find(&*tracer, &scene, cameras, told)? else {
            return Ok(None);
        };
        let mut matrix = TransportMatrix::default();
        let (mut done, total) = (0, receivers.traced.len());
        for piece in receivers.traced.chunks(PIECE) {
            if told(BakeProgress::Gathering { done, total }).is_break() {
                return Ok(None);
            }
            matrix.append(tracer.trace_transport(piece, directions, key)?);
            done += piece.len();
        }
        let mut goes_on = told(BakeProgress::Gathering { done, total });
        let mut tell = |progress| {
            if goes_on.is_continue() {
                goes_on = told(progress);
            }
        };
        let light = Exchange::new(&receivers, &matrix, directions);
        let bounces = self.max_bounces;
        let albedos = equivalent_albedos(&scene);
        let reflected = sum_of_bounces(&albedos, &light, bounces, None, &mut tell);
        if goes_on.is_break() {
            return Ok(None);
        }
        scene.radiances = with_emitters(&scene, &reflected.total);
        let highlights = Highlights::new(&scene, &receivers, self.cameras, self.seed);
        if let Some(highlights) = highlights {
            scene.harmonics = highlights.harmonics(&scene, &mut *tracer)?;
        }
        Ok(Some(scene))
    }
}
