//! Inserted surfaces as a ray tracer sees them: opaque, of the right size, and lit as told.

#![allow(clippy::unwrap_used, reason = "a test ends with its first surprise")]

use eagpt_scene::Gloss;
use eagpt_scene::discs::{Material, Solid, Surface};
use eagpt_trace::Ray;
use eagpt_trace::cpu::CpuScene;
use eagpt_trace::features::Features;
use glam::{Quat, Vec2, Vec3};
use std::f32::consts::PI;

const MATERIAL: Material = Material {
    albedo: Vec3::new(0.2, 0.4, 0.6),
    radiance: None,
    gloss: Gloss::NONE,
};

fn surface(solid: Solid, spacing: Option<f32>) -> Surface {
    Surface {
        solid,
        material: MATERIAL,
        spacing,
    }
}

/// Parallel rays along `direction` through a square grid of `num` × `num` points of a window of
/// half-width `half` about `centre`; with each its place in the window.
fn look(
    scene: &CpuScene,
    centre: Vec3,
    direction: Vec3,
    half: f32,
    num: u16,
) -> Vec<(Vec2, Features)> {
    let (right, up) = direction.any_orthonormal_pair();
    let place = |i: u16| (2.0 * (f32::from(i) + 0.5) / f32::from(num) - 1.0) * half;
    let mut seen = Vec::new();
    for j in 0..num {
        for i in 0..num {
            let at = Vec2::new(place(i), place(j));
            let origin = centre + right * at.x + up * at.y - direction * (4.0 * half);
            let ray = Ray::free(origin.to_array(), direction.to_array());
            seen.push((at, scene.trace(&ray)));
        }
    }
    seen
}

/// The area of the shadow that parallel light would make.
fn shadow_area(seen: &[(Vec2, Features)], half: f32) -> f32 {
    let share: f32 = seen
        .iter()
        .map(|(_, features)| features.alpha())
        .sum::<f32>()
        / seen.len() as f32;
    share * (2.0 * half).powi(2)
}

fn directions() -> impl Iterator<Item = Vec3> {
    (0..6_u8).map(|i| {
        let a = 0.3 + 1.1 * f32::from(i);
        Vec3::new(a.cos(), a.sin(), 0.25 * f32::from(i) - 0.6).normalize()
    })
}

#[test]
fn a_ball_is_opaque_round_and_of_its_size() {
    let (centre, radius) = (Vec3::new(1.0, 0.0, 2.25), 0.25);
    for spacing in [None, Some(0.05)] {
        let discs = surface(Solid::Ball { centre, radius }, spacing).discs();
        let scene = CpuScene::new(&discs);
        for direction in directions() {
            let seen = look(&scene, centre, direction, 0.35, 160);
            let ratio = shadow_area(&seen, 0.35) / (PI * radius * radius);
            assert!((ratio - 1.0).abs() < 0.01, "{spacing:?}: {ratio}");
            for (at, features) in seen.iter().filter(|(at, _)| at.length() < 0.9 * radius) {
                assert!(features.alpha() > 0.98, "{at}: {}", features.alpha());
                let albedo = features.albedo() / features.alpha();
                assert!((albedo - MATERIAL.albedo).length() < 1e-4);
                assert_eq!(
                    (features.emission(), features.radiance()),
                    (0.0, Vec3::ZERO)
                );
            }
        }
    }
}

#[test]
fn the_normal_of_a_ball_points_outwards() {
    let ball = Solid::Ball {
        centre: Vec3::ONE,
        radius: 0.5,
    };
    for g in surface(ball, None).discs().iter() {
        let outwards = (g.position - Vec3::ONE).normalize();
        assert!((g.rotation * Vec3::Z).dot(outwards) > 0.999_99);
    }
}

