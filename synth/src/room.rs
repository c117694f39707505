//! A room: surfaces with materials, lights, and the conditions they are switched in.

pub(crate) mod bvh;
pub(crate) mod pattern;
pub(crate) mod shape;

use bvh::Bvh;
use glam::{Vec2, Vec3};
use pattern::{PatternPoint, Texture};
use shape::{Crossing, Shape, SurfacePoint};

/// Conditions that light is computed for at once, at most.
pub(crate) const MAX_CONDITIONS: usize = 8;
/// Hits nearer than this are ignored, and rays start this far above their surface,
/// metres: room-sized floats have steps of 2e-7.
pub(crate) const LIFT: f32 = 1e-4;

/// Light in each of the conditions.
pub(crate) type PerCondition = [Vec3; MAX_CONDITIONS];

/// Material of a surface.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Material {
    /// Diffuse albedo.
    pub(crate) texture: Texture,
    /// A coat of varnish, if there is one.
    pub(crate) gloss: Option<Gloss>,
}

/// A coat of varnish, or bare metal where what is beneath is black: it mirrors the room to the
/// camera. Other surfaces receive as much light from it, spread as by a diffuse one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Gloss {
    /// Reflectance at normal incidence of each channel, 0 to 1.
    pub(crate) reflectance: Vec3,
    /// Perceptual roughness, 0 to 1: facets have GGX's distribution with α = roughness².
    pub(crate) roughness: f32,
}

impl Gloss {
    /// Reflectance where light meets a facet at the cosine `facing` (Schlick 1994).
    pub(crate) fn at(&self, facing: f32) -> Vec3 {
        let edge = (1.0 - facing.clamp(0.0, 1.0)).powi(5);
        self.reflectance + (Vec3::ONE - self.reflectance) * edge
    }

    /// Mean of [`Self::at`] over the hemisphere, weighted by the cosine.
    pub(crate) fn mean(&self) -> Vec3 {
        self.reflectance + (Vec3::ONE - self.reflectance) / 21.0
    }
}

/// A shape in the room.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Surface {
    /// Its shape.
    pub(crate) shape: Shape,
    /// Index of its material.
    pub(crate) material: u32,
    /// Index of the light it belongs to, if it emits.
    pub(crate) light: Option<u32>,
}

/// A light: surfaces that are switched together.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Light {
    /// Name.
    pub(crate) name: String,
    /// Linear Rec.709 radiance in each condition; black where it is off. A surface that emits
    /// does not reflect.
    pub(crate) radiance: PerCondition,
}

/// Surfaces, materials and lights.
#[derive(Debug, Clone)]
pub(crate) struct Room {
    surfaces: Vec<Surface>,
    shapes: Vec<Shape>,
    materials: Vec<Material>,
    lights: Vec<Light>,
    num_conditions: usize,
    bvh: Bvh,
}

/// A point of the room that a ray has met.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Hit {
    /// Distance along the ray, metres.
    pub(crate) distance: f32,
    /// World position.
    pub(crate) position: Vec3,
    /// Unit normal, turned to where the ray came from.
    pub(crate) normal: Vec3,
    /// Index of the surface.
    pub(crate) surface: u32,
    /// Face of its shape.
    pub(crate) face: u32,
    /// Coordinates on the face, 0 to 1.
    pub(crate) st: Vec2,
    /// Whether it is the inside of a closed shape, where no camera is.
    pub(crate) is_inside: bool,
}

impl Room {
    /// A room of these surfaces, whose indices of materials and lights have to exist.
    ///
    /// # Panics
    /// If there are more conditions than [`MAX_CONDITIONS`].
    pub(crate) fn new(
        surfaces: Vec<Surface>,
        materials: Vec<Material>,
        lights: Vec<Light>,
        num_conditions: usize,
    ) -> Self {
        assert!(
            num_conditions <= MAX_CONDITIONS,
            "{num_conditions} conditions"
        );
        let shapes: Vec<Shape> = surfaces.iter().map(|surface| surface.shape).collect();
        Self {
            bvh: Bvh::new(&shapes),
            surfaces,
            shapes,
            materials,
            lights,
            num_conditions,
        }
    }

