//! Light from where no view looks.
//!
//! Captures leave parts of a room out, as the ceiling over the photographer. No ray finds what
//! shines there, downlights or the sky, and albedos would pay for it; and light that goes there
//! never comes back. It is told by surfaces of one material, whose albedo is the same wherever they
//! are: rays from them that meet nothing say how much each sees of every cell of the hull around
//! the scene (`hull`), and the radiance of cells is that which explains why surfaces are brighter
//! where they see more of them (`Compared::fit`), or what the mean albedo of the scene would
//! reflect. Cells that are seen are put into the scene as surfaces that reflect, and those that are
//! brighter shine as well (`panels`).

pub(crate) mod hull;
mod panels;
mod reflected;
mod view_factors;

use crate::alike::{Compared, Expected, Fit};
use crate::hidden_lamps::HiddenLamps;
use crate::segments::Segments;
use eagpt_scene::color::luminance;
use eagpt_scene::rng::RandomKey;
use eagpt_scene::{Camera, Gaussians};
use eagpt_trace::transport::matrix::Receiver;
use eagpt_trace::{TraceError, Tracer};
use glam::Vec3;
use hull::{FLOOR, Hull};
use panels::{UnseenCell, panels};
use std::collections::{BTreeMap, BTreeSet};

/// Weight of light that is not expected of a cell. A third and three times of it change the light
/// found by a tenth.
const WEIGHT: f64 = 3e-3;
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
pub fn find(
    tracer: &dyn Tracer,
    gaussians: &Gaussians,
    received: &[(Receiver, Vec3)],
    (cameras, up): (&[Camera], Vec3),
    key: RandomKey,
) -> Result<Option<(HiddenLamps, f64)>, TraceError> {
    let places: Vec<Vec3> = received.iter().map(|((_, at), _)| at.position).collect();
    let Some(hull) = Hull::around(&places, up) else {
        return Ok(None);
    };
    let compared = Compared::new(gaussians, received);
    let rows = view_factors::seen_by(&hull, tracer, &compared, cameras, key)?;
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
    let segments = Segments::of_colors(&compared.radiances, &compared.smoothing);
    let fits = [0, 1, 2].map(|c| {
        let expected = lit.iter().map(|(cell, lit)| {
            let radiance = f64::from(lit.reflected[c]);
            let most = if may_shine.contains(cell) {
                f64::INFINITY
            } else {
                radiance
            };
            let expected = Expected {
                radiance,
                bounds: [0.0, most],
                weight: WEIGHT,
            };
            (*cell, expected)
        });
        let light = compared.channel(c);
        compared.fit(
            (&segments, false),
            &rows,
            light.each_ref().map(Vec::as_slice),
            &expected.collect(),
        )
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
    Ok(Some((panels((&hull, gaussians.len()), found), share)))
}

#[cfg(test)]
mod tests;
