//! Light baking in Gaussian space.
//!
//! The light of a scene of diffuse surfaces solves `L = L_e + ρ/π ∫ L cos θ dω`. Its Neumann series
//! is light sorted by bounces, `L = L_e + T L_e + T² L_e + …` (Kajiya 1986, section 3), and here
//! every term is kept on the Gaussians. Rays are traced once: they give the light of emitters that
//! reaches each Gaussian, and which other Gaussians it sees ([`eagpt_trace::transport::matrix`]).
//! That is the first term, and the matrix T of all further ones: a bounce more is a product of it
//! with a vector. After b bounces the scene carries the light of paths of at most b bounces.

use super::solution::Told;
use super::transport::{self, TracedTransport};
use super::{Bake, BakeProgress, emits, with_emitters};
use crate::error::{Result, TrainError};
use crate::irradiance::smooth::Smoothing;
use crate::irradiance::{self, NoisyLight};
use crate::surfaces::{self, BestSeen};
use eagpt_scene::files::{Key, digest};
use eagpt_scene::machine::available_memory;
use eagpt_scene::rng::{Purpose, RandomKey};
use eagpt_scene::{Camera, Gaussians, SceneError};
use eagpt_trace::Tracer;
use eagpt_trace::transport::matrix::{Directions, Receiver, TransportMatrix};
use glam::Vec3;
use serde::{Deserialize, Serialize};
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

/// Receivers traced between two checks for a request to stop.
pub(super) const PIECE: usize = 4096;
/// Time between two states on disk.
const STORE_EVERY: Duration = Duration::from_secs(30);

/// Options of [`super::BakeMethod::Gaussians`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct GaussianBake {
    /// Directions traced at each Gaussian, at least 1: half of them are light samples, the others
    /// serve all bounces.
    pub num_samples: u32,
}

impl GaussianBake {
    pub(super) fn directions(&self) -> Directions {
        irradiance::directions(self.num_samples)
    }
}

/// Who lights whom.
pub(super) struct Exchange<'a> {
    receivers: &'a [Receiver],
    matrix: &'a TransportMatrix,
    directions: Directions,
    smoothing: Smoothing,
}

impl<'a> Exchange<'a> {
    /// The rows of `matrix` are those of `receivers`.
    pub(super) fn new(
        receivers: &'a [Receiver],
        matrix: &'a TransportMatrix,
        directions: Directions,
    ) -> Self {
        Self {
            receivers,
            matrix,
            directions,
            smoothing: Smoothing::new(receivers),
        }
    }
}

/// The sum of the bounces so far.
#[derive(Debug, Clone, PartialEq)]
struct Series {
    /// Bounces done.
    bounce: u32,
    /// Reflected radiance of all bounces, `[n]`; zero for what emits.
    total: Vec<Vec3>,
    /// That of the last bounce alone, `[n]`.
    last: Vec<Vec3>,
}

impl Series {
    fn new(num: usize) -> Self {
        Self {
            bounce: 0,
            total: vec![Vec3::ZERO; num],
            last: vec![Vec3::ZERO; num],
        }
    }

    /// Adds a bounce: what `receivers` reflect of the light of emitters, then of that of the last
    /// bounce.
    fn add(&mut self, albedos: &[Vec3], light: &Exchange<'_>) {
        let &Exchange {
            matrix, directions, ..
        } = light;
        let noisy = if self.bounce == 0 {
            NoisyLight::direct(matrix, directions)
        } else {
            NoisyLight::indirect(matrix, directions, &self.last)
        };
        let irradiance = noisy.smoothed(&light.smoothing);
        self.last.fill(Vec3::ZERO);
        for ((i, _), light) in light.receivers.iter().zip(irradiance) {
            let i = *i as usize;
            self.last[i] = albedos[i] * light;
            self.total[i] += self.last[i];
        }
        self.bounce += 1;
    }

    /// Light of the last bounce as a share of all.
    fn share(&self) -> f64 {
        let sum = |of: &[Vec3]| -> f64 { of.iter().map(|l| f64::from(l.element_sum())).sum() };
        sum(&self.last) / sum(&self.total).max(f64::MIN_POSITIVE)
    }
}

/// File of the traced rows in the work folder.
pub(super) const STATE: &str = "transport.state";

