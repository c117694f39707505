//! Forward tracing against the brute-force oracle in double precision, and the fast searches
//! against each other.

use eagpt_scene::Gaussians;
use eagpt_testkit::gaussians::{look_at, random_cloud};
use eagpt_trace::CameraRays;
use eagpt_trace::blend::Contribution;
use eagpt_trace::blend::GradientMask;
use eagpt_trace::cpu::CameraRecord;
use eagpt_trace::cpu::bvh::{Bvh, RayScratch, Reach};
use eagpt_trace::cpu::camera::{self, HitSearch, Keep};
use eagpt_trace::cpu::realizations::{NUM_REALIZATIONS, Realizations};
use eagpt_trace::features::{NUM_LANES, lane};
use eagpt_trace::oracle::{self, OracleGaussian};
use eagpt_trace::parity::PARITY_TOLERANCE;
use eagpt_trace::ray::Ray;
use eagpt_trace::surfel::SurfelSet;
use glam::{DVec3, Vec3};
use std::sync::Arc;

fn cameras() -> Vec<eagpt_scene::Camera> {
    [
        (DVec3::new(3.0, 0.2, 0.4), DVec3::ZERO),
        (DVec3::new(0.1, -0.2, 0.05), DVec3::new(1.0, 0.3, -0.4)),
        (DVec3::new(-1.5, -1.5, 1.5), DVec3::new(0.2, 0.0, -0.1)),
        (DVec3::new(0.0, 0.0, 2.0), DVec3::ZERO),
    ]
    .map(|(origin, target)| look_at(origin, target, 37, 29))
    .to_vec()
}

#[test]
fn sums_match_the_oracle() {
    let gaussians = random_cloud(700, 3);
    let oracle_gaussians: Vec<OracleGaussian> =
        gaussians.iter().map(|g| OracleGaussian::from(&g)).collect();
    let set = SurfelSet::new(&gaussians);
    let (mut compared, mut skipped, mut hit) = (0, 0, 0);
    for camera in cameras() {
        let (image, _) = camera::trace(&set, &camera, HitSearch::Tiles, Keep::Nothing);
        let frame = camera.ray_frame();
        for (pixel, features) in image.pixels.iter().enumerate() {
            let (x, y) = (pixel as u32 % camera.width, pixel as u32 / camera.width);
            let direction = frame.direction(x as f32 + 0.5, y as f32 + 0.5).as_dvec3();
            // Hits beyond the first end of the ray do not matter, but near-ties there are harmless
            // to skip, too.
            if oracle::is_ambiguous(&oracle::hits(
                &oracle_gaussians,
                frame.origin.as_dvec3(),
                direction,
            )) {
                skipped += 1;
                continue;
            }
            let expected = oracle::trace(&oracle_gaussians, frame.origin.as_dvec3(), direction);
            compared += 1;
            hit += i32::from(expected[lane::ALPHA] > 0.5);
            for k in 0..NUM_LANES {
                let tolerance = PARITY_TOLERANCE * (1.0 + expected[k].abs());
                assert!(
                    (f64::from(features.0[k]) - expected[k]).abs() < tolerance,
                    "lane {k} of pixel ({x}, {y}): {} instead of {}",
                    features.0[k],
                    expected[k]
                );
            }
        }
    }
    assert!(
        compared > 3 * skipped && hit > 500,
        "compared {compared}, skipped {skipped}, opaque {hit}"
    );
}

#[test]
fn tiles_and_single_rays_give_the_same_bits() {
    let gaussians = random_cloud(2000, 8);
    let set = SurfelSet::new(&gaussians);
    let bvh = Bvh::new(&set);
    for camera in cameras() {
        let (tiles, _) = camera::trace(&set, &camera, HitSearch::Tiles, Keep::Nothing);
        let (rays, _) = camera::trace(&set, &camera, HitSearch::SingleRays(&bvh), Keep::Nothing);
        assert!(tiles == rays);
    }
}

