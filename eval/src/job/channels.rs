//! Channels of renders beside radiance.

use super::renders::Renders;
use crate::error::Result;
use crate::gloss_metrics::{Coat, false_gloss, roughness_mae, specular_mae};
use crate::known::{KnownPixels, pack};
use crate::scene_metrics::{albedo_psnr, depth_mae, emission_overlap, normal_mean_deg};
use crate::view::SceneMetrics;
use eagpt_scene::View;

/// Compares the channels of a view that renders and reference both have.
pub(super) fn scene_metrics(
    view: &View,
    known: Option<&KnownPixels>,
    renders: &Renders,
) -> Result<SceneMetrics> {
    let mut found = SceneMetrics::default();
    let emission = view.emission.as_ref().map(|mask| pack(known, mask));
    let emission = emission.as_deref();
    if let Some(reference) = &view.albedo
        && let Some(test) = renders.albedo(&view.name)?
        && let Some(albedo) = albedo_psnr(&pack(known, reference), &pack(known, &test), emission)
    {
        found.albedo_psnr_srgb_db = Some(albedo.srgb_db);
        found.albedo_psnr_scaled_db = Some(albedo.scaled_srgb_db);
    }
    if let Some(reference) = &view.specular
        && let Some(test) = renders.specular(&view.name)?
    {
        let (reference, test) = (pack(known, reference), pack(known, &test));
        found.specular_mae = specular_mae(&reference, &test, emission);
        found.false_gloss = false_gloss(&reference, &test, emission);
        if let Some(roughness) = &view.roughness
            && let Some(rendered) = renders.roughness(&view.name)?
        {
            let of = |specular, roughness| Coat {
                specular,
                roughness,
            };
            let (roughness, rendered) = (pack(known, roughness), pack(known, &rendered));
            let pair = (of(&*reference, &*roughness), of(&*test, &*rendered));
            found.roughness_mae = roughness_mae(pair, emission);
        }
    }
    if let Some(reference) = &view.normal
        && let Some(test) = renders.normal(&view.name)?
    {
        found.normal_mean_deg = normal_mean_deg(&pack(known, reference), &pack(known, &test));
    }
    if let Some(reference) = &view.depth
        && let Some(test) = renders.depth(&view.name)?
    {
        found.depth_mae = depth_mae(&pack(known, reference), &pack(known, &test));
    }
    if let Some(reference) = emission
        && let Some(test) = renders.emission(&view.name)?
    {
        let overlap = emission_overlap(reference, &pack(known, &test));
        found.emission_iou = overlap.iou();
        found.emission_overlap = overlap.iou().map(|_| overlap);
    }
    Ok(found)
}
