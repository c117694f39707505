//! Light that coats mirror: directions by their facets and towards lights, weighted by the balance
//! heuristic (Veach 1997). Facets have GGX's distribution with Smith's masking (Walter 2007).

use super::emitters::Receiver;
use super::path::{Lighting, MAX_BOUNCES, PathSample};
use super::points::Points;
use crate::room::{Gloss, Hit, MAX_CONDITIONS, PerCondition};
use glam::{Mat3, Vec2, Vec3};
use std::f32::consts::{PI, TAU};

/// Coats that mirror each other, at most.
const MAX_MIRRORS: u32 = 3;
/// α of facets, at least: smoother ones are mirrors to a camera.
const LEAST_ALPHA: f32 = 1e-3;

/// A point of a coat that is seen from one direction.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Coat {
    gloss: Gloss,
    alpha: f32,
    /// Tangent, bitangent and normal.
    world_from_local: Mat3,
    /// Unit direction to the eye, local.
    out: Vec3,
}

impl Coat {
    /// The coat of a surface of unit normal `normal`, met by a ray of the unit `direction`.
    pub(crate) fn new(direction: Vec3, normal: Vec3, gloss: Gloss) -> Self {
        let (tangent, bitangent) = normal.any_orthonormal_pair();
        Self {
            gloss,
            alpha: (gloss.roughness * gloss.roughness).max(LEAST_ALPHA),
            world_from_local: Mat3::from_cols(tangent, bitangent, normal),
            out: -Vec3::new(
                direction.dot(tangent),
                direction.dot(bitangent),
                direction.dot(normal).min(-1e-4),
            ),
        }
    }

    /// A unit direction that a facet mirrors to the eye, and its weight: Fresnel's reflectance and
    /// the masking of the facets, which are chosen by their visible area (Heitz 2018). `None` where
    /// a facet mirrors into the surface. `uniform` are numbers in [0, 1).
    pub(crate) fn sample(&self, uniform: Vec2) -> Option<(Vec3, Vec3)> {
        let Self { alpha, out, .. } = *self;
        // The hemisphere that is seen of the facets stretched to a ball: a disc, half of it bent.
        let stretched = Vec3::new(alpha * out.x, alpha * out.y, out.z).normalize();
        let radius = uniform.x.sqrt();
        let (sin, cos) = (TAU * uniform.y).sin_cos();
        let share = 0.5 * (1.0 + stretched.z);
        let x = radius * cos;
        let flat = (1.0 - x * x).max(0.0).sqrt();
        // `along` is to lie in the plane of the normal.
        let (across, along) = match Vec3::Z.cross(stretched).try_normalize() {
            Some(level) => (level, stretched.cross(level)),
            None => stretched.any_orthonormal_pair(),
        };
        let y = (1.0 - share) * flat + share * radius * sin;
        let z = (1.0 - x * x - y * y).max(0.0).sqrt();
        let bent = across * x + along * y + stretched * z;
        let facet = Vec3::new(alpha * bent.x, alpha * bent.y, bent.z.max(0.0)).normalize();
        let facing = out.dot(facet);
        let incoming = 2.0 * facing * facet - out;
        if incoming.z <= 0.0 {
            return None;
        }
        let weight = self.gloss.at(facing) * self.masking(incoming);
        Some(((self.world_from_local * incoming).normalize(), weight))
    }

    /// Share of the light from the unit `towards` that the eye sees, per steradian and cosine
    /// included, and the density with which [`Self::sample`] chooses that direction.
    pub(crate) fn evaluate(&self, towards: Vec3) -> (Vec3, f32) {
        let incoming = self.world_from_local.transpose() * towards;
        let Some(facet) = (incoming + self.out).try_normalize() else {
            return (Vec3::ZERO, 0.0);
        };
        if incoming.z <= 0.0 || facet.z <= 0.0 {
            return (Vec3::ZERO, 0.0);
        }
        let alpha2 = self.alpha * self.alpha;
        let spread = (facet.x * facet.x + facet.y * facet.y) / alpha2 + facet.z * facet.z;
        let num_facets = 1.0 / (PI * alpha2 * spread * spread);
        let seen = 1.0 / (1.0 + self.hidden(self.out));
        let density = num_facets * seen / (4.0 * self.out.z);
        let facing = self.out.dot(facet);
        (
            self.gloss.at(facing) * (self.masking(incoming) * density),
            density,
        )
    }

