//! Light samples to what is bright in the light of the emitters alone.
//!
//! The spot of a wall beside a lamp is small and bright: without light samples to it the second
//! bounce is blotched. What is bright is known once the first bounce is.

use super::receivers::Receivers;
use crate::error::Result;
use eagpt_light::irradiance::{self, PIECE};
use eagpt_scene::Gaussians;
use eagpt_scene::rng::{Purpose, RandomKey};
use eagpt_trace::Tracer;
use eagpt_trace::surfel::SurfelSet;
use eagpt_trace::transport::light_list::LightList;
use eagpt_trace::transport::matrix::{
    BrightSamples, Directions, Receiver, Tracing, TransportMatrix,
};
use glam::Vec3;

/// Light samples to emitters for one to a bright surface.
const EVERY: u32 = 2;
/// Bright surfaces of a scene that reflect, and the light samples that receivers send there.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct BrightSurfaces {
    /// Their Gaussians, ascending, and the radiance by which samples choose among them.
    pub(super) surfaces: Vec<(u32, Vec3)>,
    /// Entries of the samples, `[receivers, num_samples]`, or none without such surfaces.
    pub(super) targets: Vec<u32>,
    /// Rays traced.
    pub(super) num_rays: u64,
}

/// Numbers of light samples to bright surfaces at each receiver.
pub(super) fn num_samples(directions: Directions) -> u32 {
    directions.to_lights / EVERY
}

impl BrightSurfaces {
    /// Surfaces that would be bright in the first bounce if all were white: traced receivers have
    /// this irradiance over π of the emitters, `[receivers]`. Samples serve any albedos.
    pub(super) fn new(scene: &Gaussians, receivers: &Receivers, direct: &[Vec3]) -> Self {
        let mut white = vec![Vec3::ZERO; scene.len()];
        for (i, sources) in receivers.each() {
            white[i] = sources.mean(|row| direct[row]);
        }
        let bright = irradiance::bright(scene, &white);
        Self {
            surfaces: bright.map(|i| (i as u32, white[i])).collect(),
            ..Self::default()
        }
    }

    /// Traces the light samples of `receivers`; `false` if `goes_on`, told how many are done, has
    /// ended it, and then none are kept. The `tracer` of the `scene` traces it with other emitters
    /// in the meantime, which leaves its trees as they are.
    ///
    /// # Errors
    /// If the device fails.
    pub(super) fn trace(
        &mut self,
        (tracer, scene): (&mut dyn Tracer, &Gaussians),
        receivers: &[Receiver],
        (directions, seed): (Directions, u64),
        goes_on: &mut dyn FnMut(usize) -> bool,
    ) -> Result<bool> {
        let to_lights = num_samples(directions);
        if self.surfaces.is_empty() || to_lights == 0 {
            self.surfaces.clear();
            return Ok(true);
        }
        tracer.update(&self.alone(scene))?;
        let only = Directions { bsdf: 1, to_lights };
        let mut is_whole = true;
        for (number, piece) in receivers.chunks(PIECE).enumerate() {
            is_whole = goes_on(number * PIECE);
            if !is_whole {
                self.targets.clear();
                break;
            }
            let mut more = tracer.trace_transport(piece, only, key(seed))?;
            self.targets.append(&mut more.light_targets);
            self.num_rays += more.num_rays;
        }
        tracer.update(scene)?;
        if is_whole {
            goes_on(receivers.len());
        }
        Ok(is_whole)
    }

    /// Adds the samples to a matrix traced by random numbers of another `key` in `directions`.
    pub(super) fn add_to(
        &self,
        matrix: &mut TransportMatrix,
        scene: &Gaussians,
        receivers: &Receivers,
        (directions, key_of_rows, seed): (Directions, RandomKey, u64),
    ) {
        let Some(lights) = LightList::new(&SurfelSet::new(&self.alone(scene))) else {
            return;
        };
        let mut is_bright = vec![false; scene.len()];
        for (i, _) in &self.surfaces {
            is_bright[*i as usize] = true;
        }
        let tracing = Tracing {
            receivers: &receivers.traced,
            directions,
            key: key_of_rows,
            lights: None,
        };
        let samples = BrightSamples {
            lights: &lights,
            is_bright: &is_bright,
            num: num_samples(directions),
            key: key(seed),
            targets: &self.targets,
        };
        matrix.add_bright(&tracing, &samples, (scene, &receivers.fronts));
    }

