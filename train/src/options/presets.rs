//! The values of the presets.

use super::{
    AlbedoOptions, DensifyOptions, Gather, HarmonicsOptions, InitOptions, LampOptions,
    LearningRates, LossWeights, OutputOptions, Preset, RadianceOptions, StageChoice, TrainOptions,
};
use eagpt_scene::dataset::SplitRule;

impl TrainOptions {
    /// The values of a preset.
    pub fn preset(preset: Preset) -> Self {
        let weights = LossWeights {
            color: 1.0,
            ssim_share: 0.2,
            normal: 0.5,
            depth_normal: 0.05,
            emission: 0.1,
            alpha: 0.1,
            depth: if preset == Preset::Paper { 0.0 } else { 0.2 },
        };
        let fast_rates = LearningRates {
            position: 3e-4,
            scale: 2e-2,
            rotation: 1e-2,
            opacity: 5e-2,
            radiance: 3e-2,
            emission: 5e-2,
            final_share: 0.03,
        };
        let (iterations, per_point, rates) = match preset {
            Preset::Draft => (800, 1.0, fast_rates),
            Preset::Fast => (5000, 2.0, fast_rates),
            // The paper's rates; its position rate of 1.6e-5 units belongs to rooms of some five
            // units' extent.
            Preset::Paper => (
                30_000,
                1.0,
                LearningRates {
                    position: 3.2e-6,
                    scale: 5e-3,
                    rotation: 1e-3,
                    opacity: 5e-2,
                    radiance: 1e-2,
                    emission: 5e-2,
                    final_share: 1.0,
                },
            ),
        };
        let albedo = |iterations, num_samples| AlbedoOptions {
            iterations,
            gather: Gather::Gaussians,
            num_samples,
            gloss: preset == Preset::Fast,
            unseen_light: preset != Preset::Paper,
            rate: 5e-2,
            final_share: 0.1,
            emission_threshold: eagpt_trace::transport::EMISSION_THRESHOLD,
        };
        Self {
            preset,
            stage: StageChoice::All,
            seed: 0,
            split: SplitRule::Every8th,
            num_gaussians: None,
            init: InitOptions {
                per_point,
                scale_factor: 0.9,
                opacity: 0.5,
                emission: 0.1,
                albedo: 0.2,
            },
            radiance: RadianceOptions {
                iterations,
                normals_from: 0.1,
                antialias_from: if preset == Preset::Fast { 0.82 } else { 1.0 },
                rates,
                harmonics: HarmonicsOptions {
                    degree: if preset == Preset::Fast { 2 } else { 0 },
                    from: 0.5,
                    rate: 0.06,
                    decay: 0.1,
                },
                weights,
                densify: DensifyOptions {
                    times: if preset == Preset::Paper { 0 } else { 8 },
                    from: 0.08,
                    until: 0.6,
                    start_share: 0.4,
                },
                lamps: LampOptions {
                    clean: preset != Preset::Paper,
                    bare_after: 0.4,
                    after: 0.95,
                },
                mirrors: preset == Preset::Fast,
            },
            albedo: match preset {
                Preset::Draft => albedo(150, 16),
                Preset::Fast => albedo(336, 128),
                Preset::Paper => AlbedoOptions {
                    gather: Gather::Pixels,
                    rate: 5e-2,
                    final_share: 1.0,
                    ..albedo(400, 256)
                },
            },
            output: OutputOptions {
                checkpoint_every: if preset == Preset::Draft { 200 } else { 500 },
                keep_checkpoints: 2,
                preview_every: if preset == Preset::Draft { 200 } else { 500 },
                num_previews: 3,
                log_every: 10,
            },
        }
    }
}
