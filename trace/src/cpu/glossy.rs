//! Light that reaches the eye by specular lobes ([`crate::transport::bsdf`]).
//!
//! A gather takes the diffuse part of a glossy pixel from the radiance that its Gaussians carry,
//! and samples the specular lobe alone, one bounce into the radiance that is met. Emitters are
//! sampled beside the BSDF, and the two are combined by the balance heuristic (Veach 1997, section
//! 9.2).

use super::CpuScene;
use super::integrate::Samples;
use super::path::{PathLight, Start};
use super::vertex::{MIN_REFLECTANCE, Vertex, surfaces_of_pixels};
use crate::features::GBuffer;
use crate::tracer::Guide;
use crate::transport::bsdf::{Bsdf, equivalent_albedo};
use crate::transport::lights::Lights;
use crate::transport::points::Points;
use crate::transport::start::Surface;
use crate::transport::{LIGHT_SHARE, LightOptions};
use eagpt_scene::rng::{Purpose, RandomKey};
use eagpt_scene::{Camera, Gloss};
use glam::Vec3;
use rayon::prelude::*;

/// Surfaces of less roughness, of which the specular part is more than half, are mirrors to a
/// denoiser.
const MIRROR_ROUGHNESS: f32 = 0.2;
/// Mirrors in a row that guides follow.
const MAX_MIRRORS: u32 = 3;

/// Light that a pixel's specular lobe adds to its diffuse part.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Mirrored {
    /// Light that the lobe reflects towards the camera, linear Rec.709, premultiplied.
    pub light: Vec3,
    /// E(μ): of light from everywhere, what the lobe reflects towards the camera. Of the rest the
    /// albedo is scattered.
    pub reflectance: Vec3,
}

/// A point of a glossy surface, seen from somewhere.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GlossyPoint {
    /// Where it is.
    pub surface: Surface,
    /// Unit direction to the eye.
    pub to_eye: Vec3,
    /// Its gloss.
    pub gloss: Gloss,
}

/// A pixel of a glossy surface.
pub(super) struct Gathered {
    pub(super) light: Vec3,
    pub(super) second_moment: f32,
    pub(super) num_rays: u64,
    pub(super) guide: Guide,
}

/// The specular lobes of the surfaces of a scene, seen in the radiance that its Gaussians carry.
pub(super) struct Mirrors<'a> {
    pub(super) scene: &'a CpuScene,
    /// Emitters to sample; `None`: BSDF sampling only.
    pub(super) lights: Option<&'a Lights>,
    /// Directions for each pixel.
    pub(super) num_samples: u32,
}

impl Mirrors<'_> {
    /// Radiance that the surface of a pixel mirrors, premultiplied, and its samples' second moment.
    fn sampled(&self, mirror: Vertex, points: &Points, pixel: u32) -> (Mirrored, f32) {
        let start = Start::new(pixel, mirror);
        let (surface, bsdf) = (&mirror.surface, mirror.bsdf());
        let mut samples = Samples::default();
        for sample in 0..self.num_samples {
            let light = bounced(self.scene, self.lights, (surface, &bsdf), points, sample);
            samples.add(PathLight {
                light: light / start.divisor,
                num_rays: 1,
            });
        }
        let (mean, second_moment) = samples.moments();
        let mirrored = Mirrored {
            light: start.factor * mean,
            reflectance: bsdf.albedo(),
        };
        (mirrored, second_moment)
    }

    /// The pixels of a camera that show a surface: the radiance that the Gaussians there carry, of
    /// glossy ones that part of it that is scattered, and what their lobe mirrors.
    pub(super) fn gather(
        &self,
        camera: &Camera,
        features: &GBuffer,
        threshold: f32,
        key: RandomKey,
    ) -> Vec<(usize, Gathered)> {
        let (glosses, means) = self.scene.gloss_and_mean_radiance(camera, features);
        let surfaces = surfaces_of_pixels(camera, features, threshold, &glosses);
        let of_surface = |&(pixel, vertex): &(u32, Vertex)| {
            // The highlight that harmonics hold is sampled.
            let carried = match vertex.is_glossy() {
                true => means[pixel as usize],
                false => features.pixels[pixel as usize].radiance(),
            };
            let gathered = self.gathered(vertex, carried, threshold, (key, pixel));
            (pixel as usize, gathered)
        };
        surfaces.par_iter().map(of_surface).collect()
    }

    fn gathered(
        &self,
        vertex: Vertex,
        carried: Vec3,
        threshold: f32,
        (key, pixel): (RandomKey, u32),
    ) -> Gathered {
        if !vertex.is_glossy() {
            let mut guide = vertex.guide();
            guide.exact = carried;
            return Gathered {
                light: carried,
                second_moment: 0.0,
                num_rays: 0,
                guide,
            };
        }
        let mirror = vertex.mirror();
        let (mirrored, second_moment) = self.sampled(mirror, &Points::new(key, pixel), pixel);
        let scattered = vertex.albedo() * (Vec3::ONE - mirrored.reflectance);
        // Baking has taken all that is reflected for scattered.
        let all = equivalent_albedo(vertex.albedo(), vertex.gloss());
        let exact = carried * scattered / all.max(Vec3::splat(MIN_REFLECTANCE));
        let mut guide = guide(self.scene, &mirror, threshold);
        guide.exact = exact;
        Gathered {
            light: mirrored.light + exact,
            second_moment,
            num_rays: u64::from(self.num_samples),
            guide,
        }
    }
}