    /// The scene in which bright surfaces emit and nothing else does.
    fn alone(&self, scene: &Gaussians) -> Gaussians {
        let mut alone = scene.clone();
        alone.emissions.fill(0.0);
        for (i, radiance) in &self.surfaces {
            let i = *i as usize;
            (alone.emissions[i], alone.radiances[i]) = (1.0, *radiance);
        }
        alone
    }
}

/// Key of the random numbers of the samples.
fn key(seed: u64) -> RandomKey {
    RandomKey::new(seed, Purpose::Bake, 3)
}

#[cfg(test)]
mod tests {
    use super::*;
    use eagpt_testkit::gaussians::{material, sphere};
    use eagpt_trace::cpu::CpuScene;
    use eagpt_trace::transport::matrix::Front;
    use eagpt_trace::transport::start::Surface;

    const DIRECTIONS: Directions = Directions {
        bsdf: 32,
        to_lights: 32,
    };
    const SPOT: f32 = 500.0;

    /// Mean and standard deviation of the light that receivers within a sphere have of each other:
    /// 1 of all and much more of a spot, with light samples to it or without. The spot is seen from
    /// a `front`.
    fn light(front: Front, with_samples: bool) -> (f32, f32) {
        let is_spot = |scene: &Gaussians, i: usize| scene.positions[i].normalize().z > 0.999;
        let scene = sphere(3000, 1.0, |_| material(Vec3::ONE, 0.0, Vec3::splat(0.5)));
        let all = 0..scene.len();
        let radiance = |i: usize| Vec3::splat(if is_spot(&scene, i) { SPOT } else { 1.0 });
        let radiances: Vec<Vec3> = all.clone().map(radiance).collect();
        let receiver = |i: usize| {
            let position = scene.positions[i];
            let surface = Surface {
                position,
                normal: -position.normalize(),
                offset: 0.3 * scene.scales[i].x,
            };
            (i as u32, surface)
        };
        let fronts = all.clone().map(|i| match is_spot(&scene, i) {
            true => front,
            false => Front::Both,
        });
        let receivers = Receivers {
            traced: all.clone().map(receiver).collect(),
            faint: Vec::new(),
            fronts: fronts.collect(),
        };
        let mut tracer = CpuScene::new(&scene);
        let rows = RandomKey::new(1, Purpose::Bake, 1);
        let among = (&tracer as &dyn Tracer, &scene, receivers.fronts.as_slice());
        let mut matrix = irradiance::rows(among, &receivers.traced, DIRECTIONS, rows).unwrap();
        if with_samples {
            let mut bright = BrightSurfaces::new(&scene, &receivers, &radiances);
            assert!((1..10).contains(&bright.surfaces.len()));
            let among = (&mut tracer as &mut dyn Tracer, &scene);
            let traced = bright.trace(among, &receivers.traced, (DIRECTIONS, 1), &mut |_| true);
            assert!(traced.unwrap());
            bright.add_to(&mut matrix, &scene, &receivers, (DIRECTIONS, rows, 1));
        }
        let light = matrix.from_others(DIRECTIONS, &radiances);
        let [mut sum, mut squares] = [0.0; 2];
        for l in &light {
            (sum, squares) = (sum + l.x, squares + l.x * l.x);
        }
        let num = light.len() as f32;
        (sum / num, (squares / num - (sum / num).powi(2)).sqrt())
    }

    /// Inside a sphere every point receives the same light of each of its parts.
    #[test]
    fn a_bright_spot_lights_all_receivers_alike() {
        let [plain, sampled] = [false, true].map(|with| light(Front::Both, with));
        let standard_error = plain.1 / 3000.0_f32.sqrt();
        assert!(
            (plain.0 - sampled.0).abs() < 4.0 * standard_error,
            "{plain:?} {sampled:?}"
        );
        assert!(sampled.1 < 0.2 * plain.1, "{plain:?} {sampled:?}");
    }

    /// The normals of the sphere's discs point outwards.
    #[test]
    fn the_back_of_a_spot_lights_nobody() {
        let [seen, unseen] = [Front::Against, Front::Along].map(|front| light(front, true).0);
        assert!(seen > 1.1, "{seen}");
        // Receivers beside the spot may be of its surface.
        assert!(unseen < 1.02, "{unseen}");
    }
}
