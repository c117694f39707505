//! Light baking in Gaussian space.
//!
//! The light of a scene of diffuse surfaces solves `L = L_e + ρ/π ∫ L cos θ dω`. Its Neumann series is light sorted by bounces,
//! `L = L_e + T L_e + T² L_e + …` (Kajiya 1986, section 3), and here every term is kept where light lives anyway, on the
//! Gaussians: sweep b gathers, for each Gaussian, the light that the others got from sweep b − 1. Sweeps are independent of each
//! other's noise allocation: the first is direct light, which needs many directions and profits from looking at emitters; each later one
//! is smoother and weaker, and gets half the directions of the one before. After b sweeps the scene carries the light of paths of at most b
//! bounces.

use super::{Bake, BakeProgress, emits, with_emitters};
use crate::error::Result;
use crate::sealed::Kind;
use crate::surfaces::{self, BestSeen};
use eagpt_scene::rng::{Purpose, RandomKey};
use eagpt_scene::{Gaussians, SceneError};
use eagpt_trace::cpu::CpuScene;
use eagpt_trace::transport::lights::BounceSampler;
use eagpt_trace::transport::points::Points;
use eagpt_trace::transport::start::Surface;
use eagpt_trace::transport::{LIGHT_SHARE, RayTracer, irradiance_over_pi};
use eagpt_trace::{TraceError, Tracer};
use glam::Vec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// Directions of later sweeps never fall below this (or those of the first, if fewer).
const MIN_SAMPLES: u32 = 32;
/// Gaussians gathered for between two looks at whether the work shall stop.
const AT_ONCE: usize = 4096;

/// Options of [`super::BakeMethod::Gaussians`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct GaussianBake {
    /// Directions that direct light is gathered from at each Gaussian, at least 1; every further bounce takes half as many.
    pub num_samples: u32,
}

impl GaussianBake {
    /// Directions at each Gaussian in the sweep of `bounce`, counted from 1.
    pub fn samples_of(&self, bounce: u32) -> u32 {
        let halved = self.num_samples.checked_shr(bounce - 1).unwrap_or(0);
        halved.max(MIN_SAMPLES.min(self.num_samples))
    }
}

/// A Gaussian that reflects, and where light arrives for it.
type Receiver = (u32, Surface);

/// The sum of the sweeps so far.
#[derive(Debug, Clone, PartialEq)]
struct Series {
    /// Sweeps done.
    bounce: u32,
    /// Reflected radiance of all sweeps, `[n]`; zero for what emits.
    total: Vec<Vec3>,
    /// That of the last sweep alone, `[n]`.
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

    /// The light that the next sweep gathers: that of emitters alone, then that of the last sweep alone.
    fn source(&self, scene: &Gaussians) -> Gaussians {
        let radiances = if self.bounce == 0 {
            with_emitters(scene, &self.last)
        } else {
            self.last.clone()
        };
        Gaussians {
            radiances,
            ..scene.clone()
        }
    }

    /// Adds a sweep: what `receivers` reflect of what `arriving` says, irradiance over π.
    fn add(&mut self, albedos: &[Vec3], receivers: &[Receiver], arriving: &[Vec3]) {
        self.last.fill(Vec3::ZERO);
        for ((i, _), light) in receivers.iter().zip(arriving) {
            let i = *i as usize;
            self.last[i] = albedos[i] * *light;
            self.total[i] += self.last[i];
        }
        self.bounce += 1;
    }

    /// Light of the last sweep as a share of all.
    fn share(&self) -> f64 {
        let sum = |of: &[Vec3]| -> f64 { of.iter().map(|l| f64::from(l.element_sum())).sum() };
        sum(&self.last) / sum(&self.total).max(f64::MIN_POSITIVE)
    }
}

