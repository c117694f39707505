//! Evidence of a shade: views of a bulb, and the scene around it.

use crate::evidence::Evidence;
use crate::group::Group;
use crate::shape::Shape;
use eagpt_scene::Camera;
use eagpt_scene::color::luminance;
use eagpt_scene::median::{median, median_of};
use eagpt_trace::{Features, Ray, TraceError, Tracer};
use glam::Vec3;
use std::f32::consts::{FRAC_PI_2, PI, TAU};

/// Largest length of a bulb in its smallest, at most: tubes are in fixtures.
const MAX_LENGTH: f32 = 3.0;
/// Width of a bulb in pixels, at least, in views that say that it is hidden.
const MIN_WIDTH: f32 = 2.0;
/// Share of its flux from which on a view shows it: pixels of the lit inside of a shade, beside it
/// or in place of it, are far dimmer.
const SHOWN: f32 = 0.5;
/// Distance of a shade from the middle of the bulb, in radii, at least: what is nearer may be a
/// part of what training made of it; …
const NEAREST: f32 = 2.0;
/// … and at most: what is farther is a thing before the lamp.
const FARTHEST: f32 = 10.0;
/// Emission, in parts of opacity, of what views see of a shade, at most: one that shines lets light
/// through.
const DARK: f32 = 0.1;
/// Views that show the bulb, and that do not, at least, and share of either that may speak against
/// the edge between them.
const LEAST_SHOWN: usize = 1;
const LEAST_HIDDEN: usize = 3;
const MOST_ASTRAY: f32 = 0.1;
/// Steps in which the height of a shade is looked for, in radii of the bulb.
const STEP: f32 = 0.25;
/// … beside its axis, where a cord would hang.
const ASIDE: f32 = 1.0;
/// Rings around the bulb, from the edge on, in which the scene is looked at, radians, …
pub(super) const RING: f32 = 0.12;
/// … on so many sides, …
const NUM_SIDES: u8 = 24;
/// … and share of them that the shade covers, at least: a beam beside a bulb hides it from one.
const COVERED: f32 = 0.75;

/// A bulb that may be in a shade.
pub(super) struct Bulb {
    /// Middle, world space.
    pub(super) centre: Vec3,
    /// Radius, scene units.
    pub(super) radius: f32,
}

/// A view of a bulb, shown or hidden.
pub(super) struct Look {
    /// Place of the camera, world space.
    eye: Vec3,
    /// Distance from its middle of what hides it, and the radiance of that; `None` where it is
    /// shown.
    pub(super) hidden_by: Option<(f32, Vec3)>,
}

/// A ring of the scene around a bulb: distance from its middle, radiance, and mean opacity.
pub(super) struct Ring {
    pub(super) radius: f32,
    pub(super) radiance: Vec3,
    pub(super) opacity: f32,
}

/// The angles of rings to the axis, radians, from the edge on.
pub(super) fn ring_angles(edge: f32) -> impl Iterator<Item = f32> {
    let angles = (1_u8..).map(move |number| edge - RING * f32::from(number));
    angles.take_while(|angle| *angle > 0.5 * RING)
}

/// The number of rings from the edge on up to the height of the bulb, all of which are closed in a
/// shade: those below alone may be a surface that it is behind.
pub(super) fn num_below(edge: f32) -> usize {
    let below = ring_angles(edge).take_while(|angle| *angle > FRAC_PI_2);
    below.count()
}

impl Bulb {
    /// The ball of the same area as a lamp, if that is about as long as wide: of small ones views
    /// tell a ball from a drum badly.
    pub(super) fn of(shape: &Shape) -> Option<Self> {
        let size = shape.size();
        (size.max_element() <= MAX_LENGTH * size.min_element()).then(|| Self {
            centre: shape.centre(),
            radius: (shape.area() / (4.0 * PI)).sqrt(),
        })
    }

    /// The views of it in a `light`, which show it, of this `radiance`, in the pixels of a group,
    /// without those in which it is small, or behind something that is no shade.
    pub(super) fn looks(
        &self,
        evidence: &Evidence,
        (light, group, radiance): (usize, &Group, Vec3),
        tracer: &dyn Tracer,
    ) -> Result<Vec<Look>, TraceError> {
        let &Self { centre, radius } = self;
        let full = luminance(radiance.to_array());
        let shown: Vec<(&Camera, f32)> = (group.by_view())
            .map(|(view, members)| {
                let pixels = members.iter().map(|member| evidence.pixel(member).1);
                let filled = pixels.map(|pixel| {
                    let light = luminance(pixel.radiance.to_array());
                    pixel.weight * (light / full).min(1.0)
                });
                (&evidence.sights[view].camera, filled.sum())
            })
            .collect();
        let (mut looks, mut hiding, mut rays) = (Vec::new(), Vec::new(), Vec::new());
        let cameras = evidence.cameras.iter();
        for (_, camera) in cameras.filter(|(of, _)| *of == light) {
            let origin = camera.origin();
            let at = camera.project(centre);
            let width = 2.0 * radius * camera.fx as f32 / at.z;
            if !camera.is_in_picture(at) || width < MIN_WIDTH {
                continue;
            }
            let own = shown.iter().find(|(own, _)| *own == camera);
            let filled = own.map_or(0.0, |(_, filled)| *filled);
            if filled >= SHOWN * 0.25 * PI * width * width {
                looks.push(Look {
                    eye: origin,
                    hidden_by: None,
                });
            } else {
                hiding.push(origin);
                let direction = -self.towards(origin);
                rays.push(Ray::free(origin.to_array(), direction.to_array()));
            }
        }
        let met = tracer.trace_rays(&rays)?;
        let hiding = hiding.into_iter().zip(met);
        looks.extend(hiding.filter_map(|(eye, met)| {
            let away = eye.distance(centre) - met.mean_distance();
            let is_near = (NEAREST * radius..=FARTHEST * radius).contains(&away);
            let is_dark = met.alpha() > 0.5 && met.emission() <= DARK * met.alpha();
            (is_near && is_dark).then_some(Look {
                eye,
                hidden_by: Some((away, met.radiance())),
            })
        }));
        Ok(looks)
    }

