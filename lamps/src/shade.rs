//! Opaque shades around bulbs, closed where no view looks.
//!
//! Views from below show a bulb, those from higher up the shade that hides it. What closes the
//! shade beyond, no view shows, and training leaves it open there: the bulb would light the walls
//! above as if it were bare. Whether the shade is open there, what is above tells: the bulb would
//! light it. Its sides are of glowing discs, as views from below show the inside, and these send
//! light to either side; some hang into the opening. Where the scene does not close it, the shade is
//! made one surface as wide as it is around the bulb, with a flat lid over the last ring that is
//! closed, in which light leaves an opening. What glows inside it, in masks a lamp of its own without
//! a shape, is a part of it.

mod above;
mod looks;

use crate::evidence::Evidence;
use crate::group::Group;
use crate::shape::Shape;
use eagpt_scene::discs::{INSET_IN_SPACINGS, Material, SCALE_IN_SPACINGS, Solid, Surface};
use eagpt_scene::lamps::emits;
use eagpt_scene::median::{median, median_of};
use eagpt_scene::{Gaussian, Gaussians, Gloss, rotation};
use eagpt_trace::{TraceError, Tracer};
use glam::{Mat3, Quat, Vec2, Vec3};
use looks::{Bulb, Look, Ring};
use std::f32::consts::{PI, TAU};

/// Closed rings that make a shade, at least.
const LEAST_RINGS: usize = 2;
/// Radius of the surface in that of the shade, most of which stays around it as it was trained.
const WITHIN: f32 = 0.85;
/// Radius of a shade as views see it in that of the ring that the scene has around the bulb, at
/// most: what glows inside hangs before it.
const MAX_WIDER: f32 = 1.5;
/// Distance of the lid from the middle of the bulb, in radii of it, at least.
const LID: f32 = 1.3;
/// Distance up to which something that glows is of the shade, in its radius.
const AROUND: f32 = 1.25;
/// Mean opacity of rings from which on a shade is closed there as it was trained.
const WHOLE: f32 = 0.9;
/// Cosine to the axis below that of the edge up to which what hangs there is in the way of light:
/// the pole of a lamp is not.
const BELOW: f32 = 0.2;
/// Standard deviations of a disc within which it must not reach below the edge.
const DEVIATIONS: f32 = 1.5;
/// Albedo of what no view shows well.
const ALBEDO: f32 = 0.5;
/// Spacing of discs, in radii, …
const SPACING: f32 = 0.06;
/// … and distance of the outside from the inside in spacings.
const THICKNESS: f32 = 2.5;

/// A shade around a bulb.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Shade {
    /// Middle of the bulb, world space.
    centre: Vec3,
    /// Unit vector to the middle of the shade.
    axis: Vec3,
    /// Distances from the axis and heights over the middle of the bulb, scene units, from the edge
    /// up to the lid.
    profile: Vec<Vec2>,
    /// Whether a lid closes the end of the profile.
    is_closed: bool,
    /// Angle to the axis, radians, up to which a surface takes its place: from there to the edge it
    /// stays as it was trained.
    missing: f32,
    /// Radiance of the inside, whether it emits, and radiance of the outside.
    inside: (Vec3, bool),
    outside: Vec3,
}

impl Shade {
    /// The shade of a lamp of a radiance, if it has one, whose pixels in a `light` are those of a
    /// group; `up` is the unit vector upwards.
    ///
    /// # Errors
    /// If the device fails.
    pub(crate) fn of(
        evidence: &Evidence,
        (lamp, radiance): (&Shape, Vec3),
        (light, group): (usize, &Group),
        up: Vec3,
        tracer: &dyn Tracer,
    ) -> Result<Option<Self>, TraceError> {
        let Some(bulb) = Bulb::of(lamp) else {
            return Ok(None);
        };
        let looks = bulb.looks(evidence, (light, group, radiance), tracer)?;
        for axis in [up, -up] {
            for edge in bulb.edges(&looks, axis) {
                let rings = bulb.rings((axis, edge), tracer)?;
                if rings.len() < looks::num_below(edge).max(LEAST_RINGS) {
                    continue;
                }
                let height = bulb.height_of_shade(axis, &looks, tracer)?;
                let mut shade = Self::new(&bulb, (axis, edge, height), &rings, &looks);
                let opening = above::opening(&bulb, (axis, edge), (&rings, radiance), tracer)?;
                shade.open(opening);
                shade.keep_whole(&rings, edge);
                return Ok(Some(shade));
            }
        }
        Ok(None)
    }

