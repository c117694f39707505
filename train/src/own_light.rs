//! The light of a trained scene, solved, against its photographs.
//!
//! Training takes radiance from photographs, and albedo from one bounce of that radiance. Whether
//! emitters, albedo and geometry explain the photographs together, the light of all bounces tells:
//! it is solved in Gaussian space as [`crate::bake`] does after an edit, and seen by training views
//! ([`eagpt_eval::psnr_srgb`], [`eagpt_eval::ExposureFit`]). Before an edit nothing should change.

use crate::backend::TrainingView;
use crate::bake::gaussians::GaussianBake;
use crate::bake::solution::Solution;
use crate::error::Result;
use crate::irradiance::usual_samples;
use crate::progress::BakeProgress;
use eagpt_eval::{ExposureFit, KnownPixels, psnr_srgb};
use eagpt_scene::machine::available_memory;
use eagpt_scene::{Camera, Gaussians, Image};
use eagpt_trace::transport::MAX_BOUNCES;
use eagpt_trace::{CameraRays, Device};
use serde::Serialize;
use std::ops::ControlFlow;

/// Views compared, at most.
pub(crate) const MOST_VIEWS: usize = 16;

/// How a scene in its own light compares with the photographs of training views.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct OwnLight {
    /// Mean over views of the PSNR, clipped sRGB, dB.
    pub psnr_srgb_db: f64,
    /// By this the rendered light is to be multiplied to be as bright as the photographs, over
    /// pixels that do not emit and are at most 1; `None` where there are none, or all are black.
    pub exposure_scale: Option<f64>,
    /// The same of each channel.
    pub exposure_scale_rgb: Option<[f64; 3]>,
    /// Number of views.
    pub num_views: usize,
}

/// Solves the light of `scene` with the cameras of all training views, and compares `views`, of
/// those some. `None` where nothing emits, or `told` has ended it.
///
/// # Errors
/// If the device fails or a view cannot be read.
pub(crate) fn measure(
    (device, seed): (&Device, u64),
    scene: Gaussians,
    cameras: &[Camera],
    views: impl Iterator<Item = Result<TrainingView>>,
    told: &mut dyn FnMut(BakeProgress) -> ControlFlow<()>,
) -> Result<Option<OwnLight>> {
    let solution = Solution {
        device,
        cameras,
        method: GaussianBake {
            num_samples: Some(num_samples(scene.len(), available_memory())),
        },
        max_bounces: MAX_BOUNCES,
        seed,
    };
    let Some(baked) = solution.of(scene, told)? else {
        return Ok(None);
    };
    compare(device, &baked, views)
}

/// Compares `scene` with `views`; `None` without any.
///
/// # Errors
/// If the device fails or a view cannot be read.
pub(crate) fn compare(
    device: &Device,
    scene: &Gaussians,
    views: impl Iterator<Item = Result<TrainingView>>,
) -> Result<Option<OwnLight>> {
    let tracer = device.scene(scene)?;
    let mut exposure = ExposureFit::default();
    let (mut total, mut num_views) = (0.0, 0);
    for training in views {
        let view = training?.view;
        let finer = view.camera.magnified(CameraRays::RAYS_PER_AXIS);
        let features = tracer.gbuffer(&finer)?.averaged(CameraRays::RAYS_PER_AXIS);
        let rendered = features.radiance();
        let seen;
        let emission = match &view.emission {
            Some(mask) => mask,
            None => {
                seen = features.extract(|pixel| [pixel.emission()]);
                &seen
            }
        };
        let known = view.valid.as_ref().map(KnownPixels::new);
        let Some(reference) = part(known.as_ref(), &view.radiance) else {
            continue;
        };
        // The same pixels of images of the same size.
        let test = part(known.as_ref(), &rendered).unwrap_or(rendered);
        let emission = part(known.as_ref(), emission);
        total += psnr_srgb(&reference, &test);
        exposure.add(&reference, &test, emission.as_ref());
        num_views += 1;
    }
    Ok((num_views > 0).then(|| OwnLight {
        psnr_srgb_db: total / num_views as f64,
        exposure_scale: exposure.scale(),
        exposure_scale_rgb: exposure.scale_of_channels(),
        num_views,
    }))
}

/// The known pixels of an image; `None` without any.
fn part<const C: usize>(known: Option<&KnownPixels>, image: &Image<C>) -> Option<Image<C>> {
    match known {
        Some(known) => known.of(image),
        None => Some(image.clone()),
    }
}

/// Directions at each of `num` Gaussians whose entries half of the `available` memory holds.
fn num_samples(num: usize, available: Option<u64>) -> u32 {
    let each = 4 * num.max(1) as u64;
    let most = available.map_or(u64::MAX, |bytes| bytes / 2 / each);
    u64::from(usual_samples(num)).min(most).max(2) as u32
}

#[cfg(test)]
mod tests {
    use super::*;
    use eagpt_testkit::gaussians::random_cloud;

    #[test]
    fn a_scene_without_emitters_is_left_alone() {
        let mut scene = random_cloud(20, 1);
        scene.emissions.fill(0.1);
        let mut told = |step| panic!("{step:?}");
        let device = (&Device::Cpu, 0);
        let found = measure(device, scene, &[], std::iter::empty(), &mut told);
        assert_eq!(found.unwrap(), None);
    }

    #[test]
    fn fewer_directions_are_traced_where_memory_is_short() {
        let usual = usual_samples(1000);
        assert_eq!(num_samples(1000, None), usual);
        assert_eq!(num_samples(1000, Some(1 << 30)), usual);
        assert_eq!(num_samples(1000, Some(2 * 4 * 1000 * 20)), 20);
        assert_eq!(num_samples(1000, Some(0)), 2);
        assert_eq!(num_samples(0, Some(1 << 30)), usual);
    }
}
