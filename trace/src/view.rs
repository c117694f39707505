//! Rendered views from the light that an engine samples at their pixels, the same for all engines.

use crate::features::{Features, GBuffer};
use crate::ray::Ray;
use crate::transport::Integrator;
use crate::transport::bsdf::equivalent_albedo;
use crate::transport::vertex::{MIN_REFLECTANCE, Start, Vertex, surfaces_of_pixels};
use eagpt_scene::{Camera, Gloss, Image};
use glam::Vec3;
use rayon::prelude::*;

/// Mirrors in a row that a view looks into.
const MAX_MIRRORS: u32 = 3;

/// A rendered frame: the light, and the composited features of the camera rays it started from.
#[derive(Debug, Clone, PartialEq)]
pub struct RenderedView {
    /// Linear radiance, premultiplied by the opacity.
    pub radiance: Image<3>,
    /// Mean over the samples of the squared luminance of the light before the albedo; 0 where no
    /// light is sampled. With the mean it gives the variance of a pixel.
    pub second_moment: Image<1>,
    /// Composited features of the camera rays.
    pub features: GBuffer,
    /// Rays traced beside those of the camera.
    pub num_rays: u64,
    /// Guides of a denoiser for each camera ray, `[height · width]`; empty where nothing is
    /// glossy and the features say it.
    pub guides: Vec<Guide>,
}

/// A surface that guides a denoiser: the one that a camera ray meets, or the first rough one that
/// it sees in mirrors.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Guide {
    /// Reflectance for light from everywhere, times that of the mirrors before it.
    pub albedo: Vec3,
    /// Unit normal.
    pub normal: Vec3,
    /// Place, world space.
    pub position: Vec3,
    /// Of the light of the ray, what has no noise.
    pub exact: Vec3,
}

impl RenderedView {
    /// Means over squares of `factor` × `factor` pixels, of which the view has a whole number;
    /// without guides, which are of rays.
    pub fn averaged(&self, factor: u32) -> Self {
        Self {
            radiance: self.radiance.averaged(factor),
            second_moment: self.second_moment.averaged(factor),
            features: self.features.averaged(factor),
            num_rays: self.num_rays,
            guides: Vec::new(),
        }
    }
}

/// The things that the rays of a camera have met.
pub(crate) struct Pixels {
    pub(crate) features: GBuffer,
    /// Blended gloss, `[pixels]`; empty where nothing is glossy, and where no light is sampled.
    pub(crate) glosses: Vec<Gloss>,
    /// Blended radiance without what harmonics add, `[pixels]`; empty as `glosses`.
    pub(crate) means: Vec<Vec3>,
}

impl Pixels {
    /// Those of a scene without gloss.
    pub(crate) fn diffuse(features: GBuffer) -> Self {
        Self {
            features,
            glosses: Vec::new(),
            means: Vec::new(),
        }
    }
}

/// Light that the samples of a pixel have brought, see [`Start`].
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct SampledLight {
    pub(crate) mean: Vec3,
    /// Mean of the squared luminance.
    pub(crate) second_moment: f32,
    pub(crate) num_rays: u32,
}

/// A view whose camera rays are traced.
pub(crate) struct View {
    camera: Camera,
    pixels: Pixels,
    integrator: Integrator,
    threshold: f32,
    /// Pixels and their surfaces, where light is sampled or known.
    surfaces: Vec<(u32, Vertex)>,
}

impl View {
    /// Emitters have an emission above `threshold`.
    pub(crate) fn new(
        camera: &Camera,
        pixels: Pixels,
        integrator: &Integrator,
        threshold: f32,
    ) -> Self {
        let is_finished = match integrator {
            Integrator::ZeroBounce | Integrator::Gather { .. } => pixels.glosses.is_empty(),
            Integrator::OneBounce { .. } | Integrator::Path { .. } => false,
        };
        let mut surfaces = match is_finished {
            true => Vec::new(),
            false => surfaces_of_pixels(camera, &pixels.features, threshold, &pixels.glosses),
        };
        if *integrator == Integrator::ZeroBounce {
            surfaces.retain(|(_, vertex)| vertex.gloss().is_mirror());
        }
        Self {
            camera: *camera,
            pixels,
            integrator: *integrator,
            threshold,
            surfaces,
        }
    }

