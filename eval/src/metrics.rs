//! The table of all metrics: one row has everything that outputs need about a metric.

use crate::scene_metrics::Overlap;
use crate::view::ViewMetrics;

/// Direction in which a metric improves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Better {
    /// Larger values.
    Higher,
    /// Smaller values.
    Lower,
    /// Values near 1.
    One,
}

/// Population over which the mean of a metric is taken.
#[derive(Debug, Clone, Copy)]
pub enum MeanOf {
    /// The values of the views that have one.
    Views,
    /// The pixels of all views together.
    Pixels(fn(&[ViewMetrics]) -> Option<f64>),
}

/// One metric of a view.
#[derive(Debug)]
pub struct Metric {
    /// Name in JSON and CSV; the unit is in it where there is one.
    pub key: &'static str,
    /// Heading in tables.
    pub heading: &'static str,
    /// Direction of improvement.
    pub better: Better,
    /// Decimals in tables.
    pub num_decimals: usize,
    /// Definition, as written into the outputs.
    pub definition: &'static str,
    /// Population of the mean.
    pub mean: MeanOf,
    /// The value of a view; `None` if it could not be measured.
    pub of: fn(&ViewMetrics) -> Option<f64>,
}

/// All metrics, in the order of every output.
pub static METRICS: [Metric; 18] = [
    Metric {
        key: "psnr_srgb_db",
        heading: "PSNR sRGB",
        better: Better::Higher,
        num_decimals: 2,
        definition: "mean over R, G, B of each channel's dB; sRGB clipped to [0, 1], peak 1; null if infinite",
        mean: MeanOf::Views,
        of: |view| Some(view.image.psnr_srgb_db),
    },
    Metric {
        key: "psnr_linear_db",
        heading: "PSNR linear",
        better: Better::Higher,
        num_decimals: 2,
        definition: "as psnr_srgb_db in linear Rec.709, not clipped, peak 1",
        mean: MeanOf::Views,
        of: |view| Some(view.image.psnr_linear_db),
    },
    Metric {
        key: "psnr_pq_db",
        heading: "PSNR PQ",
        better: Better::Higher,
        num_decimals: 2,
        definition: "as psnr_srgb_db in PQ (SMPTE ST 2084, linear 1.0 = 100 nit), not clipped, peak 1",
        mean: MeanOf::Views,
        of: |view| Some(view.image.psnr_pq_db),
    },
    Metric {
        key: "ssim_srgb",
        heading: "SSIM",
        better: Better::Higher,
        num_decimals: 4,
        definition: "11x11 Gaussian window, sigma 1.5, zero padding, C1 = 0.01^2, C2 = 0.03^2; sRGB clipped to [0, 1]; mean over pixels and channels",
        mean: MeanOf::Views,
        of: |view| Some(view.image.ssim_srgb),
    },
    Metric {
        key: "flip_hdr",
        heading: "HDR-FLIP",
        better: Better::Lower,
        num_decimals: 4,
        definition: "mean HDR-FLIP (as flip-evaluator 1.7) of linear Rec.709 with flip_hdr_parameters; exposures from the reference unless given",
        mean: MeanOf::Views,
        of: |view| Some(view.image.flip_hdr),
    },
    Metric {
        key: "flip_ldr_srgb",
        heading: "LDR-FLIP",
        better: Better::Lower,
        num_decimals: 4,
        definition: "mean LDR-FLIP (as flip-evaluator 1.7) of sRGB clipped to [0, 1], at the ppd of flip_hdr_parameters",
        mean: MeanOf::Views,
        of: |view| Some(view.image.flip_ldr_srgb),
    },
    Metric {
        key: "psnr_srgb_aligned_db",
        heading: "PSNR sRGB aligned",
        better: Better::Higher,
        num_decimals: 2,
        definition: "as psnr_srgb_db after the renders of all views were multiplied by exposure_scale",
        mean: MeanOf::Views,
        of: |view| Some(view.aligned?.psnr_srgb_aligned_db),
    },
    Metric {
        key: "psnr_pq_aligned_db",
        heading: "PSNR PQ aligned",
        better: Better::Higher,
        num_decimals: 2,
        definition: "as psnr_pq_db after the renders of all views were multiplied by exposure_scale",
        mean: MeanOf::Views,
        of: |view| Some(view.aligned?.psnr_pq_aligned_db),
    },
    Metric {
        key: "flip_hdr_aligned",
        heading: "HDR-FLIP aligned",
        better: Better::Lower,
        num_decimals: 4,
        definition: "as flip_hdr after the renders of all views were multiplied by exposure_scale",
        mean: MeanOf::Views,
        of: |view| Some(view.aligned?.flip_hdr_aligned),
    },
    Metric {
        key: "exposure_scale",
        heading: "Exposure scale",
        better: Better::One,
        num_decimals: 3,
        definition: "sum of the references over sum of the renders, over the pixels of all views that do not emit and whose reference is at most 1 in R, G and B; null where a sum is 0",
        mean: MeanOf::Pixels(|views| {
            Some(views.iter().find_map(|view| view.aligned)?.exposure_scale)
        }),
        of: |view| Some(view.aligned?.exposure_scale),
    },
    Metric {
        key: "albedo_psnr_srgb_db",
        heading: "Albedo PSNR",
        better: Better::Higher,
        num_decimals: 2,
        definition: "as psnr_srgb_db of diffuse albedo, over pixels with reference emission of at most 0.1",
        mean: MeanOf::Views,
        of: |view| view.scene.albedo_psnr_srgb_db,
    },
    Metric {
        key: "albedo_psnr_scaled_db",
        heading: "Albedo PSNR scaled",
        better: Better::Higher,
        num_decimals: 2,
        definition: "as albedo_psnr_srgb_db after one factor for each view, fitted by least squares in linear over the same pixels",
        mean: MeanOf::Views,
        of: |view| view.scene.albedo_psnr_scaled_db,
    },
    Metric {
        key: "specular_mae",
        heading: "Specular MAE",
        better: Better::Lower,
        num_decimals: 4,
        definition: "mean absolute error of the specular reflectance at normal incidence (F0) over R, G and B, over pixels with reference emission of at most 0.1",
        mean: MeanOf::Views,
        of: |view| view.scene.specular_mae,
    },
    Metric {
        key: "false_gloss",
        heading: "False gloss",
        better: Better::Lower,
        num_decimals: 4,
        definition: "share of the pixels with reference emission of at most 0.1 whose mean F0 is above 0.02 in the render and not in the reference",
        mean: MeanOf::Views,
        of: |view| view.scene.false_gloss,
    },
    Metric {
        key: "roughness_mae",
        heading: "Roughness MAE",
        better: Better::Lower,
        num_decimals: 4,
        definition: "mean absolute error of the perceptual roughness, over pixels with reference emission of at most 0.1 whose mean F0 is above 0.02 in render and reference",
        mean: MeanOf::Views,
        of: |view| view.scene.roughness_mae,
    },
    Metric {
        key: "normal_mean_deg",
        heading: "Normal error (deg)",
        better: Better::Lower,
        num_decimals: 2,
        definition: "mean angle between world-space normals in degrees, over pixels where both are not zero",
        mean: MeanOf::Views,
        of: |view| view.scene.normal_mean_deg,
    },
    Metric {
        key: "depth_mae",
        heading: "Depth MAE",
        better: Better::Lower,
        num_decimals: 4,
        definition: "mean absolute error of depth along the optical axis in scene units, over pixels with reference depth above 0 and finite",
        mean: MeanOf::Views,
        of: |view| view.scene.depth_mae,
    },
    Metric {
        key: "emission_iou",
        heading: "Emission IoU",
        better: Better::Higher,
        num_decimals: 4,
        definition: "intersection over union of pixels with emission above 0.5; the mean is that of the pixels of all views together, so that a few pixels of a distant lamp have the weight of a few pixels",
        mean: MeanOf::Pixels(|views| {
            let overlaps = views.iter().filter_map(|view| view.scene.emission_overlap);
            Overlap::total(overlaps).iou()
        }),
        of: |view| view.scene.emission_iou,
    },
];
