//! Stages of training and of light baking.

use super::inputs::Bench;
use super::sheet::{Sheet, Unit};
use anyhow::{Context, Result, bail};
use eagpt_scene::dataset::{SplitRule, Subset};
use eagpt_scene::{Camera, files, ply};
use eagpt_train::backend::{self, AlbedoStep, Backend, RadianceStep, Taken, TrainingView};
use eagpt_train::bake::gaussians::GaussianBake;
use eagpt_train::bake::{BakeMethod, BakeOptions, BakeRequest, bake};
use eagpt_train::loss::NormalTerms;
use eagpt_train::params::{ParameterState, StepSizes};
use eagpt_train::{Preset, TrainOptions};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Gaussians that light is gathered for in a run.
const GATHERED: usize = 2048;
/// Directions for each of them.
const DIRECTIONS: u32 = 64;
/// Directions for each Gaussian in a sweep of the light solve.
const SWEEP_DIRECTIONS: u32 = 16;
/// Bytes that prepared images may take: all of the few views.
const TARGET_BUDGET: usize = 1 << 30;

fn backend(bench: &Bench<'_>) -> Result<Box<dyn Backend>> {
    let state = ParameterState::new(bench.gaussians);
    Ok(backend::new(bench.device, state, TARGET_BUDGET)?)
}

/// Iterations of both stages, one view each, with one ray for a pixel.
pub(super) fn training(bench: &Bench<'_>, sheet: &mut Sheet<'_>) -> Result<()> {
    let options = TrainOptions::preset(Preset::Fast);
    let views: Vec<TrainingView> = (bench.views.iter().enumerate())
        .map(|(index, view)| TrainingView {
            index,
            light: 0,
            view: Arc::clone(view),
            points: None,
        })
        .collect();
    let num_steps = views.len() as f64;
    let mut backend = backend(bench)?;
    let mut step = RadianceStep {
        iteration: 1,
        weights: &options.radiance.weights,
        normals: NormalTerms::On,
        antialias: false,
        // The end of the schedule: the scene stays what it is.
        sizes: StepSizes::radiance(&options.radiance.rates, bench.extent, 1.0),
    };
    let mut stage_0 = |backend: &mut dyn Backend, step: &RadianceStep<'_>, what: &str| {
        let mut all = || -> Result<()> {
            for view in &views {
                check(&backend.radiance_step(view, step)?)?;
            }
            check(&backend.finish()?)
        };
        sheet.measure(what, Unit::Iterations, num_steps, &mut all)?;
        sheet.measure_kernels(what, all)
    };
    stage_0(&mut *backend, &step, "stage 0")?;
    backend.begin_harmonics()?;
    step.sizes = step.sizes.with_harmonics(&options.radiance.harmonics, 1.0);
    stage_0(&mut *backend, &step, "stage 0 with harmonics")?;

    // Light for some of the Gaussians: how much there is makes no difference to a step.
    let cameras: Vec<Camera> = bench.cameras().copied().collect();
    let num_seen = backend.begin_gathering(&cameras)?;
    backend.gather(0..num_seen.min(GATHERED), 16, 0)?;
    backend.begin_albedo(&[])?;
    let step = AlbedoStep {
        options: &options.albedo,
        ssim_share: 0.2,
        seed: 0,
        iteration: 1,
        sizes: StepSizes::albedo(1e-3),
    };
    let mut stage_1 = || -> Result<()> {
        for view in &views {
            check(&backend.albedo_step(view, &step)?)?;
        }
        check(&backend.finish()?)
    };
    sheet.measure("stage 1", Unit::Iterations, num_steps, &mut stage_1)?;
    sheet.measure_kernels("stage 1", stage_1)
}

/// Steps count if their gradients are finite.
fn check(taken: &[Taken]) -> Result<()> {
    for step in taken {
        if let Err(bad) = &step.outcome {
            bail!("{}: {bad}", step.view.view.name);
        }
    }
    Ok(())
}

/// Gathering of the irradiance of Gaussians.
pub(super) fn gathering(bench: &Bench<'_>, sheet: &mut Sheet<'_>) -> Result<()> {
    let mut backend = backend(bench)?;
    let cameras: Vec<Camera> = bench.cameras().copied().collect();
    let total = backend.begin_gathering(&cameras)?;
    // The structure that rays are traced against is built by the first.
    let mut done = total.min(1);
    backend.gather(0..done, 1, 0)?;
    sheet.measure_counted("irradiance", Unit::Rays, || {
        if done == total {
            backend.begin_gathering(&cameras)?;
            done = 0;
        }
        let range = done..total.min(done + GATHERED);
        done = range.end;
        let num_rays = range.len() as f64 * f64::from(DIRECTIONS);
        backend.gather(range, DIRECTIONS, 0)?;
        Ok(num_rays)
    })
}

/// One sweep of the light solve, from scene file to scene file.
pub(super) fn light_solve(bench: &Bench<'_>, sheet: &mut Sheet<'_>) -> Result<()> {
    let folder = bench.work.join("bake");
    files::create_dir(&folder)?;
    let scene = folder.join("scene.ply");
    ply::write_gaussians(&scene, bench.gaussians)?;
    let request = BakeRequest {
        scene,
        cameras: bench.cameras_at.to_owned(),
        out: folder.join("baked.ply"),
        work: folder.join("work"),
        transport: None,
        per_light: None,
        options: BakeOptions {
            method: BakeMethod::Gaussians(GaussianBake {
                num_samples: Some(SWEEP_DIRECTIONS),
            }),
            max_bounces: 1,
            seed: 0,
            split: SplitRule::default(),
            subset: Subset::All,
        },
        device: bench.device.clone(),
        start_over: true,
        stop: Arc::new(AtomicBool::new(false)),
    };
    sheet.measure_counted("a sweep, with its files", Unit::Rays, || {
        let summary = bake(&request, &mut |_| ()).context("light solve")?;
        Ok(summary.num_rays as f64)
    })
}
