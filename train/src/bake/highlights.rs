//! Highlights of a baked scene: what glossy surfaces mirror of the baked light towards cameras, in
//! the harmonics of their Gaussians.
//!
//! The baked radiance of a glossy Gaussian is what a diffuse surface of the same reflectance would
//! have. Here the ratio of the light that goes to some of the cameras to that is sampled, and its
//! logarithm fitted by the harmonics, together with that of neighbours on the surface. Those of
//! degree 2 hold wide lobes and the slope of narrow ones; sharp mirror images need a gather.
//! Of lights that are set one by one, it is the highlights of all together that are kept.

use super::receivers::Receivers;
use crate::error::Result;
use crate::irradiance::smooth::Smoothing;
use eagpt_scene::harmonics::{self, NUM_FUNCTIONS};
use eagpt_scene::rng::{Purpose, RandomKey};
use eagpt_scene::{Camera, Gaussians, Harmonics};
use eagpt_trace::Tracer;
use eagpt_trace::transport::bsdf::equivalent_albedo;
use eagpt_trace::transport::glossy::{GlossyPoint, Mirrored};
use eagpt_trace::transport::matrix::Receiver;
use eagpt_trace::transport::start::Surface;
use glam::Vec3;
use nalgebra::SMatrix;
use rayon::prelude::*;

/// Cameras that a Gaussian is seen from, at most.
const MAX_EYES: usize = 16;
/// Directions of the lobe for each of them; all of them are of use for all cameras.
const NUM_SAMPLES: u32 = 4;
/// Cosine at which cameras see a surface, at least.
const MIN_COSINE: f32 = 0.05;
/// Ratios of light to diffuse light are held within this and its inverse.
const MAX_RATIO: f32 = 20.0;
/// Least radiance that others are divided by, in parts of the mean.
const MIN_RADIANCE: f32 = 1e-3;
/// Squared coefficients count as much as this part of the squared errors.
const RIDGE: f32 = 0.005;
/// Power of the ratio that errors of its logarithm count by: 0 for relative errors, by which what
/// is bright ends up too dark, 1 for absolute ones, by which what is dark ends up too bright. Of 0,
/// ¼, ½ and 0.9, it suits three rooms best.
const POWER: f32 = 0.25;

/// Sums of products of a linear fit: of functions, and of functions with the logarithms of ratios
/// of three channels. In the exponent, harmonics are linear in those.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Products {
    weight: f32,
    functions: SMatrix<f32, NUM_FUNCTIONS, NUM_FUNCTIONS>,
    logs: SMatrix<f32, NUM_FUNCTIONS, 3>,
}

impl Products {
    fn zero() -> Self {
        Self {
            weight: 0.0,
            functions: SMatrix::zeros(),
            logs: SMatrix::zeros(),
        }
    }

    fn add(&mut self, to_eye: Vec3, ratio: Vec3) {
        let log = ratio.map(|r| r.clamp(MAX_RATIO.recip(), MAX_RATIO).ln());
        let functions = SMatrix::<f32, NUM_FUNCTIONS, 1>::from(harmonics::functions(-to_eye));
        let weight = (POWER * log.element_sum() / 3.0).exp();
        self.weight += weight;
        self.functions += functions * functions.transpose() * weight;
        self.logs += functions * SMatrix::<f32, 1, 3>::from(log.to_array()) * weight;
    }

    fn add_weighted(&mut self, other: &Self, weight: f32) {
        self.weight += other.weight * weight;
        self.functions += other.functions * weight;
        self.logs += other.logs * weight;
    }

    /// The harmonics with the least squared error.
    fn fitted(mut self) -> Harmonics {
        for k in 0..NUM_FUNCTIONS {
            self.functions[(k, k)] += RIDGE * self.weight;
        }
        let solved = self.functions.cholesky().map(|f| f.solve(&self.logs));
        solved.map_or(Harmonics::NONE, |c| {
            Harmonics(std::array::from_fn(|at| c[(at / 3, at % 3)]))
        })
    }
}

/// A glossy Gaussian at a point of its surface.
struct Glossy {
    /// Its row among the receivers.
    row: usize,
    gaussian: usize,
    point: GlossyPoint,
}

