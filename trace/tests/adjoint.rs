//! The adjoint against central differences of the double-precision oracle: each class of
//! parameters, each output.

use eagpt_scene::{Camera, Gaussians};
use eagpt_testkit::gaussians::{look_at, random_cloud};
use eagpt_trace::Features;
use eagpt_trace::blend::GradientMask;
use eagpt_trace::blend::{LocalGradient, grad_lane};
use eagpt_trace::cpu::camera::{self, HitSearch, Keep};
use eagpt_trace::features::lane;
use eagpt_trace::oracle::{self, OracleGaussian};
use eagpt_trace::surfel::SurfelSet;
use glam::{DMat3, DQuat, DVec3, Vec3};

/// Moves one Gaussian along one lane of [`LocalGradient`] by `h`.
fn moved(g: &OracleGaussian, which: usize, h: f64) -> OracleGaussian {
    let mut g = *g;
    let frame = DMat3::from_quat(g.rotation.normalize());
    let axis = |k: usize| [frame.x_axis, frame.y_axis, frame.z_axis][k];
    match which {
        0..3 => g.position += axis(which) * h,
        3..5 => g.scale[which - grad_lane::SCALE] += h,
        5..8 => {
            let turn = DQuat::from_axis_angle(axis(which - grad_lane::ROTATION), h);
            g.rotation = turn * g.rotation;
        }
        8 => g.opacity += h,
        9..12 => g.radiance[which - grad_lane::RADIANCE] += h,
        12 => g.emission += h,
        _ => g.albedo[which - grad_lane::ALBEDO] += h,
    }
    g
}

/// Outputs that carry gradients, with a name each.
const OUTPUTS: [(&str, usize, usize); 6] = [
    ("radiance", lane::RADIANCE, 3),
    ("emission", lane::EMISSION, 1),
    ("albedo", lane::ALBEDO, 3),
    ("normal", lane::NORMAL, 3),
    ("alpha", lane::ALPHA, 1),
    ("distance", lane::DISTANCE, 1),
];
const PARAMETERS: [(&str, usize, usize); 7] = [
    ("position", grad_lane::POSITION, 3),
    ("scale", grad_lane::SCALE, 2),
    ("rotation", grad_lane::ROTATION, 3),
    ("opacity", grad_lane::OPACITY, 1),
    ("radiance", grad_lane::RADIANCE, 3),
    ("emission", grad_lane::EMISSION, 1),
    ("albedo", grad_lane::ALBEDO, 3),
];

/// Weights of the outputs in the scalar that is differentiated: different for each lane and pixel,
/// so that no two errors cancel.
fn weight(pixel: usize, k: usize) -> f32 {
    0.5 + ((pixel * 31 + k * 17) % 13) as f32 / 13.0
        - if (pixel + k).is_multiple_of(3) {
            1.1
        } else {
            0.0
        }
}

struct Case {
    camera: Camera,
    gaussians: Gaussians,
    /// Pixels whose hits stay the same when parameters move a little.
    steady: Vec<usize>,
}

impl Case {
    fn new(camera: Camera, gaussians: Gaussians) -> Self {
        let oracle_gaussians: Vec<OracleGaussian> =
            gaussians.iter().map(|g| OracleGaussian::from(&g)).collect();
        let mut case = Self {
            camera,
            gaussians,
            steady: Vec::new(),
        };
        for pixel in 0..camera.num_pixels() {
            let (origin, direction) = case.ray(pixel);
            let hits = oracle::hits(&oracle_gaussians, origin, direction);
            let rim = hits.iter().any(|hit| (hit.edge - 1.0).abs() < 0.02);
            let tie = hits.windows(2).any(|pair| pair[1].t - pair[0].t < 2e-3);
            // A ray that ends at the threshold of transmittance by a hair may end elsewhere in
            // single precision.
            let mut transmittance = 1.0;
            let end = hits.iter().any(|hit| {
                transmittance *= 1.0 - hit.alpha;
                (transmittance / 1e-4 - 1.0_f64).abs() < 0.05
            });
            if !(rim || tie || end || hits.is_empty()) {
                case.steady.push(pixel);
            }
        }
        case
    }

