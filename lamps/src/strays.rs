//! Gaussians beside a small lamp that are darker than anything that close to it.
//!
//! Of the surroundings of a lamp few views show more than what is beyond them, and discs in the air
//! that look like it cost nothing: they let little of the lamp's light into the room. A surface
//! there would be bright, or opaque and dark on the side away from the lamp, as a shade is.

use eagpt_scene::color::luminance;
use eagpt_scene::lamps::{Lamp, Lamps};
use eagpt_scene::{Gaussian, Gaussians, LampShape};
use eagpt_trace::transport::EMISSION_THRESHOLD;
use eagpt_trace::{Device, Ray, TraceError};
use glam::Vec3;
use std::f32::consts::PI;

/// Albedo below which there is no surface: soot and black paint have 0.03 and more.
const LEAST_ALBEDO: f32 = 0.02;
/// Distance from a lamp, in its mean sizes, beyond which black things may be. Screens and glass are
/// blacker than paint.
const NEAR: f32 = 6.0;
/// Opacity from which on a Gaussian hides what is behind it.
const OPAQUE: f32 = 0.9;
/// Start of a ray from a disc, in parts of the way to the lamp.
const START: f32 = 1e-3;

/// Whether each of `gaussians` stays, `[n]`. Of others, among the first `num_moving`, which are not
/// the lamps' own, the light that bare `lamps` send them, past what is opaque, would make a surface
/// brighter than they are: to the side that the camera centres `eyes` of the views of a lamp see, or
/// through them if they are not opaque.
///
/// # Errors
/// If the device fails.
pub fn without_strays(
    device: &Device,
    (gaussians, num_moving): (&Gaussians, usize),
    lamps: &Lamps,
    eyes: impl Fn(&Lamp) -> Vec<Vec3>,
) -> Result<Vec<bool>, TraceError> {
    let light = |i: usize| luminance(gaussians.radiances[i].to_array());
    let mut suspects = Vec::new();
    for lamp in lamps.lamps.iter().filter(|lamp| shines_around(lamp)) {
        let eyes = eyes(lamp);
        let (centre, size) = (lamp.centre(), Vec3::from(lamp.size));
        let reach = NEAR * size.element_product().cbrt();
        let intensity = lamp.luminous_power() / (4.0 * PI);
        for i in (0..num_moving).filter(|&i| gaussians.emissions[i] <= EMISSION_THRESHOLD) {
            if lamp.distance(gaussians.positions[i]) > reach {
                continue;
            }
            let towards = centre - gaussians.positions[i];
            let cosine = towards.normalize_or_zero().dot(front(gaussians, i, &eyes));
            let is_lit = cosine > 0.0 || gaussians.opacities[i] < OPAQUE;
            let cosine = if is_lit { cosine.abs() } else { 0.0 };
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
    // They would be in one another's shadow, and in that of others like them.
    suspects.iter().for_each(|suspect| keep[suspect.i] = false);
    let is_there = |(gaussian, keep): &(Gaussian, &bool)| {
        **keep && (gaussian.opacity >= OPAQUE || gaussian.emission > EMISSION_THRESHOLD)
    };
    let others = gaussians.iter().zip(&keep).filter(is_there);
    let others: Gaussians = others.map(|(gaussian, _)| gaussian).collect();
    let rays: Vec<Ray> = suspects.iter().map(|s| s.ray(gaussians)).collect();
    let met = device.scene(&others)?.trace_rays(&rays)?;
    suspects.iter().for_each(|suspect| keep[suspect.i] = true);
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

/// Whether a lamp is small and bare, and sends its light to all sides.
fn shines_around(lamp: &Lamp) -> bool {
    let is_round = matches!(
        lamp.shape,
        LampShape::Ball | LampShape::Tube | LampShape::Box
    );
    is_round && !lamp.one_sided && lamp.shade == 0.0
}

/// Unit normal of a Gaussian on the side that most of `eyes` see.
fn front(gaussians: &Gaussians, i: usize, eyes: &[Vec3]) -> Vec3 {
    let normal = gaussians.normal_of(i);
    let position = gaussians.positions[i];
    let sides = eyes
        .iter()
        .map(|eye| (*eye - position).dot(normal).signum());
    normal * sides.sum::<f32>().signum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use eagpt_scene::{Gloss, Harmonics};
    use glam::{Quat, Vec2};

    /// A disc of this radiance at a place, which is turned towards −x.
    fn disc(at: Vec3, radiance: f32, emission: f32) -> Gaussian {
        Gaussian {
            position: at,
            scale: Vec2::splat(0.03),
            rotation: Quat::from_rotation_arc(Vec3::Z, Vec3::NEG_X),
            opacity: 0.99,
            radiance: Vec3::splat(radiance),
            harmonics: Harmonics::NONE,
            gloss: Gloss::NONE,
            emission,
            albedo: Vec3::ZERO,
        }
    }

    /// A lamp of power 4π at the origin, seen along x: at a distance of 0.2 a surface that faces it
    /// has its albedo over π times 25.
    fn kept(discs: &[Gaussian], lamp: &Lamp) -> Vec<bool> {
        let shines = Gaussian {
            scale: Vec2::splat(0.1),
            ..disc(Vec3::ZERO, 100.0, 1.0)
        };
        let scene: Gaussians = discs.iter().copied().chain([shines]).collect();
        let lamps = Lamps {
            lamps: vec![lamp.clone()],
        };
        let eyes = |_: &Lamp| vec![Vec3::new(-3.0, 0.0, 0.0)];
        let keep = without_strays(&Device::Cpu, (&scene, discs.len()), &lamps, eyes).unwrap();
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
        let beyond = Vec3::new(0.2, 0.0, 0.0);
        let least = LEAST_ALBEDO / PI * 25.0;
        assert_eq!(kept(&[disc(beyond, 0.9 * least, 0.0)], &ball()), [false]);
        assert_eq!(kept(&[disc(beyond, 1.1 * least, 0.0)], &ball()), [true]);
        // Black glass is no closer than this.
        let far = Vec3::new(0.3, 0.0, 0.0);
        assert_eq!(kept(&[disc(far, 0.0, 0.0)], &ball()), [true]);
        // The outside of a shade is dark, and so is what it hides.
        let before = disc(-0.1 * Vec3::X, 0.1, 0.0);
        assert_eq!(kept(&[before], &ball()), [true]);
        let clear = Gaussian {
            opacity: 0.5,
            ..before
        };
        assert_eq!(kept(&[clear], &ball()), [false]);
        assert_eq!(
            kept(&[clear, disc(-0.05 * Vec3::X, 0.1, 0.0)], &ball()),
            [true; 2]
        );
        let between = disc(0.1 * Vec3::X, 9.0, 0.0);
        assert_eq!(
            kept(&[disc(beyond, 0.5 * least, 0.0), between], &ball()),
            [true; 2]
        );
    }

    #[test]
    fn only_bare_lamps_that_shine_to_all_sides_tell() {
        let dark = disc(Vec3::new(0.2, 0.0, 0.0), 0.0, 0.0);
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
}
