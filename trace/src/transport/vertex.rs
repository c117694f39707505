//! A vertex of a path: a surface, and what it reflects towards where the ray came from.

use super::bsdf::Bsdf;
use super::start::Surface;
use crate::features::{Features, GBuffer};
use eagpt_scene::{Camera, Gloss};
use glam::Vec3;
use rayon::prelude::*;

/// Light is divided by no smaller reflectance.
pub(crate) const MIN_REFLECTANCE: f32 = 1e-3;
/// Least roughness of what a path meets after a diffuse bounce.
pub(crate) const ROUGH_BEHIND: f32 = 0.3;

/// A surface that a ray has met.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Vertex {
    pub(crate) surface: Surface,
    /// Unit direction to where the ray came from.
    to_eye: Vec3,
    /// Diffuse albedo, not premultiplied; see [`MAX_ALBEDO`](eagpt_scene::gaussians::MAX_ALBEDO).
    albedo: Vec3,
    gloss: Gloss,
    /// Opacity of what was met: the light is premultiplied.
    pub(crate) alpha: f32,
}

impl Vertex {
    /// The vertex where a ray of unit `direction` from `origin` meets a surface, if it does.
    /// Surfaces are at least `min_roughness` rough.
    pub(crate) fn new(
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
    pub(crate) fn mirror(&self) -> Self {
        Self {
            albedo: Vec3::ZERO,
            ..*self
        }
    }

    /// The surface if it scattered all light diffusely.
    pub(crate) fn white(&self) -> Self {
        Self {
            albedo: Vec3::ONE,
            gloss: Gloss::NONE,
            ..*self
        }
    }

    /// Whether it mirrors any light.
    pub(crate) fn is_glossy(&self) -> bool {
        self.gloss.is_some()
    }

    /// The diffuse albedo, not premultiplied.
    pub(crate) fn albedo(&self) -> Vec3 {
        self.albedo
    }

    pub(crate) fn gloss(&self) -> Gloss {
        self.gloss
    }

    pub(crate) fn bsdf(&self) -> Bsdf {
        Bsdf::new(self.surface.normal, self.to_eye, self.albedo, self.gloss)
    }

    /// Of light from everywhere, what goes to the eye.
    pub(crate) fn reflectance(&self) -> Vec3 {
        match self.is_glossy() {
            true => self.bsdf().albedo(),
            false => self.albedo,
        }
    }
}

/// The surfaces that the rays of `camera` meet, whose composited `features` are given, and their
/// pixels, in order; without emitters, whose emission is above `threshold`. `glosses` are those of
/// the pixels, or none.
pub(crate) fn surfaces_of_pixels(
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

/// A pixel's surface, from which its paths go on.
///
/// Samples are of the light before the reflectance, which a denoiser can smooth: of a white surface
/// in place of a diffuse one, and divided by what a glossy one reflects.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Start {
    pub(crate) pixel: u32,
    pub(crate) vertex: Vertex,
    /// Number that the light of a sample is divided by.
    pub(crate) divisor: Vec3,
    /// Factor from the mean of its samples to the pixel.
    pub(crate) factor: Vec3,
}

impl Start {
    pub(crate) fn new(pixel: u32, vertex: Vertex) -> Self {
        let (divisor, reflectance) = match vertex.is_glossy() {
            true => {
                let all = vertex.reflectance().max(Vec3::splat(MIN_REFLECTANCE));
                (all, all)
            }
            false => (Vec3::ONE, vertex.reflectance()),
        };
        Self {
            pixel,
            vertex: if vertex.is_glossy() {
                vertex
            } else {
                vertex.white()
            },
            divisor,
            factor: reflectance * vertex.alpha,
        }
    }
}
