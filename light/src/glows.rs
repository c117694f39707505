//! Surfaces that shine of themselves, as screens and patches of sun do, though no mask shows them.
//!
//! Masks are drawn by brightness, and a screen may be no brighter than the wall beside it. The light
//! that it receives tells it: even white reflects no more than that. Light of lamps that no view
//! shows makes surfaces brighter than the light known there as well, but it fades slowly; a screen
//! ends at its edge.

mod listed;
mod shade;
mod unlisted;

pub use listed::{lamp, sights};
pub use shade::join_as_shade;
pub use unlisted::unlisted;

use crate::irradiance::smooth::Smoothing;
use eagpt_scene::color::luminance;
use eagpt_scene::lamps::emits;
use eagpt_scene::median::median_of;
use eagpt_scene::{Gaussians, Gloss};
use eagpt_trace::transport::matrix::Receiver;
use glam::Vec3;
use std::collections::BTreeSet;

/// Radiance over that of a white surface in the same light from which on a Gaussian shines of
/// itself, if its neighbours do. In six rooms the noise of both makes .1 % of all surfaces
/// brighter, in spots of a few Gaussians.
const EXCESS: f32 = 1.5;
/// Gaussians of a surface, at least.
const LEAST: usize = 32;
/// Beyond the edge of a surface the excess is less than this part of that within. Walls lit by
/// hidden lamps: 0.41 and more; screens: 0.02 to 0.2; a lantern of paper: 0.35 to 0.36.
const MAX_BEYOND: f32 = 0.4;
/// Share of its Gaussians that may be glossy, at most: steel shows lamps.
const MAX_GLOSSY: f32 = 0.5;

/// A scene, and what is known of its surfaces.
pub struct Surfaces<'a> {
    /// The Gaussians.
    pub gaussians: &'a Gaussians,
    /// Number of Gaussians, the first ones, that are not of clean lamps.
    pub num_moving: usize,
    /// The Gaussians that cameras see, each once, with the irradiance over π there.
    pub received: &'a [(Receiver, Vec3)],
    /// Gloss of each Gaussian; empty where nothing is glossy.
    pub gloss: &'a [Gloss],
}

/// The Gaussians of each surface that shines of itself, ascending; one at the edges of two surfaces
/// is of both.
pub fn glows(surfaces: &Surfaces<'_>) -> Vec<Vec<usize>> {
    let gaussians = surfaces.gaussians;
    let may_shine = |i: usize| i < surfaces.num_moving && !emits(gaussians.emissions[i]);
    let received = surfaces.received.iter();
    let (receivers, white): (Vec<Receiver>, Vec<Vec3>) = received
        .copied()
        .filter(|((i, _), _)| may_shine(*i as usize))
        .unzip();
    let gaussian = |r: usize| receivers[r].0 as usize;
    let light = |r: usize| luminance(gaussians.radiances[gaussian(r)].to_array());
    let usual = median_of((0..receivers.len()).map(light));
    let excess: Vec<f32> = (white.iter().enumerate())
        .map(|(r, white)| light(r) / luminance(white.to_array()).max(f32::MIN_POSITIVE))
        .collect();
    let smoothing = Smoothing::new(&receivers);
    let near = |r: usize| smoothing.neighbours(r).iter().map(|(j, _)| *j as usize);
    let median = |of: &mut dyn Iterator<Item = usize>| median_of(of.map(|r| excess[r]));
    let is_bright: Vec<bool> = (0..receivers.len())
        .map(|r| light(r) > usual && excess[r] > EXCESS)
        .collect();
    let shines: Vec<bool> = (0..receivers.len())
        .map(|r| is_bright[r] && median(&mut near(r).chain([r])) > EXCESS)
        .collect();
    let is_glossy = |&&r: &&usize| {
        let gloss = surfaces.gloss.get(gaussian(r));
        gloss.is_some_and(|gloss| *gloss != Gloss::NONE)
    };
    // Most neighbours of what is at the edge are beyond it.
    let with_edge = |members: Vec<usize>| -> BTreeSet<usize> {
        let edge = members.iter().flat_map(|&r| near(r));
        edge.filter(|&r| is_bright[r])
            .chain(members.iter().copied())
            .collect()
    };
    let is_glow = |members: &BTreeSet<usize>| {
        let around: BTreeSet<usize> = members.iter().flat_map(|&r| near(r)).collect();
        let num_glossy = members.iter().filter(is_glossy).count();
        members.len() >= LEAST
            && num_glossy as f32 <= MAX_GLOSSY * members.len() as f32
            && median(&mut around.difference(members).copied())
                < MAX_BEYOND * median(&mut members.iter().copied())
    };
    let all = connected(&shines, near).into_iter().map(with_edge);
    all.filter(is_glow)
        .map(|members| members.into_iter().map(gaussian).collect())
        .collect()
}

/// The sets of receivers that shine, each connected by neighbours.
fn connected<N: Iterator<Item = usize>>(
    shines: &[bool],
    near: impl Fn(usize) -> N,
) -> Vec<Vec<usize>> {
    let mut is_known = vec![false; shines.len()];
    let mut all = Vec::new();
    for first in (0..shines.len()).filter(|&r| shines[r]) {
        if std::mem::replace(&mut is_known[first], true) {
            continue;
        }
        let mut members = vec![first];
        let mut next = 0;
        while let Some(&member) = members.get(next) {
            for r in near(member).filter(|&r| shines[r]) {
                if !std::mem::replace(&mut is_known[r], true) {
                    members.push(r);
                }
            }
            next += 1;
        }
        all.push(members);
    }
    all
}

#[cfg(test)]
mod tests;
