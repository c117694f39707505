//! Highlights of a baked scene: what glossy surfaces mirror of the baked light towards cameras, in
//! the harmonics of their Gaussians.
//!
//! The baked radiance of a glossy Gaussian is what a diffuse surface of the same reflectance would
//! have. Here the ratio of the light that goes to some of the cameras to that is sampled, and its
//! logarithm fitted by the harmonics, together with that of neighbours on the surface. Those of
//! degree 2 hold wide lobes and the slope of narrow ones; sharp mirror images need a gather.
//! Of lights that are set one by one, those of each alone are fitted.

#[cfg(test)]
mod tests;

use super::receivers::Receivers;
use crate::error::Result;
use eagpt_light::irradiance::smooth::Smoothing;
use eagpt_scene::harmonics::fit::RatioFit;
use eagpt_scene::rng::{Purpose, RandomKey};
use eagpt_scene::{Camera, Gaussians, Harmonics, LightBasis};
use eagpt_trace::Tracer;
use eagpt_trace::transport::bsdf::equivalent_albedo;
use eagpt_trace::transport::glossy::{GlossyPoint, Mirrored};
use eagpt_trace::transport::matrix::Receiver;
use eagpt_trace::transport::start::Surface;
use glam::Vec3;
use rayon::prelude::*;

/// Cameras that a Gaussian is seen from, at most.
const MAX_EYES: usize = 16;
/// Directions of the lobe for each of them; all of them are of use for all cameras.
const NUM_SAMPLES: u32 = 4;
/// Cosine at which cameras see a surface, at least.
const MIN_COSINE: f32 = 0.05;
/// Least radiance that others are divided by, in parts of the mean.
const MIN_RADIANCE: f32 = 1e-3;

/// A glossy Gaussian.
struct Glossy {
    /// Its row among the receivers.
    row: usize,
    gaussian: usize,
}

/// The glossy Gaussians of a scene whose light is baked.
pub(super) struct Highlights<'a> {
    receivers: &'a Receivers,
    /// Those that rays are traced for.
    glossy: Vec<Glossy>,
    /// Points of their surfaces, `[glossy]`.
    points: Vec<GlossyPoint>,
    smoothing: Smoothing,
    key: RandomKey,
}

impl<'a> Highlights<'a> {
    /// Those of `scene` that `cameras` see; `None` where nothing is glossy.
    pub(super) fn new(
        scene: &Gaussians,
        receivers: &'a Receivers,
        cameras: &[Camera],
        seed: u64,
    ) -> Option<Self> {
        if !scene.is_glossy() {
            return None;
        }
        let glossy = |(row, (i, surface)): (usize, &Receiver)| {
            let gaussian = *i as usize;
            let gloss = scene.gloss[gaussian];
            gloss.is_some().then(|| {
                let point = GlossyPoint {
                    surface: *surface,
                    gloss,
                    eyes: eyes(gaussian, surface, cameras),
                };
                (Glossy { row, gaussian }, point)
            })
        };
        let all = receivers.traced.par_iter().enumerate();
        let (glossy, points): (Vec<Glossy>, _) = all.filter_map(glossy).unzip();
        let places: Vec<Receiver> = (glossy.iter())
            .map(|one| receivers.traced[one.row])
            .collect();
        Some(Self {
            receivers,
            glossy,
            points,
            smoothing: Smoothing::new(&places),
            key: RandomKey::new(seed, Purpose::Bake, 2),
        })
    }

