use super::*;
use crate::cpu::CpuScene;
use eagpt_scene::rng::{Purpose, RandomKey};
use eagpt_scene::{Gaussian, Gaussians, Gloss, Harmonics};
use glam::{Quat, Vec2};
use std::f32::consts::TAU;

fn lamps(num: u32) -> Gaussians {
    let key = RandomKey::new(8, Purpose::Initialise, 0);
    (0..num)
        .map(|i| {
            let [x, y, z, turn] = key.stream(i, 0).next_uniforms();
            Gaussian {
                position: Vec3::new(1.6 * x - 0.8, 1.6 * y - 0.8, 1.0 + z),
                scale: Vec2::new(0.25, 0.15 + 0.2 * x),
                rotation: Quat::from_rotation_x(0.6 * turn),
                opacity: 0.6 + 0.39 * y,
                radiance: Vec3::splat(1.0 + 9.0 * z),
                harmonics: Harmonics::NONE,
                gloss: Gloss::NONE,
                emission: if i % 5 == 4 { 0.0 } else { 1.0 },
                albedo: Vec3::ZERO,
            }
        })
        .collect()
}

fn receiver() -> Surface {
    Surface {
        position: Vec3::new(0.1, 0.3, 0.0),
        normal: Vec3::new(0.3, 0.0, 1.0).normalize(),
        offset: 0.01,
    }
}

/// The density integrates to one over the sphere, and sampled directions follow it: the mean of
/// `g/f` over samples of density f is `∫ g`, here for `g = f²`.
fn is_density_of_samples(
    what: &str,
    density: impl Fn(Vec3) -> f32,
    sample: impl Fn([f32; 3]) -> Option<Vec3>,
) {
    let density = |direction| f64::from(density(direction));
    let cells = 1_000_000_u32;
    let (mut integral, mut square) = (0.0, 0.0);
    for i in 0..cells {
        let z = 1.0 - (2 * i + 1) as f32 / cells as f32;
        let (sin, cos) = (i as f32 * 2.399_963_2 % TAU).sin_cos();
        let flat = (1.0 - z * z).sqrt();
        let f = density(Vec3::new(flat * cos, flat * sin, z).normalize());
        integral += f;
        square += f * f;
    }
    let cell = 4.0 * std::f64::consts::PI / f64::from(cells);
    let (integral, square) = (integral * cell, square * cell);
    // Cells at the rims of discs.
    assert!((integral - 1.0).abs() < 2e-2, "{what}: {integral}");
    let key = RandomKey::new(3, Purpose::Render, 0);
    let samples = 100_000;
    let values: Vec<f64> = (0..samples)
        .map(|i| {
            let [a, b, pick, _] = key.stream(i, 0).next_uniforms();
            density(sample([pick, a, b]).unwrap())
        })
        .collect();
    let mean = values.iter().sum::<f64>() / f64::from(samples);
    let sd = (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / f64::from(samples)).sqrt();
    let error = sd / f64::from(samples).sqrt();
    assert!(
        (mean - square).abs() < 4.0 * error + 3e-2 * square,
        "{what}: {mean} ± {error} instead of {square}"
    );
}

#[test]
fn densities_are_those_of_the_samples() {
    for num in [3, 400] {
        let list = LightList::new(&SurfelSet::new(&lamps(num))).unwrap();
        let surface = receiver();
        let origin = surface.position;
        let importances = &list.importances(&surface);
        let realization = 5;
        is_density_of_samples(
            &format!("{num} discs of a realization"),
            |direction| list.density(importances, realization, origin, direction),
            |point| list.sample(importances, realization, origin, point),
        );
        is_density_of_samples(
            &format!("{num} footprints"),
            |direction| list.footprint_density(importances, origin, direction),
            |point| list.sample_footprint(importances, origin, point),
        );
    }
}

/// At the rims of small discs roundings decide whether a ray meets them: those of the scene.
#[test]
fn what_a_realization_meets_has_a_density() {
    let mut gaussians = lamps(200);
    gaussians.scales.fill(Vec2::new(0.001, 0.02));
    let scene = CpuScene::new(&gaussians);
    let list = scene.light_list().unwrap();
    let surface = receiver();
    let importances = &list.importances(&surface);
    let mut num_met = 0;
    for realization in 0..REALIZATIONS {
        for (disc, surfel) in list.discs.iter().zip(&list.set.surfels) {
            let radius = disc.radii[realization].max(0.0).sqrt();
            for turn in 0..50_u8 {
                let rim = disc.point(surfel, radius, f32::from(turn) / 50.0);
                let direction = (rim - surface.position).normalize();
                let ray = surface.ray(direction);
                let hit = scene.realization_hit(&ray, realization as u32);
                if hit.is_some_and(|hit| scene.attributes(hit.index).emission() > 0.5) {
                    let realization = realization as u32;
                    let density =
                        list.density(importances, realization, surface.position, direction);
                    assert!(density > 0.0, "{realization}: {rim}");
                    num_met += 1;
                }
            }
        }
    }
    // About half of the rims.
    assert!(num_met > 10_000, "{num_met}");
}

/// Every emitter is in one cluster, clusters follow each other, and the last cumulative power is
/// that of the cluster.
#[test]
fn clusters_divide_the_emitters() {
    for (num, expected) in [(1, 1), (6, 5), (1000, MAX_CLUSTERS)] {
        let list = LightList::new(&SurfelSet::new(&lamps(num))).unwrap();
        assert_eq!(list.clusters.len(), expected);
        let mut end = 0;
        for (number, cluster) in list.clusters.iter().enumerate() {
            assert_eq!(cluster.first, end);
            end = cluster.end;
            let discs = &list.discs[cluster.range()];
            assert_eq!(discs.last().unwrap().cumulative, cluster.powers);
            let footprints = discs.last().unwrap().cumulative_footprint;
            assert_eq!(footprints, cluster.footprint_power);
            assert!(discs.iter().all(|disc| disc.cluster as usize == number));
            for surfel in &list.set.surfels[cluster.range()] {
                let far = Vec3::from(surfel.position).distance(cluster.centre);
                assert!(far <= cluster.radius);
            }
        }
        assert_eq!(end as usize, list.discs.len());
        assert_eq!(end, num - num / 5);
    }
}

#[test]
fn what_is_below_or_dark_is_not_chosen() {
    let list = LightList::new(&SurfelSet::new(&lamps(50))).unwrap();
    let below = Surface {
        position: Vec3::new(0.0, 0.0, 5.0),
        normal: Vec3::Z,
        offset: 0.01,
    };
    let importances = list.importances(&below);
    assert!(importances.iter().all(|&importance| importance == 0.0));
    let sample = list.sample(&importances, 0, below.position, [0.3, 0.4, 0.5]);
    assert_eq!(sample, None);
    let sample = list.sample_footprint(&importances, below.position, [0.3, 0.4, 0.5]);
    assert_eq!(sample, None);
    assert!(LightList::new(&SurfelSet::new(&Gaussians::default())).is_none());
    let mut dark = lamps(5);
    dark.radiances.fill(Vec3::ZERO);
    assert!(LightList::new(&SurfelSet::new(&dark)).is_none());
}
