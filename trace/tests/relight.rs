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
use eagpt_trace::transport::matrix::{
    Directions, EMITTER, Groups, NOTHING, Receiver, Tracing, TransportMatrix,
};
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

fn tracing<'a>(receivers: &'a [Receiver], lights: Option<&'a LightList>) -> Tracing<'a> {
    Tracing {
        receivers,
        directions: DIRECTIONS,
        key: key(),
        lights,
    }
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
    matrix.relight(&tracing(receivers, lights.as_ref()), &other.radiances);
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

/// Each group of emitters gives the bits that a scene has in which the others are dark, and all
/// together what was traced; light of others is that of each group alone.
#[test]
fn groups_of_emitters_give_their_light_apart() {
    let scene = lit_room();
    let receivers = receivers(&scene);
    let matrix = trace(&scene, &receivers);
    let lights = LightList::new(&SurfelSet::new(&scene));
    let tracing = tracing(&receivers, lights.as_ref());
    let of: Vec<u32> = (scene.positions.iter())
        .map(|position| 1 + u32::from(position.x > 0.0))
        .collect();
    // Nothing belongs to the first of three.
    let num = 3;
    let apart = matrix.direct_of_groups(&tracing, &scene.radiances, Groups { num, of: &of });
    let group = |k: usize| -> Vec<Vec3> { apart.chunks_exact(num).map(|row| row[k]).collect() };
    assert!(group(0).iter().all(|light| *light == Vec3::ZERO));
    for k in [1, 2] {
        let mut alone = scene.radiances.clone();
        for i in (0..scene.len()).filter(|&i| of[i] as usize != k) {
            alone[i] = Vec3::ZERO;
        }
        let mut expected = matrix.clone();
        expected.relight(&tracing, &alone);
        assert!(expected.direct.iter().any(|light| light.x > 0.0));
        assert_eq!(group(k), expected.direct);
    }
    for (row, direct) in apart.chunks_exact(num).zip(&matrix.direct) {
        let sum: Vec3 = row.iter().sum();
        assert!((sum - direct).abs().max_element() <= 1e-5 * direct.max_element());
    }

    let carried = |i: usize, k: usize| Vec3::new(i as f32, 1.0, k as f32);
    let all: Vec<[Vec3; 3]> = (0..scene.len())
        .map(|i| [0, 1, 2].map(|k| carried(i, k)))
        .collect();
    let together = matrix.from_others_of_groups(DIRECTIONS, all.as_flattened(), num);
    for k in 0..num {
        let mine: Vec<Vec3> = together.chunks_exact(num).map(|row| row[k]).collect();
        let alone: Vec<Vec3> = (0..scene.len()).map(|i| carried(i, k)).collect();
        assert_eq!(mine, matrix.from_others(DIRECTIONS, &alone));
    }
}