/// Needles and discs seen edge-on, which lie in few of the blocks that their bounds cover; several
/// in one plane, whose distances tie.
#[test]
fn needles_ties_and_grazing_discs_are_found_by_all_searches() {
    let mut gaussians = random_cloud(3000, 12);
    for (i, scale) in gaussians.scales.iter_mut().enumerate() {
        *scale *= match i % 3 {
            0 => glam::Vec2::new(12.0, 0.05),
            1 => glam::Vec2::new(0.02, 3.0),
            _ => glam::Vec2::splat(0.5),
        };
    }
    for i in (0..gaussians.len()).step_by(5) {
        gaussians.positions[i].z = 0.05 * (i % 4) as f32;
        gaussians.rotations[i] = glam::Quat::from_rotation_z(i as f32);
    }
    let set = SurfelSet::new(&gaussians);
    let bvh = Bvh::new(&set);
    for camera in cameras() {
        let (tiles, mut tile_record) = camera::trace(&set, &camera, HitSearch::Tiles, Keep::Record);
        let (rays, mut ray_record) =
            camera::trace(&set, &camera, HitSearch::SingleRays(&bvh), Keep::Record);
        assert!(tiles == rays);
        let by_tiles = tile_record.adjoint(&set, &tiles.pixels, GradientMask::Everything);
        assert!(by_tiles == ray_record.adjoint(&set, &tiles.pixels, GradientMask::Everything));
    }
}

/// Records are made in the memory of earlier ones, of images of any size.
#[test]
fn a_record_can_be_used_again() {
    let mut record = CameraRecord::default();
    for (seed, camera) in cameras().into_iter().enumerate() {
        let camera = camera.magnified(if seed % 2 == 0 { 2 } else { 1 });
        let set = SurfelSet::new(&random_cloud(900 - 200 * seed, seed as u64));
        let (image, mut fresh) = camera::trace(&set, &camera, HitSearch::Tiles, Keep::Record);
        assert!(image == record.trace(&set, &camera.into(), HitSearch::Tiles, Keep::Record));
        assert_eq!(fresh.num_hits(), record.num_hits());
        let wanted = GradientMask::Everything;
        let gradients = record.adjoint(&set, &image.pixels, wanted);
        assert!(gradients == fresh.adjoint(&set, &image.pixels, wanted));
        assert_eq!(gradients.len(), set.len());
    }
}

/// Split pixels are the means of four rays; others are those of their middles, which the directions
/// of a finer grid have to the rounding of single precision. Hits at the rim of a disc may differ.
#[test]
fn some_pixels_are_means_of_four_rays() {
    let gaussians = random_cloud(1500, 8);
    let set = SurfelSet::new(&gaussians);
    let bvh = Bvh::new(&set);
    for camera in cameras() {
        let split: Arc<[bool]> = (0..camera.num_pixels()).map(|p| p % 3 == 0).collect();
        let rays = CameraRays::splitting(camera, Arc::clone(&split));
        let trace = |search| {
            let mut record = CameraRecord::default();
            let image = record.trace(&set, &rays, search, Keep::Record);
            let mask = GradientMask::Everything;
            let gradients = record.adjoint(&set, &image.pixels, mask);
            (image, gradients, record.num_hits())
        };
        let (image, gradients, num_hits) = trace(HitSearch::Tiles);
        assert!(trace(HitSearch::SingleRays(&bvh)) == (image.clone(), gradients.clone(), num_hits));

        let middles = camera::trace(&set, &camera, HitSearch::Tiles, Keep::Nothing).0;
        let fine = camera.magnified(2);
        let (places, record) = camera::trace(&set, &fine, HitSearch::Tiles, Keep::Record);
        assert!(num_hits < record.num_hits());
        let means = places.averaged(2);
        let mut num_off = 0;
        for (pixel, features) in image.pixels.iter().enumerate() {
            if split[pixel] {
                assert_eq!(features, &means.pixels[pixel]);
            } else {
                let pairs = features.0.iter().zip(middles.pixels[pixel].0);
                let off = pairs.fold(0.0_f32, |off, (a, b)| off.max((a - b).abs() / (1.0 + b)));
                num_off += usize::from(off > 1e-4);
            }
        }
        assert!(num_off * 100 <= image.pixels.len(), "{num_off}");

        // All pixels split: those of the finer camera.
        let all = CameraRays::splitting(camera, vec![true; split.len()].into());
        let mut record = CameraRecord::default();
        assert!(means == record.trace(&set, &all, HitSearch::Tiles, Keep::Record));
    }
}

#[test]
fn the_number_of_threads_does_not_change_a_bit() {
    let gaussians = random_cloud(1500, 4);
    let camera = &cameras()[0];
    let in_pool = |threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| {
            let set = SurfelSet::new(&gaussians);
            let (image, mut record) = camera::trace(&set, camera, HitSearch::Tiles, Keep::Record);
            let gradients = record.adjoint(&set, &image.pixels, GradientMask::Everything);
            (image, gradients)
        })
    };
    let (one, five) = (in_pool(1), in_pool(5));
    assert!(one.0 == five.0);
    assert!(one.1 == five.1);
}

