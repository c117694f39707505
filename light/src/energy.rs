//! Surfaces that reflect no more than they receive.
//!
//! Albedos of single Gaussians may exceed 1 where texture is finer than they are; what may not is
//! the blend of a pixel. Where lamps are too weak it does, and light would grow with each bounce.
//!
//! Training leaves out pixels of emitters. Nothing is known of a surface that these alone show, as
//! a blind that light comes through, and under another lamp it would be the brightest thing of the
//! room if it were white: it is no brighter than the mean of the scene. Clean lamps keep the albedo
//! that they were given, or have learned in a light in which they are off.

use eagpt_scene::{Camera, Gaussians};
use eagpt_trace::{Device, Features, TraceError};
use glam::Vec3;

/// Largest albedo of a surface: whiter paints are not sold.
pub const MAX_SURFACE: f32 = 0.98;

/// Darkens the Gaussians of surfaces whose albedo, in the mean of the pixels that `cameras` have of
/// them, is above [`MAX_SURFACE`] in any channel; returns how many. Pixels that emit more than
/// `threshold` say nothing. The first `num_moving` Gaussians are not of clean lamps.
///
/// # Errors
/// If the device fails.
pub fn limit_albedos(
    device: &Device,
    (scene, num_moving): (&mut Gaussians, usize),
    cameras: &[Camera],
    threshold: f32,
) -> Result<usize, TraceError> {
    let tracer = device.scene(scene)?;
    let is_known = |pixel: &Features| pixel.emission() <= threshold;
    let known = |_: usize, pixel: &Features| f32::from(is_known(pixel));
    let surface = |index: usize, pixel: &Features| {
        let alpha = pixel.alpha().max(f32::MIN_POSITIVE);
        known(index, pixel) * (pixel.albedo() / alpha).max_element()
    };
    let mut shown = vec![Shown::default(); scene.len()];
    for camera in cameras {
        let (features, contributions) = tracer.contributions(camera, &surface)?;
        let all_known = features.pixels.iter().all(is_known);
        for found in contributions {
            let of = &mut shown[found.gaussian as usize];
            of.albedo += found.weighted_value;
            of.all += found.weight;
            if all_known {
                of.known += found.weight;
            }
        }
        if !all_known {
            for found in tracer.contributions(camera, &known)?.1 {
                shown[found.gaussian as usize].known += found.weighted_value;
            }
        }
    }
    let mean = mean(&shown);
    let mut num = 0;
    for (i, (albedo, shown)) in scene.albedos.iter_mut().zip(&shown).enumerate() {
        if shown.is_too_bright() {
            *albedo *= MAX_SURFACE * shown.known / shown.albedo;
            num += 1;
        }
        if shown.known < shown.all && i < num_moving {
            let unknown = albedo.min(Vec3::splat(mean));
            *albedo = unknown.lerp(*albedo, shown.known / shown.all);
        }
    }
    Ok(num)
}

/// Sums over the pixels that show a Gaussian, by its weight in each.
#[derive(Debug, Clone, Copy, Default)]
struct Shown {
    /// Albedo of the surface, in pixels that say something.
    albedo: f32,
    /// Weight in these.
    known: f32,
    /// Weight in all pixels.
    all: f32,
}

impl Shown {
    fn is_too_bright(self) -> bool {
        self.albedo > MAX_SURFACE * self.known
    }
}

/// The mean albedo of surfaces that may have theirs; the largest if none may.
fn mean(shown: &[Shown]) -> f32 {
    let (mut sum, mut all) = (0.0_f64, 0.0_f64);
    for shown in shown.iter().filter(|shown| !shown.is_too_bright()) {
        sum += f64::from(shown.albedo);
        all += f64::from(shown.known);
    }
    match all > 0.0 {
        true => (sum / all) as f32,
        false => MAX_SURFACE,
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test ends with its first surprise")]

    use super::*;
    use eagpt_scene::discs::{Material, Solid, Surface};
    use eagpt_scene::{Gaussian, Gloss};
    use glam::{DVec3, Vec3};

    /// A wall of one unit squared about `centre`.
    fn wall(centre: Vec3, albedo: f32, radiance: Option<Vec3>, spacing: f32) -> Gaussians {
        let wall = Surface {
            solid: Solid::Quad {
                centre,
                edges: [Vec3::X, Vec3::Y],
            },
            material: Material {
                albedo: Vec3::splat(albedo),
                radiance,
                gloss: Gloss::NONE,
            },
            spacing: Some(spacing),
        };
        wall.discs()
    }

    /// Of a wall in pixels that emit and one beside it, the first is no brighter than the second,
    /// and no brighter than it was.
    #[test]
    fn a_surface_that_emitters_alone_show_is_no_brighter_than_the_rest() {
        // A ray meets every disc, the narrow ones at corners, too.
        let camera =
            eagpt_testkit::gaussians::look_at(DVec3::new(0.0, 0.0, 3.0), DVec3::ZERO, 640, 480);
        for (unknown, is_lamp, limited) in [(0.9, false, 0.5), (0.2, false, 0.2), (0.9, true, 0.9)]
        {
            let emitting = wall(-Vec3::X, unknown, Some(Vec3::ONE), 0.05);
            let reflecting = wall(Vec3::X, 0.5, None, 0.05);
            let mut scene: Gaussians = reflecting.iter().chain(emitting.iter()).collect();
            let num_moving = if is_lamp {
                reflecting.len()
            } else {
                scene.len()
            };
            limit_albedos(&Device::Cpu, (&mut scene, num_moving), &[camera], 0.1).unwrap();
            for (i, albedo) in scene.albedos.iter().enumerate() {
                let wanted = if i < reflecting.len() { 0.5 } else { limited };
                // At edges pixels emit too little to count.
                assert!((albedo.x - wanted).abs() < 0.05, "{i}: {albedo}");
            }
        }
    }

    /// A wall with albedos 1.4 and 0.2 by turns keeps them, one of 1.4 and 1.0 is darkened.
    #[test]
    fn blends_stay_below_one_and_single_gaussians_need_not() {
        let checked = |dark: f32| -> Gaussians {
            let discs = wall(Vec3::ZERO, 1.0, None, 0.02);
            let with = |(i, disc): (usize, Gaussian)| {
                let albedo = if i % 2 == 0 { 1.4 } else { dark };
                Gaussian {
                    albedo: Vec3::splat(albedo),
                    ..disc
                }
            };
            discs.iter().enumerate().map(with).collect()
        };
        let camera =
            eagpt_testkit::gaussians::look_at(DVec3::new(0.0, 0.0, 2.0), DVec3::ZERO, 64, 48);
        let mut fine = checked(0.2);
        let all = fine.len();
        let num = limit_albedos(&Device::Cpu, (&mut fine, all), &[camera], 0.1).unwrap();
        // Some at the edge have no dark neighbours before them.
        assert!(num < fine.len() / 50, "{num} of {}", fine.len());
        let mut bright = checked(1.0);
        let all = bright.len();
        let num = limit_albedos(&Device::Cpu, (&mut bright, all), &[camera], 0.1).unwrap();
        assert!(num > bright.len() / 2, "{num} of {}", bright.len());
        let seen = Device::Cpu
            .scene(&bright)
            .unwrap()
            .gbuffer(&camera)
            .unwrap();
        let middle = &seen.pixels[camera.num_pixels() / 2 + camera.width as usize / 2];
        let albedo = middle.albedo().x / middle.alpha();
        assert!((albedo - MAX_SURFACE).abs() < 0.05, "{albedo}");
    }
}
