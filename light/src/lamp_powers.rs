//! Lamps that send more light than views see.
//!
//! Of a bulb in a shade, or in a fixture that is open upwards, cameras see the shade and the edge
//! of the opening, and a lamp of that radiance is too weak: the walls that it lights would have to
//! reflect more than others of their material. How much stronger it is, they tell: its factor is
//! that which makes their albedos alike, in all channels the same, as walls near lamps tell light
//! better than colour. A lamp is never weaker than what views saw of it.

use crate::alike::{Compared, Expected, Row};
use crate::irradiance::{self, NoisyLight};
use eagpt_scene::color::luminance;
use eagpt_scene::rng::RandomKey;
use eagpt_scene::{Camera, Gaussians, Lamp, LampShape, LightGroups};
use eagpt_trace::surfel::SurfelSet;
use eagpt_trace::transport::light_list::LightList;
use eagpt_trace::transport::matrix::{Groups, Receiver, Tracing};
use eagpt_trace::{TraceError, Tracer};
use glam::Vec3;
use std::collections::BTreeMap;

/// Directions that find the light of each lamp.
const NUM_SAMPLES: u32 = 256;
/// A lamp's light at a receiver below this part of all is noise.
const LEAST_PART: f32 = 1e-4;
/// Part of the light of a receiver that is known, at least, whatever noise leaves of it.
const LEAST_KNOWN: f64 = 0.02;
/// Weight of light that views did not see.
const WEIGHT: f64 = 1e-3;
/// A factor up to here may come of other errors; one beyond the second is not believed.
const LEAST_FACTOR: f32 = 1.15;
const MOST_FACTOR: f64 = 4.0;
/// Part of all light that a lamp has to bring as views saw it: that of weaker ones, as of spots in
/// a shade that are lamps of their own, can be anything.
const LEAST_SHARE: f64 = 0.01;
/// Cosine to the normal of a flat lamp from which on a view sees it from before, views that have to
/// and the deviation between all, at most, where what they saw is all that the lamp sends.
const BEFORE: f32 = 0.7;
const LEAST_BEFORE: usize = 3;
const MOST_DEVIATION: f32 = 0.1;
/// Views from anywhere that have to agree, their deviation at most, and the largest of their
/// cosines in the least one. Openings of shades in two rooms have .07 to .3, spots in a ceiling
/// .02.
const LEAST_AGREEING: usize = 3;
const AGREEING_DEVIATION: f32 = 0.03;
const LEAST_SPREAD: f32 = 1.25;
/// Pixels from the edge of a picture within which a lamp may be cut.
const AT_EDGE: f32 = 1.0;
/// Rounds in which factors and surfaces of one material, which are told by albedo, follow each
/// other.
const NUM_ROUNDS: u32 = 3;

/// Whether views from `eyes` saw all that a lamp sends: it is solid and shines to all sides, or is
/// flat, and sends most where some of them are, as much as others say, or the same to all of them.
/// An opening of a shade shows its bulb to views along its axis alone, and to others more or less
/// of what that lights.
pub fn is_measured(lamp: &Lamp, eyes: impl Iterator<Item = Vec3>) -> bool {
    if lamp.shape.is_solid() && !lamp.one_sided {
        return true;
    }
    let normal = lamp.world_from_lamp() * Vec3::Z;
    let cosine = |eye: Vec3| (eye - lamp.centre()).normalize_or_zero().dot(normal);
    let cosines: Vec<f32> = eyes.map(cosine).filter(|cosine| *cosine > 0.0).collect();
    let num_before = cosines.iter().filter(|cosine| **cosine >= BEFORE).count();
    let [least, most] = [f32::min, f32::max].map(|of| cosines.iter().copied().reduce(of));
    let is_spread = most >= least.map(|least| LEAST_SPREAD * least);
    let agree = is_spread && cosines.len() >= LEAST_AGREEING;
    let is_flat = lamp.one_sided && lamp.shape != LampShape::Other;
    is_flat
        && (num_before >= LEAST_BEFORE && lamp.deviation <= MOST_DEVIATION
            || agree && lamp.deviation <= AGREEING_DEVIATION)
}

/// Whether a flat lamp may go on beyond the edges of pictures: of views whose `cameras` these are
/// none shows some corner of it.
pub fn is_cut(lamp: &Lamp, cameras: &[Camera]) -> bool {
    let half = 0.5 * Vec3::from(lamp.size);
    let signs = [-1.0, 1.0];
    let corners = signs.map(|x| signs.map(|y| Vec3::new(x, y, 0.0)));
    let shows = |camera: &Camera, corner: Vec3| {
        let place = lamp.centre() + lamp.world_from_lamp() * (half * corner);
        let at = camera.project(place);
        let is_clear = |at: f32, size: u32| at > AT_EDGE && at < size as f32 - AT_EDGE;
        at.z > 0.0 && is_clear(at.x, camera.width) && is_clear(at.y, camera.height)
    };
    let is_shown = |corner: &Vec3| cameras.iter().any(|camera| shows(camera, *corner));
    lamp.shape == LampShape::Panel && !corners.as_flattened().iter().all(is_shown)
}

/// Whether one of `lamps` is a bulb in this opening of a shade: the light is that lamp's, and none
/// is hidden.
pub fn shows_bulb(opening: &Lamp, lamps: &[Lamp]) -> bool {
    let near = 0.5 * opening.size[0].max(opening.size[1]);
    let mut others = lamps.iter().filter(|lamp| lamp.shape.is_solid());
    others.any(|lamp| lamp.name != opening.name && opening.distance(lamp.centre()) <= near)
}