impl Bake<'_> {
    /// Radiances of all Gaussians, or `None` if it was stopped from outside.
    pub(super) fn solve(&mut self, method: &GaussianBake) -> Result<Option<Vec<Vec3>>> {
        let directions = method.directions();
        self.check_memory(directions)?;
        let tracer = self.request.device.scene(&self.scene)?;
        let Some(traced) = self.trace(&*tracer, directions)? else {
            return Ok(None);
        };
        let light = Exchange::new(&traced.receivers, &traced.matrix, directions);
        let max_bounces = self.request.options.max_bounces;
        let reflected =
            sum_of_bounces(&self.scene.albedos, &light, max_bounces, &mut self.progress);
        Ok(Some(with_emitters(&self.scene, &reflected)))
    }

    fn check_memory(&self, directions: Directions) -> Result<()> {
        // Beside the entries, a copy and the bytes of a file that is written.
        let copies = if self.request.transport.is_some() {
            3
        } else {
            1
        };
        let entries = u64::from(directions.bsdf + directions.to_lights);
        let needed = copies * self.scene.len() as u64 * entries * 4;
        match available_memory() {
            Some(available) if needed > available / 2 => Err(TrainError::Memory {
                needed_mib: needed >> 20,
                available_mib: available >> 21,
                advice: "fewer directions (--samples) would help".to_owned(),
            }),
            _ => Ok(()),
        }
    }

    /// All rows of the transport matrix, traced here or in an earlier process; `None` if it was
    /// stopped.
    fn trace(
        &mut self,
        tracer: &dyn Tracer,
        directions: Directions,
    ) -> Result<Option<TracedTransport>> {
        let path = match &self.request.transport {
            Some(path) => path.clone(),
            None => self.request.work.join(STATE),
        };
        let cameras = (
            digest::of_file(self.dataset.transforms())?,
            self.frames.clone(),
        );
        let key = Key::new()
            .with("geometry", transport::geometry(&self.scene))
            .with_value("cameras", &cameras)?
            .with_value("samples", &[directions.bsdf, directions.to_lights])?
            .with_value("seed", &self.request.options.seed)?;
        let traced = match self.traced_before(&path, &key)? {
            Some(traced) => traced,
            None => match self.find_receivers(tracer)? {
                Some(receivers) => TracedTransport::new(key, directions, &self.scene, receivers),
                None => return Ok(None),
            },
        };
        self.trace_rows(tracer, traced, directions, &path)
    }

    /// Rows that an earlier bake has left at `path`, if they are of use for this one; all of them
    /// with the light of the emitters as they are now.
    fn traced_before(&mut self, path: &Path, key: &Key) -> Result<Option<TracedTransport>> {
        if !path.exists() {
            return Ok(None);
        }
        let mut traced = TracedTransport::read(path)?;
        let problem = if traced.key != *key {
            format!("rays of {}", traced.key.differences_in_words(key))
        } else if !traced.fits(&self.scene) {
            return Err(SceneError::invalid(path, "entries", "the file is damaged").into());
        } else if traced.relight(&self.scene, self.key()) {
            return Ok(Some(traced));
        } else {
            "light samples of emitters with another light".to_owned()
        };
        let text = format!("{}: {problem}: all are traced anew", path.display());
        (self.progress)(BakeProgress::Warning { text });
        Ok(None)
    }

    /// Traces the rows that are not in `traced`, piece by piece; `None` if it was stopped.
    fn trace_rows(
        &mut self,
        tracer: &dyn Tracer,
        mut traced: TracedTransport,
        directions: Directions,
        path: &Path,
    ) -> Result<Option<TracedTransport>> {
        let key = self.key();
        let total = traced.receivers.len();
        let num_before = traced.num_rows();
        let mut stored = Instant::now();
        loop {
            let done = traced.num_rows();
            (self.progress)(BakeProgress::Gathering { done, total });
            let is_whole = done == total;
            if is_whole && (done == num_before || self.request.transport.is_none()) {
                break;
            }
            if is_whole || self.stopped() || stored.elapsed() > STORE_EVERY {
                traced.write(path)?;
                stored = Instant::now();
            }
            if is_whole {
                break;
            }
            if self.stopped() {
                return Ok(None);
            }
            let piece = &traced.receivers[done..total.min(done + PIECE)];
            match tracer.trace_transport(piece, directions, key) {
                Ok(more) => traced.matrix.append(more),
                Err(error) => {
                    traced.write(path)?;
                    return Err(error.into());
                }
            }
        }
        self.num_rays += traced.matrix.num_rays;
        Ok(Some(traced))
    }

    /// Key of the random numbers of all directions.
    fn key(&self) -> RandomKey {
        RandomKey::new(self.request.options.seed, Purpose::Bake, 1)
    }

    /// The receivers for the views to bake for; `None` if it was stopped.
    fn find_receivers(&mut self, tracer: &dyn Tracer) -> Result<Option<Vec<Receiver>>> {
        let frames = self.dataset.frames();
        let cameras = self.frames.iter().map(|&frame| &frames[frame].camera);
        let stop = &self.request.stop;
        let mut told = |progress| {
            (self.progress)(progress);
            match stop.load(Ordering::Relaxed) {
                true => ControlFlow::Break(()),
                false => ControlFlow::Continue(()),
            }
        };
        receivers(tracer, &self.scene, cameras, &mut told)
    }
}

