//! Single rays and the integrators: flags and structures that their kernels share with Rust.

use crate::gpu::layout::{Layout, layout};
use crate::ray::Ray;
use crate::surfel::Surfel;
use crate::transport::lights::{Footprint, Lights};
use crate::view::SampledLight;
use eagpt_scene::Gloss;
use glam::Vec3;

/// Flag of a path's ray: none came before it.
pub(in crate::gpu) const FIRST_RAY: u32 = 1;
/// Flag of a path's ray: a light sample, which the path does not follow.
pub(in crate::gpu) const TOWARDS_LIGHT: u32 = 2;
/// Flag of a path's ray: the path may be ended at random.
pub(in crate::gpu) const ROULETTE: u32 = 4;
/// Flag of a path's ray: no bounce follows.
pub(in crate::gpu) const LAST_BOUNCE: u32 = 8;

/// Flag of a bounce: what surfaces scatter is known, and their lobes alone are sampled.
pub(in crate::gpu) const GATHER: u32 = 16;

/// A ray as kernels know it.
#[derive(Debug, Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(in crate::gpu) struct RayQuery {
    origin: [f32; 3],
    t_min: f32,
    direction: [f32; 3],
    /// Of the choice of a hit.
    seed: u32,
    own_normal: [f32; 3],
    /// 1 where there is nothing to trace.
    is_idle: u32,
}

impl RayQuery {
    pub(in crate::gpu) fn layout() -> Layout {
        layout!(RayQuery {
            origin: "vec3f",
            t_min: "f32",
            direction: "vec3f",
            seed: "u32",
            own_normal: "vec3f",
            is_idle: "u32",
        })
    }

    pub(in crate::gpu) fn new(ray: &Ray, seed: u32) -> Self {
        Self {
            origin: ray.origin,
            t_min: ray.t_min,
            direction: ray.direction,
            seed,
            own_normal: ray.own_normal,
            is_idle: 0,
        }
    }
}

/// Gloss as kernels know it: F0 and roughness.
pub(in crate::gpu) fn gloss_rows(glosses: &[Gloss]) -> Vec<[f32; 4]> {
    let of = |gloss: &Gloss| gloss.specular.extend(gloss.roughness).to_array();
    glosses.iter().map(of).collect()
}

/// Parameters of the kernels.
#[derive(Debug, Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(in crate::gpu) struct LightParameters {
    /// Key of the random numbers.
    pub(in crate::gpu) key: [u32; 4],
    pub(in crate::gpu) emission_threshold: f32,
    /// Share of directions towards emitters; above 0 where next-event estimation is on.
    pub(in crate::gpu) light_share: f32,
    pub(in crate::gpu) num_emitters: u32,
    pub(in crate::gpu) scene_root: u32,
    pub(in crate::gpu) light_root: u32,
    /// Number of the bounce that paths are extended by.
    pub(in crate::gpu) bounce: u32,
    /// [`FIRST_RAY`] and others.
    pub(in crate::gpu) flags: u32,
    /// Pixel of the image that buffers begin with.
    pub(in crate::gpu) first_pixel: u32,
    /// From and to, counted from `first_pixel`.
    pub(in crate::gpu) start_pixel: u32,
    pub(in crate::gpu) end_pixel: u32,
    pub(in crate::gpu) first_sample: u32,
    pub(in crate::gpu) end_sample: u32,
}

impl LightParameters {
    pub(in crate::gpu) fn layout() -> Layout {
        layout!(LightParameters {
            key: "vec4u",
            emission_threshold: "f32",
            light_share: "f32",
            num_emitters: "u32",
            scene_root: "u32",
            light_root: "u32",
            bounce: "u32",
            flags: "u32",
            first_pixel: "u32",
            start_pixel: "u32",
            end_pixel: "u32",
            first_sample: "u32",
            end_sample: "u32",
        })
    }
}

/// An emissive Gaussian.
#[derive(Debug, Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(in crate::gpu) struct Emitter {
    pub(in crate::gpu) surfel: Surfel,
    /// Probability that one up to this one is chosen.
    cumulative: f32,
    /// Part of the footprint inside the cut.
    inside: f32,
    /// Probability over the footprint's area.
    density: f32,
    padding: f32,
}

impl From<Footprint<'_>> for Emitter {
    fn from(footprint: Footprint<'_>) -> Self {
        Self {
            surfel: *footprint.surfel,
            cumulative: footprint.cumulative,
            inside: footprint.inside,
            density: footprint.density,
            padding: 0.0,
        }
    }
}

impl Emitter {
    pub(in crate::gpu) fn layout() -> Layout {
        layout!(Emitter {
            surfel: "Surfel",
            cumulative: "f32",
            inside: "f32",
            density: "f32",
            padding: "f32",
        })
    }

    /// Those of `lights`, in their order.
    pub(in crate::gpu) fn all(lights: Option<&Lights>) -> Vec<Self> {
        lights.map_or(Vec::new(), |lights| {
            lights.footprints().map(Self::from).collect()
        })
    }
}

/// Light that the samples of a pixel have gathered.
#[derive(Debug, Clone, Copy, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(in crate::gpu) struct Gathered {
    /// Sum of the light, before the albedo.
    total: [f32; 3],
    /// Sum of its squared luminance.
    squares: f32,
    num_rays: u32,
    padding: [u32; 3],
}

impl Gathered {
    /// That of `num_samples` samples.
    pub(in crate::gpu) fn light(&self, num_samples: u32) -> SampledLight {
        let scale = 1.0 / num_samples.max(1) as f32;
        SampledLight {
            mean: Vec3::from(self.total) * scale,
            second_moment: self.squares * scale,
            num_rays: self.num_rays,
        }
    }

    pub(in crate::gpu) fn layout() -> Layout {
        layout!(Gathered {
            total: "vec3f",
            squares: "f32",
            num_rays: "u32",
            padding: "array<u32, 3>",
        })
    }
}

/// A path that is under way.
#[derive(Debug, Clone, Copy)]
#[repr(C)]
#[allow(dead_code, reason = "lives on the device alone; Rust knows its size")]
pub(in crate::gpu) struct PathState {
    /// The surface it has come to.
    position: [f32; 3],
    offset: f32,
    normal: [f32; 3],
    num_rays: u32,
    throughput: [f32; 3],
    is_alive: u32,
    /// Light so far.
    brought: [f32; 3],
    /// Least roughness of the surfaces that it comes to, in glossy scenes as all that follows.
    min_roughness: f32,
    /// Unit direction to where the path came from.
    to_eye: [f32; 3],
    padding: u32,
    /// Diffuse albedo of the surface.
    albedo: [f32; 3],
    more_padding: u32,
    /// F0 and roughness of the surface.
    gloss: [f32; 4],
    /// Number that the light is divided by.
    divisor: [f32; 3],
    last_padding: u32,
}

impl PathState {
    pub(in crate::gpu) fn layout() -> Layout {
        layout!(PathState {
            position: "vec3f",
            offset: "f32",
            normal: "vec3f",
            num_rays: "u32",
            throughput: "vec3f",
            is_alive: "u32",
            brought: "vec3f",
            min_roughness: "f32",
            to_eye: "vec3f",
            padding: "u32",
            albedo: "vec3f",
            more_padding: "u32",
            gloss: "vec4f",
            divisor: "vec3f",
            last_padding: "u32",
        })
    }
}
