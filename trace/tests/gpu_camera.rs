//! Camera rays on a device against the CPU engine and the brute-force oracle: features and
//! gradients.

mod gpu;

use eagpt_scene::{Camera, Gaussian, Gaussians, Gloss, Harmonics};
use eagpt_testkit::gaussians::{directional, look_at, random_cloud};
use eagpt_trace::blend::Contribution;
use eagpt_trace::blend::GradientMask;
use eagpt_trace::cpu::CpuScene;
use eagpt_trace::cpu::camera::{self, HitSearch, Keep};
use eagpt_trace::features::{NUM_LANES, lane};
use eagpt_trace::gpu::GpuScene;
use eagpt_trace::oracle::{self, OracleGaussian};
use eagpt_trace::surfel::SurfelSet;
use eagpt_trace::{CameraRays, Features, GBuffer, Tracer};
use glam::{DVec3, Quat, Vec2, Vec3};
use std::collections::HashSet;

/// Largest difference of a sum, relative to 1 plus its value: nine times the 5.6e-6 seen on
/// lavapipe.
const SUM_TOLERANCE: f64 = 5e-5;

/// Largest difference of a gradient, relative to the largest of its lane: ten times the 1e-5 seen
/// on lavapipe.
const GRADIENT_TOLERANCE: f32 = 1e-4;

/// Largest difference of a contribution, relative to 1 plus its value: ten times the 1e-5 seen on
/// lavapipe.
const CONTRIBUTION_TOLERANCE: f32 = 1e-4;

fn cameras() -> Vec<Camera> {
    [
        (DVec3::new(3.0, 0.2, 0.4), DVec3::ZERO),
        (DVec3::new(0.1, -0.2, 0.05), DVec3::new(1.0, 0.3, -0.4)),
        (DVec3::new(0.0, 0.0, 2.0), DVec3::ZERO),
    ]
    .map(|(origin, target)| look_at(origin, target, 37, 29))
    .to_vec()
}

/// Pixels whose hits single precision may neither reorder nor lose.
fn steady_pixels(gaussians: &Gaussians, camera: &Camera) -> Vec<usize> {
    let oracle_gaussians: Vec<OracleGaussian> =
        gaussians.iter().map(|g| OracleGaussian::from(&g)).collect();
    let frame = camera.ray_frame();
    (0..camera.num_pixels())
        .filter(|&pixel| {
            let (x, y) = (pixel as u32 % camera.width, pixel as u32 / camera.width);
            let direction = frame.direction(x as f32 + 0.5, y as f32 + 0.5).as_dvec3();
            let hits = oracle::hits(&oracle_gaussians, frame.origin.as_dvec3(), direction);
            // A ray that ends at the threshold of transmittance by a hair may end elsewhere.
            let mut transmittance = 1.0;
            let end = hits.iter().any(|hit| {
                transmittance *= 1.0 - hit.alpha;
                (transmittance / 1e-4 - 1.0_f64).abs() < 1e-3
            });
            !end && !oracle::is_ambiguous(&hits)
        })
        .collect()
}

/// Every third pixel is split.
fn split_in_part(camera: Camera) -> CameraRays {
    let split = (0..camera.num_pixels()).map(|pixel| pixel % 3 == 0);
    CameraRays::splitting(camera, split.collect())
}

/// Pixels that `rays` make of which each is steady.
fn steady_means(gaussians: &Gaussians, rays: &CameraRays) -> Vec<usize> {
    let (camera, grid) = (rays.camera(), rays.grid());
    let centers = steady_pixels(gaussians, camera);
    let Some(split) = rays.split() else {
        return centers;
    };
    let places: HashSet<usize> = steady_pixels(gaussians, &grid).into_iter().collect();
    let are_steady = |pixel: usize| {
        let (x, y) = (pixel % camera.width as usize, pixel / camera.width as usize);
        let place = |k: usize| (2 * y + k / 2) * grid.width as usize + 2 * x + k % 2;
        (0..4).all(|k| places.contains(&place(k)))
    };
    let of_split = (0..split.len()).filter(|&pixel| split[pixel] && are_steady(pixel));
    let of_others = centers.into_iter().filter(|&pixel| !split[pixel]);
    of_split.chain(of_others).collect()
}