    /// Unit vector from its middle to an eye.
    fn towards(&self, eye: Vec3) -> Vec3 {
        (eye - self.centre).normalize_or_zero()
    }

    /// Height over the middle of the bulb up to which views that do not see it see a shade.
    pub(super) fn height_of_shade(
        &self,
        axis: Vec3,
        looks: &[Look],
        tracer: &dyn Tracer,
    ) -> Result<f32, TraceError> {
        let hidden = || looks.iter().filter(|look| look.hidden_by.is_some());
        let step = STEP * self.radius;
        let mut height = 0.0;
        while height < FARTHEST * self.radius {
            let place = self.centre + axis * (height + step);
            let mut num = 0;
            for side in [-ASIDE, ASIDE] {
                let aim = |look: &Look| {
                    let aside = axis.cross(self.towards(look.eye)).normalize_or_zero();
                    place + aside * (side * self.radius)
                };
                let ray = |look: &Look| {
                    let towards = (aim(look) - look.eye).normalize_or_zero();
                    Ray::free(look.eye.to_array(), towards.to_array())
                };
                let met = tracer.trace_rays(&hidden().map(ray).collect::<Vec<_>>())?;
                let is_covered = |(look, met): &(&Look, Features)| {
                    let away = look.eye.distance(aim(look)) - met.mean_distance();
                    met.alpha() > 0.5 && (0.0..=FARTHEST * self.radius).contains(&away)
                };
                num += hidden().zip(met).filter(is_covered).count();
            }
            if num < hidden().count() {
                break;
            }
            height += step;
        }
        Ok(height)
    }

    /// The rings around it that are closed in the scene, from an angle to an axis on towards it, up
    /// to the first that is not.
    pub(super) fn rings(
        &self,
        (axis, edge): (Vec3, f32),
        tracer: &dyn Tracer,
    ) -> Result<Vec<Ring>, TraceError> {
        let start = NEAREST * self.radius;
        let reach = (FARTHEST - NEAREST) * self.radius;
        let mut rings = Vec::new();
        for angle in ring_angles(edge) {
            let met = tracer.trace_rays(&self.rays((axis, angle), start))?;
            let is_covered = |met: &&Features| met.alpha() > 0.5 && met.mean_distance() <= reach;
            let covered: Vec<&Features> = met.iter().filter(is_covered).collect();
            if (covered.len() as f32) < COVERED * f32::from(NUM_SIDES) {
                break;
            }
            rings.push(Ring {
                radius: start + median_of(covered.iter().map(|met| met.mean_distance())),
                radiance: median(&covered.iter().map(|met| met.radiance() / met.alpha())),
                opacity: covered.iter().map(|met| met.alpha()).sum::<f32>() / f32::from(NUM_SIDES),
            });
        }
        Ok(rings)
    }

    /// Rays away from it at an angle to an axis, on all sides, from a distance on.
    pub(super) fn rays(&self, (axis, angle): (Vec3, f32), start: f32) -> Vec<Ray> {
        let (right, forward) = axis.any_orthonormal_pair();
        let ray = |side: u8| {
            let turn = TAU * f32::from(side) / f32::from(NUM_SIDES);
            let aside = right * turn.cos() + forward * turn.sin();
            let towards = axis * angle.cos() + aside * angle.sin();
            let origin = self.centre + towards * start;
            Ray::free(origin.to_array(), towards.to_array())
        };
        (0..NUM_SIDES).map(ray).collect()
    }

    /// Angles to `axis`, radians, one of which may be that up to which it is hidden and from which
    /// on it is shown, the likeliest first: views tell no more than that it is between two of them.
    pub(super) fn edges(&self, looks: &[Look], axis: Vec3) -> Vec<f32> {
        let angles = |is_hidden: bool| {
            let some = (looks.iter()).filter(|look| look.hidden_by.is_some() == is_hidden);
            let cosines = some.map(|look| self.towards(look.eye).dot(axis));
            let mut angles: Vec<f32> = cosines.map(|c| c.clamp(-1.0, 1.0).acos()).collect();
            angles.sort_unstable_by(f32::total_cmp);
            angles
        };
        let (shown, hidden) = (angles(false), angles(true));
        if shown.len() < LEAST_SHOWN || hidden.len() < LEAST_HIDDEN {
            return Vec::new();
        }
        // But for some astray.
        let astray = |of: &[f32]| (MOST_ASTRAY * of.len() as f32) as usize;
        let first_shown = shown[astray(&shown)];
        let last_hidden = hidden[hidden.len() - 1 - astray(&hidden)];
        if last_hidden >= first_shown {
            return Vec::new();
        }
        let middle = 0.5 * (last_hidden + first_shown);
        let nearer = (0_u8..).map(|number| middle - RING * f32::from(number));
        let nearer = nearer.take_while(|angle| *angle > last_hidden);
        nearer.chain([last_hidden]).collect()
    }
}
