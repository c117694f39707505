//! Image and scene metrics of eagpt, their tables and error maps.
//!
//! First the pure metrics, functions of two images of the same size:
//! - [`mod@psnr`]: peak signal-to-noise ratio in sRGB, linear and PQ;
//! - [`mod@ssim`]: structural similarity, and its gradient for the training loss;
//! - [`flip`]: perceived difference of displayed (LDR) and of scene-referred (HDR) images.
//! - [`scene_metrics`]: albedo, normals, depth and emission;
//! - [`pair`]: all image metrics of one pair;
//! - [`align`]: the same after one factor for the exposure of all views;
//! - [`regions`]: the error of emitters, lit surfaces and shadows;
//! - [`known`]: the same with partly unknown references.
//!
//! Then the jobs: [`evaluate`] compares a folder of renders with the views of a dataset and writes
//! tables and error maps, [`evaluate_conditions`] does so for several lightings of a room, and
//! [`tabulate()`] puts evaluations of several modes of rendering into one table.
//!
//! Images are linear Rec.709 unless a name says otherwise. All sums run in a fixed order in f64, so
//! a result has the same bits for any number of threads.

pub mod align;
mod encode;
pub mod error;
pub mod flip;
pub mod job;
pub mod known;
pub mod metrics;
pub mod pair;
pub mod psnr;
pub mod regions;
mod report;
pub mod scene_metrics;
pub mod ssim;
pub mod tabulate;
pub mod window;

pub use align::{AlignedMetrics, ExposureFit, compare_aligned};
pub use encode::{pq_encoded, srgb_clipped};
pub use error::{EvalError, Result};
pub use flip::{FlipHdr, FlipLdr, FlipOptions, FlipParameters, ToneMapper, flip_hdr, flip_ldr};
pub use job::{
    Conditions, ConditionsOptions, EvalOptions, EvalProgress, Evaluation, ViewMetrics, evaluate,
    evaluate_conditions,
};
pub use known::KnownPixels;
pub use metrics::{METRICS, MeanOf, Metric};
pub use pair::{Comparison, ImageMetrics, compare, compare_known};
pub use psnr::{psnr, psnr_linear, psnr_pq, psnr_srgb};
pub use regions::{LightChange, Region, RegionMetrics, Regions, region_metrics};
pub use report::{METRICS_FILE, RESULT_FILES};
pub use ssim::{SsimGradient, ssim, ssim_srgb, ssim_with_gradient};
pub use tabulate::{ModeTable, TableFolder, TableOptions, tabulate};
