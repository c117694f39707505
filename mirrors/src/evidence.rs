//! Photographs, and where the trained scene has what they show.

use eagpt_scene::View;
use eagpt_scene::median::median_of;
use eagpt_trace::features::GBuffer;
use glam::Vec3;

/// Pixels that are kept of all views together, about.
const MAX_KEPT: usize = 600_000;
/// Opacity from which on a pixel shows a surface.
const LEAST_ALPHA: f32 = 0.5;
/// Thickness of surfaces, and width of the cells that they are divided into, in median distances of
/// what cameras see.
const THICKNESS: f32 = 0.012;
const CELL: f32 = 0.02;
/// Height above a mirror up to which what training makes of it may stand before it, in thicknesses
/// of surfaces.
const PAST: f32 = 4.0;
/// Of the median radiance, what is added to light before its logarithm: what is darker is noise.
const DARK: f32 = 0.05;

/// A pixel of a photograph.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Seen {
    /// Number of the view.
    pub(crate) view: u32,
    /// Place of the camera, world space.
    pub(crate) origin: Vec3,
    /// Unit direction from it.
    pub(crate) direction: Vec3,
    /// Photographed radiance, linear.
    pub(crate) radiance: Vec3,
    /// Distance of the scene, scene units; infinite where there is nothing.
    pub(crate) distance: f32,
    /// Unit normal of the scene towards the camera; zero where there is nothing.
    pub(crate) normal: Vec3,
}

impl Seen {
    /// Where the scene has it, world space.
    pub(crate) fn position(&self) -> Vec3 {
        self.origin + self.direction * self.distance
    }
}

/// Sizes by which a scene is judged.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Scale {
    /// Thickness of surfaces, scene units.
    pub(crate) near: f32,
    /// Width of a cell, scene units.
    pub(crate) cell: f32,
    /// Radiance that is noise.
    dark: f32,
}

impl Scale {
    /// Height above a mirror, scene units, from which on it may reflect what is there.
    pub(crate) fn past(&self) -> f32 {
        PAST * self.near
    }

    /// Logarithm of light, which differs from that of other light by their ratio.
    pub(crate) fn log(&self, light: Vec3) -> Vec3 {
        (light + self.dark).map(f32::ln)
    }
}

/// Pixels of training views, photographed in one light.
#[derive(Debug, Clone, Default)]
pub struct Evidence {
    pub(crate) seen: Vec<Seen>,
    num_views: u32,
    /// One pixel of so many is kept, along each axis.
    step: u32,
}

impl Evidence {
    /// Evidence of views that have `num_pixels` together.
    pub fn new(num_pixels: usize) -> Self {
        let step = (1..).find(|step| num_pixels / (step * step) <= MAX_KEPT);
        Self {
            step: step.unwrap_or(1) as u32,
            ..Self::default()
        }
    }

    /// Adds a view; the scene in its light is `seen` from its camera.
    pub fn add(&mut self, view: &View, seen: &GBuffer) {
        let camera = &view.camera;
        let frame = camera.ray_frame();
        let (first, step) = (self.step / 2, self.step as usize);
        for y in (first..camera.height).step_by(step) {
            for x in (first..camera.width).step_by(step) {
                if view.valid.as_ref().is_some_and(|v| v.get(x, y) == [0.0]) {
                    continue;
                }
                let features = &seen.pixels[(y * camera.width + x) as usize];
                let (distance, normal) = match features.alpha() >= LEAST_ALPHA {
                    true => (features.mean_distance(), features.unit_normal()),
                    false => (f32::INFINITY, Vec3::ZERO),
                };
                self.seen.push(Seen {
                    view: self.num_views,
                    origin: frame.origin,
                    direction: frame.direction(x as f32 + 0.5, y as f32 + 0.5),
                    radiance: view.radiance.get(x, y).into(),
                    distance,
                    normal,
                });
            }
        }
        self.num_views += 1;
    }

    pub(crate) fn scale(&self) -> Scale {
        let distances = self.seen.iter().map(|seen| seen.distance);
        let size = median_of(distances.filter(|distance| distance.is_finite()));
        let light = median_of(self.seen.iter().map(|seen| seen.radiance.max_element()));
        Scale {
            near: THICKNESS * size,
            cell: CELL * size,
            dark: (DARK * light).max(f32::MIN_POSITIVE),
        }
    }
}

/// Square of a difference of logarithms of light, at most 1: what is hidden in one view or wrong in
/// the scene counts once.
pub(crate) fn difference(logs: Vec3) -> f32 {
    logs.length_squared().min(1.0)
}
