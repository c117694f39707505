//! Image and scene metrics of eagpt, their tables and error maps.
//!
//! First the pure metrics, functions of two images of the same size:
//! - [`psnr`]: peak signal-to-noise ratio in sRGB, linear and PQ;
//! - [`ssim`]: structural similarity, and its gradient for the training loss;
//! - [`flip`]: perceived difference of displayed (LDR) and of scene-referred (HDR) images.
//!
//! Images are linear Rec.709 unless a name says otherwise. All sums run in a fixed order in f64, so a result has the
//! same bits for any number of threads.

mod encode;
pub mod error;
pub mod flip;
pub mod pair;
pub mod psnr;
pub mod ssim;
mod window;

pub use encode::{pq_encoded, srgb_clipped};
pub use error::{EvalError, Result};
pub use flip::{FlipHdr, FlipLdr, FlipOptions, FlipParameters, ToneMapper, flip_hdr, flip_ldr};
pub use pair::{Comparison, ImageMetrics, compare};
pub use psnr::{psnr, psnr_linear, psnr_pq, psnr_srgb};
pub use ssim::{SsimGradient, ssim, ssim_srgb, ssim_with_gradient};
