//! Directions towards lights.

mod visible;

use crate::room::shape::{Ball, Drum, Shape};
use crate::room::{Hit, LIFT, Room};
use eagpt_scene::color::luminance;
use glam::{Vec2, Vec3};
use std::f32::consts::{PI, TAU};
use visible::{Arc, Cone};

/// All faces that emit in one condition.
#[derive(Debug, Clone)]
pub(crate) struct Emitters {
    all: Vec<Emitter>,
    /// Index into `all` of each surface's first face, plus one; 0 for surfaces that do not emit.
    of_surface: Vec<u32>,
}

#[derive(Debug, Clone, Copy)]
struct Emitter {
    surface: u32,
    face: u32,
    radiance: Vec3,
    luminance: f32,
    area: f32,
    centre: Vec3,
    /// Nothing of it is farther from its centre than this.
    reach: f32,
    kind: EmitterShape,
}

#[derive(Debug, Clone, Copy)]
enum EmitterShape {
    /// Emits to one side of the plane through its centre, which this normal points to.
    Flat(Vec3),
    Ball(Ball),
    /// The outside of a drum.
    Mantle(Drum),
    Other,
}

/// A point that asks for light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Receiver {
    /// Position, lifted off its surface.
    pub(crate) position: Vec3,
    /// Unit normal.
    pub(crate) normal: Vec3,
}

/// A direction in which a light may be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct LightSample {
    /// Unit direction from the point asked about.
    pub(crate) direction: Vec3,
    /// The point of the light, lifted off its surface.
    pub(crate) position: Vec3,
    /// Density of the direction, per steradian.
    pub(crate) pdf: f32,
    /// Radiance that comes from there, if nothing is in between.
    pub(crate) radiance: Vec3,
}

impl Receiver {
    /// The point of a hit.
    pub(crate) fn of(hit: &Hit) -> Self {
        Self {
            position: hit.position + hit.normal * LIFT,
            normal: hit.normal,
        }
    }
}

impl Emitters {
    /// Emitters of a condition.
    pub(crate) fn new(room: &Room, condition: usize) -> Self {
        let mut all = Vec::new();
        let mut of_surface = Vec::with_capacity(room.surfaces().len());
        for (index, surface) in room.surfaces().iter().enumerate() {
            let (first, index) = (all.len(), index as u32);
            for face in 0..surface.shape.num_faces() {
                let radiance = room.emitted_in(condition, index, face);
                let area = surface.shape.area(face);
                if radiance == Vec3::ZERO || area == 0.0 {
                    continue;
                }
                all.push(Emitter {
                    surface: index,
                    face,
                    radiance,
                    luminance: luminance(radiance.to_array()),
                    area,
                    centre: centre(&surface.shape, face),
                    reach: 0.5 * (surface.shape.bounds()[1] - surface.shape.bounds()[0]).length(),
                    kind: kind(&surface.shape, face),
                });
            }
            of_surface.push(if all.len() > first {
                first as u32 + 1
            } else {
                0
            });
        }
        Self { all, of_surface }
    }

    /// Chooses a direction towards a light, about in proportion to the light it would bring;
    /// `uniform` are three numbers in [0, 1).
    pub(crate) fn sample(
        &self,
        room: &Room,
        receiver: &Receiver,
        uniform: Vec3,
    ) -> Option<LightSample> {
        let total: f32 = self.all.iter().map(|e| e.weight(receiver)).sum();
        if total <= 0.0 {
            return None;
        }
        let (mut left, mut chosen) = (uniform.z * total, None);
        for emitter in &self.all {
            let weight = emitter.weight(receiver);
            if weight > 0.0 {
                chosen = Some((emitter, weight));
                if left < weight {
                    break;
                }
                left -= weight;
            }
        }
        let (emitter, weight) = chosen?;
        let sample = emitter.sample(room, receiver.position, uniform.truncate())?;
        Some(LightSample {
            pdf: sample.pdf * weight / total,
            ..sample
        })
    }

    /// Density with which [`Self::sample`] chooses the direction to `hit`, per steradian; 0 for
    /// surfaces that do not emit.
    pub(crate) fn pdf(&self, receiver: &Receiver, hit: &Hit) -> f32 {
        let first = self.of_surface[hit.surface as usize];
        if first == 0 {
            return 0.0;
        }
        let emitters = &self.all[first as usize - 1..];
        let Some(emitter) = emitters
            .iter()
            .take_while(|e| e.surface == hit.surface)
            .find(|e| e.face == hit.face)
        else {
            return 0.0;
        };
        let total: f32 = self.all.iter().map(|e| e.weight(receiver)).sum();
        let weight = emitter.weight(receiver);
        if weight <= 0.0 {
            return 0.0;
        }
        weight / total * emitter.pdf(receiver.position, hit)
    }
}

