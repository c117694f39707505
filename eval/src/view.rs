//! The metrics of one view.

use crate::align::AlignedMetrics;
use crate::pair::{ImageMetrics, decibels};
use crate::regions::Regions;
use crate::scene_metrics::Overlap;
use serde::{Deserialize, Serialize};

/// Metrics of the channels beside radiance; `None` where the render or the reference lacks the
/// channel, or no pixel can be compared.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct SceneMetrics {
    /// See `scene_metrics::albedo_psnr`; infinite for equal albedos, which is `null` in
    /// JSON.
    #[serde(
        skip_serializing_if = "Option::is_none",
        with = "decibels::optional",
        default
    )]
    pub albedo_psnr_srgb_db: Option<f64>,
    /// The same after a fitted scale.
    #[serde(
        skip_serializing_if = "Option::is_none",
        with = "decibels::optional",
        default
    )]
    pub albedo_psnr_scaled_db: Option<f64>,
    /// See `gloss_metrics::specular_mae`.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub specular_mae: Option<f64>,
    /// See `gloss_metrics::false_gloss`.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub false_gloss: Option<f64>,
    /// See `gloss_metrics::roughness_mae`.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub roughness_mae: Option<f64>,
    /// See `scene_metrics::normal_mean_deg`.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub normal_mean_deg: Option<f64>,
    /// See `scene_metrics::depth_mae`.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub depth_mae: Option<f64>,
    /// See `scene_metrics::emission_overlap`; kept because the views' overlaps make up that of all
    /// pixels.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub(crate) emission_overlap: Option<Overlap>,
    /// See `Overlap::iou`.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub emission_iou: Option<f64>,
}

/// Source of the emitters of a view.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum EmittersFrom {
    /// The emission mask of the reference.
    Reference,
    /// The channel `emission` of the renders, for want of that mask: a scene knows where its lamps
    /// were put.
    Render,
}

/// All metrics of one view.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ViewMetrics {
    /// Name of the view.
    pub name: String,
    /// Metrics of radiance.
    #[serde(flatten)]
    pub image: ImageMetrics,
    /// The same with the exposure of all views aligned; `None` if there is nothing to align.
    #[serde(flatten)]
    pub aligned: Option<AlignedMetrics>,
    /// Metrics of the other channels.
    #[serde(flatten)]
    pub scene: SceneMetrics,
    /// Source of the emitters; `None` if they are unknown.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub(crate) emitters_from: Option<EmittersFrom>,
    /// The error by region, as far as regions are known.
    #[serde(skip_serializing_if = "Regions::is_empty", default)]
    pub regions: Regions,
}
