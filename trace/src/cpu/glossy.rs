//! The integrators on scenes with gloss: light that reaches the eye by a diffuse and a specular
//! lobe ([`crate::transport::bsdf`]).
//!
//! Emitters are sampled beside the BSDF, both lobes of which together are one density, and the two
//! are combined by the balance heuristic (Veach 1997, section 9.2), as for diffuse surfaces.
//!
//! A gather takes the diffuse part of a glossy pixel from the radiance that its Gaussians carry, and
//! samples the specular lobe alone, one bounce into the radiance that is met.
//!
//! A path that a diffuse lobe has scattered meets surfaces at least [`ROUGH_BEHIND`] rough: light
//! of lamps by way of mirrors, which such paths find by chance alone, is a little blurred in place
//! of spots of noise.

use super::CpuScene;
use super::camera::{self, HitSearch, Keep};
use super::integrate::Samples;
use super::path::PathLight;
use crate::blend::{GlossBlend, features_of_one};
use crate::features::{Features, GBuffer};
use crate::ray::Ray;
use crate::tracer::{Guide, RenderedView};
use crate::transport::bsdf::{Bsdf, BsdfSample, equivalent_albedo};
use crate::transport::lights::Lights;
use crate::transport::points::Points;
use crate::transport::start::Surface;
use crate::transport::{Hits, Integrator, LIGHT_SHARE, LightOptions};
use eagpt_scene::rng::{Purpose, RandomKey};
use eagpt_scene::{Camera, Gloss, Image};
use glam::Vec3;
use rayon::prelude::*;

/// Blocks of random numbers of a bounce: one for the direction, one for the light, one for hits and
/// the end of the path.
const BLOCKS: u32 = 3;
/// Least roughness of what a path meets after a diffuse bounce.
const ROUGH_BEHIND: f32 = 0.3;
/// Surfaces of less roughness, of which the specular part is more than half, are mirrors to a
/// denoiser.
const MIRROR_ROUGHNESS: f32 = 0.2;
/// Mirrors in a row that guides follow.
const MAX_MIRRORS: u32 = 3;
/// Light is divided by no smaller reflectance.
const MIN_ALBEDO: f32 = 1e-3;

/// Light transport in a glossy scene.
pub(super) struct Glossy<'a> {
    scene: &'a CpuScene,
    /// Emitters to sample; `None`: BSDF sampling only.
    lights: Option<&'a Lights>,
    integrator: &'a Integrator,
    threshold: f32,
    hits: Hits,
}

/// A surface, and how it reflects towards where the ray came from.
#[derive(Clone, Copy)]
struct Met {
    surface: Surface,
    bsdf: Bsdf,
    /// Opacity of what was met: the light is premultiplied.
    alpha: f32,
}

impl Met {
    /// What a ray of unit `direction` from `origin` has met; `None` if nothing. Surfaces are at
    /// least `min_roughness` rough.
    fn new(
        (origin, direction): (Vec3, Vec3),
        features: &Features,
        gloss: Gloss,
        min_roughness: f32,
    ) -> Option<Self> {
        let surface = Surface::at(origin, direction, features)?;
        let alpha = features.alpha();
        let gloss = Gloss {
            roughness: gloss.roughness.max(min_roughness),
            ..gloss
        };
        let albedo = (features.albedo() / alpha).min(Vec3::ONE);
        Some(Self {
            surface,
            bsdf: Bsdf::new(surface.normal, -direction, albedo, gloss),
            alpha,
        })
    }

    /// The surface without what it scatters diffusely.
    fn mirror(&self, gloss: Gloss) -> Self {
        Self {
            bsdf: Bsdf::new(self.surface.normal, self.bsdf.to_eye(), Vec3::ZERO, gloss),
            ..*self
        }
    }

    fn guide(&self) -> Guide {
        Guide {
            albedo: self.bsdf.albedo() * self.alpha,
            normal: self.surface.normal,
            position: self.surface.position,
            exact: Vec3::ZERO,
        }
    }
}

/// Light that a pixel's specular lobe adds to its diffuse part.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Mirrored {
    /// Light that the lobe reflects towards the camera, linear Rec.709, premultiplied.
    pub light: Vec3,
    /// E(μ): of light from everywhere, what the lobe reflects towards the camera. Of the rest the
    /// albedo is scattered.
    pub reflectance: Vec3,
}

/// A pixel of a frame.
#[derive(Default)]
struct Pixel {
    light: Vec3,
    second_moment: f32,
    num_rays: u32,
    guide: Guide,
}