fn trace_sphere_of_rays(set: &SurfelSet, bvh: &Bvh) -> Vec<eagpt_trace::Features> {
    let mut scratch = RayScratch::default();
    (0..400)
        .map(|i| {
            let a = i as f32 * 2.399_963;
            let z = 1.0 - (2 * i + 1) as f32 / 400.0;
            let flat = (1.0 - z * z).sqrt();
            let direction = Vec3::new(flat * a.cos(), flat * a.sin(), z).normalize();
            bvh.trace(
                set,
                &Ray::free([0.05, -0.02, 0.1], direction.to_array()),
                &mut scratch,
            )
        })
        .collect()
}

fn moved(gaussians: &Gaussians, by: f32) -> Gaussians {
    let mut out = gaussians.clone();
    for (i, p) in out.positions.iter_mut().enumerate() {
        let phase = i as f32;
        *p += Vec3::new(phase.sin(), (1.7 * phase).cos(), (0.3 * phase).sin()) * by;
    }
    out
}

#[test]
fn a_refit_tree_equals_a_fresh_one() {
    let gaussians = random_cloud(3000, 5);
    let mut bvh = Bvh::new(&SurfelSet::new(&gaussians));
    let small = SurfelSet::new(&moved(&gaussians, 0.01));
    assert!(!bvh.update(&small), "a small move is followed by a refit");
    assert!(trace_sphere_of_rays(&small, &bvh) == trace_sphere_of_rays(&small, &Bvh::new(&small)));
    let large = SurfelSet::new(&moved(&gaussians, 0.8));
    assert!(bvh.update(&large), "a large move makes a new tree");
    assert!(trace_sphere_of_rays(&large, &bvh) == trace_sphere_of_rays(&large, &Bvh::new(&large)));
}

#[test]
fn faint_gaussians_enter_and_leave_the_tree() {
    let mut gaussians = random_cloud(500, 6);
    let mut bvh = Bvh::new(&SurfelSet::new(&gaussians));
    gaussians.opacities[17] = 1e-3;
    gaussians.opacities[18] = 1.0;
    let set = SurfelSet::new(&gaussians);
    assert!(bvh.update(&set));
    assert!(trace_sphere_of_rays(&set, &bvh) == trace_sphere_of_rays(&set, &Bvh::new(&set)));
}

#[test]
fn an_empty_scene_shows_nothing() {
    let set = SurfelSet::new(&Gaussians::default());
    let bvh = Bvh::new(&set);
    for search in [HitSearch::Tiles, HitSearch::SingleRays(&bvh)] {
        let (image, record) = camera::trace(&set, &cameras()[0], search, Keep::Record);
        assert!(
            image
                .pixels
                .iter()
                .all(|features| *features == eagpt_trace::Features::default())
        );
        assert_eq!(record.num_hits(), 0);
    }
}

/// A pixel's opacity is the sum of its weights; so is what each Gaussian is given credit for.
#[test]
fn contributions_add_up_to_the_picture() {
    let gaussians = random_cloud(700, 3);
    let set = SurfelSet::new(&gaussians);
    for camera in cameras() {
        let (image, record) = camera::trace(&set, &camera, HitSearch::Tiles, Keep::Record);
        let value = |pixel: usize| 1.0 + (pixel % 7) as f32;
        let contributions = record.contributions(&|pixel, _| value(pixel));
        let (mut weight, mut weighted) = (0.0, 0.0);
        for (pixel, features) in image.pixels.iter().enumerate() {
            weight += f64::from(features.alpha());
            weighted += f64::from(features.alpha() * value(pixel));
        }
        let total = |part: fn(&Contribution) -> f32| -> f64 {
            contributions.iter().map(|c| f64::from(part(c))).sum()
        };
        // Features of some ten thousand single-precision terms in another order.
        assert!((total(|c| c.weight) / weight - 1.0).abs() < 1e-5);
        assert!((total(|c| c.weighted_value) / weighted - 1.0).abs() < 1e-5);
        for c in &contributions {
            assert!(c.weight > 0.0 && c.largest_weight <= 1.0 && c.largest_weight <= c.weight);
            assert!((c.pixel as usize) < image.pixels.len());
        }
    }
}

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
