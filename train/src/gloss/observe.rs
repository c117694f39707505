//! Photographs of Gaussians, view by view, and the light that a lobe would add to them.

use super::fit::{Lobe, NUM, ROUGHNESSES, Seen};
use super::planes::SurfacePlane;
use super::sampler::Sampler;
use crate::backend::TrainingView;
use crate::error::Result;
use eagpt_eval::KnownPixels;
use eagpt_light::surfaces::{self, BestSeen};
use eagpt_scene::Gloss;
use eagpt_scene::color::luminance;
use eagpt_scene::rng::RandomKey;
use eagpt_trace::Tracer;
use eagpt_trace::cpu::CpuScene;
use eagpt_trace::transport::bsdf::{Bsdf, albedo_parts};
use eagpt_trace::transport::matrix::Receiver;
use eagpt_trace::transport::points::Points;
use eagpt_trace::transport::start::Surface;
use glam::Vec3;

/// Views of Gaussians that are kept, at most.
const MOST_KEPT: usize = 300_000;
/// Least weight of a Gaussian in the pixel that stands for its view.
const LEAST_WEIGHT: f32 = 0.08;
/// Least opacity of that pixel, and most emission.
const LEAST_ALPHA: f32 = 0.5;
const MOST_EMISSION: f32 = 0.05;
/// Least cosine to the normal of what is compared.
const LEAST_COSINE: f32 = 0.15;
/// Least cosine between the normal of a surface and that of a pixel that shows it.
const LEAST_AGREEMENT: f32 = 0.5;

/// A Gaussian in a view.
#[derive(Debug, Clone, Copy)]
pub(super) struct Observation {
    pub(super) gaussian: u32,
    pub(super) view: u32,
    pub(super) weight: f32,
    /// Number of the light of the view.
    pub(super) light: usize,
    /// Radiance of the photograph.
    pub(super) radiance: Vec3,
    /// Unit direction from the camera.
    direction: Vec3,
    surface: Surface,
}

/// All that training views show of Gaussians.
pub(super) struct Observations {
    /// By Gaussian, then by view.
    pub(super) kept: Vec<Observation>,
    /// The Gaussians seen, as they are seen best.
    pub(super) receivers: Vec<Receiver>,
    /// Mean radiance of each of them in the photographs.
    pub(super) colors: Vec<Vec3>,
    /// Standard deviation of their luminance between the views of a light, in parts of its mean.
    pub(super) spreads: Vec<f32>,
    /// Gaussians that are seen too faintly to be compared, as they are seen best.
    pub(super) faint: Vec<Receiver>,
}

impl Observations {
    /// Looks at all `views` of a place that is `scenes` in its lights, at least one; which views
    /// are kept is chosen by `key`.
    pub(super) fn new(
        scenes: &[CpuScene],
        views: impl Iterator<Item = Result<TrainingView>>,
        key: RandomKey,
    ) -> Result<Self> {
        let num = scenes[0].surfels().surfels.len();
        let mut best = BestSeen::new(num);
        let mut sums = vec![(Vec3::ZERO, 0.0_f32); num];
        let mut moments = vec![vec![Moments::default(); num]; scenes.len()];
        let mut kept: Vec<Observation> = Vec::new();
        let word = |gaussian: u32| key.stream(gaussian, 0).next_words()[0];
        let mut limit = u32::MAX;
        for (number, training) in (0..).zip(views) {
            let TrainingView { light, view, .. } = training?;
            let camera = &view.camera;
            let known = view.valid.as_ref().map(KnownPixels::new);
            let (features, contributions) = scenes[light].contributions(camera, &|_, _| 0.0)?;
            best.add_traced(camera, &features, &contributions);
            let frame = camera.ray_frame();
            for found in contributions {
                let pixel = found.pixel as usize;
                let seen = &features.pixels[pixel];
                let is_clipped = (view.clipped.as_ref())
                    .is_some_and(|mask| mask.pixels()[pixel].iter().any(|&c| c > 0.0));
                if found.largest_weight < LEAST_WEIGHT
                    || seen.alpha() < LEAST_ALPHA
                    || seen.emission() > MOST_EMISSION
                    || known.as_ref().is_some_and(|known| !known.has(pixel))
                    || is_clipped
                {
                    continue;
                }
                let radiance = Vec3::from(view.radiance.pixels()[pixel]);
                let (sum, total) = &mut sums[found.gaussian as usize];
                *sum += radiance * found.largest_weight;
                *total += found.largest_weight;
                moments[light][found.gaussian as usize].add(found.largest_weight, radiance);
                if word(found.gaussian) > limit {
                    continue;
                }
                let (x, y) = (found.pixel % camera.width, found.pixel / camera.width);
                let direction = frame.direction(x as f32 + 0.5, y as f32 + 0.5);
                if let Some(surface) = Surface::at(frame.origin, direction, seen) {
                    kept.push(Observation {
                        gaussian: found.gaussian,
                        view: number,
                        weight: found.largest_weight,
                        light,
                        radiance,
                        direction,
                        surface,
                    });
                }
            }
            // Fewer Gaussians, with all of their views, where there are many.
            while kept.len() > MOST_KEPT {
                limit /= 2;
                kept.retain(|seen| word(seen.gaussian) <= limit);
            }
        }
        let of_best = |o: &Observation| (o.gaussian, o.view, std::cmp::Reverse(o.weight.to_bits()));
        kept.sort_unstable_by_key(of_best);
        kept.dedup_by_key(|o| (o.gaussian, o.view));
        let (receivers, faint): (Vec<Receiver>, Vec<Receiver>) =
            surfaces::receivers(&best.finish())
                .into_iter()
                .partition(|(i, _)| sums[*i as usize].1 > 0.0);
        let color = |(i, _): &Receiver| sums[*i as usize].0 / sums[*i as usize].1;
        let spread = |(i, _): &Receiver| Moments::spread(moments.iter().map(|of| of[*i as usize]));
        Ok(Self {
            colors: receivers.iter().map(color).collect(),
            spreads: receivers.iter().map(spread).collect(),
            kept,
            receivers,
            faint,
        })
    }
}

