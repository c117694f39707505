//! Luminaires that no view looks into: a floor lamp with an opaque shade, a bowl that lights the
//! ceiling.
//!
//! Cameras see them from the side, and no mask shows their bulbs; what these light would have to
//! reflect more than the rest of it. Bulbs are looked for at places that something near hides from
//! all cameras (`places`): their light leaves upwards, downwards or both ways, in cones that end
//! before the first camera, and is that which makes surfaces of one material alike (`search`). A
//! row of them may be a strip in a cove (`strip`). The light that they bring past the scene that
//! is there says how strong they are.

mod bulb;
mod gain;
mod nearby;
mod places;
mod search;
mod strip;

use crate::alike::{Compared, Expected};
use crate::hidden_lamps::HiddenLamps;
use crate::lamp_powers::{direct, luminances, rows};
use bulb::{Bulb, Found};
use eagpt_scene::lamps::emits;
use eagpt_scene::light_basis::NO_LIGHT;
use eagpt_scene::median::median_of;
use eagpt_scene::rng::RandomKey;
use eagpt_scene::{Camera, Gaussians, Lamp, LightGroups, SceneEdit};
use eagpt_trace::transport::matrix::Receiver;
use eagpt_trace::{Device, TraceError, Tracer};
use glam::Vec3;
use search::Search;
use std::collections::BTreeMap;

/// Radiance of surfaces that tell of bulbs, in parts of the median, at least: what is darker tells
/// more of its shadows.
const DARK: f32 = 0.2;
/// Depth behind a surface up to which a disc is of it, in the reach of what hides a bulb.
const SHALLOW: f32 = 0.05;
/// Weight of light that no view shows.
const WEIGHT: f64 = 1e-3;
/// Power of a bulb in that of all lamps, at least: what is weaker is noise of one channel.
const LEAST_POWER: f32 = 1e-3;
/// Rounds in which intensities and surfaces of one material follow each other.
const NUM_ROUNDS: u32 = 3;

/// The bulbs of the luminaires in the scene of `gaussians`; `received` is the light that these get
/// of all that is known, and `up` the unit vector upwards.
///
/// # Errors
/// If the device fails.
pub fn find(
    (device, gaussians): (&Device, &Gaussians),
    (lamps, received): (&[Lamp], &[(Receiver, Vec3)]),
    (cameras, up): (&[Camera], Vec3),
    key: RandomKey,
) -> Result<HiddenLamps, TraceError> {
    let brightness = |of: &(Receiver, Vec3)| gaussians.radiances[of.0.0 as usize].max_element();
    let dark = DARK * median_of(received.iter().map(brightness));
    let bright = received.iter().filter(|of| brightness(of) > dark);
    let compared = Compared::new(gaussians, &bright.copied().collect::<Vec<_>>());
    let tracer = device.scene(gaussians)?;
    let surfaces = compared.receivers.iter().map(|(_, at)| at.position);
    let surfaces: Vec<Vec3> = surfaces.collect();
    let places = places::hidden(&*tracer, (&surfaces, lamps), (cameras, up))?;
    let reach = places.reach;
    let search = Search {
        tracer: &*tracer,
        compared: &compared,
        places: &places,
        up,
    };
    let found = search.find()?;
    let around = (up, reach);
    let dim: Vec<Vec<Bulb>> = (found.iter())
        .map(|of| of.bulbs(Vec3::ONE, around))
        .collect();
    let mut edit = SceneEdit::nothing(gaussians.len());
    let scene = (&*tracer, gaussians);
    for i in in_the_way(scene, &found, (cameras, up), reach)? {
        edit.keep[i] = false;
    }
    let cleared = edit.applied(gaussians);
    let near = places::NEAR * reach;
    let intensities = intensities((device, &cleared), (&found, &dim, near), &compared, key)?;
    let all: f32 = lamps.iter().map(Lamp::luminous_power).sum();
    let power = |bulbs: &[Bulb]| {
        let powers = bulbs.iter().map(|bulb| bulb.lamp.luminous_power());
        powers.sum::<f32>()
    };
    let bulbs: Vec<Bulb> = (found.iter().zip(intensities))
        .map(|(found, intensity)| found.bulbs(intensity, around))
        .filter(|bulbs| power(bulbs) > LEAST_POWER * all)
        .flatten()
        .collect();
    edit.fixed = bulbs.iter().flat_map(|bulb| bulb.discs.iter()).collect();
    Ok(HiddenLamps {
        edit,
        lamps: bulbs.into_iter().map(|bulb| bulb.lamp).collect(),
    })
}

