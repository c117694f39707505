//! Bulbs whose light leaves in cones, and strips of light.

use super::places::{is_open, solid_angle};
use eagpt_scene::discs::{Material, Solid, Surface};
use eagpt_scene::{Gaussian, Gaussians, Gloss, Lamp, LampShape};
use glam::{Mat3, Quat, Vec3};
use std::f32::consts::PI;

/// Radius of the ball around a bulb that is open where its light leaves, in the reach of what hides
/// it, and of the bulb in that: cones end within one ring.
const LINING: f32 = 0.12;
const RADIUS: f32 = 0.15;
/// Spacing of the discs of the ball in its radius, and how much larger a second one is: one alone
/// lets some hundredths of the light through.
const SPACING: f32 = 0.1;
const SECOND: f32 = 1.2;
/// Width of a strip in the reach, and in that the spacing of its discs, and the distance and the
/// width of what closes it behind: little light passes between both.
const WIDTH: f32 = 0.1;
const SPACING_ACROSS: f32 = 0.5;
const BEHIND: f32 = 0.05;
const CLOSED: f32 = 2.0;

/// A bulb that was found, or several of one make or along a strip.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Found {
    pub(super) positions: Vec<Vec3>,
    /// Whether they are a strip that is flat, and shines to one half as a diffuse surface does.
    pub(super) is_strip: bool,
    /// Rings of the cone upwards and of that downwards; 0 where it is closed.
    pub(super) cones: [usize; 2],
}

impl Found {
    /// Bulbs that send a radiant `intensity` from each position, or one strip; `up` is the unit
    /// vector upwards, and `reach` that of what hides them.
    pub(super) fn bulbs(&self, intensity: Vec3, (up, reach): (Vec3, f32)) -> Vec<Bulb> {
        match &self.positions[..] {
            [first, .., last] if self.is_strip => {
                let normal = if self.cones[0] > 0 { up } else { -up };
                let intensity = self.positions.len() as f32 * intensity;
                vec![Bulb::strip([*first, *last], normal, intensity, reach)]
            }
            all => {
                let bulb = |at: &Vec3| Bulb::new((*at, self.cones), intensity, (up, reach));
                all.iter().map(bulb).collect()
            }
        }
    }
}

/// A bulb, or a strip of them.
pub(super) struct Bulb {
    /// It as a lamp, without a name.
    pub(super) lamp: Lamp,
    /// Its discs, and those that let its light leave in cones alone.
    pub(super) discs: Gaussians,
}

impl Bulb {
    /// One at a place of a total radiant `intensity`, that leaves in so many rings from above and
    /// from below; `up` is the unit vector upwards, and `reach` that of what hides it.
    fn new((centre, cones): (Vec3, [usize; 2]), intensity: Vec3, (up, reach): (Vec3, f32)) -> Self {
        let lining = LINING * reach;
        let radius = RADIUS * lining;
        let area = 4.0 * PI * radius * radius;
        let radiance = intensity / (PI * radius * radius);
        let bulb = black(Solid::Ball { centre, radius }, Some(radiance), None).discs();
        let frame = (centre, Quat::IDENTITY, Vec3::splat(2.0 * radius));
        let lamp = Lamp {
            num_gaussians: bulb.len(),
            // The ball around it keeps the rest.
            power: (solid_angle(cones) * intensity).to_array(),
            ..Lamp::unmeasured(LampShape::Ball, frame, (area, radiance))
        };
        // Discs are as wide as a ring.
        let left_out = cones.map(|num| if num > 0 { num + 1 } else { 0 });
        let closes = |disc: &Gaussian| {
            let direction = (disc.position - centre).normalize_or_zero();
            !is_open(direction.dot(up), left_out)
        };
        let balls = [lining, SECOND * lining].map(|radius| {
            black(Solid::Ball { centre, radius }, None, Some(SPACING * radius)).discs()
        });
        let lining = balls.iter().flat_map(Gaussians::iter).filter(closes);
        Self {
            lamp,
            discs: bulb.iter().chain(lining).collect(),
        }
    }

    /// A flat strip of these ends that sends a radiant `intensity` along its `normal`, of which
    /// nothing is seen from behind; `reach` is that of what hides it.
    fn strip([a, b]: [Vec3; 2], normal: Vec3, intensity: Vec3, reach: f32) -> Self {
        let (axis, length) = ((b - a).normalize(), a.distance(b));
        let across = normal.cross(axis);
        let centre = 0.5 * (a + b);
        let width = WIDTH * reach;
        let area = length * width;
        let radiance = intensity / area;
        let side = |radiance, at, width_in_own: f32| {
            let edges = [length * axis, width_in_own * width * across];
            black(
                Solid::Quad { centre: at, edges },
                radiance,
                Some(SPACING_ACROSS * width),
            )
            .discs()
        };
        let front = side(Some(radiance), centre, 1.0);
        let back = side(None, centre - BEHIND * width * normal, CLOSED);
        let rotation = Quat::from_mat3(&Mat3::from_cols(axis, across, normal));
        let frame = (centre, rotation, Vec3::new(length, width, 0.0));
        let lamp = Lamp {
            one_sided: true,
            num_gaussians: front.len(),
            ..Lamp::unmeasured(LampShape::Panel, frame, (area, radiance))
        };
        Self {
            lamp,
            discs: front.iter().chain(back.iter()).collect(),
        }
    }
}

/// A surface that reflects nothing.
pub(super) fn black(solid: Solid, radiance: Option<Vec3>, spacing: Option<f32>) -> Surface {
    Surface {
        solid,
        material: Material {
            albedo: Vec3::ZERO,
            radiance,
            gloss: Gloss::NONE,
        },
        spacing,
    }
}
