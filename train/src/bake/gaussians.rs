//! Light baking in Gaussian space.
//!
//! The light of a scene of diffuse surfaces solves `L = L_e + ρ/π ∫ L cos θ dω`. Its Neumann series
//! is light sorted by bounces, `L = L_e + T L_e + T² L_e + …` (Kajiya 1986, section 3), and here
//! every term is kept where light lives anyway, on the Gaussians. Rays are traced once: they say
//! how much light of emitters reaches each Gaussian, and which other Gaussians it sees
//! ([`eagpt_trace::transport::matrix`]). That is the first term, and the matrix T of all further
//! ones: a bounce more is a product of it with a vector. After b bounces the scene carries the
//! light of paths of at most b bounces.

use super::{Bake, BakeProgress, with_emitters};
use crate::error::{Result, TrainError};
use crate::sealed::Kind;
use crate::surfaces::{self, BestSeen, Seen};
use eagpt_scene::machine::available_memory;
use eagpt_scene::rng::{Purpose, RandomKey};
use eagpt_scene::{Camera, SceneError};
use eagpt_trace::Tracer;
use eagpt_trace::transport::matrix::{Directions, NOTHING, Receiver, TransportMatrix};
use glam::Vec3;
use serde::{Deserialize, Serialize};
use std::time::{Duration, Instant};

/// Gaussians gathered for between two looks at whether the work shall stop.
pub(super) const AT_ONCE: usize = 4096;
/// In place of a camera's number: none sees it.
pub(super) const LONE: u32 = NOTHING;
/// Time between two states on disk.
const STORE_EVERY: Duration = Duration::from_secs(30);

/// Options of [`super::BakeMethod::Gaussians`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct GaussianBake {
    /// Directions traced at each Gaussian, at least 1: half of them look for emitters, the others
    /// serve all bounces.
    pub num_samples: u32,
}

