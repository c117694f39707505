//! The kernels of training: their files in `train/shader/`, their buffers, and the constants that
//! they share with Rust.

use super::report;
use super::structures::{
    AdamParameters, Encoded, ExchangeParameters, LossParameters, Moments, SurfaceGradient, Terms,
};
use super::target::{self, TargetPixel};
use crate::loss::depth::{MAX_DEPTH_ERROR, MIN_DEPTH_ALPHA};
use crate::loss::normal::MIN_NORMAL_ALPHA;
use crate::loss::target::PQ_RANGE;
use crate::params::{BETA_1, BETA_2, CLASSES, EPSILON, NUM_PARAMETERS};
use eagpt_eval::ssim;
use eagpt_eval::window::{RADIUS, WEIGHTS};
use eagpt_scene::color::PQ_CONSTANTS;
use eagpt_scene::gaussians::MAX_ALBEDO;
use eagpt_trace::attributes::Attributes;
use eagpt_trace::blend::LocalGradient;
use eagpt_trace::features::Features;
use eagpt_trace::gpu::kernel::{self, kernels, shaders};
use eagpt_trace::model::{MAX_RADIUS, MIN_ALPHA};
use eagpt_trace::surfel::Surfel;
use std::borrow::Cow;

/// Invocations of a workgroup that adds up.
pub(super) const ADD_THREADS: u32 = 128;
/// Pixels that each of them adds.
pub(super) const ADD_PER_THREAD: u32 = 16;

const FILES: &[(&str, &str)] = shaders! {
    "exchange" "loss_add_up" "loss_color" "loss_derivatives" "loss_surface" "params"
    "shared/exp_ln" "shared/loss"
};

/// The files of training and those of the rays.
fn sources(name: &str) -> Option<Cow<'static, str>> {
    match name {
        "training" => Some(declarations().into()),
        _ => kernel::find(FILES, name).or_else(|| kernel::sources(name)),
    }
}

kernels! { sources;
    ENCODE = "loss_color" encode [] {
        0 loss: Uniform LossParameters, 1 rays: Read Features, 2 means: Write Features,
        3 targets: Read TargetPixel, 4 encoded: Write Encoded,
    }
    ENCODE_LIT = "loss_color" encode_lit [] {
        0 loss: Uniform LossParameters, 1 rays: Read Features, 2 means: Write Features,
        3 targets: Read TargetPixel, 4 encoded: Write Encoded, 11 lit: Read [f32; 4],
    }
    CLIP = "loss_color" clip [] {
        0 loss: Uniform LossParameters, 3 targets: Read TargetPixel, 4 encoded: Write Encoded,
        12 clipped: Read u32,
    }
    BLUR_MOMENTS = "loss_color" blur_moments [] {
        0 loss: Uniform LossParameters, 3 targets: Read TargetPixel, 4 encoded: Write Encoded,
        5 blurred: Write Moments,
    }
    COMPARE = "loss_color" compare [] {
        0 loss: Uniform LossParameters, 2 means: Write Features, 3 targets: Read TargetPixel,
        4 encoded: Write Encoded, 5 blurred: Write Moments, 6 partials: Write Moments,
        7 terms: Write Terms,
    }
    BLUR_PARTIALS = "loss_color" blur_partials [] {
        0 loss: Uniform LossParameters, 5 blurred: Write Moments, 6 partials: Write Moments,
    }
    SURFACE_TERMS = "loss_surface" surface_terms [] {
        0 loss: Uniform LossParameters, 2 means: Write Features, 3 targets: Read TargetPixel,
        7 terms: Write Terms, 8 surfaces: Write SurfaceGradient,
    }
    ADD_PIXELS = "loss_add_up" add_pixels [] {
        0 loss: Uniform LossParameters, 7 terms: Write Terms, 8 group_sums: Write Terms,
    }
    ADD_GROUPS = "loss_add_up" add_groups [] {
        0 loss: Uniform LossParameters, 8 group_sums: Write Terms, 9 report: Write u32,
    }
    DERIVATIVES = "loss_derivatives" derivatives [] {
        0 loss: Uniform LossParameters, 2 means: Write Features, 3 targets: Read TargetPixel,
        4 encoded: Write Encoded, 5 blurred: Write Moments, 7 terms: Write Terms,
        8 surfaces: Read SurfaceGradient, 9 report: Read u32, 10 d_rays: Write Features,
    }
    DERIVATIVES_LIT = "loss_derivatives" derivatives_lit [] {
        0 loss: Uniform LossParameters, 3 targets: Read TargetPixel, 4 encoded: Write Encoded,
        5 blurred: Write Moments, 10 d_rays: Write Features, 11 lit: Read [f32; 4],
    }

    EXCHANGE = "exchange" exchange [] {
        0 exchanged: Uniform ExchangeParameters, 1 values: Write f32, 2 first: Write f32,
        3 second: Write f32, 4 stored_values: Write f32, 5 stored_first: Write f32,
        6 stored_second: Write f32,
    }
    ACTIVATE = "params" activate [] {
        0 adam: Uniform AdamParameters, 1 values: Write f32, 7 surfels: Write Surfel,
        8 attributes: Write Attributes,
    }
    CHAIN_RULE = "params" chain_rule [] {
        0 adam: Uniform AdamParameters, 1 values: Write f32, 4 gradients: Read LocalGradient,
        5 raw_gradients: Write f32, 6 report: Write u32, 8 attributes: Write Attributes,
        9 counters: Write u32,
    }
    HARMONICS_STEP = "params" harmonics_step [] {
        0 adam: Uniform AdamParameters, 1 values: Write f32, 2 first: Write f32,
        3 second: Write f32, 5 raw_gradients: Write f32, 6 report: Write u32,
        7 surfels: Write Surfel, 9 counters: Write u32,
    }
    ADAM_STEP = "params" adam_step [] {
        0 adam: Uniform AdamParameters, 1 values: Write f32, 2 first: Write f32,
        3 second: Write f32, 5 raw_gradients: Write f32, 6 report: Write u32,
        9 counters: Write u32,
    }
}

