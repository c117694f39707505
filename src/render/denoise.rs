//! Denoising of rendered views: which denoiser runs, and what it gets to see.

use super::RenderArgs;
use anyhow::{Result, bail};
use clap::ValueEnum;
use eagpt_denoise::{Denoiser, Frame, Identity};
use eagpt_scene::{Camera, Image};
use eagpt_trace::RenderedView;
use eagpt_trace::transport::start::Surface;
use serde::Serialize;

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Choice {
    /// Leave the noise
    None,
    /// Open Image Denoise where it is found, the filter elsewhere
    Auto,
    /// Open Image Denoise 2, a library loaded at run time; an error where it is not found
    Oidn,
    /// The program's own filter
    Filter,
}

/// What was asked for and what runs, for the record.
#[derive(Serialize)]
pub(super) struct Denoising {
    pub(super) asked: Choice,
    /// Null if nothing is denoised.
    pub(super) ran: Option<Identity>,
}

/// The denoiser of a job; `None` if nothing is to be denoised.
///
/// # Errors
/// If the library that was asked for cannot be used.
pub(super) fn denoiser(args: &RenderArgs) -> Result<Option<Denoiser>> {
    let path = args.oidn.as_deref();
    if let (Some(path), Choice::None | Choice::Filter) = (path, args.denoise) {
        bail!(
            "--oidn {}: of use only with --denoise auto or oidn",
            path.display()
        );
    }
    Ok(match args.denoise {
        Choice::None => None,
        Choice::Auto => Some(Denoiser::auto(path)?),
        Choice::Oidn => Some(Denoiser::oidn(path)?),
        Choice::Filter => Some(Denoiser::filter()),
    })
}

/// A view with its light denoised.
///
/// `rays` is the view before its rays, `args.antialias` along each axis of a pixel, are averaged to
/// `pixels`; `camera` is that of the rays.
///
/// # Errors
/// If the denoiser gives up.
pub(super) fn denoised(
    args: &RenderArgs,
    denoiser: &Denoiser,
    camera: &Camera,
    rays: &RenderedView,
    pixels: &RenderedView,
) -> Result<Image<3>> {
    let num_rays = args.antialias.pow(2);
    let frame = frame(args, camera, rays, pixels, args.spp.div_ceil(num_rays));
    let mut image = denoiser.denoise(&frame)?;
    // A pixel that counts as an emitter stays as it is, even if some of its rays pass the emitter
    // by.
    let emitters = pixels.features.pixels.iter().zip(pixels.radiance.pixels());
    for (pixel, (features, light)) in image.pixels_mut().iter_mut().zip(emitters) {
        if features.emission() > args.emission_threshold {
            *pixel = *light;
        }
    }
    Ok(image)
}

/// The light taken apart.
fn frame(
    args: &RenderArgs,
    camera: &Camera,
    rays: &RenderedView,
    pixels: &RenderedView,
    samples_per_ray: u32,
) -> Frame {
    let (factor, threshold) = (args.antialias, args.emission_threshold);
    let (width, height) = pixels.radiance.size();
    let black = Image::filled(width, height, [0.0; 3]);
    let zero = Image::filled(width, height, [0.0]);
    let mut frame = Frame {
        emitted: black.clone(),
        reflected: black.clone(),
        albedo: black.clone(),
        normal: black.clone(),
        position: black,
        coverage: zero.clone(),
        second_moment: zero,
        num_samples: samples_per_ray * factor * factor,
    };
    let view = camera.ray_frame();
    let share = 1.0 / (factor * factor) as f32;
    for i in 0..pixels.features.pixels.len() {
        let (x0, y0) = (i as u32 % width * factor, i as u32 / width * factor);
        let mut met = 0.0;
        for (x, y) in (y0..y0 + factor).flat_map(|y| (x0..x0 + factor).map(move |x| (x, y))) {
            let ray = (y * camera.width + x) as usize;
            let features = &rays.features.pixels[ray];
            let light = rays.radiance.pixels()[ray];
            if features.emission() > threshold {
                add(&mut frame.emitted.pixels_mut()[i], light, share);
                continue;
            }
            let direction = view.direction(x as f32 + 0.5, y as f32 + 0.5);
            let Some(surface) = Surface::at(view.origin, direction, features) else {
                continue;
            };
            met += 1.0;
            add(&mut frame.reflected.pixels_mut()[i], light, share);
            add(
                &mut frame.albedo.pixels_mut()[i],
                features.albedo().into(),
                share,
            );
            add(
                &mut frame.normal.pixels_mut()[i],
                surface.normal.into(),
                1.0,
            );
            add(
                &mut frame.position.pixels_mut()[i],
                surface.position.into(),
                1.0,
            );
            add(
                &mut frame.second_moment.pixels_mut()[i],
                rays.second_moment.pixels()[ray],
                1.0,
            );
        }
        if met > 0.0 {
            let inverse = 1.0 / met;
            for value in &mut frame.normal.pixels_mut()[i] {
                *value *= inverse;
            }
            for value in &mut frame.position.pixels_mut()[i] {
                *value *= inverse;
            }
            frame.second_moment.pixels_mut()[i][0] *= inverse;
            frame.coverage.pixels_mut()[i] = [met * share];
        }
    }
    frame
}

fn add<const C: usize>(sum: &mut [f32; C], value: [f32; C], share: f32) {
    for (sum, value) in sum.iter_mut().zip(value) {
        *sum += share * value;
    }
}
