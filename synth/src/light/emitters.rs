//! Directions towards lights.

use crate::room::shape::{Ball, Shape};
use crate::room::{Hit, LIFT, Room};
use eagpt_scene::color::luminance;
use glam::{Vec2, Vec3};
use std::f32::consts::{PI, TAU};

/// All faces that shine in one condition.
#[derive(Debug, Clone)]
pub struct Emitters {
    all: Vec<Emitter>,
    /// Index into `all` of each surface's first face, plus one; 0 for surfaces that do not shine.
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
    kind: Kind,
}

#[derive(Debug, Clone, Copy)]
enum Kind {
    /// Shines to one side of the plane through its centre, which this normal points to.
    Flat(Vec3),
    Ball(Ball),
    Round,
}

/// A direction in which a light may be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LightSample {
    /// Unit direction from the point asked about.
    pub direction: Vec3,
    /// The point of the light, lifted off its surface.
    pub position: Vec3,
    /// Density of the direction, per steradian.
    pub pdf: f32,
    /// Radiance that comes from there, if nothing is in between.
    pub radiance: Vec3,
}

impl Emitters {
    /// What shines in a condition.
    pub fn new(room: &Room, condition: usize) -> Self {
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

    /// Chooses a direction towards a light as seen from `position`, about in proportion to the light it would bring; `uniform` are three
    /// numbers in [0, 1).
    pub fn sample(&self, room: &Room, position: Vec3, uniform: Vec3) -> Option<LightSample> {
        let total: f32 = self.all.iter().map(|e| e.weight(position)).sum();
        if total <= 0.0 {
            return None;
        }
        let (mut left, mut chosen) = (uniform.z * total, None);
        for emitter in &self.all {
            let weight = emitter.weight(position);
            if weight > 0.0 {
                chosen = Some((emitter, weight));
                if left < weight {
                    break;
                }
                left -= weight;
            }
        }
        let (emitter, weight) = chosen?;
        let sample = emitter.sample(room, position, uniform.truncate())?;
        Some(LightSample {
            pdf: sample.pdf * weight / total,
            ..sample
        })
    }

    /// Density with which [`Self::sample`] chooses the direction from `position` to `hit`; 0 for what does not shine.
    pub fn pdf(&self, position: Vec3, hit: &Hit) -> f32 {
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
        let total: f32 = self.all.iter().map(|e| e.weight(position)).sum();
        let weight = emitter.weight(position);
        if weight <= 0.0 {
            return 0.0;
        }
        let cosine = hit
            .normal
            .dot((position - hit.position).normalize_or_zero());
        weight / total * emitter.pdf(position, hit.distance, cosine)
    }
}

impl Emitter {
    /// About the light that arrives at `position`, were nothing in between.
    #[inline]
    fn weight(&self, position: Vec3) -> f32 {
        let offset = position - self.centre;
        if let Kind::Flat(normal) = self.kind
            && offset.dot(normal) <= 0.0
        {
            return 0.0;
        }
        // Close to a light its middle says little: never nearer than its own size.
        self.luminance * self.area / offset.length_squared().max(0.25 * self.area)
    }

    fn sample(&self, room: &Room, position: Vec3, uniform: Vec2) -> Option<LightSample> {
        if let Kind::Ball(ball) = self.kind
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
        let point = shape.point(self.face, shape.uniform_st(self.face, uniform));
        let offset = point.position - position;
        let distance = offset.length();
        let direction = offset / distance;
        let cosine = -direction.dot(point.normal);
        (cosine > 0.0 && distance > 0.0).then(|| LightSample {
            direction,
            position: point.position + point.normal * LIFT,
            pdf: distance * distance / (cosine * self.area),
            radiance: self.radiance,
        })
    }

    fn pdf(&self, position: Vec3, distance: f32, cosine: f32) -> f32 {
        if let Kind::Ball(ball) = &self.kind
            && let Some(cone) = Cone::of(ball, position)
        {
            return cone.pdf();
        }
        if cosine <= 0.0 {
            return 0.0;
        }
        distance * distance / (cosine * self.area)
    }
}

/// The cone in which a sphere is seen from outside.
struct Cone {
    axis: Vec3,
    /// Distance of the sphere's middle.
    distance: f32,
    /// 1 − cosine of its half angle.
    gap: f32,
}

impl Cone {
    fn of(ball: &Ball, position: Vec3) -> Option<Self> {
        let offset = ball.centre - position;
        let distance = offset.length();
        let sin2 = (ball.radius / distance).powi(2);
        (sin2 < 1.0).then(|| Self {
            axis: offset / distance,
            distance,
            // 1 − cos = sin² / (1 + cos) keeps the digits of small angles.
            gap: sin2 / (1.0 + (1.0 - sin2).sqrt()),
        })
    }

    fn pdf(&self) -> f32 {
        1.0 / (TAU * self.gap)
    }

    fn direction(&self, uniform: Vec2) -> Vec3 {
        let cos = 1.0 - uniform.x * self.gap;
        let sin = (1.0 - cos * cos).max(0.0).sqrt();
        let (across, up) = (TAU * uniform.y).sin_cos();
        let (tangent, bitangent) = self.axis.any_orthonormal_pair();
        (tangent * (sin * up) + bitangent * (sin * across) + self.axis * cos).normalize()
    }

    /// Distance to the sphere along a direction of the cone.
    fn distance(&self, direction: Vec3, radius: f32) -> f32 {
        let along = direction.dot(self.axis) * self.distance;
        let aside2 = self.distance * self.distance - along * along;
        along - (radius * radius - aside2).max(0.0).sqrt()
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

fn kind(shape: &Shape, face: u32) -> Kind {
    match shape {
        Shape::Ball(ball) => Kind::Ball(*ball),
        Shape::Drum(_) if face < 2 => Kind::Round,
        _ => Kind::Flat(shape.point(face, Vec2::splat(0.5)).normal),
    }
}

/// A direction about the unit `normal` with density cos θ / π (Malley's method).
pub fn cosine_direction(normal: Vec3, uniform: Vec2) -> Vec3 {
    let (tangent, bitangent) = normal.any_orthonormal_pair();
    let radius = uniform.x.sqrt();
    let (sin, cos) = (TAU * uniform.y).sin_cos();
    let height = (1.0 - uniform.x).sqrt();
    (tangent * (radius * cos) + bitangent * (radius * sin) + normal * height).normalize()
}

/// Density of [`cosine_direction`], per steradian.
pub fn cosine_pdf(normal: Vec3, direction: Vec3) -> f32 {
    normal.dot(direction).max(0.0) / PI
}
