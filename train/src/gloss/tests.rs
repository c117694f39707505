//! Gloss from pictures of a scene whose gloss is known.

use super::*;
use eagpt_scene::{Camera, Gaussian, View};
use eagpt_testkit::gaussians::{look_at, material, rectangle};
use eagpt_trace::{Integrator, LightOptions, Tracer};
use glam::{DVec3, Mat3};
use std::slice::from_ref;
use std::sync::Arc;

const FLOOR: Gloss = Gloss {
    specular: Vec3::splat(0.3),
    roughness: 0.3,
};

/// A floor below a lamp and before walls, all of which carry their light.
fn corner(gloss: Gloss) -> Gaussians {
    let (x, y, z) = (Vec3::X, Vec3::Y, Vec3::Z);
    let mut floor = material(Vec3::splat(0.25), 0.0, Vec3::splat(0.4));
    floor.gloss = gloss;
    let dark = material(Vec3::new(0.1, 0.12, 0.15), 0.0, Vec3::splat(0.5));
    let bright = material(Vec3::new(0.8, 0.7, 0.6), 0.0, Vec3::splat(0.5));
    let lamp = material(Vec3::splat(6.0), 1.0, Vec3::ZERO);
    let mut discs = rectangle(Vec3::ZERO, 1.5 * x, 1.5 * y, 0.1, floor);
    discs.extend(rectangle(1.5 * y + z, 1.5 * x, z, 0.1, dark));
    discs.extend(rectangle(1.5 * x + z, 1.5 * y, z, 0.1, bright));
    let above = Vec3::new(0.2, 0.3, 1.7);
    discs.extend(rectangle(above, 0.3 * x, 0.3 * y, 0.05, lamp));
    discs.into_iter().collect()
}

fn cameras() -> Vec<Camera> {
    (0..16)
        .map(|i| {
            let (sin, cos) = (0.2 * f64::from(i) - 2.6).sin_cos();
            let eye = DVec3::new(1.3 * cos, 1.3 * sin, 0.6 + 0.3 * f64::from(i % 3));
            look_at(eye, DVec3::new(0.2, 0.2, 0.1), 48, 36)
        })
        .collect()
}

/// Pictures of `scene`.
fn pictures(scene: &Gaussians) -> Vec<Result<TrainingView>> {
    let scene = CpuScene::new(scene);
    let take = |(index, camera): (usize, Camera)| {
        let gather = Integrator::Gather { num_samples: 64 };
        let seen = scene.render(&camera, &gather, &LightOptions::default());
        let view = View::new(index.to_string(), camera, seen.unwrap().radiance);
        Ok(TrainingView {
            index,
            light: 0,
            view: Arc::new(view),
            points: None,
        })
    };
    cameras().into_iter().enumerate().map(take).collect()
}

#[test]
fn a_glossy_floor_is_found_and_nothing_else() {
    let (truth, plain) = (corner(FLOOR), corner(Gloss::NONE));
    let found = estimate(from_ref(&plain), pictures(&truth).into_iter(), 1).unwrap();
    assert_eq!(found.surfaces.len(), 1, "{:?}", found.surfaces);
    let surface = found.surfaces[0];
    assert_eq!(surface.roughness, FLOOR.roughness);
    let off = surface.specular[0] / FLOOR.specular.x;
    assert!((0.75..1.3).contains(&off), "{surface:?}");
    assert!(surface.foretold > 0.5, "{surface:?}");
    let mut num = 0;
    for (i, gloss) in found.gloss.iter().enumerate() {
        let is_floor = truth.gloss_of(i).is_some();
        assert!(is_floor || !gloss.is_some(), "{i}");
        num += usize::from(gloss.is_some());
    }
    let num_floor = truth.gloss.iter().filter(|gloss| gloss.is_some()).count();
    assert!(num > num_floor * 3 / 5, "{num} of {num_floor}");
    let mut applied = plain.clone();
    found.apply(&mut applied);
    assert!(applied.is_glossy());
    assert_eq!(applied.positions, plain.positions);
    // Its paint is seen through the gloss.
    assert_eq!(applied.albedos, plain.albedos);
}

