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

mod alike;
mod candidates;
mod clear;
mod evidence;
mod fit;
mod group;
mod hood;
mod mount;
mod parts;
mod pixels;
mod place;
mod seen;
pub mod shape;

pub use evidence::Evidence;
pub use mount::freed;

use candidates::{Candidate, explained};
use eagpt_scene::color::luminance;
use eagpt_scene::lamps::{Lamp, LampShape, Lamps};
use eagpt_scene::{Gaussians, SceneEdit};
use eagpt_trace::transport::EMISSION_THRESHOLD;
use eagpt_trace::{TraceError, Tracer};
use fit::shape_search::Fit;
use glam::Vec3;
use group::Group;
use hood::Hood;
use pixels::measure::Measured;
use pixels::silhouette::Gaps;
use shape::Shape;
use shape::faces::Solid;

/// Lamps and the scene that they take the place of.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Found {
    /// The lamps, those with most power first. Of several lights each lamp is as in the one that
    /// shows most pixels of it.
    pub lamps: Lamps,
    /// How the scene makes room for their Gaussians, which are fixed.
    pub edit: SceneEdit,
    /// Each lamp in the lights that it shines in, by their indices.
    in_lights: Vec<Vec<(usize, Lamp)>>,
    /// The lamp of each fixed Gaussian that shines, by its index.
    lamp_of: Vec<Option<usize>>,
}

impl Found {
    /// The lamps that shine in a light.
    pub fn in_light(&self, light: usize) -> Lamps {
        let emitting = |lamp: &Vec<(usize, Lamp)>| Some(in_light(lamp, light)?.clone());
        Lamps {
            lamps: self.in_lights.iter().filter_map(emitting).collect(),
        }
    }

    /// Radiance of each fixed Gaussian in a light; `None` where it does not shine.
    pub fn radiances(&self, light: usize) -> Vec<Option<Vec3>> {
        let fixed = self.edit.fixed.radiances.iter().zip(&self.lamp_of);
        let radiance = |(own, lamp): (&Vec3, &Option<usize>)| {
            let here = in_light(&self.in_lights[(*lamp)?], light)?;
            let main = Vec3::from(self.lamps.lamps[(*lamp)?].radiance);
            // A lamp without red has none in any light.
            let share = Vec3::from(here.radiance) / main.max(Vec3::splat(f32::MIN_POSITIVE));
            Some(*own * share)
        };
        fixed.map(radiance).collect()
    }
}

/// A lamp as it is in a light, if it shines there.
fn in_light(lamp: &[(usize, Lamp)], light: usize) -> Option<&Lamp> {
    let here = lamp.iter().find(|(index, _)| *index == light)?;
    Some(&here.1)
}

