//! A vertex of a path: a surface, and what it reflects towards where the ray came from.

use super::CpuScene;
use super::camera::CameraRecord;
use crate::blend::GlossBlend;
use crate::features::{Features, GBuffer};
use crate::tracer::Guide;
use crate::transport::bsdf::Bsdf;
use crate::transport::start::Surface;
use crate::weights::BlendWeights;
use eagpt_scene::{Camera, Gloss};
use glam::Vec3;
use rayon::prelude::*;

/// Light is divided by no smaller reflectance.
pub(super) const MIN_REFLECTANCE: f32 = 1e-3;

/// A surface that a ray has met.
#[derive(Debug, Clone, Copy)]
pub(super) struct Vertex {
    pub(super) surface: Surface,
    /// Unit direction to where the ray came from.
    to_eye: Vec3,
    /// Diffuse albedo, not premultiplied; see [`MAX_ALBEDO`](eagpt_scene::gaussians::MAX_ALBEDO).
    albedo: Vec3,
    gloss: Gloss,
    /// Opacity of what was met: the light is premultiplied.
    pub(super) alpha: f32,
}

impl Vertex {
    /// The vertex where a ray of unit `direction` from `origin` meets a surface, if it does.
    /// Surfaces are at least `min_roughness` rough.
    pub(super) fn new(
        (origin, direction): (Vec3, Vec3),
        features: &Features,
        gloss: Gloss,
        min_roughness: f32,
    ) -> Option<Self> {
        let surface = Surface::at(origin, direction, features)?;
        let alpha = features.alpha();
        Some(Self {
            surface,
            to_eye: -direction,
            albedo: features.albedo() / alpha,
            gloss: Gloss {
                roughness: gloss.roughness.max(min_roughness),
                ..gloss
            },
            alpha,
        })
    }

    /// The surface without what it scatters diffusely.
    pub(super) fn mirror(&self) -> Self {
        Self {
            albedo: Vec3::ZERO,
            ..*self
        }
    }

    /// The surface if it scattered all light diffusely.
    pub(super) fn white(&self) -> Self {
        Self {
            albedo: Vec3::ONE,
            gloss: Gloss::NONE,
            ..*self
        }
    }

    /// Whether it mirrors any light.
    pub(super) fn is_glossy(&self) -> bool {
        self.gloss.is_some()
    }

    /// The diffuse albedo, not premultiplied.
    pub(super) fn albedo(&self) -> Vec3 {
        self.albedo
    }

    pub(super) fn gloss(&self) -> Gloss {
        self.gloss
    }

    pub(super) fn bsdf(&self) -> Bsdf {
        Bsdf::new(self.surface.normal, self.to_eye, self.albedo, self.gloss)
    }

    /// Of light from everywhere, what goes to the eye.
    pub(super) fn reflectance(&self) -> Vec3 {
        match self.is_glossy() {
            true => self.bsdf().albedo(),
            false => self.albedo,
        }
    }

    pub(super) fn guide(&self) -> Guide {
        Guide {
            albedo: self.reflectance() * self.alpha,
            normal: self.surface.normal,
            position: self.surface.position,
            exact: Vec3::ZERO,
        }
    }
}

/// The surfaces that the rays of `camera` meet, whose composited `features` are given, and their
/// pixels, in order; without emitters, whose emission is above `threshold`. `glosses` are those of
/// the pixels, or none.
pub(super) fn surfaces_of_pixels(
    camera: &Camera,
    features: &GBuffer,
    threshold: f32,
    glosses: &[Gloss],
) -> Vec<(u32, Vertex)> {
    let frame = camera.ray_frame();
    let of_pixel = |pixel: usize| {
        let seen = &features.pixels[pixel];
        if seen.emission() > threshold {
            return None;
        }
        let (x, y) = (pixel as u32 % camera.width, pixel as u32 / camera.width);
        let direction = frame.direction(x as f32 + 0.5, y as f32 + 0.5);
        let gloss = glosses.get(pixel).copied().unwrap_or_default();
        let vertex = Vertex::new((frame.origin, direction), seen, gloss, 0.0)?;
        Some((pixel as u32, vertex))
    };
    let pixels = (0..camera.num_pixels()).into_par_iter();
    pixels.filter_map(of_pixel).collect()
}

impl CpuScene {
    /// Blended gloss of the pixels of a camera, whose record and `features` are given; none where
    /// nothing is glossy.
    pub(super) fn gloss_of_pixels(&self, record: &CameraRecord, features: &GBuffer) -> Vec<Gloss> {
        if !self.is_glossy() {
            return Vec::new();
        }
        self.blended_gloss(&record.weights(0.0), features)
    }

    /// The same with the radiance that the Gaussians of each pixel have in the mean over all
    /// directions, whatever their harmonics, of a glossy scene.
    pub(super) fn gloss_and_mean_radiance(
        &self,
        record: &CameraRecord,
        features: &GBuffer,
    ) -> (Vec<Gloss>, Vec<Vec3>) {
        let weights = record.weights(0.0);
        let mean = weights.blend(|i| self.attributes(i).radiance());
        (self.blended_gloss(&weights, features), mean)
    }

    fn blended_gloss(&self, weights: &BlendWeights, features: &GBuffer) -> Vec<Gloss> {
        let of = |i: u32| GlossBlend::of(&self.surfels().gloss[i as usize]);
        let blended = weights.blend(of).into_iter().zip(&features.pixels);
        blended
            .map(|(blend, seen)| blend.finish(seen.alpha()))
            .collect()
    }
}