/// Discs of the floor that are tilted, off its plane or too faint to be compared are of it.
#[test]
fn a_ragged_floor_is_glossy_as_a_whole() {
    let (truth, mut ragged) = (corner(FLOOR), corner(Gloss::NONE));
    let key = RandomKey::new(3, Purpose::Albedo, 0);
    let is_floor = |i: usize| truth.gloss_of(i).is_some();
    let num_floor = (0..truth.len()).filter(|&i| is_floor(i)).count();
    for i in (0..truth.len()).filter(|&i| is_floor(i)) {
        let [a, b, c, d] = key.stream(i as u32, 0).next_uniforms();
        let tilt = Quat::from_rotation_x(0.2 * (a - 0.5)) * Quat::from_rotation_y(0.2 * (b - 0.5));
        ragged.rotations[i] = tilt * ragged.rotations[i];
        ragged.positions[i].z += 0.01 * (c - 0.5);
        if d < 0.2 {
            ragged.opacities[i] = 0.03;
        }
    }
    let found = estimate(from_ref(&ragged), pictures(&truth).into_iter(), 1).unwrap();
    assert_eq!(found.surfaces.len(), 1, "{:?}", found.surfaces);
    let mut applied = ragged;
    found.apply(&mut applied);
    let glossy: Vec<usize> = (0..applied.len())
        .filter(|&i| applied.gloss_of(i).is_some())
        .collect();
    assert!(glossy.iter().all(|&i| is_floor(i)));
    // The rest is out of sight.
    let num = glossy.len();
    assert!(num > num_floor * 3 / 5, "{num} of {num_floor}");
    let normals = glossy.iter().map(|&i| {
        let normal = Mat3::from_quat(applied.rotations[i]).z_axis;
        normal * normal.z.signum()
    });
    let mean = normals.clone().sum::<Vec3>().normalize();
    assert!(mean.z > 0.999, "{mean}");
    let is_even = |normal: &Vec3| normal.dot(mean) > 1.0 - 1e-4;
    let num_even = normals.filter(is_even).count();
    assert!(num_even > num * 19 / 20, "{num_even} of {num}");
}

/// Discs of the floor on one side of its middle.
fn half_of_floor(scene: &Gaussians) -> Vec<usize> {
    let positions = scene.positions.iter().enumerate();
    let is_there = |p: &Vec3| p.z.abs() < 1e-6 && p.x > 0.0;
    positions
        .filter(|(_, p)| is_there(p))
        .map(|(i, _)| i)
        .collect()
}

/// Halves of unlike paint below the same varnish are explained by one lobe.
#[test]
fn a_floor_of_two_paints_is_one_surface() {
    let (mut truth, mut plain) = (corner(FLOOR), corner(Gloss::NONE));
    for scene in [&mut truth, &mut plain] {
        for i in half_of_floor(scene) {
            scene.radiances[i] = Vec3::new(0.02, 0.03, 0.06);
        }
    }
    let found = estimate(from_ref(&plain), pictures(&truth).into_iter(), 1).unwrap();
    assert_eq!(found.surfaces.len(), 1, "{:?}", found.surfaces);
    assert_eq!(found.surfaces[0].roughness, FLOOR.roughness);
    let glossy = |of: &[usize]| of.iter().filter(|&&i| found.gloss[i].is_some()).count();
    let dark = half_of_floor(&plain);
    assert!(glossy(&dark) > dark.len() / 2, "{}", glossy(&dark));
}

/// Paint that is as bright as the metal beside it in the mean stays diffuse.
#[test]
fn paint_beside_metal_of_its_colour_is_divided_from_it() {
    let (mut truth, mut plain) = (corner(FLOOR), corner(Gloss::NONE));
    let painted = half_of_floor(&plain);
    for &i in &painted {
        truth.gloss[i] = Gloss::NONE;
        for scene in [&mut truth, &mut plain] {
            scene.radiances[i] = Vec3::splat(0.45);
        }
    }
    let found = estimate(from_ref(&plain), pictures(&truth).into_iter(), 1).unwrap();
    let is_painted = |i: &usize| painted.contains(i);
    let glossy: Vec<usize> = (0..plain.len())
        .filter(|&i| found.gloss[i].is_some())
        .collect();
    // Along the border, pixels show both.
    let num_false = glossy.iter().filter(|i| is_painted(i)).count();
    assert!(glossy.len() > painted.len() / 2, "{}", glossy.len());
    assert!(
        num_false <= painted.len() / 10,
        "{num_false} of {}",
        painted.len()
    );
}

#[test]
fn a_diffuse_floor_stays_diffuse() {
    let plain = corner(Gloss::NONE);
    let found = estimate(from_ref(&plain), pictures(&plain).into_iter(), 1).unwrap();
    assert_eq!(found.surfaces, [], "nothing is glossy");
    assert!(found.gloss.is_empty());
}

