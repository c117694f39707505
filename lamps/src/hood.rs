//! Opaque shades around bulbs, closed where no view looks.
//!
//! Views from below show a bulb, those from higher up the shade that hides it. What closes the
//! shade beyond, no view shows, and training leaves it open there: the bulb would light the walls
//! above as if it were bare. Its sides are of glowing discs, as views from below show the inside,
//! and these send light to either side; some hang into the opening. Here the shade is made one
//! surface as wide as the scene has it around the bulb, with a flat lid over the last ring that is
//! closed. What glows inside it, in masks a lamp of its own without a shape, is a part of it.

mod looks;

use crate::evidence::Evidence;
use crate::group::Group;
use crate::shape::Shape;
use eagpt_scene::discs::{Material, Solid, Surface};
use eagpt_scene::median::{median, median_of};
use eagpt_scene::{Gaussian, Gaussians, Gloss};
use eagpt_trace::transport::EMISSION_THRESHOLD;
use eagpt_trace::{TraceError, Tracer};
use glam::Vec3;
use looks::{Bulb, Look, Ring};

/// Closed rings that make a shade, at least.
const LEAST_RINGS: usize = 2;
/// Radius of the surface in that of the shade, most of which stays around it as it was trained.
const WITHIN: f32 = 0.85;
/// Radius of a shade as views see it in that of the ring that the scene has around the bulb, at
/// most: what glows inside hangs before it.
const MAX_WIDER: f32 = 1.5;
/// Distance of the lid from the middle of the bulb, in radii of it, at least.
const LID: f32 = 1.3;
/// What glows is of the shade up to this times its radius.
const AROUND: f32 = 1.25;
/// Cosine to the axis below that of the edge up to which what hangs there is in the way of light:
/// the pole of a lamp is not.
const BELOW: f32 = 0.2;
/// Standard deviations of a disc within which it must not reach below the edge.
const DEVIATIONS: f32 = 1.5;
/// Albedo of what no view shows well.
const ALBEDO: f32 = 0.5;
/// Spacing of discs, in radii, …
const SPACING: f32 = 0.06;
/// … distance of the outside from the inside, and of the last discs from the edge, in spacings:
/// what is soft beyond the edge is as much as what is open before it.
const THICKNESS: f32 = 2.5;
const INSET: f32 = 1.14;

/// A shade around a bulb.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Hood {
    /// Middle of the bulb, world space.
    centre: Vec3,
    /// Unit vector to the middle of the shade.
    axis: Vec3,
    /// Angle to the axis of its edge, radians.
    edge: f32,
    /// Radii at the edge and at every [`looks::RING`] further, scene units.
    radii: Vec<f32>,
    /// Height of the lid over the middle of the bulb, and its radius, scene units.
    lid: [f32; 2],
    /// Radiance of the inside, whether it emits, and radiance of the outside.
    inside: (Vec3, bool),
    outside: Vec3,
}

impl Hood {
    /// The shade of a lamp, if it has one, whose pixels in a `light` are those of a group; `up` is
    /// the unit vector upwards.
    ///
    /// # Errors
    /// If the device fails.
    pub(crate) fn of(
        evidence: &Evidence,
        lamp: &Shape,
        (light, group): (usize, &Group),
        up: Vec3,
        tracer: &dyn Tracer,
    ) -> Result<Option<Self>, TraceError> {
        let Some(bulb) = Bulb::of(lamp) else {
            return Ok(None);
        };
        let looks = bulb.looks(evidence, (light, group), tracer)?;
        for axis in [up, -up] {
            let Some(edge) = looks::edge(&looks, axis) else {
                continue;
            };
            let rings = bulb.rings((axis, edge), tracer)?;
            if rings.len() >= LEAST_RINGS {
                return Ok(Some(Self::new(&bulb, (axis, edge), &rings, &looks)));
            }
        }
        Ok(None)
    }

    /// The shade of a bulb of closed `rings` from the edge on, which `looks` see from outside.
    fn new(bulb: &Bulb, (axis, edge): (Vec3, f32), rings: &[Ring], looks: &[Look]) -> Self {
        let outside = || looks.iter().filter_map(|look| look.hidden_by);
        let seen = median_of(outside().map(|(distance, _)| distance));
        let wider = (seen / rings[0].radius).clamp(1.0, MAX_WIDER);
        // At the edge as wide as the first ring.
        let all = rings.iter().take(1).chain(rings);
        let radii: Vec<f32> = all.map(|ring| WITHIN * wider * ring.radius).collect();
        let last = radii.len() - 1;
        let (sin, cos) = (edge - looks::RING * last as f32).sin_cos();
        let height = (radii[last] * cos).max(LID * bulb.radius);
        Self {
            centre: bulb.centre,
            axis,
            edge,
            lid: [height, radii[last] * sin],
            radii,
            inside: (median(&rings.iter().map(|ring| ring.radiance)), false),
            outside: median(&outside().map(|(_, radiance)| radiance)),
        }
    }