/// Harmonics of the Gaussians of a `baked` scene, `[n]`; its own where nothing is glossy. Emitters
/// keep theirs. `tracer` has the Gaussians before they were baked.
///
/// # Errors
/// If the device fails.
pub(super) fn harmonics(
    baked: &Gaussians,
    tracer: &mut dyn Tracer,
    receivers: &Receivers,
    cameras: &[Camera],
    seed: u64,
) -> Result<Vec<Harmonics>> {
    let mut found = baked.harmonics.clone();
    if baked.gloss.is_empty() {
        return Ok(found);
    }
    found.resize(baked.len(), Harmonics::NONE);
    let key = RandomKey::new(seed, Purpose::Bake, 2);
    tracer.update(baked)?;
    let rows = of_rows(baked, tracer, &receivers.traced, cameras, key)?;
    for (i, sources) in receivers.each() {
        if baked.gloss[i].is_some() {
            let colour = |row: usize, k: usize| Vec3::from(rows[row].0.as_chunks::<3>().0[k]);
            let (of_functions, _) = found[i].0.as_chunks_mut::<3>();
            for (k, coefficients) in of_functions.iter_mut().enumerate() {
                *coefficients = sources.mean(|row| colour(row, k)).to_array();
            }
        }
    }
    Ok(found)
}

/// Those of `receivers`, `[receivers]`; none of what is not glossy.
fn of_rows(
    baked: &Gaussians,
    tracer: &dyn Tracer,
    receivers: &[Receiver],
    cameras: &[Camera],
    key: RandomKey,
) -> Result<Vec<Harmonics>> {
    let glossy = |(row, (i, surface)): (usize, &Receiver)| {
        let gaussian = *i as usize;
        let gloss = baked.gloss[gaussian];
        gloss.is_some().then(|| Glossy {
            row,
            gaussian,
            point: GlossyPoint {
                surface: *surface,
                gloss,
                eyes: eyes(gaussian, surface, cameras),
            },
        })
    };
    let all = receivers.par_iter().enumerate();
    let glossy: Vec<Glossy> = all.filter_map(glossy).collect();
    let points: Vec<GlossyPoint> = glossy.iter().map(|one| one.point.clone()).collect();
    let mirrored = tracer.mirrored_towards(&points, NUM_SAMPLES, key)?;
    let products = products(baked, &glossy, &mirrored);
    let places: Vec<Receiver> = glossy.iter().map(|one| receivers[one.row]).collect();
    let smoothing = Smoothing::new(&places);
    let with_neighbours = |(g, one): (usize, &Glossy)| {
        let mut own = 1.0;
        let mut sum = Products::zero();
        for &(j, weight) in smoothing.neighbours(g) {
            own -= weight;
            if points[j as usize].gloss == one.point.gloss {
                sum.add_weighted(&products[j as usize], weight);
            }
        }
        sum.add_weighted(&products[g], own);
        (one.row, sum.fitted())
    };
    let smooth = glossy.par_iter().enumerate().map(with_neighbours);
    let mut rows = vec![Harmonics::NONE; receivers.len()];
    for (row, harmonics) in smooth.collect::<Vec<_>>() {
        rows[row] = harmonics;
    }
    Ok(rows)
}

/// Cameras that a surface is in the picture of, a few of all; others for each `gaussian`.
fn eyes(gaussian: usize, surface: &Surface, cameras: &[Camera]) -> Vec<Vec3> {
    let shown = cameras.iter().filter_map(|camera| {
        let at = camera.project(surface.position);
        let is_inside = at.z > 0.0
            && (0.0..camera.width as f32).contains(&at.x)
            && (0.0..camera.height as f32).contains(&at.y);
        let eye = camera.origin();
        let to_eye = (eye - surface.position).normalize_or_zero();
        (is_inside && to_eye.dot(surface.normal) >= MIN_COSINE).then_some(eye)
    });
    let shown: Vec<Vec3> = shown.collect();
    let step = shown.len().div_ceil(MAX_EYES).max(1);
    let some = shown.iter().skip(gaussian % step).step_by(step);
    some.copied().collect()
}

