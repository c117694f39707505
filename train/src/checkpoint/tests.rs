//! Tests of checkpoints.

use super::*;
use eagpt_scene::{Lamp, LampShape};
use glam::{Quat, Vec3};

fn sample(iteration: u32) -> Checkpoint {
    let array = |x: f32| [[x; NUM_PARAMETERS], [x + 0.125; NUM_PARAMETERS]].concat();
    let coefficients = |x: f32| [[x; NUM_COEFFICIENTS], [x - 0.5; NUM_COEFFICIENTS]].concat();
    let stored = |x: f32| LightParameters {
        light: learned(&[x; 2 * 3 * NUM_OF_LIGHT], 0),
        harmonics: learned(&[x; 2 * 3 * NUM_COEFFICIENTS], 5),
    };
    let frame = (
        Vec3::ONE / 3.0,
        Quat::from_rotation_x(0.7),
        Vec3::splat(0.1),
    );
    let lamp = Lamp::unmeasured(LampShape::Ball, frame, (1.0 / 7.0, Vec3::splat(1e5 / 3.0)));
    Checkpoint {
        stage: Stage::Radiance,
        iteration,
        fingerprint: Key::new().with("dataset", "a".into()),
        extent: 2.5,
        monitor: LossMonitor {
            smoothed: 0.1,
            smoothed_l1: 1.0 / 3.0,
            best_l1: f64::MAX,
        },
        lamps: Some(Lamps { lamps: vec![lamp] }),
        gloss: vec![[0.25; NUM_OF_GLOSS], [1.0 / 3.0; NUM_OF_GLOSS]],
        state: ParameterState {
            raw: learned(&[1.0, -0.1, 1e-20].map(array).concat(), 7),
            harmonics: learned(&[2.0, 0.3, 1e-9].map(coefficients).concat(), 3),
            num_fixed: 1,
            lights: Lights {
                current: 1,
                stored: [0.5, 0.25].map(stored).to_vec(),
            },
        },
    }
}

#[test]
fn survives_a_round_trip() {
    let dir = tempfile::tempdir().unwrap();
    let path = sample(12).write(dir.path()).unwrap();
    assert_eq!(Checkpoint::read(&path).unwrap(), sample(12));
}

#[test]
fn damage_anywhere_is_noticed_and_the_older_one_is_used() {
    let dir = tempfile::tempdir().unwrap();
    sample(5).write(dir.path()).unwrap();
    let path = sample(10).write(dir.path()).unwrap();
    let whole = std::fs::read(&path).unwrap();
    for at in (0..whole.len()).step_by(7) {
        let mut bytes = whole.clone();
        bytes[at] ^= 0x10;
        std::fs::write(&path, &bytes).unwrap();
        assert!(Checkpoint::read(&path).is_err(), "byte {at}");
        std::fs::write(&path, &whole[..at]).unwrap();
        assert!(Checkpoint::read(&path).is_err(), "truncated to {at}");
    }
    let (found, warnings) = newest(dir.path()).unwrap();
    assert_eq!((found.iteration, warnings.len()), (5, 1));
}

#[test]
fn pruning_keeps_the_newest() {
    let dir = tempfile::tempdir().unwrap();
    for iteration in [1, 20, 300, 9] {
        sample(iteration).write(dir.path()).unwrap();
    }
    prune(dir.path(), Stage::Radiance, 2).unwrap();
    let left: Vec<u32> = list(dir.path())
        .unwrap()
        .iter()
        .map(|p| Checkpoint::read(p).unwrap().iteration)
        .collect();
    assert_eq!(left, [20, 300]);
}