    /// All surfaces.
    pub(crate) fn surfaces(&self) -> &[Surface] {
        &self.surfaces
    }

    /// All lights.
    pub(crate) fn lights(&self) -> &[Light] {
        &self.lights
    }

    /// Number of conditions.
    pub(crate) fn num_conditions(&self) -> usize {
        self.num_conditions
    }

    /// Corners of the axis-aligned box around everything.
    #[cfg(test)]
    pub(crate) fn bounds(&self) -> [Vec3; 2] {
        let boxes = self.shapes.iter().map(Shape::bounds);
        boxes
            .reduce(|[low, high], [l, h]| [low.min(l), high.max(h)])
            .unwrap_or([Vec3::ZERO; 2])
    }

    /// The first surface that a ray meets. `direction` is of unit length.
    pub(crate) fn meet(&self, origin: Vec3, direction: Vec3) -> Option<Hit> {
        let range = [LIFT, f32::INFINITY];
        let (index, crossing) = self.bvh.nearest(&self.shapes, origin, direction, range)?;
        let Crossing {
            distance,
            face,
            st,
            normal,
        } = crossing;
        let away = normal.dot(direction) > 0.0;
        Some(Hit {
            distance,
            position: origin + direction * distance,
            normal: if away { -normal } else { normal },
            surface: index,
            face,
            st,
            is_inside: away && self.shapes[index as usize].is_closed(),
        })
    }

    /// Whether nothing is in the way between two points, both lifted off their surfaces.
    pub(crate) fn is_free(&self, from: Vec3, to: Vec3) -> bool {
        let offset = to - from;
        let distance = offset.length();
        let range = [LIFT, distance - LIFT];
        distance <= 2.0 * LIFT
            || self
                .bvh
                .is_free(&self.shapes, from, offset / distance, range)
    }

    /// Material of a surface.
    pub(crate) fn material(&self, surface: u32) -> &Material {
        &self.materials[self.surfaces[surface as usize].material as usize]
    }

    /// Diffuse albedo of a point.
    pub(crate) fn albedo(&self, surface: u32, face: u32, st: Vec2) -> Vec3 {
        let extent = self.shapes[surface as usize].extent(face);
        self.material(surface).texture.albedo(&PatternPoint {
            place: st * extent,
            extent,
            seed: surface * 8 + face,
        })
    }

    /// Share of diffuse light that a point reflects in all, its coat included.
    pub(crate) fn reflectance(&self, surface: u32, face: u32, st: Vec2) -> Vec3 {
        let albedo = self.albedo(surface, face, st);
        match self.material(surface).gloss {
            Some(gloss) => albedo * (Vec3::ONE - gloss.mean()) + gloss.mean(),
            None => albedo,
        }
    }

    /// Light that a face sends out by itself in each condition; the back of a quad does not emit.
    pub(crate) fn emitted(&self, surface: u32, face: u32) -> Option<&PerCondition> {
        let Surface { shape, light, .. } = &self.surfaces[surface as usize];
        let light = (*light)?;
        if matches!(shape, Shape::Quad(_)) && face == 1 {
            return None;
        }
        Some(&self.lights[light as usize].radiance)
    }

    /// Light that a face sends out by itself in a condition.
    pub(crate) fn emitted_in(&self, condition: usize, surface: u32, face: u32) -> Vec3 {
        self.emitted(surface, face)
            .map_or(Vec3::ZERO, |light| light[condition])
    }

    /// A point of a surface.
    pub(crate) fn point(&self, surface: u32, face: u32, st: Vec2) -> SurfacePoint {
        self.shapes[surface as usize].point(face, st)
    }

    /// The brightest radiance of any light in any condition.
    pub(crate) fn brightest(&self) -> f32 {
        let all = self.lights.iter().flat_map(|light| light.radiance);
        all.map(Vec3::max_element).fold(0.0, f32::max)
    }
}