impl Emitter {
    /// Approximate irradiance at a point without occlusion; 0 only where there can be none.
    #[inline]
    fn weight(&self, receiver: &Receiver) -> f32 {
        let offset = receiver.position - self.centre;
        let distance2 = offset.length_squared();
        let distance = distance2.sqrt();
        let seen = match &self.kind {
            EmitterShape::Flat(normal) => {
                let height = offset.dot(*normal);
                if height <= 0.0 {
                    return 0.0;
                }
                // Close by, the middle says little of the rest.
                self.area * (height / distance).max(0.2)
            }
            EmitterShape::Ball(_) => 0.25 * self.area,
            EmitterShape::Mantle(drum) => {
                let along = drum.axes.z_axis.dot(offset) / distance;
                self.area / PI * (1.0 - along * along).max(0.04).sqrt()
            }
            EmitterShape::Other => 0.5 * self.area,
        };
        // Of a light whose sphere lies half below the horizon only a part is received; of one
        // wholly below nothing does.
        let cosine = -receiver.normal.dot(offset) / distance;
        let above = (cosine + self.reach / distance).clamp(0.0, 1.0);
        self.luminance * seen * above / distance2.max(0.25 * self.area)
    }

    fn sample(&self, room: &Room, position: Vec3, uniform: Vec2) -> Option<LightSample> {
        if let EmitterShape::Ball(ball) = self.kind
            && let Some(cone) = Cone::of(&ball, position)
        {
            let direction = cone.direction(uniform);
            let distance = cone.distance(direction, ball.radius);
            let on_ball = position + direction * distance;
            return Some(LightSample {
                direction,
                position: on_ball + (on_ball - ball.centre).normalize() * LIFT,
                pdf: cone.pdf(),
                radiance: self.radiance,
            });
        }
        let shape = &room.surfaces()[self.surface as usize].shape;
        let (uniform, share) = match &self.kind {
            EmitterShape::Mantle(drum) => {
                let arc = Arc::of(drum, position);
                (uniform.with_x(arc.turn(uniform.x)), arc.share)
            }
            _ => (uniform, 1.0),
        };
        let point = shape.point(self.face, shape.uniform_st(self.face, uniform));
        let offset = point.position - position;
        let distance = offset.length();
        let direction = offset / distance;
        let cosine = -direction.dot(point.normal);
        (cosine > 0.0 && distance > 0.0).then(|| LightSample {
            direction,
            position: point.position + point.normal * LIFT,
            pdf: distance * distance / (cosine * self.area * share),
            radiance: self.radiance,
        })
    }

    fn pdf(&self, position: Vec3, hit: &Hit) -> f32 {
        if let EmitterShape::Ball(ball) = &self.kind
            && let Some(cone) = Cone::of(ball, position)
        {
            return cone.pdf();
        }
        let cosine = hit
            .normal
            .dot((position - hit.position).normalize_or_zero());
        if cosine <= 0.0 {
            return 0.0;
        }
        let share = match &self.kind {
            EmitterShape::Mantle(drum) => {
                let arc = Arc::of(drum, position);
                if !arc.contains(hit.st.x) {
                    return 0.0;
                }
                arc.share
            }
            _ => 1.0,
        };
        hit.distance * hit.distance / (cosine * self.area * share)
    }
}

fn centre(shape: &Shape, face: u32) -> Vec3 {
    match shape {
        Shape::Ball(ball) => ball.centre,
        Shape::Drum(drum) if face < 2 => drum.base + drum.axes.z_axis * (0.5 * drum.height),
        Shape::Drum(drum) => {
            drum.base + drum.axes.z_axis * if face == 2 { 0.0 } else { drum.height }
        }
        _ => shape.point(face, Vec2::splat(0.5)).position,
    }
}

fn kind(shape: &Shape, face: u32) -> EmitterShape {
    match shape {
        Shape::Ball(ball) => EmitterShape::Ball(*ball),
        Shape::Drum(drum) if face == 0 => EmitterShape::Mantle(*drum),
        Shape::Drum(_) if face == 1 => EmitterShape::Other,
        _ => EmitterShape::Flat(shape.point(face, Vec2::splat(0.5)).normal),
    }
}

/// A direction about the unit `normal` with density cos θ / π (Malley's method).
pub(crate) fn cosine_direction(normal: Vec3, uniform: Vec2) -> Vec3 {
    let (tangent, bitangent) = normal.any_orthonormal_pair();
    let radius = uniform.x.sqrt();
    let (sin, cos) = (TAU * uniform.y).sin_cos();
    let height = (1.0 - uniform.x).sqrt();
    (tangent * (radius * cos) + bitangent * (radius * sin) + normal * height).normalize()
}

/// Density of [`cosine_direction`], per steradian.
pub(crate) fn cosine_pdf(normal: Vec3, direction: Vec3) -> f32 {
    normal.dot(direction).max(0.0) / PI
}
