//! The light of a trained scene, solved, against its photographs.
//!
//! Training takes radiance from photographs, and albedo from one bounce of that radiance. Whether
//! emitters, albedo and geometry explain the photographs together, the light of all bounces tells:
//! it is solved in Gaussian space as [`crate::bake`] does after an edit, and seen by training views
//! ([`eagpt_eval::psnr_srgb`], [`eagpt_eval::ExposureFit`]). Before an edit nothing should change.
//!
//! Bounces multiply: in a white room, albedos that are all too large by a hundredth make it brighter
//! by four. How bright the room is beside its photographs tells them better than one bounce does,
//! and they are all made larger or smaller by that ([`balance`]).

mod balance;

pub(crate) use balance::{Balance, balance};

use crate::backend::TrainingView;
use crate::error::Result;
use eagpt_eval::{ExposureFit, KnownPixels, psnr_srgb};
use eagpt_scene::color::luminance;
use eagpt_scene::lamps::emits;
use eagpt_scene::median::median_of;
use eagpt_scene::{Gaussians, Image};
use eagpt_trace::{CameraRays, Device};
use serde::Serialize;

/// Views compared, at most.
pub(crate) const MOST_VIEWS: usize = 16;
/// Pixels of each, at most, whose median is taken.
const MOST_PIXELS: usize = 1 << 16;
/// Luminance of a pixel, relative to white, from which on its ratio says something.
const LEAST_LUMINANCE: f32 = 1e-3;

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
    /// The same of the luminance of the median pixel, which errors of single places leave as it is.
    pub median_scale: Option<f64>,
    /// Number of views.
    pub num_views: usize,
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
    let mut ratios = Vec::new();
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
        add_ratios(&mut ratios, (&reference, &test), emission.as_ref());
        num_views += 1;
    }
    Ok((num_views > 0).then(|| OwnLight {
        psnr_srgb_db: total / num_views as f64,
        exposure_scale: exposure.scale(),
        exposure_scale_rgb: exposure.scale_of_channels(),
        median_scale: (!ratios.is_empty()).then(|| f64::from(median_of(ratios.into_iter()))),
        num_views,
    }))
}

/// Adds the luminance of pixels of a reference over that of a rendering, of those that do not emit
/// and are neither black nor brighter than 1.
fn add_ratios(
    ratios: &mut Vec<f32>,
    (reference, test): (&Image<3>, &Image<3>),
    emission: Option<&Image<1>>,
) {
    let step = reference.pixels().len().div_ceil(MOST_PIXELS);
    for i in (0..reference.pixels().len()).step_by(step) {
        let emits = emission.is_some_and(|mask| emits(mask.pixels()[i][0]));
        let [reference, test] = [reference, test].map(|image| luminance(image.pixels()[i]));
        if !emits && (LEAST_LUMINANCE..=1.0).contains(&reference) && test > 0.0 {
            ratios.push(reference / test);
        }
    }
}

/// The known pixels of an image; `None` without any.
fn part<const C: usize>(known: Option<&KnownPixels>, image: &Image<C>) -> Option<Image<C>> {
    match known {
        Some(known) => known.of(image),
        None => Some(image.clone()),
    }
}