/// All Gaussians of `scene` that reflect, and where light is gathered for them: where one of the
/// `cameras` sees them best, or, of those that no camera sees, which still light others, on their
/// own plane. `None` if `told` has ended it.
pub(super) fn receivers<'a>(
    tracer: &dyn Tracer,
    scene: &Gaussians,
    cameras: impl ExactSizeIterator<Item = &'a Camera>,
    told: &mut Told<'_>,
) -> Result<Option<Vec<Receiver>>> {
    let total = cameras.len();
    let mut best = BestSeen::new(scene.len());
    for (done, camera) in (1..).zip(cameras) {
        best.add(tracer, camera)?;
        if told(BakeProgress::Looking { done, total }).is_break() {
            return Ok(None);
        }
    }
    let seen = best.finish();
    let reflecting = || (0..scene.len() as u32).filter(|&i| !emits(scene.emissions[i as usize]));
    let unseen = reflecting().filter(|&i| seen[i as usize].is_none());
    let unseen = unseen.map(|i| scene.get(i as usize));
    let mut lone = surfaces::lone(tracer, unseen)?.into_iter();
    let surface = |i: u32| seen[i as usize].or_else(|| lone.next()).map(|s| (i, s));
    Ok(Some(reflecting().filter_map(surface).collect()))
}

/// Reflected radiance of all Gaussians, `[n]`, after so many bounces; zero for what emits.
pub(super) fn sum_of_bounces(
    albedos: &[Vec3],
    light: &Exchange<'_>,
    max_bounces: u32,
    told: &mut dyn FnMut(BakeProgress),
) -> Vec<Vec3> {
    let mut series = Series::new(albedos.len());
    while series.bounce < max_bounces {
        series.add(albedos, light);
        told(BakeProgress::Bounced {
            bounce: series.bounce,
            share: series.share(),
        });
    }
    series.total
}

#[cfg(test)]
mod tests {
    use super::*;
    use eagpt_testkit::gaussians::{material, sphere};
    use eagpt_trace::cpu::CpuScene;
    use eagpt_trace::transport::start::Surface;

    /// Inside a sphere every patch sees every other at the same `cos cos / r²`: light from a cap of
    /// area share f is spread evenly, and with albedo a the radiance of the rest after K bounces is
    /// `a L f Σ_{k<K} (a (1 − f))^k`.
    #[test]
    fn bounces_inside_a_sphere_follow_the_geometric_series() {
        let (share, albedo, radiance) = (0.25_f32, 0.6_f32, 3.0_f32);
        // Archimedes: the cap above z = 1 − 2f has the share f of the area.
        let scene = sphere(6000, 2.0, |direction| {
            if direction.z > 1.0 - 2.0 * share {
                material(Vec3::splat(radiance), 1.0, Vec3::ZERO)
            } else {
                // Radiance that must not count.
                material(Vec3::splat(50.0), 0.0, Vec3::splat(albedo))
            }
        });
        let receivers: Vec<Receiver> = (0..scene.len() as u32)
            .filter(|&i| !emits(scene.emissions[i as usize]))
            .map(|i| {
                let g = scene.get(i as usize);
                let surface = Surface {
                    position: g.position,
                    normal: -g.position.normalize(),
                    offset: 0.3 * g.scale.x,
                };
                (i, surface)
            })
            .collect();
        let rays = Directions {
            bsdf: 32,
            to_lights: 16,
        };
        let key = RandomKey::new(1, Purpose::Bake, 1);
        let matrix = TransportMatrix::trace(&CpuScene::new(&scene), &receivers, rays, key);
        let light = Exchange::new(&receivers, &matrix, rays);
        let mut series = Series::new(scene.len());
        let mut expected = 0.0;
        for bounce in 1..=4 {
            series.add(&scene.albedos, &light);
            expected += albedo * radiance * share * (albedo * (1.0 - share)).powi(bounce - 1);
            let mean: f32 = receivers
                .iter()
                .map(|(i, _)| series.total[*i as usize].x)
                .sum::<f32>()
                / receivers.len() as f32;
            // 6000 × 32 directions leave 0.3 %; the soft rim of the cap and discs that do not quite
            // close 1 %.
            assert!(
                (mean / expected - 1.0).abs() < 0.015,
                "bounce {bounce}: {mean} instead of {expected}"
            );
        }
        let baked = with_emitters(&scene, &series.total);
        assert_eq!(baked[0], scene.radiances[0]);
    }
}