#[test]
fn a_quad_is_opaque_and_as_large_as_its_edges() {
    let edges = [Vec3::new(0.6, 0.0, 0.8), Vec3::new(0.0, 1.5, 0.0)];
    let centre = Vec3::new(0.0, 2.0, -1.0);
    let normal = Vec3::new(-0.8, 0.0, 0.6);
    for spacing in [None, Some(0.1)] {
        let discs = surface(Solid::Quad { centre, edges }, spacing).discs();
        let scene = CpuScene::new(&discs);
        for g in discs.iter() {
            assert!(((g.rotation * Vec3::Z).dot(normal) - 1.0).abs() < 1e-5);
            assert!((g.position - centre).dot(normal).abs() < 1e-5);
        }
        let seen = look(&scene, centre, normal, 1.1, 220);
        let ratio = shadow_area(&seen, 1.1) / 1.5;
        // Coarse discs leave the corners open.
        assert!((ratio - 1.0).abs() < 0.02, "{spacing:?}: {ratio}");
        for (at, features) in seen.iter().filter(|(at, _)| at.abs().max_element() < 0.33) {
            assert!(features.alpha() > 0.98, "{at}: {}", features.alpha());
        }
    }
}

#[test]
fn flat_surfaces_and_boxes_have_sharp_edges_and_corners() {
    let spacing = 0.05;
    let quad = Solid::Quad {
        centre: Vec3::ZERO,
        edges: [Vec3::X, Vec3::Y],
    };
    let cube = Solid::Box {
        centre: Vec3::new(0.0, 0.0, -0.5),
        size: Vec3::ONE,
        rotation: Quat::IDENTITY,
    };
    for solid in [quad, cube] {
        let scene = CpuScene::new(&surface(solid, Some(spacing)).discs());
        let alpha = |x: f32, y: f32| {
            let ray = Ray::free([x, y, 3.0], [0.0, 0.0, -1.0]);
            scene.trace(&ray).alpha()
        };
        // Half a spacing before and beyond the edge, along it and at its ends.
        let (inside, outside) = (0.5 - 0.5 * spacing, 0.5 + 0.5 * spacing);
        for along in [-inside, -0.31, 0.0, 0.17, inside] {
            for (near, far) in [(inside, outside), (-inside, -outside)] {
                for (before, beyond) in [
                    (alpha(along, near), alpha(along, far)),
                    (alpha(near, along), alpha(far, along)),
                ] {
                    assert!(before > 0.95, "{solid:?} {along} {near}: {before}");
                    assert!(beyond < 0.05, "{solid:?} {along} {far}: {beyond}");
                }
            }
        }
    }
}

#[test]
fn a_box_is_closed_and_faces_outwards() {
    let centre = Vec3::new(0.0, 1.0, 0.0);
    let size = Vec3::new(0.4, 0.6, 0.8);
    let rotation = Quat::from_rotation_z(0.5);
    let solid = Solid::Box {
        centre,
        size,
        rotation,
    };
    let discs = surface(solid, Some(0.02)).discs();
    let scene = CpuScene::new(&discs);
    for g in discs.iter() {
        assert!((g.rotation * Vec3::Z).dot(g.position - centre) > 0.0);
    }
    for (axis, area) in [(Vec3::X, 0.48), (Vec3::Y, 0.32), (Vec3::Z, 0.24)] {
        let seen = look(&scene, centre, rotation * axis, 0.6, 150);
        let ratio = shadow_area(&seen, 0.6) / area;
        // The soft borders of the near and the far face add up.
        assert!((ratio - 1.0).abs() < 0.05, "{axis}: {ratio}");
    }
    // From inside no ray gets out, but for the soft edges.
    for axis in [Vec3::X, Vec3::Y, Vec3::Z] {
        for sign in [-1.0, 1.0] {
            let direction = rotation * (axis * sign + Vec3::new(0.05, -0.02, 0.03)).normalize();
            let ray = Ray::free(centre.to_array(), direction.to_array());
            assert!(scene.trace(&ray).alpha() > 0.98, "{axis} {sign}");
        }
    }
}

#[test]
fn an_emitter_shows_its_radiance_and_the_spacing_sets_the_number() {
    let solid = Solid::Ball {
        centre: Vec3::ZERO,
        radius: 1.0,
    };
    let light = Surface {
        material: Material {
            albedo: Vec3::ZERO,
            radiance: Some(Vec3::splat(12.0)),
            gloss: Gloss::NONE,
        },
        ..surface(solid, Some(0.1))
    };
    let discs = light.discs();
    // 4π / 0.1².
    assert_eq!(discs.len(), 1257);
    let scene = CpuScene::new(&discs);
    let ray = Ray::free([0.0, 0.0, 5.0], [0.0, 0.0, -1.0]);
    let features = scene.trace(&ray);
    assert!((features.radiance() / 12.0 - features.alpha()).length() < 1e-4);
    assert!(features.emission() > 0.98);
}
