//! Light that reaches the eye by specular lobes ([`crate::transport::bsdf`]).
//!
//! The lobe is sampled one bounce into the radiance that is met. Emitters are sampled beside the
//! BSDF, and the two are combined by the balance heuristic (Veach 1997, section 9.2).

use super::CpuScene;
use super::realizations::SampledHit;
use super::samples::{PathLight, Samples};
use crate::features::GBuffer;
use crate::ray::Ray;
use crate::transport::bsdf::Bsdf;
use crate::transport::glossy::{GlossyPoint, Mirrored};
use crate::transport::lights::Lights;
use crate::transport::points::Points;
use crate::transport::start::Surface;
use crate::transport::vertex::{Start, Vertex, surfaces_of_pixels};
use crate::transport::{LIGHT_SHARE, LightOptions};
use eagpt_scene::Camera;
use eagpt_scene::rng::{Purpose, RandomKey};
use glam::Vec3;
use rayon::prelude::*;

/// Lobes of a surface that are sampled together, at most.
const MAX_TOGETHER: usize = 16;

/// The specular lobes of the surfaces of a scene, seen in the radiance that its Gaussians carry.
pub(super) struct Mirrors<'a> {
    pub(super) scene: &'a CpuScene,
    /// Emitters to sample; `None`: BSDF sampling only.
    pub(super) lights: Option<&'a Lights>,
    /// Directions for each pixel.
    pub(super) num_samples: u32,
    /// How the hit is chosen that stands for all of a ray.
    pub(super) hit: HitChoice,
}

/// How the hit is chosen that stands for all of a ray, by a number.
pub(super) type HitChoice = fn(&CpuScene, &Ray, u32) -> Option<SampledHit>;

impl Mirrors<'_> {
    /// Radiance that the specular lobe of a pixel's surface reflects, premultiplied.
    fn of_pixel(&self, pixel: u32, vertex: &Vertex, key: RandomKey) -> Mirrored {
        let mirror = vertex.mirror();
        let start = Start::new(pixel, mirror);
        let samples = self.samples(&start, &Points::new(key, pixel));
        Mirrored {
            light: start.factor * samples.light().mean,
            reflectance: mirror.bsdf().albedo(),
        }
    }

    /// Samples of one bounce off a start into the radiance that Gaussians carry.
    pub(super) fn samples(&self, start: &Start, points: &Points) -> Samples {
        let (surface, bsdf) = (&start.vertex.surface, start.vertex.bsdf());
        let bsdfs = std::slice::from_ref(&bsdf);
        let mut samples = Samples::default();
        for sample in 0..self.num_samples {
            let mut light = Vec3::ZERO;
            let numbers = (points.block(sample, 0), points.word(sample));
            self.bounce(surface, (bsdfs, 0), numbers, |_, value| light = value);
            samples.add(PathLight {
                light: light / start.divisor,
                num_rays: 1,
            });
        }
        samples
    }

    /// A direction of one of several BSDFs of a surface or, half of the time, of an emitter,
    /// weighted by the density of all together. Tells `add` the light of each, from what is met
    /// there.
    fn bounce(
        &self,
        surface: &Surface,
        (bsdfs, chosen): (&[Bsdf], usize),
        ([a, b, pick, choice], word): ([f32; 4], u32),
        mut add: impl FnMut(usize, Vec3),
    ) {
        let origin = surface.position;
        let direction = match self.lights {
            Some(lights) if pick < LIGHT_SHARE => lights.sample(origin, pick / LIGHT_SHARE, a, b),
            _ => bsdfs[chosen].sample([choice, a, b]).map(|s| s.direction),
        };
        let Some(direction) = direction else {
            return;
        };
        let mut values = [Vec3::ZERO; MAX_TOGETHER];
        let mut density = 0.0;
        for (value, bsdf) in values.iter_mut().zip(bsdfs) {
            let (own, chance) = bsdf.evaluate(direction);
            *value = own;
            density += chance;
        }
        density /= bsdfs.len() as f32;
        if let Some(lights) = self.lights {
            density += LIGHT_SHARE / (1.0 - LIGHT_SHARE) * lights.density(origin, direction);
            density *= 1.0 - LIGHT_SHARE;
        }
        if density <= 0.0 {
            return;
        }
        let Some(hit) = (self.hit)(self.scene, &surface.ray(direction), word) else {
            return;
        };
        let light = self.scene.attributes(hit.index).radiance();
        for (number, value) in values[..bsdfs.len()].iter().enumerate() {
            add(number, light * (*value / density));
        }
    }

    /// Light that a point mirrors towards those of its eyes that see it. Their lobes are sampled
    /// together: where they overlap, the samples of one are of use for the others.
    fn towards_eyes(&self, point: &GlossyPoint, points: &Points) -> Vec<Option<Mirrored>> {
        let surface = &point.surface;
        let mut seen = vec![None; point.eyes.len()];
        let mut lobes: Vec<(usize, Bsdf)> = Vec::new();
        for (number, eye) in point.eyes.iter().enumerate() {
            let offset = *eye - surface.position;
            let to_eye = offset.normalize_or_zero();
            let hit = (self.hit)(self.scene, &surface.ray(to_eye), points.word(number as u32));
            if hit.is_none_or(|hit| hit.t >= offset.length()) {
                let lobe = Bsdf::new(surface.normal, to_eye, Vec3::ZERO, point.gloss);
                lobes.push((number, lobe));
            }
        }
        for (first, lobes) in (0..).step_by(MAX_TOGETHER).zip(lobes.chunks(MAX_TOGETHER)) {
            let bsdfs: Vec<Bsdf> = lobes.iter().map(|(_, lobe)| *lobe).collect();
            let mut sums = vec![Vec3::ZERO; bsdfs.len()];
            for (block, chosen) in (first..).zip(0..bsdfs.len()) {
                for sample in 0..self.num_samples {
                    let word = points.word((block + 1) * self.num_samples + sample);
                    let numbers = (points.block(sample, block), word);
                    let add = |number: usize, light: Vec3| sums[number] += light;
                    self.bounce(surface, (&bsdfs, chosen), numbers, add);
                }
            }
            let num = (bsdfs.len() as u32 * self.num_samples) as f32;
            for ((number, lobe), sum) in lobes.iter().zip(sums) {
                seen[*number] = Some(Mirrored {
                    light: sum / num,
                    reflectance: lobe.albedo(),
                });
            }
        }
        seen
    }
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
        let glosses = self.with_record(camera, |record| self.gloss_of_pixels(record, features));
        let threshold = options.emission_threshold;
        let surfaces = surfaces_of_pixels(camera, features, threshold, &glosses);
        let of_surface = |&(pixel, vertex): &(u32, Vertex)| match vertex.is_glossy() {
            true => mirrors.of_pixel(pixel, &vertex, key),
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
            hit: Self::realization_hit,
        }
    }
}

/// See [`crate::Tracer::mirrored_towards`].
pub(super) fn mirrored_towards(
    scene: &CpuScene,
    all: &[GlossyPoint],
    num_samples: u32,
    key: RandomKey,
) -> Vec<Vec<Option<Mirrored>>> {
    let mirrors = scene.mirrors(num_samples);
    let of_point = |(i, point): (usize, &GlossyPoint)| {
        mirrors.towards_eyes(point, &Points::new(key, i as u32))
    };
    all.par_iter().enumerate().map(of_point).collect()
}
