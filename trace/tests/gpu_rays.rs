//! Single rays on a device: composited features against the CPU engine.

mod gpu;

use eagpt_scene::{Gaussian, Gaussians, Gloss, Harmonics};
use eagpt_testkit::gaussians::random_cloud;
use eagpt_trace::cpu::CpuScene;
use eagpt_trace::gpu::GpuScene;
use eagpt_trace::oracle::{self, OracleGaussian};
use eagpt_trace::ray::Ray;
use eagpt_trace::{Features, Tracer};
use glam::{DVec3, Quat, Vec2, Vec3};

/// Largest difference of a sum, relative to 1 plus its value: as for camera rays.
const SUM_TOLERANCE: f32 = 5e-5;

/// Rays from inside a cloud in all directions; every other one leaves from a surface and does not
/// see what lies along it.
fn rays(num: usize) -> Vec<Ray> {
    let direction = |i: usize| {
        let azimuth = i as f32 * 2.399_963;
        let z = 1.0 - (2 * i + 1) as f32 / num as f32;
        let flat = (1.0 - z * z).sqrt();
        Vec3::new(flat * azimuth.cos(), flat * azimuth.sin(), z).normalize()
    };
    (0..num)
        .map(|i| {
            let origin = [0.05, -0.02, 0.1 + 0.001 * i as f32];
            let free = Ray::free(origin, direction(i).to_array());
            match i % 2 {
                0 => free,
                _ => Ray {
                    t_min: 0.5,
                    own_normal: direction(7 * i % num).to_array(),
                    ..free
                },
            }
        })
        .collect()
}

fn is_steady(gaussians: &[OracleGaussian], ray: &Ray) -> bool {
    let [origin, direction] = [ray.origin, ray.direction].map(|v| DVec3::from(v.map(f64::from)));
    let hits = oracle::hits(gaussians, origin, direction);
    // Hits just at the end of the own surface may be either.
    let own = hits
        .iter()
        .any(|hit| (hit.t - f64::from(ray.t_min)).abs() < 1e-5);
    !own && !oracle::is_ambiguous(&hits)
}

fn worst_difference(got: &Features, wanted: &Features) -> f32 {
    let pairs = got.0.iter().zip(wanted.0);
    pairs.fold(0.0, |worst, (got, wanted)| {
        worst.max((got - wanted).abs() / (1.0 + wanted.abs()))
    })
}

/// Discs in one another, the smallest in front: a search finds the nearer box small and the farther
/// one large on every level of a tree that joins the boxes that fit best, and puts all of the
/// latter off.
#[test]
fn no_hit_is_lost_in_a_deep_tree() {
    let Some(device) = gpu::device("rays through a deep tree") else {
        return;
    };
    let dolls: Gaussians = (0..300)
        .map(|i| Gaussian {
            position: Vec3::Z * (2.0 + 1e-5 * i as f32),
            scale: Vec2::splat(1e-6 * 1.06_f32.powi(i)),
            rotation: Quat::IDENTITY,
            opacity: 0.02,
            radiance: Vec3::new(1.0, i as f32 / 300.0, 0.5),
            harmonics: Harmonics::NONE,
            gloss: Gloss::NONE,
            emission: 0.0,
            albedo: Vec3::ONE,
        })
        .collect();
    let rays: Vec<Ray> = (0..64)
        .map(|i| {
            let direction = Vec3::new(1e-4 * i as f32, 1e-5, 1.0).normalize();
            Ray::free([0.0; 3], direction.to_array())
        })
        .collect();
    let scene = GpuScene::new(&device, &dolls).unwrap();
    let cpu = CpuScene::new(&dolls);
    for (got, ray) in scene.trace_rays(&rays).unwrap().iter().zip(&rays) {
        let off = worst_difference(got, &cpu.trace(ray));
        assert!(off < SUM_TOLERANCE, "{ray:?}: {off}");
    }
}

#[test]
fn blended_rays_are_those_of_the_cpu() {
    let Some(device) = gpu::device("blended rays") else {
        return;
    };
    // The second scene has more hits on a ray than wait at once.
    let mut faint = random_cloud(600, 6);
    faint
        .opacities
        .iter_mut()
        .for_each(|o| *o = 0.02 + 0.05 * *o);
    faint.scales.iter_mut().for_each(|s| *s += 0.12);
    for gaussians in [random_cloud(700, 3), faint] {
        let wanted = CpuScene::new(&gaussians);
        let rays = rays(400);
        let features = GpuScene::new(&device, &gaussians)
            .unwrap()
            .trace_rays(&rays)
            .unwrap();
        let oracle: Vec<OracleGaussian> =
            gaussians.iter().map(|g| OracleGaussian::from(&g)).collect();
        let mut num_compared = 0;
        for (ray, got) in rays.iter().zip(&features) {
            if is_steady(&oracle, ray) {
                num_compared += 1;
                let worst = worst_difference(got, &wanted.trace(ray));
                assert!(worst < SUM_TOLERANCE, "{ray:?}: {worst:e}");
            }
        }
        assert!(num_compared > 200, "{num_compared}");
    }
}

#[test]
fn nothing_is_met_in_an_empty_scene() {
    let Some(device) = gpu::device("rays through nothing") else {
        return;
    };
    let empty = GpuScene::new(&device, &Gaussians::default()).unwrap();
    assert_eq!(
        empty.trace_rays(&rays(3)).unwrap(),
        vec![Features::default(); 3]
    );
    assert_eq!(empty.trace_rays(&[]).unwrap(), vec![]);
}

#[test]
fn free_rays_are_those_of_the_cpu() {
    let Some(device) = gpu::device("free rays") else {
        return;
    };
    let cloud = random_cloud(1500, 8);
    let (scene, cpu) = (
        GpuScene::new(&device, &cloud).unwrap(),
        CpuScene::new(&cloud),
    );
    let rays = rays(300);
    let distances: Vec<f32> = (0..300).map(|i| 0.01 * (i * 7 % 150) as f32).collect();
    // Products in another order differ by roundings; none of these is that close to a half.
    let wanted = cpu.are_free(&rays, &distances).unwrap();
    assert_eq!(scene.are_free(&rays, &distances).unwrap(), wanted);
    let num = wanted.iter().filter(|is_free| **is_free).count();
    assert!((50..250).contains(&num), "{num}");
    assert_eq!(scene.are_free(&[], &[]).unwrap(), [false; 0]);
}
