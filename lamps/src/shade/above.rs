//! Light of a bulb on what is above its shade, which tells whether the shade is open there.

use super::AROUND;
use super::looks::{Bulb, RING, Ring, ring_angles};
use eagpt_scene::color::luminance;
use eagpt_scene::median::median_of;
use eagpt_trace::{Features, Ray, TraceError, Tracer};
use glam::Vec3;
use std::f32::consts::FRAC_PI_2;

/// Irradiance over π by which a surface is brighter where a bulb lights it, in that which it gets
/// from the bulb, at least: its albedo, unless that is less.
const LIT: f32 = 0.25;
/// Cosine between normals of what is one surface.
const ALIKE: f32 = 0.9;

/// A place beyond a shade.
struct Place {
    normal: Vec3,
    /// Luminance of its radiance, and of the irradiance over π that the bulb alone would give it.
    luminance: f32,
    expected: f32,
}

/// The angle to its axis, radians, less than a right one, up to which a shade is open away from its
/// edge; 0 if it is closed, or nothing near enough tells. `rings` are those that are closed,
/// `radiance` is the bulb's.
///
/// # Errors
/// If the device fails.
pub(super) fn opening(
    bulb: &Bulb,
    (axis, edge): (Vec3, f32),
    (rings, radiance): (&[Ring], Vec3),
    tracer: &dyn Tracer,
) -> Result<f32, TraceError> {
    let beyond = AROUND * rings.iter().map(|ring| ring.radius).fold(0.0, f32::max);
    let mut dark: Vec<Place> = Vec::new();
    for (number, angle) in ring_angles(edge).enumerate() {
        let (is_closed, next) = (number < rings.len(), angle + 0.5 * RING);
        if !is_closed && next >= FRAC_PI_2 {
            continue;
        }
        let rays = bulb.rays((axis, angle), beyond);
        let met = tracer.trace_rays(&rays)?;
        let places = rays.iter().zip(&met);
        let places = places.filter_map(|(ray, met)| place(bulb, ray, met, radiance));
        if is_closed {
            dark.extend(places);
            continue;
        }
        let brighter = places.filter_map(|place| {
            let alike = |other: &&Place| other.normal.dot(place.normal) > ALIKE;
            let mut others = dark
                .iter()
                .filter(alike)
                .map(|other| other.luminance)
                .peekable();
            others.peek()?;
            Some((place.luminance - median_of(others)) / place.expected)
        });
        // Where nothing tells, the median is 0.
        if median_of(brighter) >= LIT {
            return Ok(next);
        }
    }
    Ok(0.0)
}

/// The place that a ray from a bulb meets, if any.
fn place(bulb: &Bulb, ray: &Ray, met: &Features, radiance: Vec3) -> Option<Place> {
    if met.alpha() <= 0.5 {
        return None;
    }
    let towards = Vec3::from(ray.direction);
    let at = Vec3::from(ray.origin) + towards * met.mean_distance();
    let normal = met.unit_normal();
    let share = bulb.radius.powi(2) / at.distance_squared(bulb.centre);
    Some(Place {
        normal,
        luminance: luminance((met.radiance() / met.alpha()).to_array()),
        expected: luminance(radiance.to_array()) * share * -normal.dot(towards),
    })
}
