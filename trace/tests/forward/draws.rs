//! Hits drawn at random, alone or in realizations, against the weights of the blend.

use eagpt_scene::Gaussians;
use eagpt_testkit::gaussians::random_cloud;
use eagpt_trace::cpu::bvh::{Bvh, RayScratch, Reach};
use eagpt_trace::cpu::realizations::{NUM_REALIZATIONS, Realizations};
use eagpt_trace::ray::Ray;
use eagpt_trace::surfel::SurfelSet;
use glam::Vec3;

/// One hit chosen at random is each hit as often as it weighs in the blend, whatever the order in
/// which the search meets them.
#[test]
fn sampled_hits_follow_the_weights_of_the_blend() {
    const SEEDS: u32 = 20_000;
    let set = SurfelSet::new(&random_cloud(700, 3));
    let bvh = Bvh::new(&set);
    let mut scratch = RayScratch::default();
    let (mut chi2, mut degrees) = (0.0, 0.0);
    for k in 0..24 {
        let ray = through_the_cloud(k);
        let (expected, transmittance) = weights_of(&bvh, &ray, &mut scratch);
        let mut counts = vec![0_u32; expected.len()];
        let mut missed = 0;
        for seed in 0..SEEDS {
            match bvh.sample_hit(&ray, seed.wrapping_mul(0x9e37_79b9), &mut scratch) {
                None => missed += 1,
                Some(hit) => {
                    let place = expected.iter().position(|(i, _)| *i == hit.index());
                    counts[place.expect("a hit of the blend")] += 1;
                }
            }
        }
        let observed = counts.into_iter().chain([missed]);
        let weights = expected.iter().map(|(_, w)| *w).chain([transmittance]);
        // Cells of fewer than some ten expected counts do not follow the chi-square distribution.
        for (count, weight) in observed.zip(weights) {
            let mean = weight * f64::from(SEEDS);
            if mean > 10.0 {
                chi2 += (f64::from(count) - mean).powi(2) / mean;
                degrees += 1.0;
            }
        }
    }
    // Mean and standard deviation of the distribution are n and √(2n); five of those.
    assert!(degrees > 100.0);
    assert!(
        (chi2 - degrees).abs() < 5.0 * f64::sqrt(2.0 * degrees),
        "chi-square {chi2} for {degrees} degrees of freedom"
    );
}

/// Through realizations, each hit is the nearest as often as it weighs in the blend: over many
/// seeds, 16 realizations each.
#[test]
fn draws_follow_the_weights_of_the_blend() {
    const SEEDS: u32 = 600;
    let set = SurfelSet::new(&random_cloud(700, 3));
    let bvh = Bvh::new(&set);
    let mut scratch = RayScratch::default();
    let rays: Vec<Ray> = (0..24).map(through_the_cloud).collect();
    let mut counts = vec![std::collections::HashMap::new(); rays.len()];
    for seed in 0..SEEDS {
        let realizations = Realizations::new(&set, seed);
        for (ray, counts) in rays.iter().zip(&mut counts) {
            for realization in 0..NUM_REALIZATIONS {
                let hit = realizations.nearest(ray, realization, &mut scratch);
                *counts.entry(hit.map(|hit| hit.index)).or_insert(0) += 1;
            }
        }
    }
    let (mut excess, mut cells) = (0.0_f64, 0.0);
    for (ray, counts) in rays.iter().zip(counts) {
        let (weights, missed) = weights_of(&bvh, ray, &mut scratch);
        let weights = weights.into_iter().map(|(i, w)| (Some(i), w));
        for (hit, weight) in weights.chain([(None, missed)]) {
            let num = f64::from(SEEDS * NUM_REALIZATIONS);
            let share = f64::from(counts.get(&hit).copied().unwrap_or(0)) / num;
            // Independent realizations would have this variance; strata lower it, within a seed.
            let variance = weight * (1.0 - weight) / num;
            if weight * num > 20.0 {
                excess += (share - weight).powi(2) / variance;
                cells += 1.0;
            }
        }
    }
    // The mean of squares of standard normal numbers, with √(2/n) as its deviation; five of those.
    assert!(cells > 100.0);
    let mean = excess / cells;
    assert!(
        mean < 1.0 + 5.0 * f64::sqrt(2.0 / cells),
        "{mean} in {cells} cells"
    );
}

/// In any one realization the search finds what a test of all discs finds, and a bounce does not
/// meet its own surface.
#[test]
fn every_draw_is_searched_to_the_nearest_disc() {
    let gaussians = random_cloud(3000, 5);
    let set = SurfelSet::new(&gaussians);
    let realizations = Realizations::new(&set, 7);
    let mut scratch = RayScratch::default();
    let (mut num_hits, mut num_own) = (0, 0);
    for k in 0..400 {
        let mut ray = through_the_cloud(k);
        if k % 2 == 1 {
            ray.t_min = 2.6;
            ray.own_normal = Vec3::new((k as f32).sin(), (k as f32).cos(), 0.5)
                .normalize()
                .to_array();
        }
        let all = |own: bool| {
            let mut nearest: Option<(f32, u32)> = None;
            for (surfel, i) in set.surfels.iter().zip(0..) {
                let seen = surfel.seen_from(ray.origin);
                let met = seen.meet(ray.direction);
                let radius = realizations.radius_squared(&set, i, k);
                let inside = met.u * met.u + met.v * met.v <= radius;
                if seen.counts(&met)
                    && inside
                    && (own || !seen.is_own(&met, &ray))
                    && nearest.is_none_or(|(t, _)| met.t < t)
                {
                    nearest = Some((met.t, i));
                }
            }
            nearest.map(|(_, i)| i)
        };
        let found = realizations
            .nearest(&ray, k, &mut scratch)
            .map(|hit| hit.index);
        assert_eq!(found, all(false), "ray {k}");
        num_hits += u32::from(found.is_some());
        num_own += u32::from(found != all(true));
    }
    assert!(num_hits > 200 && num_own > 10, "{num_hits}, {num_own}");
}

/// Empty scenes and invisible Gaussians have no hits in realizations.
#[test]
fn draws_of_nothing_are_nothing() {
    let mut faint = random_cloud(20, 1);
    faint.opacities.fill(1e-3);
    for gaussians in [Gaussians::default(), faint] {
        let realizations = Realizations::new(&SurfelSet::new(&gaussians), 0);
        let ray = through_the_cloud(1);
        assert_eq!(
            realizations.nearest(&ray, 3, &mut RayScratch::default()),
            None
        );
    }
}

fn through_the_cloud(k: u32) -> Ray {
    let (sin, cos) = (0.7 * k as f32).sin_cos();
    let direction = Vec3::new(cos, sin, 0.3 * (k as f32).cos()).normalize();
    let origin = direction * -2.5 + Vec3::new(0.1, 0.05, -0.1);
    Ray::free(origin.to_array(), direction.to_array())
}

/// Indices and weights of the hits of the blend along `ray`, and the light that passes all of them.
fn weights_of(bvh: &Bvh, ray: &Ray, scratch: &mut RayScratch) -> (Vec<(u32, f64)>, f64) {
    bvh.find_hits(ray, Reach::Everything, scratch);
    scratch.sort();
    let mut transmittance = 1.0;
    let mut weights = Vec::new();
    for hit in scratch.hits() {
        weights.push((hit.index(), transmittance * f64::from(hit.alpha)));
        transmittance *= 1.0 - f64::from(hit.alpha);
    }
    (weights, transmittance)
}