    /// The shade of a bulb of closed `rings` from the edge on, which `looks` see from outside up to
    /// a height.
    fn new(
        bulb: &Bulb,
        (axis, edge, height): (Vec3, f32, f32),
        rings: &[Ring],
        looks: &[Look],
    ) -> Self {
        let outside = || looks.iter().filter_map(|look| look.hidden_by);
        let seen = median_of(outside().map(|(distance, _)| distance));
        let wider = (seen / rings[0].radius).clamp(1.0, MAX_WIDER);
        let mut lid = (WITHIN * height).max(LID * bulb.radius);
        // At the edge as wide as the first ring.
        let all = (0_u8..).zip(rings.iter().take(1).chain(rings));
        let mut profile: Vec<Vec2> = Vec::new();
        for (number, ring) in all {
            let (sin, cos) = (edge - looks::RING * f32::from(number)).sin_cos();
            let next = WITHIN * wider * ring.radius * Vec2::new(sin, cos);
            let Some(&last) = profile.last() else {
                // A lid is never below the edge.
                lid = lid.max(next.y);
                profile.push(next);
                continue;
            };
            // A shade becomes no wider away from its edge.
            let next = next * (last.x / next.x).min(1.0);
            if next.y > last.y && next.y >= lid {
                profile.push(last.lerp(next, (lid - last.y) / (next.y - last.y)));
                break;
            } else if next.y > last.y {
                profile.push(next);
            }
        }
        let last = profile[profile.len() - 1];
        if last.y < lid {
            profile.push(Vec2::new(last.x, lid));
        }
        Self {
            centre: bulb.centre,
            axis,
            profile,
            is_closed: true,
            missing: PI,
            inside: (median(&rings.iter().map(|ring| ring.radiance)), false),
            outside: median(&outside().map(|(_, radiance)| radiance)),
        }
    }

    /// Opens it up to an angle to its axis, radians; 0 leaves it closed.
    fn open(&mut self, opening: f32) {
        if opening > 0.0 {
            let rim = self.profile[self.profile.len() - 1];
            let next = rim.y * opening.tan();
            if next < rim.x {
                self.profile.push(Vec2::new(next, rim.y));
            }
            self.is_closed = false;
        }
    }

    /// Keeps what is closed as it was trained, `rings` from the edge on.
    fn keep_whole(&mut self, rings: &[Ring], edge: f32) {
        let is_whole = |ring: &&Ring| ring.opacity >= WHOLE;
        let num_whole = rings.iter().take_while(is_whole).count();
        if num_whole > 0 {
            let next = looks::ring_angles(edge).nth(num_whole);
            self.missing = next.map_or(0.0, |angle| angle + 0.5 * looks::RING);
        }
    }

    /// Lets its inside emit.
    pub(crate) fn glow(&mut self, radiance: Vec3) {
        self.inside = (radiance, true);
    }

    /// Radius of what is of the shade, its edge and its outside, too; scene units.
    pub(crate) fn reach(&self) -> f32 {
        let lengths = self.profile.iter().map(|at| at.length());
        AROUND * lengths.fold(0.0, f32::max)
    }

    /// Whether what glows at a place is of the shade.
    pub(crate) fn has(&self, position: Vec3) -> bool {
        position.distance(self.centre) <= self.reach()
    }

    /// Distance from the axis and height of a place.
    fn local(&self, position: Vec3) -> Vec2 {
        let offset = position - self.centre;
        let height = offset.dot(self.axis);
        Vec2::new((offset - self.axis * height).length(), height)
    }

    /// Whether the surface is around a place.
    fn holds(&self, local: Vec2) -> bool {
        self.profile.array_windows().any(|&[below, above]| {
            let at = (local.y - below.y) / (above.y - below.y);
            (0.0..=1.0).contains(&at) && local.x < below.lerp(above, at).x
        })
    }