/// The Gaussians that no camera sees and that are where light leaves a luminaire.
///
/// # Errors
/// If the device fails.
fn in_the_way(
    (tracer, gaussians): (&dyn Tracer, &Gaussians),
    found: &[Found],
    (cameras, up): (&[Camera], Vec3),
    reach: f32,
) -> Result<impl Iterator<Item = usize>, TraceError> {
    let is_within = |place: &Vec3| {
        found.iter().any(|of| {
            of.positions.iter().any(|position| {
                let offset = *place - *position;
                let direction = offset.normalize_or_zero();
                offset.length() < reach && places::is_open(direction.dot(up), of.cones)
            })
        })
    };
    let within = (0..gaussians.len()).filter(|i| is_within(&gaussians.positions[*i]));
    let within: Vec<usize> = within.collect();
    let at: Vec<Vec3> = within.iter().map(|i| gaussians.positions[*i]).collect();
    let seen = places::seen(tracer, &at, cameras, SHALLOW * reach)?;
    let unseen = within.into_iter().zip(seen).filter(|(_, seen)| !seen);
    Ok(unseen.map(|(i, _)| i))
}

/// The radiant intensities of what was `found`, by its `bulbs` of intensity 1. Receivers up to
/// `near` to one are of what hides it, and tell nothing of it.
fn intensities(
    (device, gaussians): (&Device, &Gaussians),
    (found, bulbs, near): (&[Found], &[Vec<Bulb>], f32),
    compared: &Compared,
    key: RandomKey,
) -> Result<Vec<Vec3>, TraceError> {
    let num = bulbs.len();
    if num == 0 {
        return Ok(Vec::new());
    }
    // All that emits already is one more light.
    let rest = |emission: &f32| match emits(*emission) {
        true => num as u32,
        false => NO_LIGHT,
    };
    let mut of: Vec<u32> = gaussians.emissions.iter().map(rest).collect();
    let bulbs = || {
        (0..)
            .zip(bulbs)
            .flat_map(|(light, of)| of.iter().map(move |bulb| (light, bulb)))
    };
    for (light, bulb) in bulbs() {
        let emissions = bulb.discs.emissions.iter();
        of.extend(emissions.map(|emission| if emits(*emission) { light } else { NO_LIGHT }));
    }
    let names = vec![String::new(); num + 1];
    let discs = bulbs().flat_map(|(_, bulb)| bulb.discs.iter());
    let scene: Gaussians = gaussians.iter().chain(discs).collect();
    let tracer = device.scene(&scene)?;
    let direct = direct(
        (&*tracer, &scene),
        &LightGroups { names, of },
        compared,
        key,
    )?;
    let of_bulb = |(_, surface): &Receiver, (part, found): (&Vec3, &Found)| {
        let is_near = |at: &Vec3| at.distance(surface.position) <= near;
        if found.positions.iter().any(is_near) {
            Vec3::ZERO
        } else {
            *part
        }
    };
    let parts = compared.receivers.iter().zip(direct.chunks(num + 1));
    let direct: Vec<Vec3> = parts
        .flat_map(|(at, parts)| parts.iter().zip(found).map(move |part| of_bulb(at, part)))
        .collect();
    let rows = rows(&direct, num, &luminances(&compared.known));
    let expected = Expected {
        radiance: 0.0,
        bounds: [0.0, f64::INFINITY],
        weight: WEIGHT,
    };
    let expected: BTreeMap<usize, Expected> = (0..num).map(|bulb| (bulb, expected)).collect();
    let mut intensities = vec![Vec3::ZERO; num];
    for _ in 0..NUM_ROUNDS {
        let more = direct.chunks(num).map(|parts| {
            let parts = parts.iter().zip(&intensities);
            parts
                .map(|(part, intensity)| *part * *intensity)
                .sum::<Vec3>()
        });
        let segments = compared.segments(&more.collect::<Vec<_>>());
        for channel in 0..3 {
            let light = compared.channel(channel);
            let light = light.each_ref().map(Vec::as_slice);
            let fit = compared.fit((&segments, true), &rows, light, &expected);
            for (bulb, intensity) in intensities.iter_mut().enumerate() {
                intensity[channel] = fit.x[&bulb] as f32;
            }
        }
    }
    Ok(intensities)
}

#[cfg(test)]
mod tests;
