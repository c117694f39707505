//! The modules of training's kernels, and what they share with Rust.

use super::loss::LossParameters;
use super::params::AdamParameters;
use super::target::{self, TargetPixel};
use super::{loss, report};
use crate::loss::MIN_NORMAL_ALPHA;
use crate::loss::target::PQ_RANGE;
use crate::params::{BETA_1, BETA_2, EPSILON, NUM_PARAMETERS};
use eagpt_eval::ssim;
use eagpt_eval::window::{RADIUS, WEIGHTS};
use eagpt_scene::color::PQ_CONSTANTS;
use eagpt_trace::gpu::kernel::{Module, shared};
use eagpt_trace::model::{MAX_RADIUS, MIN_ALPHA};

/// What all modules share.
const COMMON: &[&str] = &[shared::SURFEL, shared::BLEND, include_str!("numbers.wgsl")];
/// What modules of the loss share.
const PIXELS: &str = include_str!("loss_pixels.wgsl");

pub(super) static PARAMS: Module = Module::with_declarations(
    "parameters",
    declarations,
    &[COMMON, &[shared::HARMONICS, include_str!("params.wgsl")]],
);
pub(super) static COLOR: Module = Module::with_declarations(
    "loss: colour",
    declarations,
    &[COMMON, &[PIXELS, include_str!("loss_color.wgsl")]],
);
pub(super) static SURFACE: Module = Module::with_declarations(
    "loss: surface",
    declarations,
    &[COMMON, &[PIXELS, include_str!("loss_surface.wgsl")]],
);
pub(super) static ADD_UP: Module = Module::with_declarations(
    "loss: features",
    declarations,
    &[COMMON, &[PIXELS, include_str!("loss_add_up.wgsl")]],
);
pub(super) static DERIVATIVES: Module = Module::with_declarations(
    "loss: derivatives",
    declarations,
    &[COMMON, &[PIXELS, include_str!("loss_derivatives.wgsl")]],
);

/// Structures and constants beside those of the rays.
fn declarations() -> String {
    let mut text = String::new();
    for layout in [
        AdamParameters::layout(),
        LossParameters::layout(),
        TargetPixel::layout(),
    ] {
        text.push_str(&layout.declaration());
    }
    let pq_numbers = PQ_CONSTANTS.map(|(name, value)| (name, value as f32));
    let numbers = [
        ("BETA_1", BETA_1),
        ("BETA_2", BETA_2),
        ("EPSILON", EPSILON),
        ("MIN_ALPHA", MIN_ALPHA),
        ("MAX_RADIUS", MAX_RADIUS),
        ("MIN_NORMAL_ALPHA", MIN_NORMAL_ALPHA),
        ("MIN_POSITIVE", f32::MIN_POSITIVE),
        ("SSIM_C1", ssim::C1),
        ("SSIM_C2", ssim::C2),
        ("PQ_RANGE", PQ_RANGE),
    ];
    for (name, value) in numbers.into_iter().chain(pq_numbers) {
        text.push_str(&format!("const {name}: f32 = {value:?};\n"));
    }
    for (name, value) in [
        ("NUM_PARAMETERS", NUM_PARAMETERS as u32),
        ("REPORT_BAD", report::BAD),
        ("REPORT_ENTRIES", report::ENTRIES),
        ("REPORT_CHUNKS", report::CHUNKS),
        ("REPORT_TERMS", report::TERMS),
        ("REPORT_STUCK", report::STUCK),
        ("NOTHING_BAD", report::NOTHING_BAD),
        ("ADD_THREADS", loss::ADD_THREADS),
        ("ADD_PER_THREAD", loss::ADD_PER_THREAD),
        ("KNOWN", target::KNOWN),
        ("WINDOW", target::WINDOW),
        ("FLAG_BITS", target::FLAG_BITS),
        ("FULL_OPACITY", target::FULL_OPACITY),
    ] {
        text.push_str(&format!("const {name}: u32 = {value}u;\n"));
    }
    let weights: Vec<String> = WEIGHTS.iter().map(|w| format!("{w:?}")).collect();
    text.push_str(&format!(
        "const BLUR_RADIUS: i32 = {RADIUS};\nconst BLUR_WEIGHTS = array<f32, {}>({});\n",
        WEIGHTS.len(),
        weights.join(", ")
    ));
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Without a device: what one would reject is found here.
    #[test]
    fn all_modules_are_valid() {
        for module in [&PARAMS, &COLOR, &SURFACE, &ADD_UP, &DERIVATIVES] {
            assert_eq!(
                eagpt_testkit::kernels::check(module.name(), &module.source()),
                Ok(())
            );
        }
    }
}
