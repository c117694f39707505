//! Light on what is right beside a lamp: a tube, a bar or a ball before a wall lights it far more
//! there than a few pixels away; a flat lamp in the plane of its mount does not light that at all.
//! Silhouettes of few pixels cannot tell one from the other.

use crate::evidence::{Evidence, Sight};
use crate::group::Group;
use eagpt_scene::color::luminance;
use eagpt_scene::median::median_of;
use eagpt_scene::plane::Plane;
use std::collections::HashMap;
use std::ops::RangeInclusive;

/// Distances from a lamp that are compared, in pixels; those next to it may show a part of it.
const NEAR: RangeInclusive<u32> = 2..=2;
const FAR: RangeInclusive<u32> = 5..=7;
/// Least number of pixels at each.
const MIN_PIXELS: usize = 6;
/// How much brighter it has to be near the lamp. Measured in twelve rooms: 0.9 to 1.1 around flat
/// lamps in their mounts, from 2.4 around bars and tubes before a wall.
const BRIGHTER: f32 = 1.25;

/// The surface beside a lamp.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Beside {
    /// Its plane.
    pub(crate) mount: Plane,
    /// Whether the lamp lights it.
    pub(crate) is_lit: bool,
}

impl Beside {
    /// That of the lamp of `group`, which may be mounted on it.
    pub(crate) fn new(evidence: &Evidence, group: &Group, mount: Plane) -> Self {
        let is_lit = lights_it(evidence, group);
        Self { mount, is_lit }
    }
}

/// Whether the lamp of `group` lights what views show beside it.
fn lights_it(evidence: &Evidence, group: &Group) -> bool {
    let ratios: Vec<f32> = group
        .by_view()
        .filter_map(|(view, members)| brighter(&evidence.sights[view], members))
        .collect();
    !ratios.is_empty() && median_of(ratios.into_iter()) > BRIGHTER
}

/// Luminance near pixels of a view over that farther away; `None` where it shows too few of them.
fn brighter(sight: &Sight, members: &[(u32, u32)]) -> Option<f32> {
    let mut away: HashMap<(u32, u32), u32> = HashMap::new();
    for (_, pixel) in members {
        let pixel = &sight.pixels[*pixel as usize];
        let around = |at: u32| at.saturating_sub(*FAR.end())..=at + *FAR.end();
        for y in around(pixel.y) {
            for x in around(pixel.x) {
                let distance = x.abs_diff(pixel.x).max(y.abs_diff(pixel.y));
                let least = away.entry((x, y)).or_insert(distance);
                *least = distance.min(*least);
            }
        }
    }
    let typical = |distances: RangeInclusive<u32>| {
        let dark = sight.pixels.iter().filter(|pixel| !pixel.lit.is_lit());
        let at: Vec<f32> = dark
            .filter(|pixel| {
                let distance = away.get(&(pixel.x, pixel.y));
                distance.is_some_and(|distance| distances.contains(distance))
            })
            .map(|pixel| luminance(pixel.radiance.to_array()))
            .collect();
        (at.len() >= MIN_PIXELS).then(|| median_of(at.into_iter()))
    };
    let (near, far) = (typical(NEAR)?, typical(FAR)?);
    (far > 0.0).then(|| near / far)
}
