//! Training that starts from points.

use super::lights::{self, Light};
use super::run::Run;
use crate::backend::TrainingView;
use crate::checkpoint::{Checkpoint, LossMonitor};
use crate::error::Result;
use crate::init::Initialiser;
use crate::init::agreement::Agreement;
use crate::options::Stage;
use crate::params::ParameterState;
use crate::views::Views;
use eagpt_scene::files::Key;

/// The start of a light: its points, or views that find them.
enum Start {
    Points(Box<Initialiser>),
    Agreement(Agreement),
}

/// The state before the first iteration, of Gaussians at the points of the first light.
///
/// # Errors
/// If views or points cannot be used.
pub(super) fn checkpoint(
    lights: &[Light],
    views: &mut Views,
    fingerprint: Key,
    run: &mut Run<'_>,
) -> Result<Checkpoint> {
    let options = &run.request.options;
    let start = |Light { dataset, .. }: &Light| -> Result<Start> {
        Ok(match dataset.points()? {
            Some(cloud) => {
                let start = Initialiser::new(&cloud, options, dataset.root())?;
                Start::Points(Box::new(start))
            }
            None => Start::Agreement(Agreement::default()),
        })
    };
    let mut starts: Vec<Start> = lights.iter().map(start).collect::<Result<_>>()?;
    let observe = |training: &TrainingView| match &mut starts[training.light] {
        Start::Points(start) => start.observe(&training.view),
        Start::Agreement(agreement) => agreement.add(&training.view),
    };
    run.check(views, observe)?;
    let (mut extent, mut scenes) = (0.0, Vec::with_capacity(lights.len()));
    for (light, start) in starts.into_iter().enumerate() {
        let dataset = &lights[light].dataset;
        let start = match start {
            Start::Points(start) => *start,
            Start::Agreement(agreement) => {
                let num = options.num_points(dataset)?;
                let found = agreement.points(num, options.seed, dataset.root())?;
                run.warn(found.warning());
                let mut start = Initialiser::new(&found.cloud, options, dataset.root())?;
                for training in views.of_light(light) {
                    start.observe(&training?.view);
                }
                start
            }
        };
        if light == 0 {
            extent = start.extent;
        }
        scenes.push(start.finish(&options.init));
    }
    let others = lights::light_of_nearest(&scenes);
    let mut state = ParameterState::new(&scenes[0]).with_lights(&others);
    state.sort_in_space();
    Ok(Checkpoint {
        stage: Stage::Radiance,
        iteration: 0,
        fingerprint,
        extent,
        monitor: LossMonitor {
            smoothed: 0.0,
            smoothed_l1: 0.0,
            best_l1: f64::MAX,
        },
        lamps: None,
        gloss: Vec::new(),
        state,
    })
}