    /// Angle of a place to the axis, radians, by its distance from that and its height.
    fn angle(local: Vec2) -> f32 {
        local.x.atan2(local.y)
    }

    /// Whether what is at a place, in its axes, stays as it was trained.
    fn stays(&self, local: Vec2) -> bool {
        let angle = Self::angle(local);
        angle > self.missing && angle < Self::angle(self.profile[0])
    }

    /// Whether what is at a place, away from a bulb of this `radius`, stays as the shade.
    pub(crate) fn spares(&self, position: Vec3, radius: f32) -> bool {
        let local = self.local(position);
        local.length() > LID * radius && self.stays(local)
    }

    /// Its discs: the inside, and the outside, which does not emit, where the scene has none.
    pub(crate) fn discs(&self) -> Vec<Gaussian> {
        let (glow, emits) = self.inside;
        let mut discs = self.layer((glow, emits), 1.0);
        discs.extend(self.layer((self.outside, false), 1.0 + THICKNESS * SPACING));
        discs.retain(|disc| Self::angle(self.local(disc.position)) <= self.missing);
        discs
    }

    /// Discs of the surface, so many times as large.
    fn layer(&self, (radiance, emits): (Vec3, bool), times: f32) -> Vec<Gaussian> {
        let material = Material {
            albedo: Vec3::splat(ALBEDO),
            radiance: emits.then_some(radiance),
            gloss: Gloss::NONE,
        };
        let profile: Vec<Vec2> = self.profile.iter().map(|at| *at * times).collect();
        let spacing = SPACING * self.reach();
        let (right, forward) = self.axis.any_orthonormal_pair();
        let rim = profile[profile.len() - 1];
        let lid = Surface {
            solid: Solid::Ellipse {
                centre: self.centre + self.axis * rim.y,
                axes: [right, forward].map(|axis| axis * (2.0 * rim.x)),
            },
            material,
            spacing: Some(spacing),
        };
        let lid = lid.discs();
        let Some(model) = lid.iter().next() else {
            return Vec::new();
        };
        let mut discs: Vec<Gaussian> = match self.is_closed {
            true => lid.iter().collect(),
            false => Vec::new(),
        };
        // Rows along the profile, from the edge on.
        let mut next = INSET_IN_SPACINGS * spacing;
        for &[below, above] in profile.array_windows() {
            let length = below.distance(above);
            let slope = (above - below) / length;
            while next < length {
                let at = below + slope * next;
                let num = (TAU * at.x / spacing).ceil().max(3.0);
                for k in 0..num as u16 {
                    let (sin, cos) = (f32::from(k) * TAU / num).sin_cos();
                    let out = right * cos + forward * sin;
                    let up = out * slope.x + self.axis * slope.y;
                    let along = self.axis.cross(out);
                    let frame = Mat3::from_cols(along, up, along.cross(up));
                    discs.push(Gaussian {
                        position: self.centre + out * at.x + self.axis * at.y,
                        scale: Vec2::splat(SCALE_IN_SPACINGS * spacing),
                        rotation: rotation::unit(Quat::from_mat3(&frame)),
                        ..model
                    });
                }
                next += spacing;
            }
            next -= length;
        }
        for disc in &mut discs {
            disc.radiance = radiance;
        }
        discs
    }

    /// Takes out what the shade stands for, and what is in it or in its opening.
    pub(crate) fn clear(&self, gaussians: &Gaussians, keep: &mut [bool]) {
        let (edge, reach) = (self.profile[0], self.reach());
        for (i, keep) in keep.iter_mut().enumerate() {
            let local = self.local(gaussians.positions[i]);
            let distance = local.length();
            if distance > reach || self.stays(local) {
                continue;
            }
            let wide = DEVIATIONS * gaussians.scales[i].max_element();
            let is_lit = emits(gaussians.emissions[i]);
            let is_below = Self::angle(local) + (wide / distance).atan() > Self::angle(edge)
                && local.y / distance >= edge.normalize().y - BELOW;
            *keep &= !(is_lit || self.holds(local) || is_below);
        }
    }
}
