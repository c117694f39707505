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
mod cut;
mod evidence;
mod fit;
mod floaters;
mod group;
mod mount;
mod parts;
mod pixels;
mod place;
mod reflecting;
mod seen;
mod shade;
pub mod shape;
mod strays;

pub use evidence::Evidence;
pub use floaters::without_floaters;
pub use mount::freed;
pub use strays::{without_heaps, without_strays};

use candidates::{Candidate, explained};
use eagpt_scene::color::luminance;
use eagpt_scene::lamps::{Lamp, LampShape, Lamps, emits};
use eagpt_scene::{Gaussians, SceneEdit};
use eagpt_trace::{TraceError, Tracer};
use fit::shape_search::Fit;
use glam::Vec3;
use group::Group;
use pixels::measure::Measured;
use pixels::silhouette::Gaps;
use shade::Shade;
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

/// Lamps to look for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kinds {
    /// All.
    All,
    /// Balls, tubes and boxes of a few pixels without a shade or a glow about them, which training
    /// makes heaps of.
    Bare,
}

/// Finds the lamps of these kinds that views show in the scene of `gaussians`, which `tracer` traces;
/// `up` is the unit vector upwards. `progress` is told how many groups of lit pixels are fitted, of
/// how many.
///
/// # Errors
/// If the device fails.
pub fn find(
    (evidence, kinds): (&Evidence, Kinds),
    (gaussians, tracer): (&Gaussians, &dyn Tracer),
    up: Vec3,
    progress: &mut dyn FnMut(usize, usize),
) -> Result<Found, TraceError> {
    let mut candidates = seen_lamps(evidence, up, tracer, progress)?;
    put_up_shades(evidence, &mut candidates, up, tracer)?;
    reflecting::leave_reflecting(&mut candidates, &evidence.known);
    if kinds == Kinds::Bare {
        candidates.retain(|candidate| candidate.is_bare(evidence));
    }
    let power =
        |c: &Candidate| luminance(place::power(&c.fit.shape, c.measured.radiance).to_array());
    candidates.sort_by(|a, b| power(b).total_cmp(&power(a)));
    let discs: Vec<Option<Gaussians>> = (candidates.iter())
        .map(|c| c.is_clean.then(|| discs(evidence, c, up)))
        .collect();
    let fixed = discs.iter().flatten().flat_map(Gaussians::iter).collect();
    let (edit, nums) = room_for(fixed, &candidates, evidence, (gaussians, tracer))?;
    let heights = || gaussians.positions.iter().map(|p| p.dot(up));
    let shapes: Vec<Shape> = candidates.iter().map(|c| c.fit.shape).collect();
    let names = shape::names::names(
        &shapes,
        up,
        heights().fold(f32::INFINITY, f32::min),
        heights().fold(f32::NEG_INFINITY, f32::max),
    );
    let (mut lamps, mut in_lights, mut lamp_of) = (Vec::new(), Vec::new(), Vec::new());
    for (((c, discs), name), num) in candidates.iter().zip(&discs).zip(names).zip(nums) {
        if let Some(discs) = discs {
            let shines = discs.emissions.iter().map(|e| emits(*e));
            lamp_of.extend(shines.map(|shines| shines.then_some(lamps.len())));
        } else if num == 0 {
            // Where there is neither a shape nor what training left, there is no lamp.
            continue;
        }
        let in_light = |group: &Group, measured: &Measured| {
            lamp(evidence, c, (group, measured), name.clone(), num)
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

/// The lamps that explain lit pixels and that enough views show.
fn seen_lamps(
    evidence: &Evidence,
    up: Vec3,
    tracer: &dyn Tracer,
    progress: &mut dyn FnMut(usize, usize),
) -> Result<Vec<Candidate>, TraceError> {
    let mut all = explained(evidence, up, progress);
    alike::share_shapes(evidence, &mut all);
    let mut candidates = Vec::new();
    for candidate in all {
        let pixels = (candidate.light, &candidate.group);
        if seen::is_seen(evidence, pixels, &candidate.fit, tracer)? {
            candidates.push(candidate);
        }
    }
    Ok(candidates)
}

/// Puts shades around clean lamps that have one; what glows inside them is a part of them.
fn put_up_shades(
    evidence: &Evidence,
    candidates: &mut Vec<Candidate>,
    up: Vec3,
    tracer: &dyn Tracer,
) -> Result<(), TraceError> {
    for c in candidates.iter_mut().filter(|c| c.is_clean) {
        let pixels = (c.light, &c.group);
        let lamp = (&c.fit.shape, c.measured.radiance);
        c.shade = Shade::of(evidence, lamp, pixels, up, tracer)?;
    }
    let (mut clean, others): (Vec<Candidate>, Vec<Candidate>) = std::mem::take(candidates)
        .into_iter()
        .partition(|c| c.is_clean);
    for other in others {
        let mut shades = clean.iter_mut().filter_map(|c| c.shade.as_mut());
        match shades.find(|shade| shade.has(other.fit.shape.centre())) {
            Some(shade) => shade.glow(other.measured.radiance),
            None => candidates.push(other),
        }
    }
    candidates.append(&mut clean);
    Ok(())
}

/// The discs of a clean lamp and of the shade around it.
fn discs(evidence: &Evidence, c: &Candidate, up: Vec3) -> Gaussians {
    let pixel = pixel_width(evidence, &c.group);
    let is_glass = c.fit.gaps == Gaps::Bars || place::is_on_wall(&c.fit.shape, up);
    let own = place::discs(&c.fit.shape, c.measured.radiance, is_glass, pixel);
    let shade = c.shade.iter().flat_map(Shade::discs);
    own.iter().chain(shade).collect()
}

/// How a scene makes room for the `fixed` discs of lamps, and how many of its Gaussians are parts
/// of each.
fn room_for(
    fixed: Gaussians,
    candidates: &[Candidate],
    evidence: &Evidence,
    (gaussians, tracer): (&Gaussians, &dyn Tracer),
) -> Result<(SceneEdit, Vec<usize>), TraceError> {
    let clean = || candidates.iter().filter(|c| c.is_clean);
    let mut edit = SceneEdit {
        fixed,
        ..SceneEdit::nothing(gaussians.len())
    };
    let nums = clear::replaced(gaussians, candidates, &mut edit.keep);
    let shades = candidates.iter().filter_map(|c| c.shade.as_ref());
    shades.for_each(|shade| shade.clear(gaussians, &mut edit.keep));
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
    let fits: Vec<Fit> = clean().map(|c| c.fit).collect();
    if !fits.is_empty() {
        let device = tracer.device();
        clear::remove_what_hides(&device, evidence, gaussians, &fits, &mut edit)?;
    }
    Ok((edit, nums))
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
        shade: c.shade.as_ref().map_or(0.0, Shade::reach),
        reach: 0.0,
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