impl<'a> Glossy<'a> {
    pub(super) fn new(
        scene: &'a CpuScene,
        lights: Option<&'a Lights>,
        integrator: &'a Integrator,
        options: &LightOptions,
    ) -> Self {
        Self {
            scene,
            lights,
            integrator,
            threshold: options.emission_threshold,
            hits: options.hits,
        }
    }

    /// Frame of `camera`, given the composited features of its rays.
    pub(super) fn render(
        &self,
        camera: &Camera,
        features: GBuffer,
        key: RandomKey,
    ) -> RenderedView {
        let frame = camera.ray_frame();
        let glosses = self.scene.gloss_of_pixels(camera, &features);
        let of_pixel = |pixel: usize| -> Pixel {
            let seen = &features.pixels[pixel];
            if seen.emission() > self.threshold {
                return Pixel {
                    light: seen.radiance(),
                    ..Pixel::default()
                };
            }
            let (x, y) = (pixel as u32 % camera.width, pixel as u32 / camera.width);
            let direction = frame.direction(x as f32 + 0.5, y as f32 + 0.5);
            let gloss = glosses[pixel];
            let Some(met) = Met::new((frame.origin, direction), seen, gloss, 0.0) else {
                return Pixel::default();
            };
            let points = Points::new(key, pixel as u32);
            match self.integrator {
                Integrator::Gather { .. } => self.gathered(&met, gloss, seen, &points),
                _ => {
                    let (mut sampled, _) = self.sampled(&met, &points);
                    sampled.guide = self.guide(&met);
                    sampled
                }
            }
        };
        let pixels: Vec<Pixel> = (0..camera.num_pixels())
            .into_par_iter()
            .map(of_pixel)
            .collect();
        let (width, height) = (camera.width, camera.height);
        let radiance = pixels.iter().map(|pixel| pixel.light.to_array()).collect();
        let second_moment = pixels.iter().map(|pixel| [pixel.second_moment]).collect();
        let one_each = "one value for each pixel";
        RenderedView {
            radiance: Image::from_pixels(width, height, radiance).expect(one_each),
            second_moment: Image::from_pixels(width, height, second_moment).expect(one_each),
            num_rays: pixels.iter().map(|pixel| u64::from(pixel.num_rays)).sum(),
            guides: pixels.iter().map(|pixel| pixel.guide).collect(),
            features,
        }
    }

    /// The mean of all samples of a pixel, without its guide, and the reflectance.
    fn sampled(&self, met: &Met, points: &Points) -> (Pixel, Vec3) {
        // Samples are of the light before the reflectance, as of diffuse surfaces.
        let albedo = met.bsdf.albedo().max(Vec3::splat(MIN_ALBEDO));
        let mut samples = Samples::default();
        for sample in 0..self.num_samples() {
            let PathLight { light, num_rays } = self.sample(met, points, sample);
            samples.add(PathLight {
                light: light / albedo,
                num_rays,
            });
        }
        let (mean, second_moment) = samples.moments();
        let pixel = Pixel {
            light: mean * albedo * met.alpha,
            second_moment,
            num_rays: samples.num_rays,
            guide: Guide::default(),
        };
        (pixel, met.bsdf.albedo())
    }

    /// The radiance that the Gaussians of a pixel carry, of glossy ones that part of it that is
    /// scattered, and what their lobe mirrors.
    fn gathered(&self, met: &Met, gloss: Gloss, seen: &Features, points: &Points) -> Pixel {
        if !gloss.is_some() {
            let mut guide = met.guide();
            guide.exact = seen.radiance();
            return Pixel {
                light: guide.exact,
                guide,
                ..Pixel::default()
            };
        }
        let mirror = met.mirror(gloss);
        let (mut pixel, reflected) = self.sampled(&mirror, points);
        let albedo = (seen.albedo() / met.alpha).min(Vec3::ONE);
        let scattered = albedo * (Vec3::ONE - reflected);
        // Baking has taken all that is reflected for scattered.
        let all = equivalent_albedo(albedo, gloss).max(Vec3::splat(MIN_ALBEDO));
        let exact = seen.radiance() * scattered / all;
        pixel.light += exact;
        pixel.guide = self.guide(&mirror);
        pixel.guide.exact = exact;
        pixel
    }