    /// A surface as it is sampled: what it scatters is known where it shows its own radiance.
    fn sampled(&self, vertex: &Vertex) -> Vertex {
        match self.integrator.shows_own_radiance() && vertex.is_glossy() {
            true => vertex.mirror(),
            false => *vertex,
        }
    }

    /// Where light is sampled.
    pub(crate) fn starts(&self) -> Vec<Start> {
        let is_sampled = |vertex: &Vertex| match self.integrator {
            Integrator::ZeroBounce => false,
            Integrator::Gather { .. } => vertex.is_glossy(),
            Integrator::OneBounce { .. } | Integrator::Path { .. } => true,
        };
        (self.surfaces.iter())
            .filter(|(_, vertex)| is_sampled(vertex))
            .map(|(pixel, vertex)| Start::new(*pixel, self.sampled(vertex)))
            .collect()
    }

    /// The view with the light of its starts, `[starts]`. `trace` has features and gloss of single
    /// rays, for what mirrors show.
    pub(crate) fn finish<E>(
        self,
        starts: &[Start],
        lights: &[SampledLight],
        trace: impl FnMut(&[Ray]) -> Result<Vec<(Features, Gloss)>, E>,
    ) -> Result<RenderedView, E> {
        let shows_own = |seen: &Features| {
            seen.emission() > self.threshold || self.integrator.shows_own_radiance()
        };
        let own = |seen: &Features| match shows_own(seen) {
            true => seen.radiance().to_array(),
            false => [0.0; 3],
        };
        let features = &self.pixels.features;
        let mut radiance: Vec<[f32; 3]> = features.pixels.iter().map(own).collect();
        let mut second_moment = vec![[0.0]; radiance.len()];
        let mut num_rays = 0;
        for (start, light) in starts.iter().zip(lights) {
            let pixel = start.pixel as usize;
            radiance[pixel] = (start.factor * light.mean).to_array();
            second_moment[pixel] = [light.second_moment];
            num_rays += u64::from(light.num_rays);
        }
        let mut guides = Vec::new();
        if !self.pixels.glosses.is_empty() {
            guides = vec![Guide::default(); radiance.len()];
            let seen: Vec<Vertex> = (self.surfaces.iter())
                .map(|(_, vertex)| self.sampled(vertex))
                .collect();
            let found = through_mirrors(&seen, self.threshold, trace)?;
            for ((pixel, vertex), (guide, image)) in self.surfaces.iter().zip(found) {
                let exact = match self.integrator {
                    Integrator::ZeroBounce => self.scattered(*pixel, vertex) + image,
                    Integrator::Gather { .. } => self.scattered(*pixel, vertex),
                    Integrator::OneBounce { .. } | Integrator::Path { .. } => Vec3::ZERO,
                };
                let pixel = *pixel as usize;
                guides[pixel] = Guide { exact, ..guide };
                match self.integrator {
                    Integrator::ZeroBounce => radiance[pixel] = exact.to_array(),
                    Integrator::Gather { .. } if vertex.is_glossy() => {
                        radiance[pixel] = (Vec3::from(radiance[pixel]) + exact).to_array();
                    }
                    _ => {}
                }
            }
        }
        let (width, height) = (self.camera.width, self.camera.height);
        let one_each = "one value for each pixel";
        Ok(RenderedView {
            radiance: Image::from_pixels(width, height, radiance).expect(one_each),
            second_moment: Image::from_pixels(width, height, second_moment).expect(one_each),
            num_rays,
            features: self.pixels.features,
            guides,
        })
    }

