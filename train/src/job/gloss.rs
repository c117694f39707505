//! Gloss between the stages: estimated, and taken out of what albedos are to explain.

use crate::backend::{Backend, TrainingView};
use crate::checkpoint::NUM_OF_GLOSS;
use crate::error::Result;
use crate::gloss::{self, Estimate};
use crate::options::TrainOptions;
use crate::progress::TrainProgress;
use crate::views::Views;
use eagpt_scene::color::luminance;
use eagpt_scene::{Gaussians, Gloss, SceneEdit};
use eagpt_trace::cpu::CpuScene;
use eagpt_trace::transport::glossy::Mirrored;
use eagpt_trace::{LightOptions, Tracer};
use glam::Vec3;
use std::collections::HashMap;
use std::sync::Arc;

/// Directions of the specular lobe at each pixel of a training view.
const NUM_SAMPLES: u32 = 6;
/// Light is divided by no smaller share that a lobe leaves to the albedo: what metals scatter is
/// noise.
const LEAST_LEFT: f32 = 0.25;

/// The gloss of a run.
#[derive(Default)]
pub(super) struct RunGloss {
    estimate: Estimate,
    /// For each training view, the pixels with gloss and what an albedo is to explain there.
    diffuse: HashMap<usize, Vec<(u32, Vec3)>>,
    /// For each light, of that of each Gaussian what an albedo is to explain; empty where all of it
    /// is.
    pub(super) shares: Vec<Vec<f32>>,
}

impl RunGloss {
    /// Gives the finished scene its gloss.
    pub(super) fn apply(&self, gaussians: &mut Gaussians) {
        self.estimate.apply(gaussians);
    }

    /// Gloss of each Gaussian; empty where nothing is glossy.
    pub(super) fn of_gaussians(&self) -> &[Gloss] {
        &self.estimate.gloss
    }

    /// A view as stage 1 is to explain it. It has another index than the photograph: prepared
    /// copies of the two differ.
    pub(super) fn diffuse_view(&self, training: TrainingView, num_frames: usize) -> TrainingView {
        let Some(pixels) = self.diffuse.get(&training.index) else {
            return training;
        };
        let mut view = (*training.view).clone();
        for &(pixel, light) in pixels {
            view.radiance.pixels_mut()[pixel as usize] = light.to_array();
        }
        TrainingView {
            light: training.light,
            index: training.index + num_frames,
            view: Arc::new(view),
            points: None,
        }
    }

    /// Follows an edit of the scene.
    pub(super) fn edit(&mut self, edit: &SceneEdit) {
        self.estimate.edit(edit);
    }

    /// Rows of it for a checkpoint.
    pub(super) fn rows(&self) -> Vec<[f32; NUM_OF_GLOSS]> {
        self.estimate.rows()
    }

    /// That of a checkpoint of stage 1.
    pub(super) fn from_rows(rows: &[[f32; NUM_OF_GLOSS]]) -> Self {
        Self {
            estimate: Estimate::from_rows(rows),
            ..Self::default()
        }
    }

    /// Estimates the gloss of the scene of stage 0, where that is asked for.
    pub(super) fn estimate(
        options: &TrainOptions,
        backend: &mut dyn Backend,
        views: &Views,
        progress: &mut dyn FnMut(TrainProgress),
    ) -> Result<Self> {
        if !options.albedo.gloss {
            return Ok(Self::default());
        }
        progress(TrainProgress::Gloss { surfaces: None });
        let lights = backend.state()?.in_lights();
        let estimate = gloss::estimate(&lights, views.iter(), options.seed)?;
        progress(TrainProgress::Gloss {
            surfaces: Some(estimate.surfaces.clone()),
        });
        Ok(Self {
            estimate,
            ..Self::default()
        })
    }

    /// Tells what albedos are to explain of the photographs and of each Gaussian's light, by what
    /// its surface mirrors of the scene as it is.
    pub(super) fn explain(
        &mut self,
        options: &TrainOptions,
        backend: &mut dyn Backend,
        views: &Views,
    ) -> Result<()> {
        if self.estimate.gloss.is_empty() {
            return Ok(());
        }
        let mut lights = backend.state()?.in_lights();
        for gaussians in &mut lights {
            self.apply(gaussians);
        }
        let mut scenes: Vec<CpuScene> = lights.iter().map(CpuScene::new).collect();
        let mut sums = vec![vec![(0.0_f32, 0.0_f32); lights[0].len()]; lights.len()];
        for (seed, training) in (options.seed..).zip(views.iter()) {
            let TrainingView {
                index, light, view, ..
            } = training?;
            let (scene, sums) = (&mut scenes[light], &mut sums[light]);
            let sampling = LightOptions {
                seed,
                emission_threshold: options.albedo.emission_threshold,
                ..LightOptions::default()
            };
            let features = scene.record(&view.camera.into())?;
            let mirrored = scene.mirrored(&view.camera, &features, NUM_SAMPLES, &sampling);
            let mut pixels = Vec::new();
            let mut shares = vec![1.0_f32; mirrored.len()];
            for (i, mirrored) in mirrored.iter().enumerate() {
                if mirrored.reflectance == Vec3::ZERO {
                    continue;
                }
                let seen = Vec3::from(view.radiance.pixels()[i]);
                let diffuse = diffuse(seen, mirrored);
                let all = luminance(seen.to_array()).max(f32::MIN_POSITIVE);
                shares[i] = luminance(diffuse.to_array()) / all;
                pixels.push((i as u32, diffuse));
            }
            let value = |pixel: usize, _: &eagpt_trace::Features| shares[pixel];
            for of in scene.contributions(&view.camera, &value)?.1 {
                let (sum, total) = &mut sums[of.gaussian as usize];
                *sum += of.weighted_value;
                *total += of.weight;
            }
            self.diffuse.insert(index, pixels);
        }
        let share = |(sum, total): (f32, f32)| if total > 0.0 { sum / total } else { 1.0 };
        let shares = sums.into_iter().map(|of| of.into_iter().map(share));
        self.shares = shares.map(Iterator::collect).collect();
        Ok(())
    }
}

/// Light that the albedo is to explain: what the lobe does not mirror, as if there were none.
fn diffuse(seen: Vec3, mirrored: &Mirrored) -> Vec3 {
    let left = (Vec3::ONE - mirrored.reflectance).max(Vec3::splat(LEAST_LEFT));
    (seen - mirrored.light).max(Vec3::ZERO) / left
}
