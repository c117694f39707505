//! Training views are checked before the work.

use super::request::BadViews;
use super::run::Run;
use crate::backend::TrainingView;
use crate::error::{Result, TrainError};
use crate::progress::TrainProgress;
use crate::views::Views;
use eagpt_scene::dataset::{MIN_FACING, share_facing};

impl Run<'_> {
    /// Reads all `views` once, in order, handing each to `seen`. A view that cannot be used is an
    /// error that names all of them, or is left out. Views without
    /// any mask are warned of, and normals of the side that no camera sees.
    pub(super) fn check(
        &mut self,
        views: &mut Views,
        mut seen: impl FnMut(&TrainingView),
    ) -> Result<()> {
        let (mut done, mut num_masked, total) = (0, 0_usize, views.len());
        let mut turned_away = Vec::new();
        let mut problems = Vec::new();
        views.retain(|training| {
            done += 1;
            let read = training.map(|training| {
                let view = &training.view;
                num_masked += usize::from(view.emission.is_some());
                let normal = view.normal.as_ref();
                let facing = normal.and_then(|normal| share_facing(&view.camera, normal));
                if facing.is_some_and(|share| share < MIN_FACING) {
                    turned_away.push(view.name.clone());
                }
                seen(&training);
            });
            (self.progress)(TrainProgress::ReadingViews { done, total });
            read.map_err(|error| problems.push(error.to_string()))
                .is_ok()
        });
        if !problems.is_empty() && self.request.bad_views == BadViews::Refuse {
            let problem = match problems.as_slice() {
                [one] => one.clone(),
                many => format!(
                    "{} views cannot be used (--skip-bad trains without them): {}",
                    many.len(),
                    many.join("; ")
                ),
            };
            let path = views.dataset(0).root().to_owned();
            return Err(TrainError::Dataset { path, problem });
        }
        for problem in problems {
            self.warn(format!("view left out: {problem}"));
        }
        if num_masked == 0 {
            self.warn(
                "no training view has an emission mask (`eagpt masks` makes them): lamps are not \
                 found, and albedos are wrong"
                    .to_owned(),
            );
        }
        if let Some(first) = turned_away.first() {
            self.warn(format!(
                "normals of {} views are turned away from the camera in more than a tenth of their \
                 pixels, {first} for one: surfaces will be wrong (`eagpt dataset check`)",
                turned_away.len()
            ));
        }
        match (0..views.num_lights()).find(|&light| !views.has(light)) {
            None => Ok(()),
            Some(light) => Err(TrainError::Dataset {
                path: views.dataset(light).root().to_owned(),
                problem: "no training view is left".to_owned(),
            }),
        }
    }
}