/// Largest difference over the steady pixels, relative to 1 plus the wanted value.
fn worst_difference(got: &GBuffer, wanted: &GBuffer, pixels: &[usize]) -> f64 {
    pixels
        .iter()
        .flat_map(|&pixel| {
            let (got, wanted) = (got.pixels[pixel].0, wanted.pixels[pixel].0);
            (0..NUM_LANES).map(move |k| {
                f64::from((got[k] - wanted[k]).abs()) / f64::from(1.0 + wanted[k].abs())
            })
        })
        .fold(0.0, f64::max)
}

#[test]
fn sums_are_those_of_the_cpu() {
    let Some(device) = gpu::device("features of camera rays") else {
        return;
    };
    let plain = random_cloud(700, 3);
    let mut gpu = GpuScene::new(&device, &random_cloud(700, 4)).unwrap();
    // Neither the scene before nor the camera before leaves anything behind.
    gpu.gbuffer(&cameras()[0]).unwrap();
    for gaussians in [&plain, &directional(plain.clone(), 5), &plain] {
        gpu.update(gaussians).unwrap();
        let cpu = CpuScene::new(gaussians);
        for camera in cameras() {
            let steady = steady_pixels(gaussians, &camera);
            assert!(2 * steady.len() > camera.num_pixels());
            let got = gpu.gbuffer(&camera).unwrap();
            let worst = worst_difference(&got, &cpu.gbuffer(&camera).unwrap(), &steady);
            assert!(worst < SUM_TOLERANCE, "{worst:e}");
        }
    }
}

/// Sixty wide, faint discs one behind the other, in no order, all of which may begin at the camera:
/// hits overflow what waits in a pixel several times over, and their order must hold all the same.
#[test]
fn long_lists_of_hits_keep_their_order() {
    let Some(device) = gpu::device("long lists of hits") else {
        return;
    };
    let disc = |i: usize| Gaussian {
        position: Vec3::X * (0.05 * (i * 23 % 60) as f32),
        scale: Vec2::new(2.0, 3.0),
        rotation: Quat::from_rotation_y(1.5 + 0.002 * (i % 7) as f32),
        opacity: 0.02 + 0.001 * (i % 50) as f32,
        radiance: Vec3::new(1.0, 0.1 * (i % 9) as f32, 0.2 * (i % 5) as f32),
        harmonics: Harmonics::NONE,
        gloss: Gloss::NONE,
        emission: 0.01 * i as f32,
        albedo: Vec3::splat(0.5),
    };
    let gaussians: Gaussians = (0..60).map(disc).collect();
    let camera = look_at(DVec3::new(-1.0, 0.2, 0.1), DVec3::ZERO, 19, 13);
    let steady = steady_pixels(&gaussians, &camera);
    let gpu = GpuScene::new(&device, &gaussians).unwrap();
    let got = gpu.gbuffer(&camera).unwrap();
    let wanted = CpuScene::new(&gaussians).gbuffer(&camera).unwrap();
    let worst = worst_difference(&got, &wanted, &steady);
    assert!(
        2 * steady.len() > camera.num_pixels() && worst < SUM_TOLERANCE,
        "{worst:e} over {}",
        steady.len()
    );
}

#[test]
fn nothing_shows_nothing() {
    let Some(device) = gpu::device("an empty scene") else {
        return;
    };
    let camera = &cameras()[0];
    let empty = GpuScene::new(&device, &Gaussians::default()).unwrap();
    let features = empty.gbuffer(camera).unwrap();
    assert!(
        features
            .pixels
            .iter()
            .all(|features| *features == Features::default())
    );
    // Behind the camera there is something, in front nothing.
    let behind = GpuScene::new(&device, &random_cloud(50, 2)).unwrap();
    let camera = look_at(
        DVec3::new(9.0, 0.0, 0.0),
        DVec3::new(10.0, 0.1, 0.0),
        20,
        20,
    );
    let features = behind.gbuffer(&camera).unwrap();
    assert!(
        features
            .pixels
            .iter()
            .all(|features| *features == Features::default())
    );
}

/// Weights of the outputs in the scalar that is differentiated: different for each lane and pixel,
/// so that no two errors cancel.
fn weight(pixel: usize, k: usize) -> f32 {
    let sign = if (pixel + k).is_multiple_of(3) {
        -1.0
    } else {
        1.0
    };
    sign * (0.2 + ((pixel * 31 + k * 17) % 13) as f32 / 13.0)
}