/// Structures and constants beside those of the rays.
fn declarations() -> String {
    let mut text = String::new();
    for layout in [
        AdamParameters::layout(),
        ExchangeParameters::layout(),
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
        ("MAX_ALBEDO", MAX_ALBEDO),
        ("MAX_RADIUS", MAX_RADIUS),
        ("MIN_NORMAL_ALPHA", MIN_NORMAL_ALPHA),
        ("MIN_DEPTH_ALPHA", MIN_DEPTH_ALPHA),
        ("MAX_DEPTH_ERROR", MAX_DEPTH_ERROR),
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
        ("ADD_THREADS", ADD_THREADS),
        ("ADD_PER_THREAD", ADD_PER_THREAD),
        ("KNOWN", target::KNOWN),
        ("WINDOW", target::WINDOW),
        ("EDGE", target::EDGE),
        ("FLAG_BITS", target::FLAG_BITS),
        ("FULL_OPACITY", target::FULL_OPACITY),
    ]
    .into_iter()
    .chain(report::PLACES)
    {
        text.push_str(&format!("const {name}: u32 = {value}u;\n"));
    }
    for (class, range) in CLASSES {
        let (name, start) = (class.to_uppercase(), range.start);
        text.push_str(&format!("const {name}: u32 = {start}u;\n"));
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
    use eagpt_testkit::kernels;
    use eagpt_trace::gpu::kernel::{Access, Binding};

    fn binding(of: &Binding) -> kernels::Binding {
        kernels::Binding {
            number: of.number,
            name: of.name.to_owned(),
            is_uniform: of.access == Access::Uniform,
            is_written: of.access == Access::Write,
            bytes: of.bytes as u32,
        }
    }

    /// Without a device: what one would reject is found here.
    #[test]
    fn kernels_are_those_of_the_table() {
        for kernel in ALL {
            let bindings: Vec<kernels::Binding> = kernel.bindings().iter().map(binding).collect();
            let (file, entry) = kernel.name();
            let source = kernel.source().unwrap();
            assert_eq!(kernels::check(file, &source, entry, &bindings), Ok(()));
        }
    }

    #[test]
    fn files_import_what_they_use() {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/shader");
        let all = ALL.iter().map(|kernel| {
            let (file, entry) = kernel.name();
            (file, entry, kernel.defines())
        });
        let all: Vec<_> = all.collect();
        let files: Vec<&str> = FILES.iter().map(|(path, _)| *path).collect();
        let source = |name: &str, defines: &[&str]| kernel::preprocess(sources, name, defines);
        kernels::check_folder(folder, &files, &all, source).unwrap();
        // None hides a file of the rays.
        for file in files {
            let name = file.strip_prefix("shared/").unwrap_or(file);
            assert!(kernel::sources(name).is_none(), "{file}");
        }
    }
}
