#![allow(clippy::unwrap_used, reason = "a test ends with its first surprise")]

use super::*;
use eagpt_testkit::gaussians::{cube, look_at, material, rectangle};
use glam::{DVec3, Vec3};

/// A room whose ceiling shines, and a board of this albedo above the middle of its floor.
fn room(albedo: f32) -> Gaussians {
    let wall = |side: Vec3| match side.z > 0.0 {
        true => material(Vec3::splat(2.0), 1.0, Vec3::ZERO),
        false => material(Vec3::ZERO, 0.0, Vec3::splat(0.3)),
    };
    let board = rectangle(
        Vec3::new(0.0, 0.0, -0.3),
        0.3 * Vec3::X,
        0.3 * Vec3::Y,
        0.04,
        material(Vec3::ZERO, 0.0, Vec3::splat(albedo)),
    );
    cube(1.0, 0.1, wall).into_iter().chain(board).collect()
}

/// Light that the floor reflects below a board of this albedo, which cameras see from above.
fn below(albedo: f32) -> f32 {
    let scene = room(albedo);
    let sides = [DVec3::X, -DVec3::X, DVec3::Y, -DVec3::Y];
    let floor = DVec3::new(0.0, 0.0, -1.0);
    let from_the_side = sides.map(|side| look_at(0.9 * side - 0.2 * DVec3::Z, floor, 96, 96));
    let from_above = look_at(DVec3::new(0.0, 0.0, 0.8), floor, 96, 96);
    let cameras: Vec<Camera> = from_the_side.into_iter().chain([from_above]).collect();
    let solution = Solution {
        device: &Device::Cpu,
        cameras: &cameras,
        method: GaussianBake {
            num_samples: Some(512),
        },
        max_bounces: 4,
        seed: 1,
    };
    let goes_on = &mut |_| ControlFlow::Continue(());
    let mut traced = solution.trace(&scene, goes_on).unwrap().unwrap();
    let solved = traced.solve(scene, goes_on).unwrap().unwrap().scene;
    let is_below = |i: &usize| {
        let position = solved.positions[*i];
        position.z < -0.99 && position.truncate().length() < 0.15
    };
    let found: Vec<usize> = (0..solved.len()).filter(is_below).collect();
    assert!(found.len() >= 4, "{found:?}");
    let light = found.iter().map(|&i| solved.radiances[i].x);
    light.sum::<f32>() / found.len() as f32
}

/// The underside of a board that cameras see from above is dark, however bright its top: the floor
/// has of it what comes by way of the walls.
#[test]
fn the_light_of_a_front_is_not_at_the_back() {
    let [black, white] = [0.01, 0.95].map(below);
    assert!(black > 0.02, "{black}");
    // With the light of the top below it there would be 2.7 times as much.
    assert!((1.0..1.1).contains(&(white / black)), "{black} {white}");
}
