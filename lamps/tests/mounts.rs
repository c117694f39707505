//! Discs that training puts before a lamp go: behind it, along its ceiling, or away.

#![allow(clippy::unwrap_used, reason = "a test ends with its first surprise")]

mod rig;

use eagpt_lamps::freed;
use eagpt_scene::lamps::{Lamp, LampShape, Lamps};
use eagpt_scene::{Gaussian, Gaussians, SceneEdit, rotation};
use glam::{Quat, Vec2, Vec3};
use rig::{RADIANCE, room};

/// Height of the panel of [`panel`].
const HEIGHT: f32 = 2.49;

fn panel(bars: bool) -> Lamps {
    let size = Vec3::new(0.2, 0.16, 0.0);
    let down = rotation::from_z_to(Vec3::NEG_Z);
    let frame = (Vec3::new(0.2, 0.1, HEIGHT), down, size);
    let lamp = Lamp {
        name: "ceiling-1".to_owned(),
        one_sided: true,
        bars,
        num_pixels: 100,
        ..Lamp::unmeasured(LampShape::Panel, frame, (0.032, RADIANCE))
    };
    Lamps { lamps: vec![lamp] }
}

/// Discs before the lamp: the edge of a large one of the ceiling that is tilted, a faint one below
/// the lamp, one that stands upright beside it, one of the ceiling farther away, two upright ones
/// below the lamp, translucent and opaque, and the lamp's own.
fn discs() -> [Gaussian; 7] {
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
        disc([0.2, 0.1, 2.45], [0.05, 0.05], upright, 0.4),
        disc([0.2, 0.1, 2.45], [0.05, 0.05], upright, 0.9),
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
    let [tilted, faint, upright, far, translucent, opaque, own] =
        [0, 1, 2, 3, 4, 5, 6].map(|i| first + i);

    let edit = freed(&scene, own, &panel(false), |_| Vec::new());
    let moved = |i: usize| edit.moved.iter().find(|(at, _)| *at as usize == i);
    let (_, flat) = moved(tilted).unwrap();
    let normal = flat.rotation * Vec3::Z;
    assert!(normal.z.abs() > 0.999_99, "{normal}");
    assert!(flat.position.z > HEIGHT, "{}", flat.position);
    assert_eq!(flat.scale, scene.scales[tilted]);
    let gone: Vec<usize> = (0..scene.len()).filter(|&i| !edit.keep[i]).collect();
    assert_eq!(gone, [faint, translucent]);
    for i in [upright, far, opaque, own] {
        assert!(moved(i).is_none(), "{i}");
    }
    assert!(edit.moved.is_sorted_by_key(|(i, _)| *i));

    // Freed once, there is nothing left to do but for what lies right already.
    let after = edit.applied(&scene);
    let again = freed(&after, own - 2, &panel(false), |_| Vec::new());
    assert!(again.keep.iter().all(|keep| *keep));
    for (i, gaussian) in &again.moved {
        let before = after.positions[*i as usize];
        assert!(gaussian.position.distance(before) < 1e-5, "{before}");
    }
}

#[test]
fn what_stands_before_a_window_stays() {
    let scene: Gaussians = room().iter().chain(discs()).collect();
    let edit = freed(&scene, scene.len() - 1, &panel(true), |_| Vec::new());
    assert_eq!(edit, SceneEdit::nothing(scene.len()));
}

/// A flat can at the ceiling, seen from below: a faint disc hangs before its face, one of the
/// ceiling hangs down beside it, and a board is farther below.
#[test]
fn nothing_hides_the_face_of_a_can_at_the_ceiling() {
    let [mut can] = <[Lamp; 1]>::try_from(panel(false).lamps).unwrap();
    can.shape = LampShape::Tube;
    can.size = [0.1, 0.1, 0.01];
    can.centre[2] = HEIGHT - 0.005;
    let face = HEIGHT - 0.01;
    let mut scene: Vec<Gaussian> = room().iter().collect();
    let first = scene.len();
    let like = scene[0];
    let disc = |x: f32, z: f32, size: f32, opacity: f32| Gaussian {
        position: Vec3::new(x, 0.1, z),
        scale: Vec2::splat(size),
        rotation: Quat::IDENTITY,
        opacity,
        ..like
    };
    // Enough of the ceiling for a plane.
    for k in 0..12 {
        scene.push(disc(0.14 + 0.01 * k as f32, HEIGHT + 0.001, 0.02, 0.9));
    }
    let hanging = scene.len();
    scene.push(disc(0.28, HEIGHT - 0.002, 0.02, 0.9));
    let film = scene.len();
    scene.push(disc(0.21, face - 0.08, 0.05, 0.12));
    let board = scene.len();
    scene.push(disc(0.2, face - 0.6, 0.3, 0.9));
    let scene: Gaussians = scene.into_iter().collect();
    let lamps = Lamps { lamps: vec![can] };
    let eyes = |_: &Lamp| [0.0, 0.4].map(|x| Vec3::new(x, 0.0, HEIGHT - 0.6)).to_vec();

    let edit = freed(&scene, scene.len(), &lamps, eyes);
    let gone: Vec<usize> = (0..scene.len()).filter(|&i| !edit.keep[i]).collect();
    assert_eq!(gone, [film]);
    let after = |i: usize| edit.moved.iter().find(|(at, _)| *at as usize == i);
    let moved = after(hanging).unwrap().1;
    assert!(moved.position.z > HEIGHT, "{}", moved.position);
    assert!(after(board).is_none());
    assert!(edit.moved.iter().all(|(i, _)| *i as usize >= first));

    // Without views that show it, a face is not known to shine, and what is before it stays.
    let edit = freed(&scene, scene.len(), &lamps, |_| Vec::new());
    assert!(edit.keep[film]);
}

