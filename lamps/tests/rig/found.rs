//! Lamps found in photographs of them.

use super::{cameras, find_in, heap, photograph_all, room};
use eagpt_lamps::Kinds;
use eagpt_lamps::shape::Shape;
use eagpt_scene::lamps::Lamp;
use eagpt_scene::{Camera, Gaussians, View};
use glam::Vec3;
use std::f32::consts::PI;

/// Lamps found in photographs of these, where training has a heap of discs for each `trained` one.
pub(crate) fn found(lamps: &[(Shape, Vec3)], trained: &[(Shape, Vec3)]) -> Vec<Lamp> {
    found_by(&cameras(), lamps, trained)
}

pub(crate) fn found_by(
    cameras: &[Camera],
    lamps: &[(Shape, Vec3)],
    trained: &[(Shape, Vec3)],
) -> Vec<Lamp> {
    found_lit(cameras, lamps, trained, |_| {})
}

/// … where something is `done` to the photographs.
pub(crate) fn found_lit(
    cameras: &[Camera],
    lamps: &[(Shape, Vec3)],
    trained: &[(Shape, Vec3)],
    done: impl Fn(&mut View),
) -> Vec<Lamp> {
    let heaps = trained
        .iter()
        .flat_map(|(shape, radiance)| heap(shape, *radiance));
    let scene: Gaussians = room().iter().chain(heaps).collect();
    let photographs = cameras.iter().enumerate().map(|(i, &camera)| {
        let mut view = photograph_all(i, camera, lamps, &[]);
        done(&mut view);
        view
    });
    find_in(&scene, Kinds::All, photographs).lamps.lamps
}

/// Checks that each of `lamps` is found, within this share of its power, and nothing else.
pub(crate) fn check(lamps: &[(Shape, Vec3)], tolerance: f32) -> Vec<Lamp> {
    check_found(lamps, found(lamps, lamps), tolerance)
}

pub(crate) fn check_found(lamps: &[(Shape, Vec3)], found: Vec<Lamp>, tolerance: f32) -> Vec<Lamp> {
    assert_eq!(found.len(), lamps.len(), "{found:#?}");
    for (shape, radiance) in lamps {
        let distance = |lamp: &&Lamp| lamp.centre().distance(shape.centre());
        let nearest = found
            .iter()
            .min_by(|a, b| distance(a).total_cmp(&distance(b)));
        let lamp = nearest.unwrap();
        assert!(
            distance(&lamp) < 0.3 * shape.size().max_element(),
            "{lamp:?} {shape:?}"
        );
        let ratio = Vec3::from(lamp.power) / (*radiance * (PI * shape.area()));
        let is_right = |share: f32| (share - 1.0).abs() < tolerance;
        assert!(
            ratio.to_array().into_iter().all(is_right),
            "{ratio} {lamp:?}"
        );
    }
    found
}
