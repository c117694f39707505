//! Discs that training puts beside small lamps where nothing is: heaps that make up a lamp before it
//! is clean, and translucent ones that are darker than anything that close to it.
//!
//! Of the surroundings of a lamp few views show more than what is beyond them, and discs in the air
//! that look like it cost nothing: they let little of the lamp's light into the room. A surface
//! there would be bright, or opaque, as the outside of a shade and metal, which is dark where it
//! mirrors what is dark.

use eagpt_scene::color::luminance;
use eagpt_scene::lamps::{Lamp, Lamps, emits};
use eagpt_scene::median::median_of;
use eagpt_scene::{Gaussian, Gaussians};
use eagpt_trace::{Device, Ray, TraceError};
use glam::Vec3;
use std::f32::consts::PI;

/// Albedo below which what is translucent is no surface: soot and black paint have 0.03 and more.
const LEAST_ALBEDO: f32 = 0.05;
/// Distance from a lamp, in its mean sizes, beyond which black things may be.
const NEAR: f32 = 9.0;
/// The same in median distances of the scene: the walls of a room are not beside its lantern.
const NEAR_IN_SCENE: f32 = 0.3;
/// Opacity from which on a Gaussian is a surface, and hides what is behind it.
pub(crate) const OPAQUE: f32 = 0.75;
/// Start of a ray from a disc, in parts of the way to the lamp.
const START: f32 = 1e-3;

/// Whether each of `gaussians` stays, `[n]`, when bare `lamps` become clean while training goes on.
/// It has put discs about them that are brighter than a surface, and dark ones that hide these:
/// among the first `num_moving` only those beside the lamps stay that emit or lie at a surface.
pub fn without_heaps(
    (gaussians, num_moving): (&Gaussians, usize),
    lamps: &Lamps,
    is_at_surface: impl Fn(Vec3) -> bool,
) -> Vec<bool> {
    let is_beside = beside((gaussians, num_moving), lamps);
    let stays = |i: usize| !is_beside(i) || is_at_surface(gaussians.positions[i]);
    (0..gaussians.len()).map(stays).collect()
}

/// Tells of Gaussians by their index whether they are beside bare `lamps`, among the first
/// `num_moving`, and do not emit.
pub(crate) fn beside<'a>(
    (gaussians, num_moving): (&'a Gaussians, usize),
    lamps: &'a Lamps,
) -> impl Fn(usize) -> bool + 'a {
    let bare = bare(lamps, gaussians);
    move |i| {
        let is_near = |bare: &Bare| bare.is_beside(gaussians.positions[i]);
        i < num_moving && !emits(gaussians.emissions[i]) && bare.iter().any(is_near)
    }
}

/// Whether each of `gaussians` stays, `[n]`. Of others, among the first `num_moving`, which are not
/// the lamps' own, the light that bare `lamps` send them, past what is opaque, would make a surface
/// brighter than they are.
///
/// # Errors
/// If the device fails.
pub fn without_strays(
    device: &Device,
    (gaussians, num_moving): (&Gaussians, usize),
    lamps: &Lamps,
) -> Result<Vec<bool>, TraceError> {
    let light = |i: usize| luminance(gaussians.radiances[i].to_array());
    let is_translucent =
        |i: &usize| !emits(gaussians.emissions[*i]) && gaussians.opacities[*i] < OPAQUE;
    let translucent: Vec<usize> = (0..num_moving).filter(is_translucent).collect();
    let mut suspects = Vec::new();
    for bare in bare(lamps, gaussians) {
        let lamp = bare.lamp;
        let (centre, size) = (lamp.centre(), Vec3::from(lamp.size));
        let intensity = lamp.luminous_power() / (4.0 * PI);
        for &i in &translucent {
            if !bare.is_beside(gaussians.positions[i]) {
                continue;
            }
            let towards = centre - gaussians.positions[i];
            let cosine = towards
                .normalize_or_zero()
                .dot(gaussians.normal_of(i))
                .abs();
            let distance = towards.length().max(0.5 * size.max_element());
            let least = LEAST_ALBEDO / PI * intensity * cosine / distance.powi(2);
            if light(i) < least {
                suspects.push(Suspect { i, centre, least });
            }
        }
    }
    let mut keep = vec![true; gaussians.len()];
    if suspects.is_empty() {
        return Ok(keep);
    }
    // Translucent discs would be in one another's shadow.
    let is_there = |gaussian: &Gaussian| gaussian.opacity >= OPAQUE || emits(gaussian.emission);
    let opaque: Gaussians = gaussians.iter().filter(is_there).collect();
    let rays: Vec<Ray> = suspects.iter().map(|s| s.ray(gaussians)).collect();
    let met = device.scene(&opaque)?.trace_rays(&rays)?;
    for (suspect, met) in suspects.iter().zip(met) {
        keep[suspect.i] &= light(suspect.i) >= suspect.least * met.emission();
    }
    Ok(keep)
}

/// A Gaussian that is darker than a lamp would make it if nothing were between.
struct Suspect {
    i: usize,
    /// Middle of the lamp.
    centre: Vec3,
    /// Radiance, at least, of a surface there.
    least: f32,
}

impl Suspect {
    fn ray(&self, gaussians: &Gaussians) -> Ray {
        let position = gaussians.positions[self.i];
        let towards = self.centre - position;
        let origin = position + START * towards;
        Ray::free(origin.to_array(), towards.normalize_or_zero().to_array())
    }
}

/// A lamp that is bare, and sends its light to all sides.
struct Bare<'a> {
    lamp: &'a Lamp,
    /// Distance within which what is beside it lies.
    reach: f32,
}

impl Bare<'_> {
    fn is_beside(&self, position: Vec3) -> bool {
        self.lamp.distance(position) <= self.reach
    }
}

