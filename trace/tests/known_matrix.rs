//! TransportMatrix brought up to date against matrix traced from nothing.

#[path = "gpu/receivers.rs"]
mod receivers;
#[path = "gpu/room.rs"]
mod room;

use eagpt_scene::Gaussians;
use eagpt_scene::rng::{Purpose, RandomKey};
use eagpt_trace::Tracer;
use eagpt_trace::cpu::CpuScene;
use eagpt_trace::transport::EMISSION_THRESHOLD;
use eagpt_trace::transport::lights::Lights;
use eagpt_trace::transport::matrix::known::{KnownDirections, UNKNOWN};
use eagpt_trace::transport::matrix::{Directions, NOTHING, Receiver, TransportMatrix};
use glam::Vec3;
use receivers::receivers;
use room::lit_room;

const DIRECTIONS: Directions = Directions {
    plain: 24,
    to_lights: 16,
};

fn key() -> RandomKey {
    RandomKey::new(2, Purpose::Bake, 1)
}

fn emits(scene: &Gaussians, i: u32) -> bool {
    scene.emissions[i as usize] > EMISSION_THRESHOLD
}

struct Fixture {
    scene: Gaussians,
    engine: CpuScene,
    lights: Option<Lights>,
    receivers: Vec<Receiver>,
    targets: Vec<u32>,
    weights: Vec<f32>,
}

impl Fixture {
    fn new(scene: Gaussians) -> Self {
        let receivers = receivers(&scene);
        let num = receivers.len() * (DIRECTIONS.plain + DIRECTIONS.to_lights) as usize;
        Self {
            engine: CpuScene::new(&scene),
            lights: Lights::new(&scene),
            scene,
            receivers,
            targets: vec![UNKNOWN; num],
            weights: vec![0.0; num],
        }
    }

    /// TransportMatrix of all that is known, and the rays that the rest took.
    fn matrix(&mut self) -> (TransportMatrix, u64) {
        let known = KnownDirections::new(self.lights.as_ref(), DIRECTIONS, key());
        let num_rays = known
            .trace(&self.engine, &self.receivers, &mut self.targets)
            .expect("the CPU never fails");
        let scene = &self.scene;
        let emitted = |i: u32| emits(scene, i).then(|| scene.radiances[i as usize]);
        let matrix = known.matrix(&self.receivers, &self.targets, &mut self.weights, emitted);
        (matrix, num_rays)
    }

    fn traced_anew(&self) -> TransportMatrix {
        self.engine
            .trace_transport(&self.receivers, DIRECTIONS, key())
            .expect("the CPU never fails")
    }
}

#[test]
fn unknown_links_are_those_of_a_trace_to_the_bit() {
    let mut all = Fixture::new(lit_room());
    let (matrix, num_rays) = all.matrix();
    let wanted = all.traced_anew();
    assert!(matrix.direct.iter().any(|light| light.x > 0.0));
    assert_eq!(matrix.direct, wanted.direct);
    assert_eq!(matrix.targets, wanted.targets);
    assert_eq!(num_rays, wanted.num_rays);
    // Then all is known, with weights or without.
    assert_eq!(all.matrix(), (matrix.clone(), 0));
    all.weights.fill(0.0);
    assert_eq!(all.matrix(), (matrix.clone(), 0));
    // A few that are forgotten are found again.
    let known = KnownDirections::new(all.lights.as_ref(), DIRECTIONS, key());
    let mut targets = all.targets.clone();
    known.forget(&all.receivers, &mut targets, |target, ray| {
        target != NOTHING && ray.direction[2] > 0.5
    });
    let num_lost = targets.iter().filter(|&&target| target == UNKNOWN).count();
    assert!(
        num_lost > 1000 && num_lost < targets.len() / 2,
        "{num_lost}"
    );
    all.targets = targets;
    assert_eq!(all.matrix(), (matrix, num_lost as u64));
}

/// Directions that look for lamps as they were bring the light of lamps as they are: in the mean of
/// all receivers, with the noise of each.
#[test]
fn other_light_of_the_same_lamps_needs_no_ray() {
    let mut all = Fixture::new(lit_room());
    all.matrix();
    let factor = Vec3::new(0.5, 2.0, 1.0);
    for i in 0..all.scene.len() {
        if emits(&all.scene, i as u32) {
            all.scene.radiances[i] *= factor;
        }
    }
    let (matrix, num_rays) = all.matrix();
    assert_eq!(num_rays, 0);
    all.engine = CpuScene::new(&all.scene);
    let wanted = all.traced_anew();
    let mean = |matrix: &TransportMatrix| {
        let sum: Vec3 = matrix.direct.iter().sum();
        sum / matrix.direct.len() as f32
    };
    // All lamps by the same factor: directions are the same but for rounding, and so is the light.
    let off = (mean(&matrix) / mean(&wanted) - Vec3::ONE).abs();
    assert!(off.max_element() < 1e-4, "{off}");

    // One lamp of the two alone, which directions then look for as if it were still on.
    let mut all = Fixture::new(lit_room());
    all.matrix();
    for i in 0..all.scene.len() {
        if emits(&all.scene, i as u32) && all.scene.positions[i].x > 0.0 {
            all.scene.radiances[i] = Vec3::ZERO;
        }
    }
    let (matrix, _) = all.matrix();
    all.engine = CpuScene::new(&all.scene);
    let wanted = all.traced_anew();
    assert!(mean(&wanted).x > 0.0);
    let off = (mean(&matrix) / mean(&wanted) - Vec3::ONE).abs();
    // 16 to 40 directions at each of some thousand receivers.
    assert!(off.max_element() < 0.03, "{off}");
}
