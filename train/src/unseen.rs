//! Light from where no view looks.
//!
//! Captures leave parts of a room out, as the ceiling over the photographer. No ray finds what
//! shines there, downlights or the sky, and albedos would pay for it; and light that goes there
//! never comes back. It is told by surfaces of one material, whose albedo is the same wherever they
//! are: rays from them that meet nothing say how much each sees of every cell of the hull around
//! the scene ([`hull`]), and the radiance of cells is that which explains why surfaces are brighter
//! where they see more of them ([`fit`]), or what the mean albedo of the scene would reflect. Cells
//! that are seen are put into the scene as surfaces that reflect, and those that are brighter shine
//! as well ([`panels`]).

mod fit;
mod hull;
mod panels;
mod reflected;
mod view_factors;

pub(crate) use panels::Panels;

use crate::error::Result;
use crate::irradiance::smooth::Smoothing;
use crate::segments::Segments;
use eagpt_scene::color::luminance;
use eagpt_scene::rng::RandomKey;
use eagpt_scene::{Camera, Gaussians};
use eagpt_trace::Tracer;
use eagpt_trace::transport::matrix::Receiver;
use fit::{Equations, Fit};
use glam::Vec3;
use hull::{FLOOR, Hull};
use panels::UnseenCell;
use reflected::Compared;
use std::collections::{BTreeMap, BTreeSet};

/// Receivers that are compared, at most: differences between them are few.
const MAX_RECEIVERS: usize = 16_384;
/// Light of single receivers below this part of the mean is noise.
const DARK: f32 = 0.02;
/// Receivers of a surface of one material, at least.
const LEAST_OF_SEGMENT: usize = 30;
/// Part of all light, at least, that cells bring beyond what they reflect, and part of the
/// differences within materials that it explains, for them to shine.
const LEAST_SHARE: f64 = 0.02;
const LEAST_EXPLAINED: f64 = 0.02;
/// Mean share of their cosine-weighted directions in which receivers see a cell, at least, for it
/// to shine: the light of what few see can be anything.
const SEEN_TO_SHINE: f64 = 1e-3;
/// The cells that close the room, and the share of all light that they send, if it is worth while.
/// `received` is the light that Gaussians get of all that is known, and their surfaces.
///
/// # Errors
/// If the device fails.
pub(crate) fn find(
    tracer: &dyn Tracer,
    gaussians: &Gaussians,
    received: &[(Receiver, Vec3)],
    (cameras, up): (&[Camera], Vec3),
    key: RandomKey,
) -> Result<Option<(Panels, f64)>> {
    let places: Vec<Vec3> = received.iter().map(|((_, at), _)| at.position).collect();
    let Some(hull) = Hull::around(&places, up) else {
        return Ok(None);
    };
    let compared = compared(gaussians, received);
    let smoothing = Smoothing::new(&compared.receivers);
    let surfaces = (compared.receivers.as_slice(), &smoothing);
    let rows = view_factors::seen_by(&hull, tracer, surfaces, cameras, key)?;
    let mut seen = BTreeMap::new();
    for (cell, share) in rows.iter().flatten() {
        *seen.entry(*cell).or_insert(0.0) += share / rows.len() as f64;
    }
    if seen.is_empty() {
        return Ok(None);
    }
    let scene = (tracer, gaussians.radiances.as_slice());
    let lit = reflected::expected(&hull, seen.keys().copied(), scene, &compared, key)?;
    let may_shine = |(cell, seen): (&usize, &f64)| {
        let may = hull.cell(*cell).face != FLOOR && *seen >= SEEN_TO_SHINE;
        may.then_some(*cell)
    };
    let may_shine: BTreeSet<usize> = seen.iter().filter_map(may_shine).collect();
    let segments = Segments::of_colors(&compared.radiances, &smoothing);
    let fits = [0, 1, 2].map(|c| {
        let channel = |of: &[Vec3]| of.iter().map(|v| f64::from(v[c])).collect::<Vec<_>>();
        let expected = lit
            .iter()
            .map(|(cell, lit)| (*cell, f64::from(lit.reflected[c])));
        let equations = Equations {
            rows: &rows,
            radiances: &channel(&compared.radiances),
            known: &channel(&compared.known),
            expected: &expected.collect(),
            may_shine: &may_shine,
            segments: &segments.of,
            least: LEAST_OF_SEGMENT,
        };
        equations.fit()
    });
    let weigh = |of: &dyn Fn(&Fit) -> f64| {
        let channels = fits.each_ref().map(|fit| of(fit) as f32);
        f64::from(luminance(channels))
    };
    let (share, explained) = (weigh(&|fit| fit.share), weigh(&|fit| fit.explained));
    if share < LEAST_SHARE || explained < LEAST_EXPLAINED {
        return Ok(None);
    }
    let found = lit.iter().map(|(&number, lit)| {
        let x = Vec3::from_array(fits.each_ref().map(|fit| fit.x[&number] as f32));
        let reflected = x.min(lit.reflected);
        UnseenCell {
            number,
            albedo: reflected / lit.irradiance.max(Vec3::splat(f32::MIN_POSITIVE)),
            reflected,
            emitted: x - reflected,
        }
    });
    Ok(Some((Panels::new(&hull, found), share)))
}

/// Some of the receivers, those that are lit.
fn compared(gaussians: &Gaussians, received: &[(Receiver, Vec3)]) -> Compared {
    let step = received.len().div_ceil(MAX_RECEIVERS).max(1);
    let radiance = |of: &(Receiver, Vec3)| gaussians.radiances[of.0.0 as usize];
    let least = |light: &dyn Fn(&(Receiver, Vec3)) -> Vec3| {
        let sum: Vec3 = received.iter().map(light).sum();
        DARK * sum.max_element() / received.len() as f32
    };
    let (sent, got) = (least(&radiance), least(&|of| of.1));
    let is_lit =
        |of: &&(Receiver, Vec3)| radiance(of).min_element() > sent && of.1.min_element() > got;
    let some: Vec<_> = received.iter().step_by(step).filter(is_lit).collect();
    Compared {
        receivers: some.iter().map(|of| of.0).collect(),
        radiances: some.iter().map(|of| radiance(of)).collect(),
        known: some.iter().map(|of| of.1).collect(),
    }
}

#[cfg(test)]
mod tests;