/// Contributions of Gaussians against the CPU, whose tiles list them one by one.
#[test]
fn contributions_are_those_of_the_cpu() {
    let Some(device) = gpu::device("what Gaussians contribute") else {
        return;
    };
    let gaussians = random_cloud(700, 3);
    let set = SurfelSet::new(&gaussians);
    let fit = GpuScene::new(&device, &gaussians).unwrap();
    for camera in cameras() {
        let value = |pixel: usize, features: &Features| weight(pixel, 0) * features.alpha();
        let (_, record) = camera::trace(&set, &camera, HitSearch::Tiles, Keep::Record);
        let mut wanted = vec![Contribution::default(); gaussians.len()];
        for row in record.contributions(&value) {
            let sum = &mut wanted[row.gaussian as usize];
            sum.weight += row.weight;
            sum.weighted_value += row.weighted_value;
            if row.largest_weight > sum.largest_weight {
                (sum.largest_weight, sum.pixel) = (row.largest_weight, row.pixel);
            }
        }
        let (features, got) = fit.contributions(&camera, &value).unwrap();
        assert!(features == fit.gbuffer(&camera).unwrap());
        assert!(got == fit.contributions(&camera, &value).unwrap().1);
        assert!(got.len() > 100);
        let num_wanted = wanted.iter().filter(|row| row.weight > 0.0).count();
        assert!(got.len().abs_diff(num_wanted) * 100 <= num_wanted);
        let (mut worst, mut num_other_pixels) = (0.0_f32, 0);
        for row in &got {
            let wanted = &wanted[row.gaussian as usize];
            // Gaussians on the rim of which a hit flips are told by a weight that nothing else has.
            for (a, b) in [
                (row.weight, wanted.weight),
                (row.weighted_value, wanted.weighted_value),
                (row.largest_weight, wanted.largest_weight),
            ] {
                worst = worst.max((a - b).abs() / (1.0 + b.abs()));
            }
            num_other_pixels += usize::from(row.pixel != wanted.pixel);
        }
        eprintln!(
            "off by {worst:e}, {num_other_pixels} of {} in other pixels",
            got.len()
        );
        assert!(worst < CONTRIBUTION_TOLERANCE, "{worst:e}");
        assert!(num_other_pixels * 100 <= got.len());
    }
}

/// Each lane of the gradient against that of the CPU, relative to the lane's largest value.
#[test]
fn gradients_are_those_of_the_cpu() {
    let Some(device) = gpu::device("gradients of camera rays") else {
        return;
    };
    let gaussians = directional(random_cloud(700, 3), 5);
    let mut cpu = CpuScene::new(&gaussians);
    let mut gpu = GpuScene::new(&device, &gaussians).unwrap();
    let of_cameras = cameras().into_iter().map(CameraRays::from);
    for rays in of_cameras.chain(cameras().into_iter().map(split_in_part)) {
        let mut d_features = vec![Features::default(); rays.camera().num_pixels()];
        let steady = steady_means(&gaussians, &rays);
        for &pixel in &steady {
            for k in 0..lane::SPREAD {
                d_features[pixel].0[k] = weight(pixel, k);
            }
        }
        let mask = GradientMask::Everything;
        let features = cpu.record(&rays).unwrap();
        let wanted = cpu.adjoint(&rays, &d_features, mask).unwrap();
        let worst = worst_difference(&gpu.record(&rays).unwrap(), &features, &steady);
        assert!(worst < SUM_TOLERANCE, "{worst:e}");
        let got = gpu.adjoint(&rays, &d_features, mask).unwrap();
        let again = gpu.adjoint(&rays, &d_features, mask).unwrap();
        assert!(got == again, "the same device gives the same bits");
        let mut failures = Vec::new();
        for k in 0..NUM_LANES {
            let scale = wanted.iter().fold(0.0_f32, |m, g| m.max(g.0[k].abs()));
            let pairs = got.iter().zip(&wanted);
            let worst = pairs.fold(0.0_f32, |m, (a, b)| m.max((a.0[k] - b.0[k]).abs()));
            if worst > GRADIENT_TOLERANCE * scale {
                failures.push(format!("lane {k}: off by {worst:e} of {scale:e}"));
            }
        }
        assert!(failures.is_empty(), "{}", failures.join("\n"));
    }
}