/// Weighted sums of the luminance of a Gaussian over the views of a light, and of its square.
#[derive(Debug, Clone, Copy, Default)]
struct Moments {
    weight: f32,
    sum: f32,
    squares: f32,
}

impl Moments {
    fn add(&mut self, weight: f32, radiance: Vec3) {
        let light = luminance(radiance.to_array());
        self.weight += weight;
        self.sum += weight * light;
        self.squares += weight * light * light;
    }

    /// Standard deviation within each light, in parts of the mean.
    fn spread(lights: impl Iterator<Item = Self>) -> f32 {
        let seen = lights.filter(|of| of.weight > 0.0);
        let (squares, level) = seen.fold((0.0, 0.0), |(squares, level), of| {
            let mean = of.sum * of.sum / of.weight;
            (squares + (of.squares - mean).max(0.0), level + mean)
        });
        (squares / level.max(f32::MIN_POSITIVE)).sqrt()
    }
}

impl Observation {
    /// Light that lobes would mirror here of a scene whose Gaussians are seen from their `fronts`,
    /// on a surface of unit `normal`, which may lie in a `plane`; `None` where that is seen too
    /// flatly. For each channel of light, and its luminance last.
    pub(super) fn predict(
        &self,
        (scene, fronts): (&CpuScene, &[Vec3]),
        (normal, plane): (Vec3, Option<SurfacePlane>),
        key: RandomKey,
    ) -> Option<[[Lobe; NUM]; 4]> {
        let normal = normal * -normal.dot(self.direction).signum();
        let cosine = -normal.dot(self.direction);
        if cosine < LEAST_COSINE || normal.dot(self.surface.normal) < LEAST_AGREEMENT {
            return None;
        }
        let mut surface = Surface {
            normal,
            ..self.surface
        };
        if let Some(SurfacePlane { plane, reach }) = plane {
            // Where the view meets the plane; other discs of it are no neighbours to mirror.
            let distance = -plane.height(surface.position) / plane.normal.dot(self.direction);
            surface.position += self.direction * distance;
            surface.offset = surface.offset.max(reach);
        }
        let lobes = ROUGHNESSES.map(|roughness| {
            let gloss = Gloss {
                specular: Vec3::ONE,
                roughness,
            };
            Bsdf::new(normal, -self.direction, Vec3::ZERO, gloss)
        });
        let mut found = [[Lobe::default(); NUM]; 4];
        for (k, roughness) in ROUGHNESSES.into_iter().enumerate() {
            let albedo = albedo_parts(roughness, cosine).map(f64::from);
            found.iter_mut().for_each(|of| of[k].albedo = albedo);
        }
        let element = key.stream(self.gaussian, self.view).next_words()[0];
        for half in 0..2 {
            let points = Points::new(key, element.wrapping_add(half));
            let sampler = Sampler {
                scene,
                fronts,
                surface: &surface,
                lobes: &lobes,
                direction: self.direction,
            };
            sampler.add(&points, half as usize, &mut found);
        }
        Some(found)
    }

    /// As a sample of its point, whose `light` counts by `weight`.
    pub(super) fn seen(&self, light: f32, scale: f32, lobes: [Lobe; NUM]) -> Seen {
        Seen {
            light: light.into(),
            weight: f64::from(self.weight * scale),
            lobes,
        }
    }
}