    /// Of the radiance that the Gaussians of a pixel carry, what its surface scatters.
    fn scattered(&self, pixel: u32, vertex: &Vertex) -> Vec3 {
        let pixel = pixel as usize;
        if !vertex.is_glossy() {
            return self.pixels.features.pixels[pixel].radiance();
        }
        let reflectance = vertex.mirror().bsdf().albedo();
        let scattered = vertex.albedo() * (Vec3::ONE - reflectance);
        // The highlight that harmonics hold is sampled, and baking has taken all that is reflected
        // for scattered.
        let all = equivalent_albedo(vertex.albedo(), vertex.gloss());
        self.pixels.means[pixel] * scattered / all.max(Vec3::splat(MIN_REFLECTANCE))
    }
}

fn guide_of(vertex: &Vertex) -> Guide {
    Guide {
        albedo: vertex.reflectance() * vertex.alpha,
        normal: vertex.surface.normal,
        position: vertex.surface.position,
        exact: Vec3::ZERO,
    }
}

/// A mirror that a view looks into.
struct MirrorRay {
    /// Number of the pixel's surface.
    number: usize,
    vertex: Vertex,
    /// Reflectance of the mirrors so far.
    tint: Vec3,
}

/// Of each of `vertices`, the first surface that is no mirror, seen by way of those that are, and
/// the light that comes that way of the radiance that Gaussians carry: none where a vertex is no
/// mirror. Emitters have an emission above `threshold`. `[vertices]`
fn through_mirrors<E>(
    vertices: &[Vertex],
    threshold: f32,
    mut trace: impl FnMut(&[Ray]) -> Result<Vec<(Features, Gloss)>, E>,
) -> Result<Vec<(Guide, Vec3)>, E> {
    let first_seen = |vertex: &Vertex| (guide_of(vertex), Vec3::ZERO);
    let mut found: Vec<(Guide, Vec3)> = vertices.par_iter().map(first_seen).collect();
    let first = |(number, &vertex): (usize, &Vertex)| MirrorRay {
        number,
        vertex,
        tint: Vec3::ONE,
    };
    let mut reflected: Vec<MirrorRay> = vertices.iter().enumerate().map(first).collect();
    for _ in 0..MAX_MIRRORS {
        let into_mirror = |mirror: MirrorRay| {
            let bsdf = mirror.vertex.bsdf();
            let is_mirror =
                bsdf.roughness() < Gloss::MIRROR_ROUGHNESS && bsdf.specular_share() > 0.5;
            is_mirror.then(|| {
                let tint = mirror.tint * bsdf.albedo() * mirror.vertex.alpha;
                let ray = mirror.vertex.surface.ray(bsdf.mirror_direction());
                (MirrorRay { tint, ..mirror }, ray)
            })
        };
        let mirrors = reflected.into_par_iter().filter_map(into_mirror);
        let (mirrors, rays): (Vec<MirrorRay>, Vec<Ray>) = mirrors.unzip();
        if mirrors.is_empty() {
            break;
        }
        reflected = Vec::new();
        for ((mirror, ray), (features, gloss)) in mirrors.into_iter().zip(&rays).zip(trace(&rays)?)
        {
            let ray = (Vec3::from(ray.origin), Vec3::from(ray.direction));
            let Some(vertex) = Vertex::new(ray, &features, gloss, 0.0) else {
                continue;
            };
            let (guide, image) = &mut found[mirror.number];
            *guide = guide_of(&vertex);
            *image = mirror.tint * features.radiance();
            if features.emission() > threshold {
                // Of a lamp in a mirror, the light is no product with its albedo.
                guide.albedo = mirror.tint;
                continue;
            }
            guide.albedo *= mirror.tint;
            reflected.push(MirrorRay { vertex, ..mirror });
        }
    }
    Ok(found)
}
