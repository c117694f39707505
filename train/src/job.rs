//! The training job: which view comes when, with which step sizes; logs, previews, checkpoints,
//! divergence.

mod bare_lamps;
mod check;
mod fingerprint;
mod finish;
mod folder;
mod free_lamps;
mod gloss;
mod glows;
mod hidden_lamps;
mod initial;
mod lamp_powers;
mod lamps;
mod lights;
mod lit_pixels;
mod memory;
mod mirrors;
mod preview;
mod request;
mod run;
mod stages;
mod start;
mod steps;
mod watch;

use crate::backend;
use crate::error::Result;
use crate::options::StageChoice;
use crate::params::ParameterState;
use crate::points::Discs;
use crate::progress::TrainProgress;
use crate::views::Views;
use eagpt_scene::files::digest;
use eagpt_scene::lamps::write_lamps;
use folder::Folder;
use gloss::RunGloss;
use lights::Light;
use run::Run;
use std::sync::Arc;
use std::time::Instant;

pub use fingerprint::light_part;
pub use lights::light_name;
pub use request::{BadViews, Existing, TrainRequest, TrainSummary};

/// Trains a scene.
///
/// # Errors
/// Bad input, an unusable output folder, too little memory, or a run that diverged; each names what
/// it is about.
pub fn train(
    request: &TrainRequest,
    progress: &mut dyn FnMut(TrainProgress),
) -> Result<TrainSummary> {
    let options = &request.options;
    options.validate()?;
    let mut lights = lights::open(request)?;
    let given = start::read(request)?;
    let mut fingerprint = fingerprint::of(&lights, options)?;
    if let Some(path) = &request.start {
        fingerprint = fingerprint.with("start", digest::of_file(path)?);
    }
    let folder = Folder::new(request, &lights);
    let resumed = folder.prepare(request.existing, options, &fingerprint)?;
    start::take_lamps(request)?;
    let mut run = Run {
        request,
        folder,
        progress,
        warnings: Vec::new(),
        started: Instant::now(),
        stage_seconds: Vec::new(),
        budget: options.gaussians_for(options.num_points(&lights[0].dataset)?),
        next_scene: None,
        gloss: RunGloss::default(),
        mirrors: Vec::new(),
    };
    let of_splits = lights.iter().flat_map(|light| &light.split.warnings);
    for warning in of_splits.chain(&resumed.warnings) {
        run.warn(warning.clone());
    }
    let budget = memory::image_budget(request, &lights)?;
    let of_lights = lights.iter().map(Light::views).collect();
    let mut views = Views::new(of_lights, budget, options.seed);
    if let Some(given) = &given {
        if given.is_glossy() && !options.albedo.gloss {
            run.warn("the gloss of the given scene is left out".to_owned());
        }
        run.budget = options.num_gaussians.unwrap_or(0).max(given.len());
    }
    let start = match (resumed.checkpoint, &given) {
        (Some(checkpoint), _) => {
            run.check(&mut views, |_| ())?;
            if let Some(lamps) = &checkpoint.lamps {
                write_lamps(&run.folder.lamps(0), lamps)?;
            }
            checkpoint
        }
        (None, Some(given)) => {
            run.check(&mut views, |_| ())?;
            start::checkpoint(given, lights.len(), options, fingerprint.clone())
        }
        (None, None) => initial::checkpoint(&lights, &mut views, fingerprint.clone(), &mut run)?,
    };
    if options.stage != StageChoice::Albedo && options.radiance.weights.depth > 0.0 {
        let discs = |light: &Light| -> Result<Option<Arc<Discs>>> {
            let points = light.dataset.points()?;
            // Maps tell more of edges than planes do.
            let frames = light.dataset.frames();
            let with_planes = frames.iter().all(|frame| frame.files.normal.is_none());
            let discs = |points| Arc::new(Discs::new(points, with_planes));
            Ok(points.as_ref().map(discs))
        };
        views.look_for(lights.iter().map(discs).collect::<Result<_>>()?);
    }
    run.take_up_mirrors(&views, &start)?;
    let mut backend = backend::new(&request.device, start.state.clone(), budget / 2)?;
    let mut position = start;
    position.state = ParameterState::default();
    let finished = run.stages(backend.as_mut(), &views, &mut position)?;
    let state = backend.state()?;
    let (scenes, num_moving) = (state.in_lights(), state.num_moving());
    // Its memory, for what is done with the scene.
    drop(backend);
    let num_gaussians = scenes[0].len();
    let scene = request.out.join("scene.ply");
    let own_light = match finished {
        true => run.write_scenes(scenes, num_moving, &views)?,
        false => None,
    };
    Ok(TrainSummary {
        scene: finished.then_some(scene),
        num_gaussians,
        device: request.device.name(),
        lights: match lights.as_slice() {
            [_] => Vec::new(),
            several => several.iter().map(|light| light.name.clone()).collect(),
        },
        split: lights.swap_remove(0).split,
        fingerprint,
        extent: position.extent,
        own_light,
        stage_seconds: run.stage_seconds,
        warnings: run.warnings,
    })
}