    fn num_samples(&self) -> u32 {
        match *self.integrator {
            Integrator::ZeroBounce => 0,
            Integrator::OneBounce { num_samples }
            | Integrator::Gather { num_samples }
            | Integrator::Path { num_samples, .. } => num_samples,
        }
    }

    /// Light of one sample towards the eye.
    fn sample(&self, met: &Met, points: &Points, sample: u32) -> PathLight {
        match *self.integrator {
            Integrator::ZeroBounce => PathLight::default(),
            Integrator::OneBounce { .. } | Integrator::Gather { .. } => PathLight {
                light: self.bounced(met, points, sample),
                num_rays: 1,
            },
            Integrator::Path {
                max_bounces,
                roulette_from,
                ..
            } => self.path(
                met,
                points,
                sample,
                (max_bounces, roulette_from.unwrap_or(u32::MAX)),
            ),
        }
    }

    /// One bounce into the radiance that Gaussians carry. Directions are those of the BSDF and, half
    /// of them, of emitters, weighted by the density of both together.
    fn bounced(&self, met: &Met, points: &Points, sample: u32) -> Vec3 {
        let [a, b, pick, choice] = points.block(sample, 0);
        let origin = met.surface.position;
        let chosen = match self.lights {
            Some(lights) if pick < LIGHT_SHARE => lights.sample(origin, pick / LIGHT_SHARE, a, b),
            _ => met.bsdf.sample([choice, a, b]).map(|s| s.direction),
        };
        let Some(direction) = chosen else {
            return Vec3::ZERO;
        };
        let (value, mut density) = met.bsdf.evaluate(direction);
        if let Some(lights) = self.lights {
            density += LIGHT_SHARE / (1.0 - LIGHT_SHARE) * lights.density(origin, direction);
            density *= 1.0 - LIGHT_SHARE;
        }
        if density <= 0.0 {
            return Vec3::ZERO;
        }
        let hit = (self.scene).sample_hit(&met.surface.ray(direction), points.word(sample));
        hit.map_or(Vec3::ZERO, |hit| {
            self.scene.attributes(hit.index).radiance() * (value / density)
        })
    }

    /// Light of one path of at most `max_bounces` bounces, which may end at random from the bounce
    /// `roulette_from` on.
    fn path(
        &self,
        start: &Met,
        points: &Points,
        sample: u32,
        (max_bounces, roulette_from): (u32, u32),
    ) -> PathLight {
        let mut path = PathLight::default();
        let mut throughput = Vec3::ONE;
        let mut met = *start;
        let mut min_roughness = 0.0_f32;
        for number in 0..max_bounces {
            let block = |k: u32| points.block(sample, BLOCKS * number + k);
            let origin = met.surface.position;
            let [choice, a, b, _] = block(0);
            let [of_light, of_bounce, survive, _] = block(2);
            if let Some(lights) = self.lights {
                let [pick, u, v, _] = block(1);
                let towards = lights.sample(origin, pick, u, v);
                let light = towards.map(|w| self.of_emitter(&met, lights, w, (number, of_light)));
                if let Some((light, num_rays)) = light {
                    path.light += throughput * light;
                    path.num_rays += num_rays;
                }
            }
            let Some(BsdfSample {
                direction,
                value,
                density,
            }) = met.bsdf.sample([choice, a, b])
            else {
                return path;
            };
            let ray = met.surface.ray(direction);
            let (features, gloss) = self.meet(&ray, number, of_bounce);
            path.num_rays += 1;
            if features.emission() > self.threshold {
                let of_lights =
                    (self.lights).map_or(0.0, |lights| lights.density(origin, direction));
                let weight = value / (density + of_lights);
                path.light += throughput * features.radiance() * weight;
                return path;
            }
            throughput *= value / density;
            if choice >= met.bsdf.specular_share() {
                min_roughness = ROUGH_BEHIND;
            }
            let Some(next) = Met::new((origin, direction), &features, gloss, min_roughness) else {
                return path;
            };
            throughput *= next.alpha;
            if number + 1 >= roulette_from {
                let chance = (throughput * next.bsdf.albedo()).max_element().min(1.0);
                if survive >= chance {
                    return path;
                }
                throughput /= chance;
            }
            met = next;
        }
        path
    }