    fn ray(&self, pixel: usize) -> (DVec3, DVec3) {
        let frame = self.camera.ray_frame();
        let (x, y) = (
            pixel as u32 % self.camera.width,
            pixel as u32 / self.camera.width,
        );
        (
            frame.origin.as_dvec3(),
            frame.direction(x as f32 + 0.5, y as f32 + 0.5).as_dvec3(),
        )
    }

    fn analytic(&self, first: usize, count: usize) -> Vec<LocalGradient> {
        let set = SurfelSet::new(&self.gaussians);
        let (_, mut record) = camera::trace(&set, &self.camera, HitSearch::Tiles, Keep::Record);
        let mut d_features = vec![Features::default(); self.camera.num_pixels()];
        for &pixel in &self.steady {
            for k in first..first + count {
                d_features[pixel].0[k] = weight(pixel, k);
            }
        }
        record.adjoint(&set, &d_features, GradientMask::Everything)
    }

    fn scalar(&self, gaussians: &[OracleGaussian], first: usize, count: usize) -> f64 {
        self.steady
            .iter()
            .map(|&pixel| {
                let (origin, direction) = self.ray(pixel);
                let features = oracle::trace(gaussians, origin, direction);
                (first..first + count)
                    .map(|k| f64::from(weight(pixel, k)) * features[k])
                    .sum::<f64>()
            })
            .sum()
    }

    /// All outputs against all parameters; every failure is reported at once. `tolerance` is
    /// relative to the largest derivative of the class.
    fn check(&self, tolerance: f64) {
        assert!(
            self.steady.len() > 20,
            "only {} steady pixels",
            self.steady.len()
        );
        let oracle_gaussians: Vec<OracleGaussian> = self
            .gaussians
            .iter()
            .map(|g| OracleGaussian::from(&g))
            .collect();
        let mut failures = Vec::new();
        for (output, first, count) in OUTPUTS {
            let analytic = self.analytic(first, count);
            for (parameter, first_lane, num_lanes) in PARAMETERS {
                let mut pairs = Vec::new();
                for which in first_lane..first_lane + num_lanes {
                    for i in 0..self.gaussians.len() {
                        let h = 1e-6;
                        let mut shifted = oracle_gaussians.clone();
                        shifted[i] = moved(&oracle_gaussians[i], which, h);
                        let up = self.scalar(&shifted, first, count);
                        shifted[i] = moved(&oracle_gaussians[i], which, -h);
                        let down = self.scalar(&shifted, first, count);
                        pairs.push((f64::from(analytic[i].0[which]), (up - down) / (2.0 * h)));
                    }
                }
                let scale = pairs.iter().fold(0.0_f64, |m, p| m.max(p.1.abs()));
                let worst = pairs.iter().fold(0.0_f64, |m, p| m.max((p.0 - p.1).abs()));
                if worst > tolerance * scale + 1e-6 {
                    failures.push(format!(
                        "d {output} / d {parameter}: off by {worst:.3e} of {scale:.3e}"
                    ));
                }
            }
        }
        assert!(failures.is_empty(), "{}", failures.join("\n"));
    }
}

/// Single-precision features over a few hundred hits; worst seen 4e-5 of the largest derivative.
const TOLERANCE: f64 = 2e-4;

#[test]
fn a_few_large_gaussians_seen_off_axis() {
    let mut gaussians = random_cloud(12, 21);
    gaussians.scales.iter_mut().for_each(|s| *s += 0.15);
    Case::new(
        look_at(DVec3::new(2.5, 0.8, 0.9), DVec3::new(0.0, 0.6, 0.3), 16, 12),
        gaussians,
    )
    .check(TOLERANCE);
}

