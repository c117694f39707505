//! Light that leaves a surface: next-event estimation and cosine-weighted bounces, weighted by the
//! balance heuristic (Veach 1997).

use super::cache::Cache;
use super::emitters::{Emitters, Receiver, cosine_direction, cosine_pdf};
use super::points::Points;
use crate::room::{Hit, MAX_CONDITIONS, PerCondition, Room};
use glam::{Vec2, Vec3};

/// Paths end at random from this bounce on.
const ROULETTE_FROM: u32 = 4;
/// Paths end here at the latest. Behind the roulette few come so far; what they carry is far below
/// noise.
pub(crate) const MAX_BOUNCES: u32 = 32;
/// Fours of numbers for each bounce.
const BLOCKS: u32 = 2;

/// Inputs of light transport.
#[derive(Debug, Clone)]
pub(crate) struct Lighting<'a> {
    /// The room.
    pub(crate) room: &'a Room,
    /// Its lights in each condition.
    pub(crate) emitters: Vec<Emitters>,
    /// Light that is known already; without it every path is followed to its end.
    pub(crate) cache: Option<Cache>,
}

impl<'a> Lighting<'a> {
    /// All light by paths.
    pub(crate) fn new(room: &'a Room) -> Self {
        let conditions = 0..room.num_conditions();
        Self {
            room,
            emitters: conditions.map(|c| Emitters::new(room, c)).collect(),
            cache: None,
        }
    }

    /// One sample of the light that reaches a white surface at `hit` and leaves it by diffuse
    /// reflection, in each condition: irradiance over π. `block` is the first unused four of
    /// `points`; at most `max_bounces` surfaces reflect.
    pub(crate) fn irradiance(&self, hit: &Hit, points: &Points, path: PathSample) -> PerCondition {
        let mut total = [Vec3::ZERO; MAX_CONDITIONS];
        let mut throughput = Vec3::ONE;
        let num = self.emitters.len();
        let mut is_on = [true; MAX_CONDITIONS];
        let mut at = Receiver::of(hit);
        for bounce in 0..path.max_bounces {
            let block = path.block + BLOCKS * bounce;
            let [a, b, c, roulette] = points.block(path.sample, block);
            for condition in 0..num {
                if is_on[condition] {
                    let uniform = Vec3::new(a, b, c);
                    total[condition] += throughput * self.direct(condition, &at, uniform);
                }
            }
            let [a, b, ..] = points.block(path.sample, block + 1);
            let direction = cosine_direction(at.normal, Vec2::new(a, b));
            let Some(next) = self.room.meet(at.position, direction) else {
                break;
            };
            if let Some(emitted) = self.room.emitted(next.surface, next.face) {
                for condition in 0..num {
                    if is_on[condition] && emitted[condition] != Vec3::ZERO {
                        let weight = self.weight_of_bounce(condition, &at, (direction, &next));
                        total[condition] += throughput * emitted[condition] * weight;
                        is_on[condition] = false;
                    }
                }
                if !is_on[..num].contains(&true) {
                    break;
                }
            }
            throughput *= self.room.reflectance(next.surface, next.face, next.st);
            if let Some(known) = self.cached(&next) {
                for condition in 0..num {
                    if is_on[condition] {
                        total[condition] += throughput * known[condition];
                    }
                }
                break;
            }
            if bounce + 1 >= ROULETTE_FROM {
                let survival = throughput.max_element().min(1.0);
                if roulette >= survival {
                    break;
                }
                throughput /= survival;
            }
            at = Receiver::of(&next);
        }
        total
    }

    /// Irradiance over π that the cache knows.
    fn cached(&self, hit: &Hit) -> Option<PerCondition> {
        self.cache.as_ref()?.irradiance(hit)
    }

    /// One sample of all the light that comes straight from lights, over π, in each condition: of
    /// directions towards lights and of a bounce.
    pub(super) fn lit(&self, at: &Receiver, uniform: Vec3, bounce: [f32; 2]) -> PerCondition {
        let mut total = [Vec3::ZERO; MAX_CONDITIONS];
        let direction = cosine_direction(at.normal, bounce.into());
        let met = self.room.meet(at.position, direction);
        for (condition, total) in (0..self.emitters.len()).zip(&mut total) {
            *total = self.direct(condition, at, uniform);
            let found = met.as_ref();
            let found = found.and_then(|hit| self.found_by_bounce(condition, at, (direction, hit)));
            *total += found.map_or(Vec3::ZERO, |(emitted, weight)| emitted * weight);
        }
        total
    }

    /// One sample of the light that comes straight from lights, over π, weighted against what
    /// bounces find.
    pub(super) fn direct(&self, condition: usize, at: &Receiver, uniform: Vec3) -> Vec3 {
        let Some(sample) = self.emitters[condition].sample(self.room, at, uniform) else {
            return Vec3::ZERO;
        };
        let from_bounce = cosine_pdf(at.normal, sample.direction);
        if from_bounce == 0.0 || !self.room.is_free(at.position, sample.position) {
            return Vec3::ZERO;
        }
        sample.radiance * (from_bounce / (sample.pdf + from_bounce))
    }

    /// Light that a bounce along `direction` finds at its end, if that is a light, and its weight.
    pub(super) fn found_by_bounce(
        &self,
        condition: usize,
        at: &Receiver,
        (direction, hit): (Vec3, &Hit),
    ) -> Option<(Vec3, f32)> {
        let emitted = self.room.emitted_in(condition, hit.surface, hit.face);
        let weight = || self.weight_of_bounce(condition, at, (direction, hit));
        (emitted != Vec3::ZERO).then(|| (emitted, weight()))
    }

    /// The weight of light that a bounce along `direction` finds at `hit`.
    fn weight_of_bounce(
        &self,
        condition: usize,
        at: &Receiver,
        (direction, hit): (Vec3, &Hit),
    ) -> f32 {
        let from_bounce = cosine_pdf(at.normal, direction);
        let from_light = self.emitters[condition].pdf(at, hit);
        // A bounce along the horizon has no density of its own to speak of.
        from_bounce / (from_bounce + from_light).max(f32::MIN_POSITIVE)
    }

    /// Light that a point seen along `direction` sends back: what it emits, and one sample of what
    /// it reflects diffusely.
    pub(crate) fn reflected(&self, hit: &Hit, points: &Points, path: PathSample) -> PerCondition {
        let albedo = self.room.albedo(hit.surface, hit.face, hit.st);
        let emitted = self.room.emitted(hit.surface, hit.face);
        let known = self.cached(hit);
        let mut light = known.unwrap_or_else(|| self.irradiance(hit, points, path));
        for (condition, light) in light.iter_mut().enumerate() {
            let own = emitted.map_or(Vec3::ZERO, |e| e[condition]);
            *light = if own == Vec3::ZERO {
                *light * albedo
            } else {
                own
            };
        }
        light
    }
}

/// Random numbers and path depth of a sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct PathSample {
    /// Number of the sample.
    pub(crate) sample: u32,
    /// First four of numbers.
    pub(crate) block: u32,
    /// Surfaces that reflect, at most.
    pub(crate) max_bounces: u32,
}