    /// Part of the facets seen by the eye that light from the local `incoming` reaches.
    fn masking(&self, incoming: Vec3) -> f32 {
        let seen = 1.0 + self.hidden(self.out);
        seen / (seen + self.hidden(incoming))
    }

    /// Smith's Λ of a local direction.
    fn hidden(&self, w: Vec3) -> f32 {
        let tangent2 = (w.x * w.x + w.y * w.y) / (w.z * w.z);
        0.5 * ((1.0 + self.alpha * self.alpha * tangent2).sqrt() - 1.0)
    }
}

impl Lighting<'_> {
    /// One sample of the light that the coat `gloss` at `hit` mirrors against the unit `direction`,
    /// in each condition, of which further coats may mirror a part. `path` is that of the point's
    /// own irradiance, `uniform` are two more numbers in [0, 1).
    pub(crate) fn mirrored(
        &self,
        hit: &Hit,
        (direction, gloss): (Vec3, Gloss),
        (points, (path, uniform)): (&Points, (PathSample, Vec2)),
    ) -> PerCondition {
        let mut light = [Vec3::ZERO; MAX_CONDITIONS];
        let mut throughput = Vec3::ONE;
        let (mut hit, mut direction, mut gloss, mut uniform) = (*hit, direction, gloss, uniform);
        // Behind all that the path itself, and those of earlier mirrors, may take.
        let paths = |mirror: u32| path.block + 2 * MAX_BOUNCES * mirror;
        let own = paths(MAX_MIRRORS + 1);
        for mirror in 1..=MAX_MIRRORS {
            let coat = Coat::new(direction, hit.normal, gloss);
            let at = Receiver::of(&hit);
            let [a, b, c, _] = points.block(path.sample, own + MAX_MIRRORS + mirror);
            for (condition, light) in light.iter_mut().enumerate().take(self.emitters.len()) {
                *light += throughput * self.glint(condition, (&coat, &at), Vec3::new(a, b, c));
            }
            let Some((towards, weight)) = coat.sample(uniform) else {
                break;
            };
            let Some(next) = self.room.meet(at.position, towards) else {
                break;
            };
            let path = PathSample {
                block: paths(mirror),
                ..path
            };
            let emitted = self.room.emitted(next.surface, next.face);
            let next_gloss = self.room.material(next.surface).gloss;
            let next_gloss = next_gloss.filter(|_| emitted.is_none());
            let beneath = next_gloss.map_or(Vec3::ONE, |gloss| {
                Vec3::ONE - gloss.at(next.normal.dot(-towards))
            });
            let (_, from_facets) = coat.evaluate(towards);
            let seen = self.reflected(&next, points, path);
            for (condition, light) in light.iter_mut().enumerate().take(self.emitters.len()) {
                let emits = emitted.is_some_and(|emitted| emitted[condition] != Vec3::ZERO);
                let share = if emits {
                    from_facets / (from_facets + self.emitters[condition].pdf(&at, &next))
                } else {
                    1.0
                };
                *light += throughput * weight * seen[condition] * beneath * share;
            }
            throughput *= weight;
            let Some(next_gloss) = next_gloss else {
                break;
            };
            let [a, b, ..] = points.block(path.sample, own + mirror);
            (hit, direction, gloss, uniform) = (next, towards, next_gloss, Vec2::new(a, b));
        }
        light
    }

    /// One sample of the light that a coat mirrors straight from lights, weighted against what its
    /// facets find.
    fn glint(&self, condition: usize, (coat, at): (&Coat, &Receiver), uniform: Vec3) -> Vec3 {
        let Some(sample) = self.emitters[condition].sample(self.room, at, uniform) else {
            return Vec3::ZERO;
        };
        let (value, from_facets) = coat.evaluate(sample.direction);
        if value == Vec3::ZERO || !self.room.is_free(at.position, sample.position) {
            return Vec3::ZERO;
        }
        sample.radiance * value / (sample.pdf + from_facets)
    }
}