    /// Harmonics of the Gaussians of a `baked` scene, `[n]`; its own where nothing is glossy.
    /// Emitters keep theirs. `tracer` has the Gaussians in any light.
    ///
    /// # Errors
    /// If the device fails.
    pub(super) fn harmonics(
        &self,
        baked: &Gaussians,
        tracer: &mut dyn Tracer,
    ) -> Result<Vec<Harmonics>> {
        let mut found = baked.harmonics.clone();
        found.resize(baked.len(), Harmonics::NONE);
        tracer.update(baked)?;
        let rows = self.of_rows(baked, tracer)?;
        for (i, sources) in self.receivers.each() {
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

    /// The `basis` of a `baked` scene with the highlights of each light.
    ///
    /// # Errors
    /// If the device fails.
    pub(super) fn of_lights(
        &self,
        basis: LightBasis,
        baked: &Gaussians,
        tracer: &mut dyn Tracer,
    ) -> Result<LightBasis> {
        let mut to_eyes = vec![Vec::new(); self.receivers.traced.len()];
        for (one, point) in self.glossy.iter().zip(&self.points) {
            to_eyes[one.row] = point.to_eyes().collect();
        }
        let each = self.receivers.each();
        let glossy = each.filter(|(i, _)| baked.gloss[*i].is_some());
        let mut glossy: Vec<(u32, Vec<Vec3>)> = glossy
            .map(|(i, sources)| (i as u32, to_eyes[sources.first()].clone()))
            .collect();
        glossy.sort_unstable_by_key(|(i, _)| *i);
        let mut lit = baked.clone();
        basis.with_highlights(&glossy, |basis, light| {
            basis.light_alone(&mut lit, light);
            let all = self.harmonics(&lit, tracer)?;
            Ok(glossy.iter().map(|(i, _)| all[*i as usize]).collect())
        })
    }

    /// Those of the traced receivers, `[receivers]`; none of what is not glossy.
    fn of_rows(&self, baked: &Gaussians, tracer: &dyn Tracer) -> Result<Vec<Harmonics>> {
        let points = &self.points;
        let mirrored = tracer.mirrored_towards(points, NUM_SAMPLES, self.key)?;
        let fits = self.fits(baked, &mirrored);
        let with_neighbours = |(g, one): (usize, &Glossy)| {
            let mut own = 1.0;
            let mut sum = RatioFit::default();
            for &(j, weight) in self.smoothing.neighbours(g) {
                own -= weight;
                if points[j as usize].gloss == points[g].gloss {
                    sum.add_weighted(&fits[j as usize], weight);
                }
            }
            sum.add_weighted(&fits[g], own);
            (one.row, sum.fitted())
        };
        let smooth = self.glossy.par_iter().enumerate().map(with_neighbours);
        let mut rows = vec![Harmonics::NONE; self.receivers.traced.len()];
        for (row, harmonics) in smooth.collect::<Vec<_>>() {
            rows[row] = harmonics;
        }
        Ok(rows)
    }

    /// Fits of each to its own ratios, from what it mirrors towards its eyes, `[glossy]`.
    fn fits(&self, baked: &Gaussians, mirrored: &[Vec<Option<Mirrored>>]) -> Vec<RatioFit> {
        let mean = baked.radiances.iter().map(|l| l.element_sum()).sum::<f32>() / 3.0;
        let least = Vec3::splat(MIN_RADIANCE * mean / baked.len() as f32);
        let of = |((one, point), mirrored): ((&Glossy, &GlossyPoint), &Vec<Option<Mirrored>>)| {
            let albedo = baked.albedos[one.gaussian];
            let carried = baked.radiances[one.gaussian].max(least);
            let all = equivalent_albedo(albedo, point.gloss).max(Vec3::splat(1e-3));
            let mut fit = RatioFit::default();
            for (to_eye, mirrored) in point.to_eyes().zip(mirrored) {
                if let Some(mirrored) = mirrored {
                    let scattered = albedo * (Vec3::ONE - mirrored.reflectance) / all;
                    fit.add(to_eye, mirrored.light / carried + scattered);
                }
            }
            fit
        };
        let points = self.glossy.par_iter().zip(&self.points);
        points.zip(mirrored).map(of).collect()
    }
}

/// Cameras that a surface is in the picture of, a few of all; others for each `gaussian`.
fn eyes(gaussian: usize, surface: &Surface, cameras: &[Camera]) -> Vec<Vec3> {
    let shown = cameras.iter().filter_map(|camera| {
        let at = camera.project(surface.position);
        let eye = camera.origin();
        let to_eye = (eye - surface.position).normalize_or_zero();
        (camera.is_in_picture(at) && to_eye.dot(surface.normal) >= MIN_COSINE).then_some(eye)
    });
    let shown: Vec<Vec3> = shown.collect();
    let step = shown.len().div_ceil(MAX_EYES).max(1);
    let some = shown.iter().skip(gaussian % step).step_by(step);
    some.copied().collect()
}
