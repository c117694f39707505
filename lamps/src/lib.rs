//! Lamps of a scene: what masks of photographs show to shine, as clean surfaces of known power.
//!
//! Training gives pixels the right light from where cameras stand, by heaps of tilted discs that
//! overlap. What such a heap sends past the cameras, along the wall beside it, has no reason to be
//! right, and is what lights the wall. Here each lamp is made the simplest surface that explains
//! its silhouettes ([`mod@shape`]), with the radiance that gives the flux that the views measured,
//! and nothing before it that would hide it.
//!
//! - [`Evidence`]: lit pixels of the views, and where the trained scene has them.
//! - [`find`]: from there to [`Found`], clean lamps and what has to make room for them.

mod bars;
mod clear;
mod evidence;
mod fit;
mod group;
mod measure;
mod median;
mod names;
mod patches;
mod place;
mod search;
mod seen;
pub mod shape;
mod starts;

pub use evidence::Evidence;

use eagpt_scene::color::luminance;
use eagpt_scene::lamps::{Lamp, LampShape, Lamps};
use eagpt_scene::{Gaussian, Gaussians, SceneEdit};
use eagpt_trace::{TraceError, Tracer};
use fit::Fit;
use glam::Vec3;
use group::Group;
use patches::Gaps;
use shape::Shape;
use std::collections::BTreeMap;

/// Standard deviation of the flux between views beyond which there is no such lamp.
const MAX_DEVIATION: f32 = 0.5;
/// Least number of lit pixels over all views, and of views, of a lamp.
const MIN_PIXELS: usize = 6;
const MIN_VIEWS: usize = 2;
/// Share of its pixels on other lamps from which on a group is taken for a part of these.
const SHARE_ELSEWHERE: f32 = 0.5;

/// Lamps and the scene that they take the place of.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Found {
    /// The lamps, those with most power first.
    pub lamps: Lamps,
    /// How the scene makes room for their Gaussians, which are fixed.
    pub edit: SceneEdit,
}

/// A lamp under way.
struct Candidate {
    group: Group,
    fit: Fit,
    radiance: Vec3,
    deviation: f32,
    /// Whether its shape explains what the views show.
    is_clean: bool,
}

/// Finds the lamps that views show in the scene of `gaussians`, which `tracer` traces; `up` is the
/// unit vector upwards.
///
/// # Errors
/// If the device fails.
pub fn find(
    evidence: &Evidence,
    gaussians: &Gaussians,
    up: Vec3,
    tracer: &dyn Tracer,
) -> Result<Found, TraceError> {
    let mut candidates = Vec::new();
    for candidate in explained(evidence, up) {
        if seen::is_seen(evidence, &candidate.group, &candidate.fit.shape, tracer)? {
            candidates.push(candidate);
        }
    }
    let power = |c: &Candidate| luminance(place::power(&c.fit.shape, c.radiance).to_array());
    candidates.sort_by(|a, b| power(b).total_cmp(&power(a)));
    let shapes: Vec<Shape> = candidates.iter().map(|c| c.fit.shape).collect();
    let clean = || candidates.iter().filter(|c| c.is_clean);
    let clean_fits: Vec<Fit> = clean().map(|c| c.fit).collect();
    let mut keep = vec![true; gaussians.len()];
    let nums = clear::replaced(gaussians, &candidates, &mut keep);
    let mut moved: BTreeMap<u32, Gaussian> = BTreeMap::new();
    let mounted = clean().filter(|c| c.fit.gaps == Gaps::Seen);
    for flat in mounted.filter_map(|c| c.fit.shape.flat()) {
        for (i, gaussian) in clear::flatten_mount(gaussians, flat, &keep) {
            // Where mounts meet, that of the stronger lamp counts.
            moved.entry(i).or_insert(gaussian);
        }
    }
    let discs: Vec<Gaussians> = clean()
        .map(|c| place::discs(&c.fit.shape, c.radiance, pixel_width(evidence, &c.group)))
        .collect();
    let mut edit = SceneEdit {
        keep,
        moved: moved.into_iter().collect(),
        fixed: discs.iter().flat_map(Gaussians::iter).collect(),
    };
    if !clean_fits.is_empty() {
        clear::remove_what_hides(
            &tracer.device(),
            evidence,
            gaussians,
            &clean_fits,
            &mut edit,
        )?;
    }
    let heights = || gaussians.positions.iter().map(|p| p.dot(up));
    let names = names::names(
        &shapes,
        up,
        heights().fold(f32::INFINITY, f32::min),
        heights().fold(f32::NEG_INFINITY, f32::max),
    );
    let lamps = (candidates.iter().zip(names).zip(nums))
        // Where there is neither a shape nor what training left, there is no lamp.
        .filter(|((c, _), num)| c.is_clean || *num > 0)
        .map(|((c, name), num)| lamp(evidence, c, name, num))
        .collect();
    Ok(Found {
        lamps: Lamps { lamps },
        edit,
    })
}

