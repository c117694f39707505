//! Other light of the same emitters, from the rays of a transport matrix that is there.

#[path = "gpu/receivers.rs"]
mod receivers;
#[path = "gpu/room.rs"]
mod room;

use eagpt_scene::Gaussians;
use eagpt_scene::rng::{Purpose, RandomKey};
use eagpt_trace::cpu::CpuScene;
use eagpt_trace::surfel::SurfelSet;
use eagpt_trace::transport::EMISSION_THRESHOLD;
use eagpt_trace::transport::light_list::LightList;
use eagpt_trace::transport::matrix::{Directions, EMITTER, NOTHING, Receiver, TransportMatrix};
use glam::Vec3;
use receivers::receivers;
use room::lit_room;

const DIRECTIONS: Directions = Directions {
    bsdf: 24,
    to_lights: 16,
};

fn key() -> RandomKey {
    RandomKey::new(2, Purpose::Bake, 1)
}

fn trace(scene: &Gaussians, receivers: &[Receiver]) -> TransportMatrix {
    TransportMatrix::trace(&CpuScene::new(scene), receivers, DIRECTIONS, key())
}

/// `matrix`, traced in `scene`, with the radiance of emitters changed by `change`; and that scene
/// with its matrix traced anew.
fn relit(
    scene: &Gaussians,
    mut matrix: TransportMatrix,
    receivers: &[Receiver],
    change: impl Fn(Vec3, &mut Vec3),
) -> [TransportMatrix; 2] {
    let mut other = scene.clone();
    for i in 0..other.len() {
        if other.emissions[i] > EMISSION_THRESHOLD {
            change(other.positions[i], &mut other.radiances[i]);
        }
    }
    let lights = LightList::new(&SurfelSet::new(scene));
    matrix.relight(
        receivers,
        DIRECTIONS,
        key(),
        lights.as_ref(),
        &other.radiances,
    );
    [matrix, trace(&other, receivers)]
}

fn mean(matrix: &TransportMatrix) -> Vec3 {
    let sum: Vec3 = matrix.direct.iter().sum();
    sum / matrix.direct.len() as f32
}

#[test]
fn the_same_light_and_twice_as_much_are_bit_identical_to_a_trace() {
    let scene = lit_room();
    let receivers = receivers(&scene);
    let matrix = trace(&scene, &receivers);
    assert!(matrix.direct.iter().any(|light| light.x > 0.0));
    let targets = || matrix.targets.iter().chain(&matrix.light_targets);
    let is_emitter = |target: &u32| target & EMITTER != 0;
    for target in targets().filter(|target| **target != NOTHING) {
        let emission = scene.emissions[(target & !EMITTER) as usize];
        assert_eq!(is_emitter(target), emission > EMISSION_THRESHOLD);
    }
    assert!(targets().filter(|target| is_emitter(target)).count() > 1000);
    for factor in [1.0, 2.0] {
        let [relit, traced] = relit(&scene, matrix.clone(), &receivers, |_, radiance| {
            *radiance *= factor;
        });
        assert_eq!(relit, traced);
    }
}

/// Directions that sample lamps as they were find the light of lamps as they are: in the mean of
/// all receivers, with the noise of each.
#[test]
fn other_light_has_the_mean_of_a_trace() {
    let scene = lit_room();
    let receivers = receivers(&scene);
    let matrix = trace(&scene, &receivers);
    // All lamps by the same factor: directions are the same but for rounding, and so is the light.
    let factor = Vec3::new(0.5, 2.0, 1.0);
    let pair = relit(&scene, matrix.clone(), &receivers, |_, radiance| {
        *radiance *= factor;
    });
    let [relit_mean, traced_mean] = pair.each_ref().map(mean);
    let off = (relit_mean / traced_mean - Vec3::ONE).abs();
    assert!(off.max_element() < 1e-4, "{off}");

    // One lamp of the two alone, while directions sample both.
    let pair = relit(&scene, matrix, &receivers, |position, radiance| {
        if position.x > 0.0 {
            *radiance = Vec3::ZERO;
        }
    });
    let [relit_mean, traced_mean] = pair.each_ref().map(mean);
    assert!(traced_mean.x > 0.0);
    let off = (relit_mean / traced_mean - Vec3::ONE).abs();
    // 16 to 40 directions at each of some thousand receivers.
    assert!(off.max_element() < 0.03, "{off}");
}
