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

pub(crate) use panels::{NAME, Panels};

use crate::error::Result;
use crate::irradiance;
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
use std::collections::BTreeSet;

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
/// Directions from which the light that a cell gets is gathered.
const NUM_SAMPLES: u32 = 256;

/// What cells reflect and send, and the share of all light that they send, if it is worth while.
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
    let step = received.len().div_ceil(MAX_RECEIVERS).max(1);
    let radiance = |(i, _): &Receiver| gaussians.radiances[*i as usize];
    let sum = |light: &dyn Fn(&(Receiver, Vec3)) -> Vec3| received.iter().map(light).sum::<Vec3>();
    let (sent, got) = (sum(&|of| radiance(&of.0)), sum(&|of| of.1));
    let dark = |sum: Vec3| DARK * sum.max_element() / received.len() as f32;
    let is_lit = |of: &&(Receiver, Vec3)| {
        radiance(&of.0).min_element() > dark(sent) && of.1.min_element() > dark(got)
    };
    let compared = received.iter().step_by(step).filter(is_lit).copied();
    let (receivers, known): (Vec<Receiver>, Vec<Vec3>) = compared.unzip();
    let colors: Vec<Vec3> = receivers.iter().map(radiance).collect();
    let Some(hull) = Hull::around(received.iter().map(|(receiver, _)| receiver), up) else {
        return Ok(None);
    };
    let smoothing = Smoothing::new(&receivers);
    let rows = hull.seen_by(tracer, (&receivers, &smoothing), cameras, key)?;
    let albedos = hull.albedos(&receivers, &colors, &known);
    let cells: BTreeSet<usize> = rows.iter().flatten().map(|(cell, _)| *cell).collect();
    let surfaces: Vec<Receiver> = cells
        .iter()
        .zip(0..)
        .map(|(c, i)| (i, hull.surface(*c)))
        .collect();
    let light = irradiance::received(tracer, &surfaces, &gaussians.radiances, (NUM_SAMPLES, key))?;
    let mut reflected = vec![Vec3::ZERO; hull.num_cells()];
    for (cell, light) in cells.iter().zip(&light) {
        reflected[*cell] = albedos[hull.cell(*cell).face as usize] * *light;
    }
    let mut seen = vec![0.0; hull.num_cells()];
    for (cell, share) in rows.iter().flatten() {
        seen[*cell] += share / rows.len() as f64;
    }
    let may_shine: Vec<bool> = (seen.iter().enumerate())
        .map(|(number, seen)| hull.cell(number).face != FLOOR && *seen >= SEEN_TO_SHINE)
        .collect();
    let segments = Segments::of_colors(&colors, &smoothing);
    let channels = [0, 1, 2].map(|c| {
        let channel = |of: &[Vec3]| of.iter().map(|v| f64::from(v[c])).collect::<Vec<_>>();
        let equations = Equations {
            rows: &rows,
            radiances: &channel(&colors),
            known: &channel(&known),
            expected: &channel(&reflected),
            may_shine: &may_shine,
            segments: &segments.of,
            least: LEAST_OF_SEGMENT,
        };
        equations.fit()
    });
    let weigh = |of: &dyn Fn(&Fit) -> f64| {
        let [r, g, b] = channels.each_ref().map(|fit| of(fit) as f32);
        f64::from(luminance([r, g, b]))
    };
    let (share, explained) = (weigh(&|fit| fit.share), weigh(&|fit| fit.explained));
    if share < LEAST_SHARE || explained < LEAST_EXPLAINED {
        return Ok(None);
    }
    let found = cells.iter().zip(&light).map(|(&number, light)| {
        let x = Vec3::from_array(channels.each_ref().map(|fit| fit.x[number] as f32));
        let sent = x.min(reflected[number]);
        UnseenCell {
            number,
            albedo: sent / light.max(Vec3::splat(f32::MIN_POSITIVE)),
            reflected: sent,
            emitted: x - sent,
        }
    });
    Ok(Some((Panels::new(&hull, found), share)))
}

#[cfg(test)]
mod tests;