#[test]
fn saturated_rays() {
    let mut gaussians = random_cloud(40, 22);
    gaussians.scales.iter_mut().for_each(|s| *s += 0.3);
    gaussians
        .opacities
        .iter_mut()
        .for_each(|o| *o = 0.9 + 0.0999 * *o);
    Case::new(
        look_at(DVec3::new(-2.0, -1.2, 0.6), DVec3::ZERO, 14, 10),
        gaussians,
    )
    .check(TOLERANCE);
}

#[test]
fn a_camera_inside_the_cloud() {
    let mut gaussians = random_cloud(30, 23);
    gaussians.scales.iter_mut().for_each(|s| *s += 0.05);
    Case::new(
        look_at(
            DVec3::new(0.05, 0.1, -0.1),
            DVec3::new(1.0, -0.2, 0.1),
            16,
            12,
        ),
        gaussians,
    )
    .check(TOLERANCE);
}

#[test]
fn light_and_material_alone_are_the_same_as_with_everything() {
    let set = SurfelSet::new(&random_cloud(400, 24));
    let camera = look_at(DVec3::new(2.0, 0.3, 0.5), DVec3::ZERO, 40, 30);
    let (features, mut record) = camera::trace(&set, &camera, HitSearch::Tiles, Keep::Record);
    let all = record.adjoint(&set, &features.pixels, GradientMask::Everything);
    let some = record.adjoint(&set, &features.pixels, GradientMask::LightAndMaterial);
    let mut num_seen = 0;
    for (all, some) in all.iter().zip(&some) {
        assert_eq!(some.0[..grad_lane::RADIANCE], [0.0; grad_lane::RADIANCE]);
        assert_eq!(some.0[grad_lane::RADIANCE..], all.0[grad_lane::RADIANCE..]);
        num_seen += usize::from(all.0[grad_lane::EMISSION] != 0.0);
    }
    assert!(num_seen > 100);
}

/// The matrix of a view's blends against its trace, and its transpose against the definition of
/// one: `⟨d, W v⟩ = ⟨Wᵀ d, v⟩`.
#[test]
fn the_matrix_of_a_view_blends_as_its_trace_does() {
    let gaussians = random_cloud(900, 4);
    let set = SurfelSet::new(&gaussians);
    let camera = look_at(DVec3::new(2.4, -0.8, 0.9), DVec3::ZERO, 45, 37);
    let (features, record) = camera::trace(&set, &camera, HitSearch::Tiles, Keep::Record);
    let albedos = &gaussians.albedos;
    // Features of some tens of terms in another order; what is left out and given to others changes
    // a pixel by its share at most.
    for (least, tolerance) in [(0.0, 1e-5), (1e-3, 1e-2)] {
        let weights = record.weights(least);
        let blended = weights.blend(|i| albedos[i as usize]);
        for (pixel, (seen, blended)) in features.pixels.iter().zip(&blended).enumerate() {
            assert!(
                (seen.albedo() - *blended).abs().max_element() < tolerance,
                "pixel {pixel}: {blended} instead of {}",
                seen.albedo()
            );
        }
        let d: Vec<Vec3> = (0..blended.len())
            .map(|i| Vec3::new((i as f32).sin(), (2.0 * i as f32).cos(), 0.5))
            .collect();
        let dot = |a: &[Vec3], b: &[Vec3]| -> f64 {
            a.iter().zip(b).map(|(a, b)| f64::from(a.dot(*b))).sum()
        };
        let d_albedos = weights.adjoint(&d, albedos.len());
        let (of_pixels, of_gaussians) = (dot(&d, &blended), dot(&d_albedos, albedos));
        // Single-precision features of some thousand terms of size one.
        assert!(
            (of_pixels - of_gaussians).abs() < 1e-2,
            "{of_pixels} and {of_gaussians}"
        );
    }
    assert!(record.weights(1e-3).num_bytes() < record.weights(0.0).num_bytes());
}
