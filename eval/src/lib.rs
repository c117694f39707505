//! Image and scene metrics of eagpt, their tables and error maps.
//!
//! First the pure metrics, functions of two images of the same size:
//! - [`mod@psnr`]: peak signal-to-noise ratio in sRGB, linear and PQ;
//! - [`mod@ssim`]: structural similarity, and its gradient for the training loss;
//! - [`flip`]: perceived difference of displayed (LDR) and of scene-referred (HDR) images.
//! - [`scene_metrics`]: albedo, normals, depth and emission;
//! - [`pair`]: all image metrics of one pair.
//!
//! Then the job: [`evaluate`] compares a folder of renders with the views of a dataset and writes tables and error maps.
//!
//! Images are linear Rec.709 unless a name says otherwise. All sums run in a fixed order in f64, so a result has the
//! same bits for any number of threads.

mod encode;
pub mod error;
pub mod flip;
pub mod job;
pub mod metrics;
pub mod pair;
pub mod psnr;
mod report;
pub mod scene_metrics;
pub mod ssim;
mod window;

pub use encode::{pq_encoded, srgb_clipped};
pub use error::{EvalError, Result};
pub use flip::{FlipHdr, FlipLdr, FlipOptions, FlipParameters, ToneMapper, flip_hdr, flip_ldr};
pub use job::{EvalOptions, EvalProgress, Evaluation, ViewMetrics, evaluate};
pub use metrics::{METRICS, MeanOf, Metric};
pub use pair::{Comparison, ImageMetrics, compare};
pub use psnr::{psnr, psnr_linear, psnr_pq, psnr_srgb};
pub use ssim::{SsimGradient, ssim, ssim_srgb, ssim_with_gradient};
