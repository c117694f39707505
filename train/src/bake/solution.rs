//! Light baking in Gaussian space of a scene in memory: nothing is stored, nothing resumes.

use super::bright::BrightSurfaces;
use super::emitters::{forget_directions, with_emitters};
use super::highlights::Highlights;
use super::receivers::Receivers;
use super::request::{GaussianBake, Told};
use super::series::{Exchange, limit_growth, sum_of_bounces};
use crate::error::Result;
use crate::progress::BakeProgress;
use eagpt_light::irradiance::{self, PIECE};
use eagpt_scene::lamps::emits;
use eagpt_scene::rng::{Purpose, RandomKey};
use eagpt_scene::{Camera, Gaussians};
use eagpt_trace::transport::bsdf::equivalent_albedos;
use eagpt_trace::transport::matrix::{Directions, TransportMatrix};
use eagpt_trace::{Device, Tracer};
use std::ops::ControlFlow;

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

/// The rays of a scene, which serve any albedos.
pub(crate) struct TracedScene<'a> {
    solution: &'a Solution<'a>,
    tracer: Box<dyn Tracer>,
    directions: Directions,
    receivers: Receivers,
    matrix: TransportMatrix,
}

/// A scene with its light.
#[derive(Debug)]
pub(crate) struct Solved {
    /// The scene, with the light baked.
    pub(crate) scene: Gaussians,
    /// Luminance of what Gaussians reflect by bounces, in sum, `[bounces]`.
    pub(crate) bounces: Vec<f64>,
}

impl Solution<'_> {
    /// Traces a scene; `None` where nothing emits, or `told` has ended it.
    ///
    /// # Errors
    /// If the device fails or has not enough memory.
    pub(crate) fn trace(
        &self,
        scene: &Gaussians,
        told: &mut Told<'_>,
    ) -> Result<Option<TracedScene<'_>>> {
        if !scene.emissions.iter().any(|&e| emits(e)) {
            return Ok(None);
        }
        let mut scene = scene.clone();
        forget_directions(&mut scene);
        let directions = irradiance::directions(self.method.number(scene.len(), false));
        let mut tracer = self.device.scene(&scene)?;
        let cameras = self.cameras.iter();
        let Some(receivers) = Receivers::find(&*tracer, &scene, cameras, told)? else {
            return Ok(None);
        };
        let key = RandomKey::new(self.seed, Purpose::Bake, 1);
        let mut matrix = TransportMatrix::default();
        let (mut done, total) = (0, receivers.traced.len());
        for piece in receivers.traced.chunks(PIECE) {
            if told(BakeProgress::Gathering { done, total }).is_break() {
                return Ok(None);
            }
            let among = (&*tracer, &scene, receivers.fronts.as_slice());
            matrix.append(irradiance::rows(among, piece, directions, key)?);
            done += piece.len();
        }
        if told(BakeProgress::Gathering { done, total }).is_break() {
            return Ok(None);
        }
        let mut bright = BrightSurfaces::new(&scene, &receivers, &matrix.direct);
        let mut goes_on = |done| told(BakeProgress::Gathering { done, total }).is_continue();
        let samples = (directions, self.seed);
        let traced = &receivers.traced;
        if !bright.trace((&mut *tracer, &scene), traced, samples, &mut goes_on)? {
            return Ok(None);
        }
        bright.add_to(
            &mut matrix,
            &scene,
            &receivers,
            (directions, key, self.seed),
        );
        Ok(Some(TracedScene {
            solution: self,
            tracer,
            directions,
            receivers,
            matrix,
        }))
    }
}

impl TracedScene<'_> {
    /// Darkens the Gaussians of the scene that was traced between which light grows with each
    /// bounce; returns how many.
    pub(crate) fn limit_growth(&self, scene: &mut Gaussians) -> usize {
        limit_growth(scene, &self.exchange())
    }

    /// Who lights whom in it.
    fn exchange(&self) -> Exchange<'_> {
        Exchange::new(&self.receivers, &self.matrix, self.directions)
    }

    /// Solves the light of the scene that was traced, whose albedos may differ; `None` where `told`
    /// has ended it.
    ///
    /// # Errors
    /// If the device fails.
    pub(crate) fn solve(
        &mut self,
        mut scene: Gaussians,
        told: &mut Told<'_>,
    ) -> Result<Option<Solved>> {
        forget_directions(&mut scene);
        let mut goes_on = ControlFlow::Continue(());
        let mut tell = |progress| {
            if goes_on.is_continue() {
                goes_on = told(progress);
            }
        };
        let light = self.exchange();
        let &Solution {
            cameras,
            max_bounces,
            seed,
            ..
        } = self.solution;
        let albedos = equivalent_albedos(&scene);
        let reflected = sum_of_bounces(&albedos, &light, max_bounces, None, &mut tell);
        if goes_on.is_break() {
            return Ok(None);
        }
        scene.radiances = with_emitters(&scene, &reflected.total);
        if let Some(highlights) = Highlights::new(&scene, &self.receivers, cameras, seed) {
            scene.harmonics = highlights.harmonics(&scene, &mut *self.tracer)?;
        }
        Ok(Some(Solved {
            scene,
            bounces: reflected.bounces,
        }))
    }
}

#[cfg(test)]
mod tests;