/// One bounce off a surface into the radiance that Gaussians carry. Directions are those of the
/// BSDF and, half of them, of emitters, weighted by the density of both together.
pub(super) fn bounced(
    scene: &CpuScene,
    lights: Option<&Lights>,
    (surface, bsdf): (&Surface, &Bsdf),
    points: &Points,
    sample: u32,
) -> Vec3 {
    let [a, b, pick, choice] = points.block(sample, 0);
    let origin = surface.position;
    let chosen = match lights {
        Some(lights) if pick < LIGHT_SHARE => lights.sample(origin, pick / LIGHT_SHARE, a, b),
        _ => bsdf.sample([choice, a, b]).map(|s| s.direction),
    };
    let Some(direction) = chosen else {
        return Vec3::ZERO;
    };
    let (value, mut density) = bsdf.evaluate(direction);
    if let Some(lights) = lights {
        density += LIGHT_SHARE / (1.0 - LIGHT_SHARE) * lights.density(origin, direction);
        density *= 1.0 - LIGHT_SHARE;
    }
    if density <= 0.0 {
        return Vec3::ZERO;
    }
    let hit = scene.sample_hit(&surface.ray(direction), points.word(sample));
    hit.map_or(Vec3::ZERO, |hit| {
        scene.attributes(hit.index).radiance() * (value / density)
    })
}

/// The first surface that is no mirror, seen by way of those that are; emitters have an emission
/// above `threshold`.
pub(super) fn guide(scene: &CpuScene, vertex: &Vertex, threshold: f32) -> Guide {
    let mut guide = vertex.guide();
    let mut tint = Vec3::ONE;
    let mut vertex = *vertex;
    for _ in 0..MAX_MIRRORS {
        let bsdf = vertex.bsdf();
        if bsdf.roughness() >= MIRROR_ROUGHNESS || bsdf.specular_share() <= 0.5 {
            break;
        }
        tint *= bsdf.albedo() * vertex.alpha;
        let (origin, direction) = (vertex.surface.position, bsdf.mirror_direction());
        let (features, gloss) = scene.trace_glossy(&vertex.surface.ray(direction));
        let Some(next) = Vertex::new((origin, direction), &features, gloss, 0.0) else {
            break;
        };
        guide = next.guide();
        guide.albedo *= tint;
        if features.emission() > threshold {
            // Of a lamp in a mirror, the light is no product with its albedo.
            guide.albedo = tint;
            break;
        }
        vertex = next;
    }
    guide
}

impl CpuScene {
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
        let mirrors = self.mirrors(num_samples);
        let key = RandomKey::new(options.seed, Purpose::Render, 0);
        let glosses = self.gloss_of_pixels(camera, features);
        let threshold = options.emission_threshold;
        let surfaces = surfaces_of_pixels(camera, features, threshold, &glosses);
        let of_surface = |&(pixel, vertex): &(u32, Vertex)| match vertex.is_glossy() {
            true => (mirrors.sampled(vertex.mirror(), &Points::new(key, pixel), pixel)).0,
            false => Mirrored::default(),
        };
        let found: Vec<Mirrored> = surfaces.par_iter().map(of_surface).collect();
        let mut all = vec![Mirrored::default(); camera.num_pixels()];
        for ((pixel, _), mirrored) in surfaces.iter().zip(found) {
            all[*pixel as usize] = mirrored;
        }
        all
    }

    fn mirrors(&self, num_samples: u32) -> Mirrors<'_> {
        Mirrors {
            scene: self,
            lights: self.lights(),
            num_samples,
        }
    }

    /// The same for `points`, with the random numbers of `key`. `[points]`
    pub fn mirrored_at(
        &self,
        points: &[GlossyPoint],
        num_samples: u32,
        key: RandomKey,
    ) -> Vec<Mirrored> {
        let mirrors = self.mirrors(num_samples);
        let of_point = |(i, point): (usize, &GlossyPoint)| {
            let number = i as u32;
            let mirror = Vertex::mirror_of(point);
            (mirrors.sampled(mirror, &Points::new(key, number), number)).0
        };
        points.par_iter().enumerate().map(of_point).collect()
    }
}
