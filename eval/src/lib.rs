//! Image and scene metrics of eagpt, their tables and error maps.
//!
//! First the pure metrics, functions of two images of the same size:
//! - `psnr`: peak signal-to-noise ratio in sRGB, linear and PQ;
//! - [`mod@ssim`]: structural similarity, and its gradient for the training loss;
//! - `flip`: perceived difference of displayed (LDR) and of scene-referred (HDR) images.
//! - `scene_metrics`: albedo, normals, depth and emission; `gloss_metrics`: F0 and roughness;
//! - `pair`: all image metrics of one pair;
//! - `align`: the same after one factor for the exposure of all views;
//! - `regions`: the error of emitters, lit surfaces and shadows;
//! - `known`: the same with partly unknown references;
//! - `lamps`: found lamps against true ones.
//!
//! Then the jobs: [`evaluate`] compares folders of renders with the views of datasets and writes
//! tables and error maps, for one lighting of a room or several, and [`tabulate()`] puts
//! evaluations of several modes of rendering into one table.
//!
//! Images are linear Rec.709 unless a name says otherwise. All sums run in a fixed order in f64, so
//! a result has the same bits for any number of threads.

mod align;
mod encode;
mod error;
mod evaluation;
mod flip;
mod gloss_metrics;
mod job;
mod known;
mod lamps;
mod metrics;
mod pair;
mod provenance;
mod psnr;
mod regions;
mod report;
mod scene_metrics;
pub mod ssim;
pub mod tabulate;
mod view;
pub mod window;

pub use align::ExposureFit;
pub use encode::{pq_encoded, srgb_clipped};
pub use error::{EvalError, Result};
pub use evaluation::{Conditions, Evaluation, Mean};
pub use flip::{FlipOptions, ToneMapper, flip_hdr, flip_ldr, magma_rgb8};
pub use job::{ConditionsOptions, EvalOptions, EvalProgress, Selection, evaluate};
pub use known::{KnownPixels, Windows};
pub use lamps::{ComparedLamp, LampComparison, TrueLamp, TrueLamps, compare_lamps};
pub use metrics::{METRICS, Metric};
pub use pair::{Comparison, ImageMetrics, compare};
pub use psnr::{psnr, psnr_linear, psnr_pq, psnr_srgb};
pub use regions::{Region, Regions};
pub use report::{METRICS_FILE, RESULT_FILES};
pub use ssim::{ssim, ssim_srgb, ssim_with_gradient};
pub use tabulate::{TableFolder, TableOptions, tabulate};