impl GaussianBake {
    fn directions(&self) -> Directions {
        Directions::divided(self.num_samples, 2)
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
    fn add(
        &mut self,
        albedos: &[Vec3],
        receivers: &[Receiver],
        matrix: &TransportMatrix,
        rays: Directions,
    ) {
        let gathered;
        let arriving = if self.bounce == 0 {
            &matrix.direct
        } else {
            gathered = matrix.from_others(rays, &self.last);
            &gathered
        };
        self.last.fill(Vec3::ZERO);
        for ((i, _), light) in receivers.iter().zip(arriving) {
            let i = *i as usize;
            self.last[i] = albedos[i] * *light;
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

/// File of the state in the work folder.
pub(super) const STATE: &str = "matrix.state";

const KIND: Kind = Kind {
    magic: b"EAGPTBAK",
    version: 2,
    noun: "state",
};

#[derive(Serialize, Deserialize)]
struct Header {
    num_receivers: usize,
    directions: u32,
}

impl Bake<'_> {
    /// Radiances of all Gaussians, or `None` if it was stopped from outside.
    pub(super) fn solve(&mut self, method: &GaussianBake) -> Result<Option<Vec<Vec3>>> {
        let rays = method.directions();
        self.check_memory(rays)?;
        let tracer = self.request.device.scene(&self.scene)?;
        let found = match &self.request.matrix {
            Some(path) => self.relink(&*tracer, rays, path)?,
            None => self.link(&*tracer, rays)?,
        };
        let Some((receivers, matrix)) = found else {
            return Ok(None);
        };
        let mut series = Series::new(self.scene.len());
        while series.bounce < self.request.options.max_bounces {
            series.add(&self.scene.albedos, &receivers, &matrix, rays);
            (self.progress)(BakeProgress::Bounced {
                bounce: series.bounce,
                share: series.share(),
            });
        }
        Ok(Some(with_emitters(&self.scene, &series.total)))
    }

    /// All receivers and their matrix; `None` if it was stopped.
    fn link(
        &mut self,
        tracer: &dyn Tracer,
        rays: Directions,
    ) -> Result<Option<(Vec<Receiver>, TransportMatrix)>> {
        let reflecting: Vec<u32> = self.reflecting().collect();
        let Some(seen) = self.look(tracer, &self.cameras())? else {
            return Ok(None);
        };
        let places = self.places(tracer, &reflecting, &seen)?;
        let receivers = places.into_iter().map(|(i, seen)| (i, seen.surface));
        let receivers: Vec<Receiver> = receivers.collect();
        let matrix = self.trace_transport(tracer, &receivers, rays)?;
        Ok(matrix.map(|matrix| (receivers, matrix)))
    }

    fn check_memory(&self, rays: Directions) -> Result<()> {
        // TransportMatrix that are kept have targets and weights of all directions, which are
        // copied on the way to their file.
        let num_values = match self.request.matrix {
            Some(_) => 5 * (rays.plain + rays.to_lights),
            None => rays.plain,
        };
        let needed = self.scene.len() as u64 * u64::from(num_values) * 4;
        match available_memory() {
            Some(available) if needed > available / 2 => Err(TrainError::Memory {
                needed_mib: needed >> 20,
                available_mib: available >> 21,
                advice: "fewer directions (--samples) would help".to_owned(),
            }),
            _ => Ok(()),
        }
    }

    /// The matrix of all `receivers`, piece by piece; `None` if it was stopped.
    fn trace_transport(
        &mut self,
        tracer: &dyn Tracer,
        receivers: &[Receiver],
        rays: Directions,
    ) -> Result<Option<TransportMatrix>> {
        let mut matrix = self.taken_up(receivers.len(), rays)?;
        let key = self.key();
        let total = receivers.len();
        let mut stored = Instant::now();
        loop {
            let done = matrix.direct.len();
            (self.progress)(BakeProgress::Gathering { done, total });
            if done == total {
                self.num_rays += matrix.num_rays;
                return Ok(Some(matrix));
            }
            if self.stopped() {
                self.store(&matrix, rays)?;
                return Ok(None);
            }
            if stored.elapsed() > STORE_EVERY {
                self.store(&matrix, rays)?;
                stored = Instant::now();
            }
            let piece = &receivers[done..total.min(done + AT_ONCE)];
            match tracer.trace_transport(piece, rays, key) {
                Ok(more) => matrix.append(more),
                Err(error) => {
                    self.store(&matrix, rays)?;
                    return Err(error.into());
                }
            }
        }
    }

    /// Of the random numbers of all directions.
    pub(super) fn key(&self) -> RandomKey {
        RandomKey::new(self.request.options.seed, Purpose::Bake, 1)
    }

    /// Cameras of the views to bake for.
    pub(super) fn cameras(&self) -> Vec<Camera> {
        let frames = self.dataset.frames();
        self.frames.iter().map(|&i| frames[i].camera).collect()
    }

    /// Each Gaussian as one of `cameras` sees it best; `None` if it was stopped.
    pub(super) fn look(
        &mut self,
        tracer: &dyn Tracer,
        cameras: &[Camera],
    ) -> Result<Option<Vec<Option<Seen>>>> {
        let total = cameras.len();
        let mut best = BestSeen::new(self.scene.len());
        for (done, camera) in (1..).zip(cameras) {
            if self.stopped() {
                return Ok(None);
            }
            best.look(tracer, camera)?;
            (self.progress)(BakeProgress::Looking { done, total });
        }
        Ok(Some(best.finish()))
    }

    /// Where light arrives for the Gaussians `wanted`: where they are `seen`, or, of those that no
    /// camera sees, which still light others, on their own plane. Camera [`LONE`] sees these, with
    /// no weight.
    pub(super) fn places(
        &self,
        tracer: &dyn Tracer,
        wanted: &[u32],
        seen: &[Option<Seen>],
    ) -> Result<Vec<(u32, Seen)>> {
        let wanted = wanted.iter().map(|&i| (i, seen[i as usize]));
        let unseen = wanted.clone().filter(|(_, seen)| seen.is_none());
        let unseen = unseen.map(|(i, _)| self.scene.get(i as usize));
        let mut lone = surfaces::lone(tracer, unseen)?.into_iter();
        let mut alone = || Seen {
            surface: lone.next().expect("one for each that is not seen"),
            weight: 0.0,
            camera: LONE,
        };
        Ok(wanted
            .map(|(i, seen)| (i, seen.unwrap_or_else(&mut alone)))
            .collect())
    }

    fn store(&self, matrix: &TransportMatrix, rays: Directions) -> Result<()> {
        let header = Header {
            num_receivers: matrix.direct.len(),
            directions: rays.plain,
        };
        let direct: Vec<f32> = matrix.direct.iter().flat_map(Vec3::to_array).collect();
        let targets: Vec<f32> = matrix.targets.iter().map(|&i| f32::from_bits(i)).collect();
        let path = self.request.work.join(STATE);
        KIND.write(&path, &header, &[&direct, &targets])
    }

    /// The matrix that an earlier process left, or none.
    fn taken_up(&self, num_receivers: usize, rays: Directions) -> Result<TransportMatrix> {
        let path = self.request.work.join(STATE);
        if !path.exists() {
            return Ok(TransportMatrix::default());
        }
        let (header, values): (Header, _) = KIND.read(&path)?;
        let num = header.num_receivers;
        let num_direct = 3 * num;
        let fits = num <= num_receivers
            && header.directions == rays.plain
            && values.len() == num_direct + num * rays.plain as usize;
        if !fits {
            return Err(SceneError::invalid(&path, "arrays", "the state is damaged").into());
        }
        let (direct, targets) = values.split_at(num_direct);
        let (triples, _) = direct.as_chunks::<3>();
        Ok(TransportMatrix {
            direct: triples.iter().map(|t| Vec3::from_array(*t)).collect(),
            targets: targets.iter().map(|i| i.to_bits()).collect(),
            num_rays: 0,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::emits;
    use super::*;
    use eagpt_testkit::gaussians::{material, sphere};
    use eagpt_trace::cpu::CpuScene;
    use eagpt_trace::transport::start::Surface;

    /// Inside a sphere every patch sees every other at the same `cos cos / r²`: light from a cap of
    /// area share f arrives evenly, and with albedo a the radiance of the rest after K bounces is
    /// `a L f Σ_{k<K} (a (1 − f))^k`.
    #[test]
    fn bounces_inside_a_sphere_follow_the_geometric_series() {
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
            plain: 32,
            to_lights: 16,
        };
        let key = RandomKey::new(1, Purpose::Bake, 1);
        let matrix = TransportMatrix::trace(&CpuScene::new(&scene), &receivers, rays, key);
        let mut series = Series::new(scene.len());
        let mut expected = 0.0;
        for bounce in 1..=4 {
            series.add(&scene.albedos, &receivers, &matrix, rays);
            expected += albedo * light * share * (albedo * (1.0 - share)).powi(bounce - 1);
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
