//! Denoising of rendered views, and the guides of the denoiser.

use crate::RenderJob;
use eagpt_denoise::{DenoiseError, Denoiser, Frame};
use eagpt_scene::{Camera, Image};
use eagpt_trace::transport::start::Surface;
use eagpt_trace::{Guide, Integrator, RenderedView};
use glam::Vec3;

/// A view with its light denoised.
///
/// `rays` is the view before its rays are averaged to `pixels`; `camera` is that of the rays.
///
/// # Errors
/// If the denoiser gives up.
pub(crate) fn denoised(
    job: &RenderJob<'_>,
    denoiser: &Denoiser,
    camera: &Camera,
    rays: &RenderedView,
    pixels: &RenderedView,
) -> Result<Image<3>, DenoiseError> {
    let frame = frame(job, camera, rays, pixels);
    let mut image = denoiser.denoise(&frame)?;
    // A pixel that counts as an emitter stays as it is, even if some of its rays pass the emitter
    // by.
    let emitters = pixels.features.pixels.iter().zip(pixels.radiance.pixels());
    for (pixel, (features, light)) in image.pixels_mut().iter_mut().zip(emitters) {
        if features.emission() > job.light.emission_threshold {
            *pixel = *light;
        }
    }
    Ok(image)
}

/// The guides of the denoiser: light of emitters and reflected light apart, albedo, normals and
/// positions.
fn frame(
    job: &RenderJob<'_>,
    camera: &Camera,
    rays: &RenderedView,
    pixels: &RenderedView,
) -> Frame {
    let samples_per_ray = match job.integrator {
        Integrator::ZeroBounce => 0,
        Integrator::OneBounce { num_samples }
        | Integrator::Gather { num_samples }
        | Integrator::Path { num_samples, .. } => num_samples,
    };
    let (factor, threshold) = (job.rays_per_axis, job.light.emission_threshold);
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
        let mut num_hits = 0.0;
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
            let guide = rays.guides.get(ray).copied().unwrap_or(Guide {
                albedo: features.albedo(),
                normal: surface.normal,
                position: surface.position,
                exact: Vec3::ZERO,
            });
            num_hits += 1.0;
            let noisy = Vec3::from(light) - guide.exact;
            add(
                &mut frame.emitted.pixels_mut()[i],
                guide.exact.into(),
                share,
            );
            add(&mut frame.reflected.pixels_mut()[i], noisy.into(), share);
            add(
                &mut frame.albedo.pixels_mut()[i],
                guide.albedo.into(),
                share,
            );
            add(&mut frame.normal.pixels_mut()[i], guide.normal.into(), 1.0);
            add(
                &mut frame.position.pixels_mut()[i],
                guide.position.into(),
                1.0,
            );
            add(
                &mut frame.second_moment.pixels_mut()[i],
                rays.second_moment.pixels()[ray],
                1.0,
            );
        }
        if num_hits > 0.0 {
            let inverse = 1.0 / num_hits;
            for value in &mut frame.normal.pixels_mut()[i] {
                *value *= inverse;
            }
            for value in &mut frame.position.pixels_mut()[i] {
                *value *= inverse;
            }
            frame.second_moment.pixels_mut()[i][0] *= inverse;
            frame.coverage.pixels_mut()[i] = [num_hits * share];
        }
    }
    frame
}

fn add<const C: usize>(sum: &mut [f32; C], value: [f32; C], share: f32) {
    for (sum, value) in sum.iter_mut().zip(value) {
        *sum += share * value;
    }
}
