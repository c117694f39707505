//! What training puts before a lamp goes: behind it, along its ceiling, or away.

#![allow(clippy::unwrap_used, reason = "a test ends with its first surprise")]

mod rig;

use eagpt_lamps::freed;
use eagpt_scene::lamps::{Lamp, LampShape, Lamps};
use eagpt_scene::{Gaussian, Gaussians, SceneEdit, rotation};
use glam::{Quat, Vec2, Vec3};
use rig::{RADIANCE, room};

const HEIGHT: f32 = 2.49;

fn panel(bars: bool) -> Lamps {
    let r = rotation::from_z_to(Vec3::NEG_Z);
    let lamp = Lamp {
        name: "ceiling-1".to_owned(),
        shape: LampShape::Panel,
        centre: [0.2, 0.1, HEIGHT],
        rotation: [r.w, r.x, r.y, r.z],
        size: [0.2, 0.16, 0.0],
        one_sided: true,
        bars,
        area: 0.032,
        radiance: RADIANCE.to_array(),
        power: (RADIANCE * 0.1).to_array(),
        num_gaussians: 0,
        views: Vec::new(),
        num_pixels: 100,
        deviation: 0.0,
        factor: [1.0; 3],
    };
    Lamps { lamps: vec![lamp] }
}

/// Discs before the lamp: the edge of a large one of the ceiling that is tilted, a faint one below
/// the lamp, one that stands upright beside it, one of the ceiling farther away, and the lamp's own.
fn discs() -> [Gaussian; 5] {
    let like = room().get(0);
    let disc = |position: [f32; 3], scale: [f32; 2], rotation: Quat, opacity: f32| Gaussian {
        position: position.into(),
        scale: Vec2::from(scale),
        rotation,
        opacity,
        ..like
    };
    let tilted = Quat::from_rotation_y(-0.03);
    let upright = rotation::from_z_to(Vec3::X);
    [
        disc([1.0, 0.1, 2.5], [0.5, 0.3], tilted, 0.95),
        disc([0.25, 0.1, 2.42], [0.05, 0.05], Quat::IDENTITY, 0.12),
        disc([0.32, 0.1, 2.4], [0.05, 0.05], upright, 0.9),
        disc([1.0, 1.5, 2.5], [0.2, 0.2], Quat::IDENTITY, 0.9),
        disc(
            [0.2, 0.1, HEIGHT - 0.001],
            [0.01, 0.01],
            Quat::IDENTITY,
            0.99,
        ),
    ]
}

#[test]
fn nothing_along_the_ceiling_stays_before_a_panel() {
    let mut scene: Vec<Gaussian> = room().iter().collect();
    let first = scene.len();
    scene.extend(discs());
    let scene: Gaussians = scene.into_iter().collect();
    let [tilted, faint, upright, far, own] = [0, 1, 2, 3, 4].map(|i| first + i);

    let edit = freed(&scene, own, &panel(false));
    let moved = |i: usize| edit.moved.iter().find(|(at, _)| *at as usize == i);
    let (_, flat) = moved(tilted).unwrap();
    let normal = flat.rotation * Vec3::Z;
    assert!(normal.z.abs() > 0.999_99, "{normal}");
    assert!(flat.position.z > HEIGHT, "{}", flat.position);
    assert_eq!(flat.scale, scene.scales[tilted]);
    let gone: Vec<usize> = (0..scene.len()).filter(|&i| !edit.keep[i]).collect();
    assert_eq!(gone, [faint]);
    for i in [upright, far, own] {
        assert!(moved(i).is_none(), "{i}");
    }
    assert!(edit.moved.is_sorted_by_key(|(i, _)| *i));

    // Freed once, there is nothing left to do but for what lies right already.
    let after = edit.applied(&scene);
    let again = freed(&after, own - 1, &panel(false));
    assert!(again.keep.iter().all(|keep| *keep));
    for (i, gaussian) in &again.moved {
        let before = after.positions[*i as usize];
        assert!(gaussian.position.distance(before) < 1e-5, "{before}");
    }
}

#[test]
fn what_stands_before_a_window_stays() {
    let scene: Gaussians = room().iter().chain(discs()).collect();
    let edit = freed(&scene, scene.len() - 1, &panel(true));
    assert_eq!(edit, SceneEdit::nothing(scene.len()));
}
