//! Surfaces that reflect no more than they receive.
//!
//! Albedos of single Gaussians may exceed 1 where texture is finer than they are; what may not is
//! the blend of a pixel. Where lamps are too weak it does, and light would grow with each bounce.
//!
//! What exceeds it by little is white, seen in noisy light. What exceeds it by far is not bright for
//! its albedo: blinds that light comes through, bars of a window, highlights. Under another lamp
//! they would be the brightest things of the room if they were white; nothing is known of them, and
//! they get the usual albedo of the scene.

use crate::error::Result;
use eagpt_scene::{Camera, Gaussians};
use eagpt_trace::{Device, Features};

/// Largest albedo of a surface: whiter paints are not sold.
const MAX_SURFACE: f32 = 0.98;
/// Albedos that noise makes of white, at most, and albedos that say nothing, at least.
const UNLIKELY: [f32; 2] = [1.05, 1.5];

/// Darkens the Gaussians of surfaces whose albedo, in the mean of the pixels that `cameras` have of
/// them, is above [`MAX_SURFACE`] in any channel; returns how many.
///
/// # Errors
/// If the device fails.
pub(crate) fn limit_albedos(
    device: &Device,
    scene: &mut Gaussians,
    cameras: &[Camera],
) -> Result<usize> {
    let tracer = device.scene(scene)?;
    let surface = |_: usize, pixel: &Features| {
        let alpha = pixel.alpha().max(f32::MIN_POSITIVE);
        (pixel.albedo() / alpha).max_element()
    };
    let mut blended = vec![0.0_f32; scene.len()];
    let mut weights = vec![0.0_f32; scene.len()];
    for camera in cameras {
        let (_, contributions) = tracer.contributions(camera, &surface)?;
        for found in contributions {
            blended[found.gaussian as usize] += found.weighted_value;
            weights[found.gaussian as usize] += found.weight;
        }
    }
    let usual = usual(&blended, &weights);
    let mut num = 0;
    for (albedo, (blended, weight)) in (scene.albedos.iter_mut()).zip(blended.iter().zip(&weights))
    {
        if *blended > MAX_SURFACE * weight {
            let surface = blended / weight;
            *albedo *= believed(surface, usual) / surface;
            num += 1;
        }
    }
    Ok(num)
}

/// The mean albedo of surfaces that may have theirs; the largest if none may.
fn usual(blended: &[f32], weights: &[f32]) -> f32 {
    let (mut sum, mut all) = (0.0_f64, 0.0_f64);
    for (blended, weight) in blended.iter().zip(weights) {
        if *blended <= MAX_SURFACE * weight {
            sum += f64::from(*blended);
            all += f64::from(*weight);
        }
    }
    match all > 0.0 {
        true => (sum / all) as f32,
        false => MAX_SURFACE,
    }
}

/// The albedo of a surface that has one above [`MAX_SURFACE`], among others of a `usual` one.
fn believed(surface: f32, usual: f32) -> f32 {
    let [likely, unlikely] = UNLIKELY;
    let share = ((surface - likely) / (unlikely - likely)).clamp(0.0, 1.0);
    MAX_SURFACE + (usual - MAX_SURFACE) * share
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test ends with its first surprise")]

    use super::*;
    use eagpt_scene::discs::{Material, Solid, Surface};
    use eagpt_scene::{Gaussian, Gloss};
    use glam::{DVec3, Vec3};

    #[test]
    fn what_is_too_bright_for_white_paint_has_the_usual_albedo() {
        let (blended, weights) = ([0.8, 0.2, 9.0, 0.0], [2.0, 0.5, 3.0, 0.0]);
        let usual = usual(&blended, &weights);
        assert!((usual - 0.4).abs() < 1e-6);
        let [likely, unlikely] = UNLIKELY;
        for (surface, albedo) in [
            (0.99, MAX_SURFACE),
            (likely, MAX_SURFACE),
            (0.5 * (likely + unlikely), 0.5 * (MAX_SURFACE + usual)),
            (unlikely, usual),
            (3.0, usual),
        ] {
            let found = believed(surface, usual);
            assert!((found - albedo).abs() < 1e-6, "{surface}: {found}");
        }
    }

    /// A wall with albedos 1.4 and 0.2 by turns keeps them, one of 1.4 and 1.0 is darkened.
    #[test]
    fn blends_stay_below_one_and_single_gaussians_need_not() {
        let wall = Surface {
            solid: Solid::Quad {
                centre: Vec3::ZERO,
                edges: [Vec3::X, Vec3::Y],
            },
            material: Material {
                albedo: Vec3::ONE,
                radiance: None,
                gloss: Gloss::NONE,
            },
            spacing: Some(0.02),
        };
        let checked = |dark: f32| -> Gaussians {
            let discs = wall.discs();
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
        let num = limit_albedos(&Device::Cpu, &mut fine, &[camera]).unwrap();
        // Some at the edge have no dark neighbours before them.
        assert!(num < fine.len() / 50, "{num} of {}", fine.len());
        let mut bright = checked(1.0);
        let num = limit_albedos(&Device::Cpu, &mut bright, &[camera]).unwrap();
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
