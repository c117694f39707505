//! Pictures of cameras, and the records of how they came about.

use super::cameras;
use eagpt_testkit::gaussians::random_cloud;
use eagpt_trace::CameraRays;
use eagpt_trace::blend::Contribution;
use eagpt_trace::blend::GradientMask;
use eagpt_trace::cpu::CameraRecord;
use eagpt_trace::cpu::bvh::Bvh;
use eagpt_trace::cpu::camera::{self, HitSearch, Keep};
use eagpt_trace::features::{NUM_LANES, lane};
use eagpt_trace::oracle::{self, OracleGaussian};
use eagpt_trace::parity::PARITY_TOLERANCE;
use eagpt_trace::surfel::SurfelSet;
use std::sync::Arc;

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