/// A strip under a shelf, which cameras see from a little below it: the shelf, trained too low, is
/// over the strip, not under it.
#[test]
fn a_strip_under_a_shelf_hangs_from_it() {
    let [mut strip] = <[Lamp; 1]>::try_from(panel(false).lamps).unwrap();
    strip.shape = LampShape::Box;
    strip.size = [0.8, 0.03, 0.015];
    strip.rotation = [1.0, 0.0, 0.0, 0.0];
    strip.centre[2] = HEIGHT - 0.9;
    let centre = strip.centre();
    let mut scene: Vec<Gaussian> = room().iter().collect();
    let first = scene.len();
    let like = scene[0];
    for k in 0..16 {
        scene.push(Gaussian {
            position: centre + Vec3::new(0.05 * (k as f32 - 7.5), 0.02, -0.004 + 0.001 * k as f32),
            scale: Vec2::splat(0.04),
            rotation: Quat::IDENTITY,
            opacity: 0.9,
            ..like
        });
    }
    let scene: Gaussians = scene.into_iter().collect();
    let lamps = Lamps { lamps: vec![strip] };
    let eyes = |_: &Lamp| {
        [-0.5, 0.0, 0.5]
            .map(|x| centre + Vec3::new(x, -2.0, -0.15))
            .to_vec()
    };
    let edit = freed(&scene, scene.len(), &lamps, eyes);
    let after = edit.applied(&scene);
    let shelf: Vec<f32> = (first..after.len()).map(|i| after.positions[i].z).collect();
    let top = centre.z + 0.5 * 0.015;
    assert!(
        shelf.len() >= 8 && shelf.iter().all(|z| *z > top),
        "{top} {shelf:?}"
    );
}

/// A tube before a wall whose discs training has bulging around it, and a picture that hangs beside
/// it.
#[test]
fn a_tube_hangs_before_its_wall() {
    let [mut tube] = <[Lamp; 1]>::try_from(panel(false).lamps).unwrap();
    let (centre, radius) = (Vec3::new(0.0, 0.0, 1.6), 0.015);
    tube.shape = LampShape::Tube;
    tube.centre = centre.to_array();
    tube.size = [2.0 * radius, 2.0 * radius, 0.6];
    let along_x = rotation::from_z_to(Vec3::X);
    tube.rotation = [along_x.w, along_x.x, along_x.y, along_x.z];
    let mut scene: Vec<Gaussian> = room().iter().collect();
    let first = scene.len();
    let like = scene[0];
    let facing = rotation::from_z_to(Vec3::NEG_Y);
    let disc = |x: f32, y: f32, z: f32| Gaussian {
        position: centre + Vec3::new(x, y, z),
        scale: Vec2::splat(0.02),
        rotation: facing,
        opacity: 0.9,
        ..like
    };
    // The wall is at 0.03; it bulges by up to 0.025.
    for k in 0..60 {
        let x = 0.01 * (k as f32 - 29.5);
        let z = 0.02 * ((k % 5) as f32 - 2.0);
        scene.push(disc(x, 0.03 - 0.005 * (k % 6) as f32, z));
    }
    let picture = scene.len();
    scene.push(disc(0.1, -0.02, 0.2));
    let scene: Gaussians = scene.into_iter().collect();
    let lamps = Lamps { lamps: vec![tube] };
    let eyes = |_: &Lamp| {
        [-0.5, 0.0, 0.5]
            .map(|x| centre + Vec3::new(x, -2.0, 0.1))
            .to_vec()
    };
    let edit = freed(&scene, scene.len(), &lamps, eyes);
    assert!(edit.keep.iter().all(|keep| *keep));
    let after = edit.applied(&scene);
    let wall = (first..picture).map(|i| after.positions[i].y);
    assert!(
        wall.clone().all(|y| y > radius),
        "{:?}",
        wall.collect::<Vec<_>>()
    );
    assert_eq!(after.get(picture), scene.get(picture));
    // Seen from the other side it has no wall.
    let behind = |lamp: &Lamp| eyes(lamp).into_iter().map(|eye| eye.with_y(2.0)).collect();
    let edit = freed(&scene, scene.len(), &lamps, behind);
    assert!(edit.moved.is_empty());
}