/// Products of each of `glossy` with its own ratios, from what it mirrors towards its eyes.
fn products(
    baked: &Gaussians,
    glossy: &[Glossy],
    mirrored: &[Vec<Option<Mirrored>>],
) -> Vec<Products> {
    let mean = baked.radiances.iter().map(|l| l.element_sum()).sum::<f32>() / 3.0;
    let least = Vec3::splat(MIN_RADIANCE * mean / baked.len() as f32);
    let of = |(one, mirrored): (&Glossy, &Vec<Option<Mirrored>>)| {
        let Glossy {
            gaussian, point, ..
        } = one;
        let albedo = baked.albedos[*gaussian];
        let carried = baked.radiances[*gaussian].max(least);
        let all = equivalent_albedo(albedo, point.gloss).max(Vec3::splat(1e-3));
        let mut sum = Products::zero();
        for (eye, mirrored) in point.eyes.iter().zip(mirrored) {
            if let Some(mirrored) = mirrored {
                let to_eye = (*eye - point.surface.position).normalize_or_zero();
                let scattered = albedo * (Vec3::ONE - mirrored.reflectance) / all;
                sum.add(to_eye, mirrored.light / carried + scattered);
            }
        }
        sum
    };
    glossy.par_iter().zip(mirrored).map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::super::gaussians::GaussianBake;
    use super::super::solution::Solution;
    use super::*;
    use eagpt_scene::{Gaussian, Gloss};
    use eagpt_testkit::gaussians::{look_at, material, rectangle};
    use eagpt_trace::cpu::CpuScene;
    use eagpt_trace::{Device, Integrator, LightOptions};
    use glam::{DVec3, Vec2};
    use std::ops::ControlFlow;

    /// A floor of brushed metal or of paint, a wall behind it, and a lamp before that.
    fn room(gloss: Gloss, albedo: f32) -> Gaussians {
        let paint = |albedo: f32| material(Vec3::ZERO, 0.0, Vec3::splat(albedo));
        let floor = rectangle(
            Vec3::ZERO,
            2.0 * Vec3::X,
            2.0 * Vec3::Y,
            0.12,
            paint(albedo),
        );
        let floor = floor.into_iter().map(|g| Gaussian { gloss, ..g });
        let up = Vec3::new(0.0, 0.0, 2.0);
        let wall = rectangle(Vec3::new(0.0, 2.0, 1.0), 2.0 * Vec3::X, up, 0.2, paint(0.5));
        let lamp = material(Vec3::splat(30.0), 1.0, Vec3::ZERO);
        let lamp = Gaussian {
            scale: Vec2::splat(0.1),
            ..lamp
        };
        let lamp = rectangle(
            Vec3::new(0.2, 1.5, 1.0),
            0.3 * Vec3::X,
            Vec3::new(0.0, 0.0, 0.3),
            0.1,
            lamp,
        );
        floor.chain(wall).chain(lamp).collect()
    }

    fn cameras() -> Vec<Camera> {
        let eye = |i: u32| {
            let across = f64::from(i % 5) - 2.0;
            DVec3::new(across, -2.5, 1.0 + 0.4 * f64::from(i / 5))
        };
        let target = DVec3::new(0.0, 0.3, 0.0);
        (0..20).map(|i| look_at(eye(i), target, 48, 32)).collect()
    }

    fn baked(scene: Gaussians, cameras: &[Camera]) -> Gaussians {
        let solution = Solution {
            device: &Device::Cpu,
            cameras,
            method: GaussianBake {
                num_samples: Some(256),
            },
            max_bounces: 4,
            seed: 3,
        };
        let mut told = |_| ControlFlow::Continue(());
        solution.of(scene, &mut told).unwrap().unwrap()
    }

    /// Mean difference of `0-bounce` from what a gather sees, over pixels without lamps, as a part
    /// of the light there.
    fn error(scene: &Gaussians, camera: &Camera) -> f32 {
        let scene = CpuScene::new(scene);
        let render = |integrator| {
            let options = LightOptions::default();
            scene.render(camera, &integrator, &options).unwrap()
        };
        let plain = render(Integrator::ZeroBounce);
        let gathered = render(Integrator::Gather { num_samples: 256 });
        let (mut off, mut all) = (0.0, 0.0);
        let pixels = plain.radiance.pixels().iter();
        let pixels = pixels.zip(gathered.radiance.pixels());
        for ((a, b), seen) in pixels.zip(&plain.features.pixels) {
            if seen.emission() < 0.1 {
                off += (Vec3::from(*a) - Vec3::from(*b)).abs().element_sum();
                all += Vec3::from(*b).element_sum();
            }
        }
        off / all
    }

    /// From eyes between those it was baked for, too.
    #[test]
    fn a_floor_of_metal_shows_the_lamp_where_it_mirrors_it() {
        let metal = Gloss {
            specular: Vec3::splat(0.7),
            roughness: 0.5,
        };
        let cameras = cameras();
        let with = baked(room(metal, 0.0), &cameras);
        let without = Gaussians {
            harmonics: Vec::new(),
            ..with.clone()
        };
        let other = look_at(DVec3::new(0.4, -2.4, 1.3), DVec3::ZERO, 48, 32);
        for camera in [&cameras[7], &other] {
            let (with, without) = (error(&with, camera), error(&without, camera));
            eprintln!("{with} with highlights, {without} without");
            assert!(with < 0.6 * without, "{with} {without}");
        }
    }

    #[test]
    fn paint_has_none() {
        let baked = baked(room(Gloss::NONE, 0.6), &cameras());
        assert!(baked.harmonics.is_empty());
    }
}
