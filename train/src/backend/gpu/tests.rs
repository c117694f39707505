//! Each stage against the CPU.

mod adam;
mod losses;
mod steps;

use crate::options::{LossWeights, Preset, TrainOptions};
use eagpt_trace::features::Features;

#[path = "../../../../trace/tests/gpu/mod.rs"]
mod gpu;

fn weights() -> LossWeights {
    TrainOptions::preset(Preset::Draft).radiance.weights
}

/// Largest difference in lane `k`, relative to the largest value.
fn off(got: &[Features], wanted: &[Features], k: usize) -> f32 {
    let scale = wanted.iter().fold(0.0_f32, |m, s| m.max(s.0[k].abs()));
    let pairs = got.iter().zip(wanted);
    let worst = pairs.fold(0.0_f32, |m, (a, b)| m.max((a.0[k] - b.0[k]).abs()));
    if worst == 0.0 { 0.0 } else { worst / scale }
}