/// Finds the lamps that views show in the scene of `gaussians`, which `tracer` traces; `up` is the
/// unit vector upwards. `progress` is told how many groups of lit pixels are fitted, of how many.
///
/// # Errors
/// If the device fails.
pub fn find(
    evidence: &Evidence,
    gaussians: &Gaussians,
    up: Vec3,
    tracer: &dyn Tracer,
    progress: &mut dyn FnMut(usize, usize),
) -> Result<Found, TraceError> {
    let mut all = explained(evidence, up, progress);
    alike::share_shapes(evidence, &mut all);
    let mut candidates = Vec::new();
    for candidate in all {
        let pixels = (candidate.light, &candidate.group);
        if seen::is_seen(evidence, pixels, &candidate.fit, tracer)? {
            candidates.push(candidate);
        }
    }
    let power =
        |c: &Candidate| luminance(place::power(&c.fit.shape, c.measured.radiance).to_array());
    candidates.sort_by(|a, b| power(b).total_cmp(&power(a)));
    let glowing = || candidates.iter().filter(|c| !c.is_clean);
    let hoods = candidates.iter().map(|c| match c.is_clean {
        true => Hood::of(evidence, c, up, tracer, glowing()),
        false => Ok(None),
    });
    let hoods = hoods.collect::<Result<Vec<_>, _>>()?;
    let shades: Vec<Hood> = hoods.iter().flatten().cloned().collect();
    let is_of_shade =
        |c: &Candidate| !c.is_clean && shades.iter().any(|s| s.has(c.fit.shape.centre()));
    let (candidates, hoods): (Vec<Candidate>, Vec<Option<Hood>>) = (candidates.into_iter())
        .zip(hoods)
        .filter(|(c, _)| !is_of_shade(c))
        .unzip();
    let shapes: Vec<Shape> = candidates.iter().map(|c| c.fit.shape).collect();
    let clean = || candidates.iter().filter(|c| c.is_clean);
    let clean_fits: Vec<Fit> = clean().map(|c| c.fit).collect();
    let mut keep = vec![true; gaussians.len()];
    let nums = clear::replaced(gaussians, &candidates, &mut keep);
    shades
        .iter()
        .for_each(|shade| shade.clear(gaussians, &mut keep));
    let discs: Vec<Gaussians> = (candidates.iter().zip(&hoods))
        .filter(|(c, _)| c.is_clean)
        .map(|(c, hood)| {
            let pixel = pixel_width(evidence, &c.group);
            let is_glass = c.fit.gaps == Gaps::Bars || place::is_on_wall(&c.fit.shape, up);
            let own = place::discs(&c.fit.shape, c.measured.radiance, is_glass, pixel);
            let shade = hood.iter().flat_map(Hood::discs);
            own.iter().chain(shade).collect()
        })
        .collect();
    let mut edit = SceneEdit {
        keep,
        moved: Vec::new(),
        fixed: discs.iter().flat_map(Gaussians::iter).collect(),
    };
    let mounted = clean().filter(|c| c.fit.gaps == Gaps::Seen);
    let faces = mounted.flat_map(|c| {
        let views = c.group.by_view();
        let eyes: Vec<Vec3> = views
            .map(|(view, _)| evidence.sights[view].origin())
            .collect();
        let solid = Solid::of_shape(&c.fit.shape);
        mount::faces(&solid, &eyes, gaussians, gaussians.len())
    });
    mount::free_all(gaussians, gaussians.len(), faces, &mut edit);
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
    let names = shape::names::names(
        &shapes,
        up,
        heights().fold(f32::INFINITY, f32::min),
        heights().fold(f32::NEG_INFINITY, f32::max),
    );
    let (mut lamps, mut in_lights, mut lamp_of) = (Vec::new(), Vec::new(), Vec::new());
    let mut discs = discs.iter();
    for (((c, hood), name), num) in candidates.iter().zip(&hoods).zip(names).zip(nums) {
        if let Some(discs) = c.is_clean.then(|| discs.next()).flatten() {
            let shines = discs.emissions.iter().map(|e| *e > EMISSION_THRESHOLD);
            lamp_of.extend(shines.map(|shines| shines.then_some(lamps.len())));
        } else if num == 0 {
            // Where there is neither a shape nor what training left, there is no lamp.
            continue;
        }
        let in_light = |group: &Group, measured: &Measured| {
            let lamp = lamp(evidence, c, (group, measured), name.clone(), num);
            let shade = hood.as_ref().map_or(0.0, Hood::reach);
            Lamp { shade, ..lamp }
        };
        let own = in_light(&c.group, &c.measured);
        let others = c.others.iter();
        let others = others.map(|(light, group, measured)| (*light, in_light(group, measured)));
        in_lights.push([(c.light, own.clone())].into_iter().chain(others).collect());
        lamps.push(own);
    }
    Ok(Found {
        lamps: Lamps { lamps },
        edit,
        in_lights,
        lamp_of,
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

/// The lamp of a candidate in the light that has these pixels of it.
fn lamp(
    evidence: &Evidence,
    c: &Candidate,
    (group, measured): (&Group, &Measured),
    name: String,
    num_gaussians: usize,
) -> Lamp {
    let r = c.fit.shape.rotation();
    let views = group.by_view().map(|(view, _)| view);
    Lamp {
        name,
        shape: if c.is_clean {
            c.fit.shape.kind()
        } else {
            LampShape::Other
        },
        centre: c.fit.shape.centre().to_array(),
        rotation: [r.w, r.x, r.y, r.z],
        size: c.fit.shape.size().to_array(),
        one_sided: c.is_clean && c.fit.shape.flat().is_some(),
        bars: c.is_clean && c.fit.gaps == Gaps::Bars,
        shade: 0.0,
        area: c.fit.shape.area(),
        radiance: measured.radiance.to_array(),
        power: place::power(&c.fit.shape, measured.radiance).to_array(),
        num_gaussians,
        views: views.map(|v| evidence.sights[v].name.clone()).collect(),
        num_pixels: group.members.len(),
        deviation: measured.deviation,
        factor: [1.0; 3],
    }
}
