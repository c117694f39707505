//! Training views are checked before the work.

use super::request::BadViews;
use super::run::Run;
use crate::backend::TrainingView;
use crate::error::{Result, TrainError};
use crate::progress::TrainProgress;
use crate::views::Views;

impl Run<'_> {
    /// Reads all `views` once, in order, handing each to `seen`. A view that cannot be used is an
    /// error that names all of them, or is left out.
    pub(super) fn check(
        &mut self,
        views: &mut Views,
        mut seen: impl FnMut(&TrainingView),
    ) -> Result<()> {
        let (mut done, total) = (0, views.len());
        let mut problems = Vec::new();
        views.retain(|training| {
            done += 1;
            let read = training.map(|training| seen(&training));
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
        match (0..views.num_lights()).find(|&light| !views.has(light)) {
            None => Ok(()),
            Some(light) => Err(TrainError::Dataset {
                path: views.dataset(light).root().to_owned(),
                problem: "no training view is left".to_owned(),
            }),
        }
    }
}