/// Width of a pixel on the lamp in the views that see it nearest.
fn pixel_width(evidence: &Evidence, group: &Group) -> f32 {
    let mut widths: Vec<f32> = (group.members.iter())
        .map(|member| {
            let (sight, pixel) = evidence.pixel(member);
            sight.width(pixel)
        })
        .collect();
    widths.sort_unstable_by(f32::total_cmp);
    widths[widths.len() / 10]
}

/// The groups of lit pixels that a shape explains.
fn explained(evidence: &Evidence, up: Vec3) -> Vec<Candidate> {
    let mut groups = group::group(evidence);
    groups.sort_by_key(|group| std::cmp::Reverse(group.members.len()));
    let mut found: Vec<Candidate> = Vec::new();
    for group in groups {
        if group.members.len() < MIN_PIXELS || group.by_view().count() < MIN_VIEWS {
            continue;
        }
        let elsewhere = group.members.iter().filter(|member| {
            let (sight, pixel) = evidence.pixel(member);
            let meets = |c: &Candidate| {
                let shows = c.fit.shape.meet(sight.origin(), pixel.direction).is_some();
                // Bars and frames divide the lit pixels of a window.
                let is_pane =
                    c.fit.gaps == Gaps::Bars && clear::is_near(&c.fit.shape, sight.position(pixel));
                shows || is_pane
            };
            found.iter().any(meets)
        });
        if elsewhere.count() as f32 > SHARE_ELSEWHERE * group.members.len() as f32 {
            continue;
        }
        let Some(fit) = fit::fit(evidence, &group, up) else {
            continue;
        };
        let measured = match (fit.gaps, fit.shape.flat()) {
            (Gaps::Bars, Some(flat)) => bars::measure(evidence, &group, flat),
            _ => measure::measure(evidence, &group, &fit.shape),
        };
        if let Some(measured) = measured
            && measured.deviation <= MAX_DEVIATION
        {
            found.push(Candidate {
                is_clean: fit.is_clean(&group),
                group,
                fit,
                radiance: measured.radiance,
                deviation: measured.deviation,
            });
        }
    }
    found
}

fn lamp(evidence: &Evidence, c: &Candidate, name: String, num_gaussians: usize) -> Lamp {
    let r = c.fit.shape.rotation();
    let views = c.group.by_view().map(|(view, _)| view);
    Lamp {
        name,
        shape: match c.fit.shape {
            _ if !c.is_clean => LampShape::Other,
            Shape::Rectangle(_) | Shape::Ellipse(_) => LampShape::Panel,
            Shape::Ball { .. } => LampShape::Ball,
            Shape::Tube { .. } => LampShape::Tube,
        },
        centre: c.fit.shape.centre().to_array(),
        rotation: [r.w, r.x, r.y, r.z],
        size: c.fit.shape.size().to_array(),
        one_sided: c.is_clean && c.fit.shape.flat().is_some(),
        area: c.fit.shape.area(),
        radiance: c.radiance.to_array(),
        power: place::power(&c.fit.shape, c.radiance).to_array(),
        num_gaussians,
        views: views.map(|v| evidence.sights[v].name.clone()).collect(),
        num_pixels: c.group.members.len(),
        deviation: c.deviation,
        factor: [1.0; 3],
    }
}