/// The factor, 1 or more, of the light of each of `lights`, in which what emits of `gaussians` is
/// divided, `[lights]`: of those that are not `free` it is 1. `received` is the light that
/// Gaussians get of all that is known.
///
/// # Errors
/// If the device fails.
pub fn factors(
    (tracer, gaussians): (&dyn Tracer, &Gaussians),
    (lights, free): (&LightGroups, &[bool]),
    received: &[(Receiver, Vec3)],
    key: RandomKey,
) -> Result<Vec<f32>, TraceError> {
    let num = lights.names.len();
    if num == 0 {
        return Ok(Vec::new());
    }
    let compared = Compared::new(gaussians, received);
    let direct = direct((tracer, gaussians), lights, &compared, key)?;
    let all = luminances(&compared.known);
    let rows = rows(&direct, num, &all);
    let known = |(row, all): (&Row, &f64)| {
        let others = all - row.iter().map(|(_, part)| part).sum::<f64>();
        others.max(LEAST_KNOWN * all)
    };
    let known: Vec<f64> = rows.iter().zip(&all).map(known).collect();
    let mut brought = vec![0.0; num];
    for (lamp, part) in rows.iter().flatten() {
        brought[*lamp] += part;
    }
    let least = LEAST_SHARE * all.iter().sum::<f64>();
    let expected = free.iter().enumerate().map(|(lamp, free)| {
        let is_free = *free && brought[lamp] >= least;
        let most = if is_free { MOST_FACTOR } else { 1.0 };
        let expected = Expected {
            radiance: 1.0,
            bounds: [1.0, most],
            weight: WEIGHT,
        };
        (lamp, expected)
    });
    let light = Light {
        direct: &direct,
        rows: &rows,
        known: &known,
    };
    let certain = |factor: f32| if factor < LEAST_FACTOR { 1.0 } else { factor };
    let factors = light.fit(&compared, &expected.collect());
    Ok(factors.into_iter().map(certain).collect())
}

/// Light of lamps whose factors are looked for.
struct Light<'a> {
    /// Irradiance over π that receivers get straight from each, `[receivers, lamps]` …
    direct: &'a [Vec3],
    /// … and its luminance, where it is no noise, `[receivers]`.
    rows: &'a [Row],
    /// Luminance of what receivers get of all else, `[receivers]`.
    known: &'a [f64],
}

impl Light<'_> {
    /// The factor of each lamp, which are expected to be these; all that is known of `compared` has
    /// the light of the expected ones already.
    fn fit(&self, compared: &Compared, expected: &BTreeMap<usize, Expected>) -> Vec<f32> {
        let num = expected.len();
        let radiances = luminances(&compared.radiances);
        let usual = |lamp: usize| expected[&lamp].radiance as f32;
        let mut factors: Vec<f32> = (0..num).map(usual).collect();
        for _ in 0..NUM_ROUNDS {
            let more = self.direct.chunks(num).map(|parts| {
                let parts = parts.iter().zip(&factors).enumerate();
                let more = parts.map(|(lamp, (part, f))| *part * (f - usual(lamp)));
                more.sum::<Vec3>()
            });
            let segments = compared.segments(&more.collect::<Vec<_>>());
            let fit = compared.fit(
                (&segments, true),
                self.rows,
                [&radiances, self.known],
                expected,
            );
            factors = (0..num).map(|lamp| fit.x[&lamp] as f32).collect();
        }
        factors
    }
}

pub(crate) fn luminances(of: &[Vec3]) -> Vec<f64> {
    let luminances = of.iter().map(|v| luminance(v.to_array()));
    luminances.map(f64::from).collect()
}

/// The luminance of light that receivers get straight from each of `num` lamps, `[receivers, num]`,
/// where it is no noise beside `all` that they get, `[receivers]`.
pub(crate) fn rows(direct: &[Vec3], num: usize, all: &[f64]) -> Vec<Row> {
    let row = |(lamps, all): (&[Vec3], &f64)| -> Row {
        let parts = luminances(lamps).into_iter().enumerate();
        let parts = parts.filter(|(_, part)| *part > f64::from(LEAST_PART) * all);
        parts.collect()
    };
    direct.chunks(num).zip(all).map(row).collect()
}

/// Irradiance over π that compared receivers get straight from each of `lights`, smoothed,
/// `[receivers, lights]`.
pub(crate) fn direct(
    (tracer, gaussians): (&dyn Tracer, &Gaussians),
    lights: &LightGroups,
    compared: &Compared,
    key: RandomKey,
) -> Result<Vec<Vec3>, TraceError> {
    let directions = irradiance::directions(NUM_SAMPLES);
    let receivers = compared.receivers.as_slice();
    let matrix = tracer.trace_transport(receivers, directions, key)?;
    let list = LightList::new(&SurfelSet::new(gaussians));
    let tracing = Tracing {
        receivers,
        directions,
        key,
        lights: list.as_ref(),
    };
    let num = lights.names.len();
    let groups = Groups {
        num,
        of: &lights.of,
    };
    let parts = matrix.direct_of_groups(&tracing, &gaussians.radiances, groups);
    Ok(NoisyLight::direct(&matrix, directions).smoothed_parts(&compared.smoothing, &parts, num))
}

#[cfg(test)]
mod tests;