    /// Lets its inside emit.
    pub(crate) fn glow(&mut self, radiance: Vec3) {
        self.inside = (radiance, true);
    }

    /// Radius of what is of the shade, its edge and its outside, too; scene units.
    pub(crate) fn reach(&self) -> f32 {
        AROUND * self.radii.iter().copied().fold(0.0, f32::max)
    }

    /// Whether what glows at a place is of the shade.
    pub(crate) fn has(&self, position: Vec3) -> bool {
        position.distance(self.centre) <= self.reach()
    }

    /// Angle to the axis of a direction from the middle.
    fn angle(&self, towards: Vec3) -> f32 {
        towards.dot(self.axis).clamp(-1.0, 1.0).acos()
    }

    /// Distance of the surface from the middle, by the angle to the axis; 0 beyond the edge.
    fn radius(&self, angle: f32) -> f32 {
        if angle > self.edge {
            return 0.0;
        }
        let at = (self.edge - angle) / looks::RING;
        let ring = at as usize;
        let [height, wide] = self.lid;
        if let [own, next, ..] = self.radii[ring.min(self.radii.len())..] {
            own + (next - own) * at.fract()
        } else if angle > wide.atan2(height) {
            wide / angle.sin()
        } else {
            height / angle.cos()
        }
    }

    /// Its discs: the inside, and the outside, which does not emit.
    pub(crate) fn discs(&self) -> Vec<Gaussian> {
        let (glow, emits) = self.inside;
        let inside = self.layer((glow, emits), 1.0);
        let outside = self.layer((self.outside, false), 1.0 + THICKNESS * SPACING);
        inside.chain(outside).collect()
    }

    /// Discs of the surface, so many times as large.
    fn layer(
        &self,
        (radiance, emits): (Vec3, bool),
        times: f32,
    ) -> impl Iterator<Item = Gaussian> + use<> {
        let discs = |solid: Solid, spacing: f32| -> Vec<Gaussian> {
            let material = Material {
                albedo: Vec3::splat(ALBEDO),
                radiance: emits.then_some(radiance),
                gloss: Gloss::NONE,
            };
            let spacing = Some(spacing);
            let surface = Surface {
                solid,
                material,
                spacing,
            };
            surface.discs().iter().collect()
        };
        let [height, wide] = self.lid.map(|of| of * times);
        let (right, forward) = self.axis.any_orthonormal_pair();
        let lid = discs(
            Solid::Ellipse {
                centre: self.centre + self.axis * height,
                axes: [right, forward].map(|axis| axis * (2.0 * wide)),
            },
            SPACING * wide,
        );
        let ball = discs(
            Solid::Ball {
                centre: Vec3::ZERO,
                radius: 1.0,
            },
            SPACING,
        );
        let side = (self.edge - INSET * SPACING, self.lid[1].atan2(self.lid[0]));
        let placed = ball.into_iter().filter_map(|disc| {
            let towards = disc.position.normalize_or_zero();
            let angle = self.angle(towards);
            let radius = self.radius(angle) * times;
            (side.1..=side.0).contains(&angle).then_some(Gaussian {
                position: self.centre + towards * radius,
                scale: disc.scale * radius,
                ..disc
            })
        });
        let all: Vec<Gaussian> = lid.into_iter().chain(placed).collect();
        all.into_iter()
            .map(move |disc| Gaussian { radiance, ..disc })
    }

    /// Takes out what the shade stands for, and what is in it or in its opening.
    pub(crate) fn clear(&self, gaussians: &Gaussians, keep: &mut [bool]) {
        for (i, keep) in keep.iter_mut().enumerate() {
            let offset = gaussians.positions[i] - self.centre;
            let distance = offset.length();
            if distance > self.reach() {
                continue;
            }
            let angle = self.angle(offset.normalize_or_zero());
            let wide = DEVIATIONS * gaussians.scales[i].max_element();
            let is_lit = gaussians.emissions[i] > EMISSION_THRESHOLD;
            let is_inside = distance < self.radius(angle);
            let is_below = angle + (wide / distance).atan() > self.edge
                && angle.cos() >= self.edge.cos() - BELOW;
            *keep &= !(is_lit || is_inside || is_below);
        }
    }
}