/// Irradiance over π at some receivers, of a scene that carries a [`Series::source`]. Without emitters in it no direction is spent on
/// looking for them.
fn gather(scene: &CpuScene, receivers: &[Receiver], num_samples: u32, key: RandomKey) -> Vec<Vec3> {
    let sampler = BounceSampler::new(scene.lights(), LIGHT_SHARE);
    receivers
        .par_iter()
        .map(|(gaussian, surface)| {
            let points = Points::new(key, *gaussian);
            irradiance_over_pi(scene, &sampler, surface, num_samples, &points)
        })
        .collect()
}

/// File of the state in the work folder.
pub(super) const STATE: &str = "sweeps.state";

const KIND: Kind = Kind {
    magic: b"EAGPTBAK",
    version: 1,
    noun: "state",
};

#[derive(Serialize, Deserialize)]
struct Header {
    bounce: u32,
    num_gaussians: usize,
}

impl Bake<'_> {
    /// Radiances of all Gaussians, or `None` if it was stopped from outside.
    pub(super) fn sweeps(&mut self, method: &GaussianBake) -> Result<Option<Vec<Vec3>>> {
        let mut series = self.taken_up()?;
        if series.bounce < self.request.options.max_bounces {
            let mut engine = CpuScene::new(&self.scene);
            let Some(receivers) = self.receivers(&engine)? else {
                return Ok(None);
            };
            while series.bounce < self.request.options.max_bounces {
                let source = series.source(&self.scene);
                engine.update(&source)?;
                let Some(arriving) = self.sweep(&engine, &receivers, method, series.bounce + 1)?
                else {
                    return Ok(None);
                };
                series.add(&self.scene.albedos, &receivers, &arriving);
                self.store(&series)?;
                (self.progress)(BakeProgress::Swept {
                    bounce: series.bounce,
                    share: series.share(),
                });
            }
        }
        Ok(Some(with_emitters(&self.scene, &series.total)))
    }

    /// One sweep, piece by piece; `None` if it was stopped.
    fn sweep(
        &mut self,
        engine: &CpuScene,
        receivers: &[Receiver],
        method: &GaussianBake,
        bounce: u32,
    ) -> Result<Option<Vec<Vec3>>, TraceError> {
        let key = RandomKey::new(self.request.options.seed, Purpose::Bake, bounce);
        let num_samples = method.samples_of(bounce);
        let total = receivers.len();
        let mut arriving = Vec::with_capacity(total);
        (self.progress)(BakeProgress::Sweep {
            bounce,
            done: 0,
            total,
        });
        for piece in receivers.chunks(AT_ONCE) {
            if self.stopped() {
                return Ok(None);
            }
            arriving.extend(gather(engine, piece, num_samples, key));
            self.num_rays += u64::from(num_samples) * piece.len() as u64;
            (self.progress)(BakeProgress::Sweep {
                bounce,
                done: arriving.len(),
                total,
            });
        }
        Ok(Some(arriving))
    }

    /// All Gaussians that reflect, each with its surface; `None` if it was stopped. Those that no camera sees still light others.
    fn receivers(&mut self, engine: &CpuScene) -> Result<Option<Vec<Receiver>>> {
        let total = self.frames.len();
        let mut best = BestSeen::new(self.scene.len());
        for (done, &frame) in (1..).zip(&self.frames) {
            if self.stopped() {
                return Ok(None);
            }
            best.look(engine.surfels(), &self.dataset.frames()[frame].camera);
            (self.progress)(BakeProgress::Looking { done, total });
        }
        let seen: Vec<Option<Surface>> = best.finish().collect();
        let receivers = (0..self.scene.len() as u32)
            .into_par_iter()
            .filter(|&i| !emits(self.scene.emissions[i as usize]))
            .map(|i| {
                let surface = seen[i as usize]
                    .unwrap_or_else(|| surfaces::lone(engine, &self.scene.get(i as usize)));
                (i, surface)
            })
            .collect();
        Ok(Some(receivers))
    }

    fn store(&self, series: &Series) -> Result<()> {
        let header = Header {
            bounce: series.bounce,
            num_gaussians: series.total.len(),
        };
        let flat = |of: &[Vec3]| -> Vec<f32> { of.iter().flat_map(Vec3::to_array).collect() };
        KIND.write(
            &self.request.work.join(STATE),
            &header,
            &[&flat(&series.total), &flat(&series.last)],
        )
    }

    /// The state that an earlier process left, or none.
    fn taken_up(&self) -> Result<Series> {
        let path = self.request.work.join(STATE);
        let num = self.scene.len();
        if !path.exists() {
            return Ok(Series::new(num));
        }
        let (header, values): (Header, _) = KIND.read(&path)?;
        if header.num_gaussians != num || values.len() != 6 * num {
            return Err(SceneError::invalid(&path, "arrays", "the state is damaged").into());
        }
        let read = |range: Range<usize>| -> Vec<Vec3> {
            let (triples, _) = values[range].as_chunks::<3>();
            triples.iter().map(|t| Vec3::from_array(*t)).collect()
        };
        Ok(Series {
            bounce: header.bounce,
            total: read(0..3 * num),
            last: read(3 * num..6 * num),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use eagpt_testkit::gaussians::{material, sphere};

    /// Inside a sphere every patch sees every other at the same `cos cos / r²`: light from a cap of area share f arrives evenly, and
    /// with albedo a the radiance of the rest after K bounces is `a L f Σ_{k<K} (a (1 − f))^k`.
    #[test]
    fn sweeps_inside_a_sphere_follow_the_geometric_series() {
        let (share, albedo, light) = (0.25_f32, 0.6_f32, 3.0_f32);
        // Archimedes: the cap above z = 1 − 2f has the share f of the area.
        let scene = sphere(6000, 2.0, |direction| {
            if direction.z > 1.0 - 2.0 * share {
                material(Vec3::splat(light), 1.0, Vec3::ZERO)
            } else {
                // Radiance that must not count.
                material(Vec3::splat(50.0), 0.0, Vec3::splat(albedo))
            }
        });
        let mut engine = CpuScene::new(&scene);
        let receivers: Vec<Receiver> = (0..scene.len() as u32)
            .filter(|&i| !emits(scene.emissions[i as usize]))
            .map(|i| {
                let g = scene.get(i as usize);
                let surface = Surface {
                    position: g.position,
                    normal: -g.position.normalize(),
                    slab: 0.3 * g.scale.x,
                };
                (i, surface)
            })
            .collect();
        let mut series = Series::new(scene.len());
        let mut expected = 0.0;
        for bounce in 1..=4 {
            engine.update(&series.source(&scene)).unwrap();
            let key = RandomKey::new(1, Purpose::Bake, bounce);
            let arriving = gather(&engine, &receivers, 32, key);
            series.add(&scene.albedos, &receivers, &arriving);
            expected += albedo * light * share * (albedo * (1.0 - share)).powi(bounce as i32 - 1);
            let mean: f32 = receivers
                .iter()
                .map(|(i, _)| series.total[*i as usize].x)
                .sum::<f32>()
                / receivers.len() as f32;
            // 6000 × 32 directions leave 0.3 %; the soft rim of the cap and discs that do not quite close 1 %.
            assert!(
                (mean / expected - 1.0).abs() < 0.015,
                "bounce {bounce}: {mean} instead of {expected}"
            );
        }
        let baked = with_emitters(&scene, &series.total);
        assert_eq!(baked[0], scene.radiances[0]);
    }

    #[test]
    fn later_sweeps_take_half_the_directions_but_not_too_few() {
        let bake = GaussianBake { num_samples: 256 };
        assert_eq!(
            [1, 2, 3, 4, 5, 40].map(|b| bake.samples_of(b)),
            [256, 128, 64, 32, 32, 32]
        );
        assert_eq!(GaussianBake { num_samples: 8 }.samples_of(3), 8);
    }
}
