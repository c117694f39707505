use super::*;
use crate::irradiance;
use crate::surfaces;
use eagpt_scene::Camera;
use eagpt_scene::rng::{Purpose, RandomKey};
use eagpt_testkit::gaussians::{look_at, material, sphere};
use eagpt_trace::cpu::CpuScene;
use glam::DVec3;
use std::f32::consts::TAU;

/// Cosine of the angle from the middle of a cap to its edge.
const EDGE: f32 = 0.9;

fn cameras() -> Vec<Camera> {
    [
        DVec3::X,
        -DVec3::X,
        DVec3::Y,
        -DVec3::Y,
        DVec3::Z,
        -DVec3::Z,
    ]
    .map(|to| look_at(DVec3::ZERO, to, 160, 160))
    .to_vec()
}

/// The inside of a sphere that sends `light` by the direction from its middle: where that is 1 all
/// surfaces receive what makes white ones send about 1.
fn room(light: impl Fn(Vec3) -> f32) -> Gaussians {
    sphere(4000, 1.0, |towards| {
        material(Vec3::splat(light(towards)), 0.0, Vec3::splat(0.5))
    })
}

/// As far as it is known.
struct Known {
    num_moving: usize,
    gloss: Vec<Gloss>,
}

impl Known {
    fn nothing(gaussians: &Gaussians) -> Self {
        Self {
            num_moving: gaussians.len(),
            gloss: Vec::new(),
        }
    }

    fn glows(&self, gaussians: &Gaussians) -> Vec<Vec<usize>> {
        let tracer = CpuScene::new(gaussians);
        let seen = surfaces::best_seen(&tracer, gaussians.len(), &cameras()).unwrap();
        let receivers = surfaces::receivers(&seen);
        let sampling = (64, RandomKey::new(1, Purpose::Albedo, 1));
        let white = irradiance::received(&tracer, &receivers, &gaussians.radiances, sampling);
        let received: Vec<_> = receivers.into_iter().zip(white.unwrap()).collect();
        glows(&Surfaces {
            gaussians,
            num_moving: self.num_moving,
            received: &received,
            gloss: &self.gloss,
        })
    }
}

fn screen(towards: Vec3) -> f32 {
    if towards.x > EDGE { 2.5 } else { 0.7 }
}

#[test]
fn a_screen_shines_and_light_that_fades_does_not() {
    let gaussians = room(screen);
    let found = Known::nothing(&gaussians).glows(&gaussians);
    let within = |edge: f32| {
        let all = gaussians.positions.iter().enumerate();
        all.filter(move |(_, position)| position.normalize().x > edge)
    };
    assert_eq!(found.len(), 1);
    assert!(found[0].iter().all(|&i| gaussians.radiances[i].x == 2.5));
    // All but what discs beyond the edge are blended with.
    for (i, _) in within(EDGE + 0.01) {
        assert!(found[0].contains(&i), "{}", gaussians.positions[i]);
    }

    let fading = room(|towards| 0.7 + 1.8 * ((1.0 - towards.x) / -0.3).exp());
    let bright = fading.radiances.iter().filter(|light| light.x > 2.0);
    assert!(bright.count() > LEAST);
    assert!(Known::nothing(&fading).glows(&fading).is_empty());
    // No brighter than white.
    let white = room(|towards| if towards.x > EDGE { 1.2 } else { 0.7 });
    assert!(Known::nothing(&white).glows(&white).is_empty());
}

#[test]
fn what_is_known_otherwise_does_not_shine() {
    let gaussians = room(screen);
    let nothing = || Known::nothing(&gaussians);
    let is_found = |known: Known| !known.glows(&gaussians).is_empty();
    assert!(is_found(nothing()));
    let steel = Gloss {
        specular: Vec3::splat(0.5),
        ..Gloss::NONE
    };
    assert!(!is_found(Known {
        gloss: vec![steel; gaussians.len()],
        ..nothing()
    }));
    assert!(!is_found(Known {
        num_moving: 0,
        ..nothing()
    }));
    let small = room(|towards| if towards.x > 0.995 { 2.5 } else { 0.7 });
    assert!(Known::nothing(&small).glows(&small).is_empty());
}

#[test]
fn the_listed_lamp_has_the_area_that_views_show() {
    let gaussians = room(screen);
    let found = Known::nothing(&gaussians).glows(&gaussians);
    let tracer = CpuScene::new(&gaussians);
    let cameras = cameras();
    let views = cameras.iter().copied().zip(["a", "b", "c", "d", "e", "f"]);
    let sights = sights(&found, (&tracer, gaussians.len()), views).unwrap();
    assert_eq!(sights.len(), 1);
    // Towards it, and none of the others: fields of view are narrower than a right angle.
    assert_eq!(sights[0].views, ["a"]);
    let members = &found[0];
    let lamp = lamp(&gaussians, members, &sights[0]);
    // A cap, and the outer halves of discs at its edge, about .03 wide, or not all of these.
    let area = TAU * (1.0 - EDGE);
    assert!(
        (lamp.area / area - 1.0).abs() < 0.15,
        "{} {area}",
        lamp.area
    );
    assert!((lamp.radiance[0] - 2.5).abs() < 1e-5);
    assert!((lamp.power[0] / (lamp.area * 2.5 * std::f32::consts::PI) - 1.0).abs() < 1e-5);
    let middle = lamp.centre().normalize();
    assert!(middle.x > 0.999, "{middle}");
    assert!(
        members
            .iter()
            .all(|&i| lamp.contains(gaussians.positions[i]))
    );
    // As high as the cap, and as wide.
    let wide = 2.0 * (1.0 - EDGE * EDGE).sqrt();
    let [x, y, z] = lamp.size;
    assert!(
        (x / wide - 1.0).abs() < 0.1 && (y / wide - 1.0).abs() < 0.1,
        "{x} {y}"
    );
    assert!(z < 1.1 * (1.0 - EDGE), "{z}");
}
