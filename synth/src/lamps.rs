//! Lamps of a room: where they are and how much light leaves them, for what is compared with the
//! truth.

#[cfg(test)]
mod tests;

use crate::light::emitters::cosine_direction;
use crate::room::shape::Shape;
use crate::room::{LIFT, Room, Surface};
use eagpt_scene::rng::{Purpose, RandomKey};
use glam::{Vec2, Vec3};
use serde::Serialize;
use std::collections::BTreeMap;
use std::f32::consts::PI;

/// Rays from each face that say how much of its light meets the lamp itself.
const RAYS_OF_FACE: u32 = 4096;

/// Surfaces of one light that touch each other.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Lamp {
    /// The name of the light; with a number from 1 where that has several lamps.
    pub(crate) name: String,
    /// Corners of the axis-aligned box around its surfaces, metres.
    pub(crate) bounds_m: [Vec3; 2],
    /// Area of the faces that emit, m².
    pub(crate) area_m2: f32,
    /// Mean direction of the emission, weighted by area; shorter than 1 where faces differ, 0 for a
    /// ball.
    pub(crate) direction: Vec3,
    /// Linear Rec.709 radiance by condition; 0 where it is off.
    pub(crate) radiance: BTreeMap<String, Vec3>,
    /// Radiant flux that leaves it by condition: radiance × π × area, less what its own surfaces
    /// take in, as the inside of a shade does.
    pub(crate) power: BTreeMap<String, Vec3>,
}

/// All lamps of a room, in the order of their surfaces.
pub(crate) fn lamps(room: &Room, conditions: &[String]) -> Vec<Lamp> {
    let mut groups: Vec<(u32, Vec<u32>)> = Vec::new();
    for (index, surface) in (0..).zip(room.surfaces()) {
        let Some(light) = surface.light else { continue };
        let touches = |group: &(u32, Vec<u32>)| {
            let mut of = group
                .1
                .iter()
                .map(|&other| &room.surfaces()[other as usize]);
            group.0 == light && of.any(|other| touch(surface, other))
        };
        // A surface may join groups that did not touch before.
        let (joined, mut others): (Vec<_>, Vec<_>) = groups.into_iter().partition(touches);
        let mut members: Vec<u32> = joined.into_iter().flat_map(|group| group.1).collect();
        members.push(index);
        others.push((light, members));
        others.sort_by_key(|group| group.1[0]);
        groups = others;
    }
    let same_light = |light: u32| groups.iter().filter(move |group| group.0 == light);
    let mut numbers = BTreeMap::new();
    groups
        .iter()
        .map(|(light, surfaces)| {
            let number = numbers.entry(*light).or_insert(0);
            *number += 1;
            let name = &room.lights()[*light as usize].name;
            let name = match same_light(*light).count() {
                1 => name.clone(),
                _ => format!("{name}-{number}"),
            };
            lamp(room, conditions, name, surfaces)
        })
        .collect()
}

fn lamp(room: &Room, conditions: &[String], name: String, surfaces: &[u32]) -> Lamp {
    let shapes = surfaces
        .iter()
        .map(|&of| &room.surfaces()[of as usize].shape);
    let boxes = shapes.map(Shape::bounds);
    let around = |[low, high]: [Vec3; 2], [l, h]: [Vec3; 2]| [low.min(l), high.max(h)];
    let (mut area_m2, mut leaving_m2, mut direction) = (0.0, 0.0, Vec3::ZERO);
    for &surface in surfaces {
        let shape = &room.surfaces()[surface as usize].shape;
        for face in 0..shape.num_faces() {
            let area = shape.area(face);
            if room.emitted(surface, face).is_none() || area == 0.0 {
                continue;
            }
            let (share, mean) = leaving(room, surface, face, surfaces);
            area_m2 += area;
            leaving_m2 += area * share;
            direction += mean * area;
        }
    }
    let light = room.surfaces()[surfaces[0] as usize].light;
    let radiance = |condition: usize| {
        light.map_or(Vec3::ZERO, |light| {
            room.lights()[light as usize].radiance[condition]
        })
    };
    let by_condition = |factor: f32| {
        let all = conditions.iter().cloned().enumerate();
        all.map(|(index, name)| (name, radiance(index) * factor))
            .collect()
    };
    Lamp {
        name,
        bounds_m: boxes.reduce(around).unwrap_or_default(),
        area_m2,
        direction: direction / area_m2.max(f32::MIN_POSITIVE),
        radiance: by_condition(1.0),
        power: by_condition(PI * leaving_m2),
    }
}

/// The share of a face's light that does not meet the lamp's own surfaces, and the mean of its
/// normals.
fn leaving(room: &Room, surface: u32, face: u32, lamp: &[u32]) -> (f32, Vec3) {
    let key = RandomKey::new(0, Purpose::Simulate, u32::MAX - 2);
    let shape = &room.surfaces()[surface as usize].shape;
    let (mut free, mut normals) = (0, Vec3::ZERO);
    for ray in 0..RAYS_OF_FACE {
        let [u0, u1, u2, u3] = key.stream(surface * 8 + face, ray).next_uniforms();
        let point = shape.point(face, shape.uniform_st(face, Vec2::new(u0, u1)));
        let direction = cosine_direction(point.normal, Vec2::new(u2, u3));
        let origin = point.position + point.normal * LIFT;
        let meets = |&other: &u32| {
            let shape = &room.surfaces()[other as usize].shape;
            let range = [LIFT, f32::INFINITY];
            shape.meet(origin, direction, range).is_some()
        };
        free += u32::from(!lamp.iter().any(meets));
        normals += point.normal;
    }
    let num = RAYS_OF_FACE as f32;
    (free as f32 / num, normals / num)
}

fn touch(a: &Surface, b: &Surface) -> bool {
    let ([a0, a1], [b0, b1]) = (a.shape.bounds(), b.shape.bounds());
    (a0 - LIFT).cmple(b1).all() && (b0 - LIFT).cmple(a1).all()
}