/// A table is as bright from below as its top in a scene that no camera has seen from there.
#[test]
fn undersides_that_no_camera_sees_are_not_mirrored() {
    let board = |height: f32, light: f32| {
        let centre = Vec3::new(-0.2, -0.1, height);
        let material = material(Vec3::splat(light), 0.0, Vec3::splat(0.5));
        rectangle(centre, 0.35 * Vec3::X, 0.35 * Vec3::Y, 0.07, material)
    };
    let top = board(0.5, 1.5);
    let with = |gloss: Gloss, below: &[Gaussian]| -> Gaussians {
        let others = top.iter().chain(below).copied();
        corner(gloss).iter().chain(others).collect()
    };
    let (truth, plain) = (with(FLOOR, &board(0.48, 0.05)), with(Gloss::NONE, &[]));
    let found = estimate(from_ref(&plain), pictures(&truth).into_iter(), 1).unwrap();
    assert_eq!(found.surfaces.len(), 1, "{:?}", found.surfaces);
    let off = found.surfaces[0].specular[0] / FLOOR.specular.x;
    assert!((0.75..1.3).contains(&off), "{:?}", found.surfaces);
}

/// An albedo of a metal would scatter only by how much its mirror images are off.
#[test]
fn bare_metal_scatters_nothing() {
    let (mut truth, plain) = (corner(FLOOR), corner(Gloss::NONE));
    for (light, gloss) in truth.radiances.iter_mut().zip(&mut truth.gloss) {
        if gloss.is_some() {
            (*light, gloss.specular) = (Vec3::ZERO, Vec3::splat(0.6));
        }
    }
    let found = estimate(from_ref(&plain), pictures(&truth).into_iter(), 1).unwrap();
    assert_eq!(found.surfaces.len(), 1, "{:?}", found.surfaces);
    let mut applied = plain.clone();
    found.apply(&mut applied);
    for i in 0..plain.len() {
        let albedo = if found.gloss[i].is_some() {
            Vec3::ZERO
        } else {
            plain.albedos[i]
        };
        assert_eq!(applied.albedos[i], albedo, "{i}");
    }
}

/// Differences within each of two lights add up.
#[test]
fn views_in_another_light_count_too() {
    let (truth, plain) = (corner(FLOOR), corner(Gloss::NONE));
    let dimmed = |scene: &Gaussians| {
        let mut dimmed = scene.clone();
        dimmed.radiances.iter_mut().for_each(|light| *light *= 0.5);
        dimmed
    };
    let num = cameras().len();
    let second = pictures(&dimmed(&truth)).into_iter().map(|view| {
        view.map(|view| TrainingView {
            index: view.index + num,
            light: 1,
            ..view
        })
    });
    let lights = [plain.clone(), dimmed(&plain)];
    let found = estimate(&lights, pictures(&truth).into_iter().chain(second), 1).unwrap();
    assert_eq!(found.surfaces.len(), 1, "{:?}", found.surfaces);
    let one = estimate(&lights[..1], pictures(&truth).into_iter(), 1).unwrap();
    let [two, one] = [found, one].map(|found| found.surfaces[0]);
    assert_eq!(two.roughness, one.roughness);
    let ratio = two.specular[0] / one.specular[0];
    assert!((0.8..1.25).contains(&ratio), "{two:?} {one:?}");
}

#[test]
fn discs_turn_towards_their_plane_unless_it_is_another() {
    let normal = Vec3::new(0.1, 0.2, 1.0).normalize();
    for own in [Quat::IDENTITY, Quat::from_rotation_x(3.0)] {
        let axis = Mat3::from_quat(fill::turned(own, normal)).z_axis;
        assert!(axis.dot(normal).abs() > 1.0 - 1e-5);
    }
    let steep = Quat::from_rotation_x(1.2);
    assert_eq!(fill::turned(steep, normal), steep);
}

#[test]
fn gloss_stays_with_its_gaussian_when_others_go_and_come() {
    let gloss = |specular: f32| Gloss {
        specular: Vec3::splat(specular),
        roughness: 0.25,
    };
    let turned = |angle: f32| Quat::from_rotation_x(angle);
    let mut estimate = Estimate {
        gloss: [0.0, 0.5, 0.75].map(gloss).to_vec(),
        is_bare: vec![false, true, false],
        rotations: [0.0, 1.0, 2.0].map(turned).to_vec(),
        surfaces: Vec::new(),
    };
    let mut edit = SceneEdit::nothing(3);
    edit.keep[0] = false;
    edit.fixed = [material(Vec3::ZERO, 0.0, Vec3::ONE)].into_iter().collect();
    edit.fixed.rotations[0] = turned(3.0);
    estimate.edit(&edit);
    assert_eq!(estimate.gloss, [gloss(0.5), gloss(0.75), Gloss::NONE]);
    assert_eq!(estimate.is_bare, [true, false, false]);
    assert_eq!(estimate.rotations, [1.0, 2.0, 3.0].map(turned));
    assert_eq!(Estimate::from_rows(&estimate.rows()), estimate);
}