/// The bare ones of the lamps of a scene.
fn bare<'a>(lamps: &'a Lamps, gaussians: &Gaussians) -> Vec<Bare<'a>> {
    let is_bare = |lamp: &&Lamp| lamp.shape.is_solid() && !lamp.one_sided && lamp.shade == 0.0;
    let with_reach = |lamp: &'a Lamp| {
        let size = Vec3::from(lamp.size).element_product().cbrt();
        let distances = gaussians.positions.iter().map(|at| lamp.distance(*at));
        let reach = (NEAR * size).min(NEAR_IN_SCENE * median_of(distances));
        Bare { lamp, reach }
    };
    lamps.lamps.iter().filter(is_bare).map(with_reach).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use eagpt_scene::{Gloss, Harmonics, LampShape};
    use glam::{Quat, Vec2};

    /// A disc of this radiance and opacity at a place, which is turned towards −x.
    fn disc(at: Vec3, radiance: f32, opacity: f32) -> Gaussian {
        Gaussian {
            position: at,
            scale: Vec2::splat(0.03),
            rotation: Quat::from_rotation_arc(Vec3::Z, Vec3::NEG_X),
            opacity,
            radiance: Vec3::splat(radiance),
            harmonics: Harmonics::NONE,
            gloss: Gloss::NONE,
            emission: 0.0,
            albedo: Vec3::ZERO,
        }
    }

    /// A room about it.
    fn walls() -> [Gaussian; 8] {
        [disc(Vec3::new(2.0, 0.0, 0.0), 1.0, 0.9); 8]
    }

    /// A lamp of power 4π at the origin: at a distance of 0.2 a surface that faces it has its albedo
    /// over π times 25.
    fn kept(discs: &[Gaussian], lamp: &Lamp) -> Vec<bool> {
        let shines = Gaussian {
            scale: Vec2::splat(0.1),
            emission: 1.0,
            ..disc(Vec3::ZERO, 100.0, 0.99)
        };
        let scene: Gaussians = discs
            .iter()
            .copied()
            .chain([shines])
            .chain(walls())
            .collect();
        let lamps = Lamps {
            lamps: vec![lamp.clone()],
        };
        let keep = without_strays(&Device::Cpu, (&scene, discs.len()), &lamps).unwrap();
        keep[..discs.len()].to_vec()
    }

    fn ball() -> Lamp {
        let frame = (Vec3::ZERO, Quat::IDENTITY, Vec3::splat(0.04));
        Lamp {
            power: [4.0 * PI; 3],
            ..Lamp::unmeasured(LampShape::Ball, frame, (0.001, Vec3::ONE))
        }
    }

    #[test]
    fn what_stays_dark_beside_a_lamp_is_not_there() {
        let least = LEAST_ALBEDO / PI * 25.0;
        for side in [0.2, -0.2] {
            let at = Vec3::new(side, 0.0, 0.0);
            assert_eq!(kept(&[disc(at, 0.9 * least, 0.5)], &ball()), [false]);
            assert_eq!(kept(&[disc(at, 1.1 * least, 0.5)], &ball()), [true]);
            // A shade is opaque, and hides what is outside.
            let shade = disc(0.5 * at, 0.0, 0.9);
            let outside = disc(at, 0.2 * least, 0.5);
            assert_eq!(kept(&[outside, shade], &ball()), [true; 2]);
            let clear = disc(0.5 * at, 0.0, 0.5);
            assert_eq!(kept(&[outside, clear], &ball()), [false; 2]);
        }
        // Black glass is no closer than this.
        let far = Vec3::new(0.4, 0.0, 0.0);
        assert_eq!(kept(&[disc(far, 0.0, 0.5)], &ball()), [true]);
    }

    #[test]
    fn of_a_heap_around_a_lamp_what_lies_at_a_surface_stays() {
        let at = |x: f32| disc(Vec3::new(x, 0.0, 0.0), 1.0, 0.9);
        let emits = Gaussian {
            emission: 1.0,
            ..at(0.1)
        };
        let discs = [at(0.1), at(0.2), at(0.5), emits, at(0.1)];
        let scene: Gaussians = discs.into_iter().chain(walls()).collect();
        let lamps = |lamp: Lamp| Lamps { lamps: vec![lamp] };
        let surface = |place: Vec3| (place.x - 0.2).abs() < 0.01;
        let keep = without_heaps((&scene, 4), &lamps(ball()), surface);
        // At a surface, far away, emitting, the lamp's own.
        assert_eq!(keep[..5], [false, true, true, true, true]);
        let panel = Lamp {
            shape: LampShape::Panel,
            ..ball()
        };
        let keep = without_heaps((&scene, 4), &lamps(panel), surface);
        assert!(keep.iter().all(|stays| *stays));
    }

    #[test]
    fn only_bare_lamps_that_shine_to_all_sides_tell() {
        let dark = disc(Vec3::new(0.2, 0.0, 0.0), 0.0, 0.5);
        for lamp in [
            Lamp {
                shape: LampShape::Panel,
                ..ball()
            },
            Lamp {
                shade: 0.1,
                ..ball()
            },
        ] {
            assert_eq!(kept(&[dark], &lamp), [true]);
        }
        assert_eq!(kept(&[dark], &ball()), [false]);
    }

    /// The walls are 2 m away: 0.6 m from a lantern of 0.4 m nothing is beside it.
    #[test]
    fn the_room_is_not_beside_a_large_lamp() {
        let lantern = Lamp {
            size: [0.4; 3],
            power: [400.0; 3],
            ..ball()
        };
        let at = |x: f32| disc(Vec3::new(x, 0.0, 0.0), 0.0, 0.5);
        assert_eq!(kept(&[at(0.7), at(0.8)], &lantern), [false, true]);
    }
}
