//! Light from where no view looks.
//!
//! Captures leave parts of a room out, as the ceiling over the photographer. What shines there,
//! downlights or the sky, lights what photographs show, and no ray finds it: albedos would pay for
//! its light. It is told by surfaces of one material, whose albedo is the same wherever they are:
//! rays from them that meet nothing say how much each sees of every part of the hull around the
//! scene ([`hull`]), and the radiance of those parts is the least that explains why surfaces are
//! brighter where they see more of them ([`fit`]). Parts that shine are put into the scene.

mod fit;
mod hull;
mod panels;

pub(crate) use panels::{NAME, Panels};

use crate::error::Result;
use crate::irradiance::smooth::Smoothing;
use crate::segments::Segments;
use eagpt_scene::Gaussians;
use eagpt_scene::color::luminance;
use eagpt_scene::rng::RandomKey;
use eagpt_trace::Tracer;
use eagpt_trace::transport::matrix::Receiver;
use fit::{Equations, Fit};
use glam::Vec3;
use hull::Hull;

/// Receivers that are compared, at most: differences between them are few.
const MAX_RECEIVERS: usize = 16_384;
/// Light of single receivers below this part of the mean is noise.
const DARK: f32 = 0.02;
/// Receivers of a surface of one material, at least.
const LEAST_OF_SEGMENT: usize = 30;
/// Part of all light, at least, that has to come from where no view looks, and part of the
/// differences within materials that it has to explain. What unseen surfaces reflect comes to 2 %
/// and 1 %, in eight rooms whose lamps views show; downlights that none shows to 4 % and 4 % and
/// more, in three.
const LEAST_SHARE: f64 = 0.03;
const LEAST_EXPLAINED: f64 = 0.03;

/// The light that comes from where no view looks, if it is worth it: from parts of the hull, and
/// which share of the light it is. `received` is the light that Gaussians get of all that is known,
/// and their surfaces.
///
/// # Errors
/// If the device fails.
pub(crate) fn find(
    tracer: &dyn Tracer,
    gaussians: &Gaussians,
    received: &[(Receiver, Vec3)],
    up: Vec3,
    key: RandomKey,
) -> Result<Option<(Panels, f64)>> {
    let step = received.len().div_ceil(MAX_RECEIVERS).max(1);
    let radiance = |(i, _): &Receiver| gaussians.radiances[*i as usize];
    let mean = |light: &dyn Fn(&(Receiver, Vec3)) -> Vec3| {
        let all = received.iter().map(|of| luminance(light(of).to_array()));
        all.sum::<f32>() / received.len().max(1) as f32
    };
    let (sent, got) = (mean(&|of| radiance(&of.0)), mean(&|of| of.1));
    let is_lit = |of: &&(Receiver, Vec3)| {
        radiance(&of.0).min_element() > DARK * sent && of.1.min_element() > DARK * got
    };
    let compared = received.iter().step_by(step).filter(is_lit).copied();
    let (receivers, known): (Vec<Receiver>, Vec<Vec3>) = compared.unzip();
    let colors: Vec<Vec3> = receivers.iter().map(radiance).collect();
    let Some(hull) = Hull::around(&receivers, up) else {
        return Ok(None);
    };
    let smoothing = Smoothing::new(&receivers);
    let rows = hull.seen_by(tracer, (&receivers, &smoothing), key)?;
    let segments = Segments::of_colors(&colors, &smoothing);
    let channels = [0, 1, 2].map(|c| {
        let equations = Equations {
            rows: &rows,
            radiances: &colors
                .iter()
                .map(|color| f64::from(color[c]))
                .collect::<Vec<_>>(),
            known: &known
                .iter()
                .map(|light| f64::from(light[c]))
                .collect::<Vec<_>>(),
            segments: &segments.of,
            least: LEAST_OF_SEGMENT,
        };
        equations.fit(hull.num_cells())
    });
    let weigh = |of: &dyn Fn(&Fit) -> f64| {
        let [r, g, b] = channels.each_ref().map(|fit| of(fit) as f32);
        f64::from(luminance([r, g, b]))
    };
    let (share, explained) = (weigh(&|fit| fit.share), weigh(&|fit| fit.explained));
    if share < LEAST_SHARE || explained < LEAST_EXPLAINED {
        return Ok(None);
    }
    let light = |cell: usize| Vec3::from_array(channels.each_ref().map(|fit| fit.x[cell] as f32));
    let radiances: Vec<Vec3> = (0..hull.num_cells()).map(light).collect();
    Ok(Some((Panels::new(&hull, &radiances), share)))
}

#[cfg(test)]
mod tests;
