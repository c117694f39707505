//! Surfaces that reflect no more than they receive.
//!
//! Albedos of single Gaussians may exceed 1 where texture is finer than they are; what may not is
//! the blend of a pixel. Where lamps are too weak it does, and light would grow with each bounce.

use crate::error::Result;
use eagpt_scene::{Camera, Gaussians};
use eagpt_trace::{Device, Features};

/// Largest albedo of a surface: whiter paints are not sold.
const MAX_SURFACE: f32 = 0.98;

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
    let mut num = 0;
    for (albedo, (blended, weight)) in (scene.albedos.iter_mut()).zip(blended.iter().zip(&weights))
    {
        if *blended > MAX_SURFACE * weight {
            *albedo *= MAX_SURFACE * weight / blended;
            num += 1;
        }
    }
    Ok(num)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test ends with its first surprise")]

    use super::*;
    use eagpt_scene::discs::{Material, Solid, Surface};
    use eagpt_scene::{Gaussian, Gloss};
    use glam::{DVec3, Vec3};

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
