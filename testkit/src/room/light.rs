//! The room's light: path tracing with next-event estimation (a shadow ray to the light at every
//! bounce).

use super::shapes::{self, HALF_LIGHT, HEIGHT, Hit, LIGHT_RADIANCE};
use eagpt_scene::rng::RandomStream;
use glam::{Vec2, Vec3};
use std::f32::consts::{PI, TAU};

/// Surfaces that light is followed over, at most; the limit of the program's own path tracing.
pub(super) const MAX_BOUNCES: u32 = 7;

/// Rays leave this far above a surface, metres; room-sized floats have steps of 2e-7.
const LIFT: f32 = 1e-4;

/// One sample of the light that leaves `hit` towards the viewer, emission included.
pub(super) fn radiance(hit: &Hit, max_bounces: u32, random: &mut RandomStream) -> Vec3 {
    if hit.is_light() {
        return hit.emitted;
    }
    let (mut total, mut throughput, mut at) = (Vec3::ZERO, Vec3::ONE, *hit);
    for bounce in 1..=max_bounces {
        let [a, b, c, d] = random.next_uniforms();
        throughput *= at.albedo;
        let origin = at.position + at.normal * LIFT;
        total += throughput * direct(origin, at.normal, Vec2::new(a, b));
        if bounce == max_bounces {
            break;
        }
        at = shapes::intersect(origin, cosine_direction(at.normal, c, d));
        if at.is_light() {
            // The shadow ray has counted this light already.
            break;
        }
    }
    total
}

/// Light that a point of the light source, chosen by `uniform`, brings to a white surface, over π.
fn direct(origin: Vec3, normal: Vec3, uniform: Vec2) -> Vec3 {
    let on_light = ((uniform * 2.0 - 1.0) * HALF_LIGHT).extend(HEIGHT);
    let offset = on_light - origin;
    let distance = offset.length();
    let direction = offset / distance;
    let cosines = direction.dot(normal).max(0.0) * direction.z.max(0.0);
    if cosines == 0.0 || !shapes::is_free(origin, direction, distance) {
        return Vec3::ZERO;
    }
    let area = 4.0 * HALF_LIGHT.x * HALF_LIGHT.y;
    LIGHT_RADIANCE * (cosines * area / (PI * distance * distance))
}

fn cosine_direction(normal: Vec3, a: f32, b: f32) -> Vec3 {
    let (tangent, bitangent) = normal.any_orthonormal_pair();
    let (radius, angle) = (a.sqrt(), TAU * b);
    let flat = tangent * (radius * angle.cos()) + bitangent * (radius * angle.sin());
    (flat + normal * (1.0 - a).max(0.0).sqrt()).normalize()
}

#[cfg(test)]
mod tests {
    use super::*;
    use eagpt_scene::rng::{Purpose, RandomKey};

    fn mean(hit: &Hit, max_bounces: u32, num: u32) -> Vec3 {
        let key = RandomKey::new(1, Purpose::Render, 0);
        let sample = |i| radiance(hit, max_bounces, &mut key.stream(0, i));
        (0..num).map(sample).sum::<Vec3>() / num as f32
    }

    #[test]
    fn direct_light_under_a_rectangle_is_its_form_factor() {
        let floor = shapes::intersect(Vec3::new(0.0, 0.0, 1.0), Vec3::NEG_Z);
        // Form factor of a parallel rectangle above a corner (Howell, configuration B-4), four
        // times.
        let quarter = |x: f32, y: f32| {
            let (rx, ry) = ((1.0 + x * x).sqrt(), (1.0 + y * y).sqrt());
            (x / rx * (y / rx).atan() + y / ry * (x / ry).atan()) / TAU
        };
        let factor = 4.0 * quarter(HALF_LIGHT.x / HEIGHT, HALF_LIGHT.y / HEIGHT);
        let expected = floor.albedo * LIGHT_RADIANCE * factor;
        let error = (mean(&floor, 1, 20_000) / expected - 1.0).abs();
        // The integrand varies by a tenth over the light: 20,000 samples leave less than a
        // thousandth.
        assert!(error.max_element() < 2e-3, "{error}");
    }

    #[test]
    fn bounces_add_light_and_converge() {
        let floor = shapes::intersect(Vec3::new(0.4, 0.3, 1.0), Vec3::NEG_Z);
        let [one, four, seven] = [1, 4, MAX_BOUNCES].map(|n| mean(&floor, n, 20_000).y);
        assert!(one < four && four < seven, "{one} {four} {seven}");
        // Albedos average some 0.5, so each bounce adds about half of the one before.
        assert!(seven - four < 0.2 * (four - one), "{one} {four} {seven}");
    }
}