    /// Light from the unit `direction` towards an emitter, weighted, and the rays traced for it.
    fn of_emitter(
        &self,
        met: &Met,
        lights: &Lights,
        direction: Vec3,
        (bounce, choice): (u32, f32),
    ) -> (Vec3, u32) {
        let (value, density) = met.bsdf.evaluate(direction);
        if density <= 0.0 {
            return (Vec3::ZERO, 0);
        }
        let (features, _) = self.meet(&met.surface.ray(direction), bounce, choice);
        if features.emission() <= self.threshold {
            return (Vec3::ZERO, 1);
        }
        let both = density + lights.density(met.surface.position, direction);
        (features.radiance() * value / both, 1)
    }

    /// The surface that a ray meets after `bounce` bounces; `choice` is the random number of a sampled
    /// hit.
    fn meet(&self, ray: &Ray, bounce: u32, choice: f32) -> (Features, Gloss) {
        match self.hits.is_sampled(bounce) {
            false => self.scene.trace_glossy(ray),
            true => {
                let hit = self.scene.sample_hit(ray, choice.to_bits());
                hit.map_or((Features::default(), Gloss::NONE), |hit| {
                    let attributes = self.scene.attributes(hit.index);
                    let features = features_of_one(hit.t, attributes, ray.direction);
                    (features, self.scene.gloss(hit.index))
                })
            }
        }
    }

    /// The first surface that is no mirror, seen by way of those that are.
    fn guide(&self, met: &Met) -> Guide {
        let mut guide = met.guide();
        let mut tint = Vec3::ONE;
        let mut met = *met;
        for _ in 0..MAX_MIRRORS {
            let bsdf = &met.bsdf;
            if bsdf.roughness() >= MIRROR_ROUGHNESS || bsdf.specular_share() <= 0.5 {
                break;
            }
            tint *= bsdf.albedo() * met.alpha;
            let (origin, direction) = (met.surface.position, bsdf.mirror_direction());
            let (features, gloss) = self.scene.trace_glossy(&met.surface.ray(direction));
            let Some(next) = Met::new((origin, direction), &features, gloss, 0.0) else {
                break;
            };
            guide = next.guide();
            guide.albedo *= tint;
            if features.emission() > self.threshold {
                // Of a lamp in a mirror, the light is no product with its albedo.
                guide.albedo = tint;
                break;
            }
            met = next;
        }
        guide
    }
}

impl CpuScene {
    /// Blended gloss of the pixels of `camera`, whose `features` are given.
    fn gloss_of_pixels(&self, camera: &Camera, features: &GBuffer) -> Vec<Gloss> {
        if !self.is_glossy() {
            return vec![Gloss::NONE; camera.num_pixels()];
        }
        let set = self.surfels();
        let (_, record) = camera::trace(set, camera, HitSearch::Tiles, Keep::Record);
        let blended = record
            .weights(0.0)
            .blend(|i| GlossBlend::of(&set.gloss[i as usize]));
        let pixels = blended.into_iter().zip(&features.pixels);
        pixels
            .map(|(blend, seen)| blend.finish(seen.alpha()))
            .collect()
    }

    /// Of every pixel of `camera`, whose composited `features` are given, what its specular lobe
    /// mirrors of the radiance that Gaussians carry, from `num_samples` directions each; nothing
    /// where there is no gloss, and on emitters. `[height · width]`
    pub fn mirrored(
        &self,
        camera: &Camera,
        features: &GBuffer,
        num_samples: u32,
        options: &LightOptions,
    ) -> Vec<Mirrored> {
        let integrator = Integrator::Gather { num_samples };
        let glossy = Glossy::new(self, self.lights(), &integrator, options);
        let key = RandomKey::new(options.seed, Purpose::Render, 0);
        let frame = camera.ray_frame();
        let glosses = self.gloss_of_pixels(camera, features);
        let of_pixel = |pixel: usize| {
            let seen = &features.pixels[pixel];
            if !glosses[pixel].is_some() || seen.emission() > options.emission_threshold {
                return Mirrored::default();
            }
            let (x, y) = (pixel as u32 % camera.width, pixel as u32 / camera.width);
            let direction = frame.direction(x as f32 + 0.5, y as f32 + 0.5);
            let gloss = glosses[pixel];
            let met = Met::new((frame.origin, direction), seen, gloss, 0.0);
            let Some(met) = met else {
                return Mirrored::default();
            };
            let points = Points::new(key, pixel as u32);
            let (pixel, reflectance) = glossy.sampled(&met.mirror(gloss), &points);
            Mirrored {
                light: pixel.light,
                reflectance,
            }
        };
        (0..camera.num_pixels())
            .into_par_iter()
            .map(of_pixel)
            .collect()
    }
}
