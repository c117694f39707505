//! Training views: checked before the work, then taken in shuffled rounds.

use super::{BadViews, Run};
use crate::backend::TrainingView;
use crate::error::{Result, TrainError};
use crate::options::Stage;
use crate::progress::TrainProgress;
use eagpt_scene::dataset::ViewCache;
use eagpt_scene::rng::{Purpose, RandomKey};
use eagpt_scene::{Camera, Dataset, View};
use glam::Vec3;
use std::sync::Arc;

/// The views a run trains on.
pub(crate) struct Views {
    cache: ViewCache,
    indices: Vec<usize>,
    seed: u64,
}

impl Views {
    pub(crate) fn new(
        dataset: Arc<Dataset>,
        indices: Vec<usize>,
        budget: usize,
        seed: u64,
    ) -> Self {
        Self {
            cache: ViewCache::new(dataset, budget / 2),
            indices,
            seed,
        }
    }

    pub(super) fn len(&self) -> usize {
        self.indices.len()
    }

    /// Upwards, a unit vector.
    pub(super) fn up(&self) -> Vec3 {
        self.cache.dataset().up().vector()
    }

    /// The cameras of all training views.
    pub(super) fn cameras(&self) -> Vec<Camera> {
        let frames = self.cache.dataset().frames();
        self.indices.iter().map(|&i| frames[i].camera).collect()
    }

    /// All views, in the dataset's order.
    pub(super) fn iter(&self) -> impl Iterator<Item = Result<TrainingView>> + '_ {
        self.indices.iter().map(|&index| self.get(index))
    }

    fn get(&self, index: usize) -> Result<TrainingView> {
        Ok(TrainingView {
            index,
            view: self.cache.get(index)?,
        })
    }

    /// Reads every view once, in order, handing each to `seen`. A view that cannot be used is an
    /// error that names all of them, or is left out.
    pub(super) fn check(
        &mut self,
        bad: BadViews,
        mut seen: impl FnMut(&View),
        run: &mut Run<'_>,
    ) -> Result<()> {
        let total = self.indices.len();
        let mut problems = Vec::new();
        let mut good = Vec::with_capacity(total);
        for (done, &index) in self.indices.iter().enumerate() {
            match self.get(index) {
                Ok(training) => {
                    seen(&training.view);
                    good.push(index);
                }
                Err(error) => problems.push(error.to_string()),
            }
            (run.progress)(TrainProgress::ReadingViews {
                done: done + 1,
                total,
            });
        }
        let path = self.cache.dataset().root().to_owned();
        if !problems.is_empty() && bad == BadViews::Refuse {
            let problem = match problems.as_slice() {
                [one] => one.clone(),
                many => format!(
                    "{} views cannot be used (--skip-bad trains without them): {}",
                    many.len(),
                    many.join("; ")
                ),
            };
            return Err(TrainError::Dataset { path, problem });
        }
        for problem in problems {
            run.warn(format!("view left out: {problem}"));
        }
        if good.is_empty() {
            return Err(TrainError::Dataset {
                path,
                problem: "no training view is left".to_owned(),
            });
        }
        self.indices = good;
        Ok(())
    }

    /// The view of an iteration (counted from 1): every round takes each view once, in an order of
    /// its own.
    pub(crate) fn at(&self, stage: Stage, iteration: u32) -> Result<TrainingView> {
        let num = self.indices.len() as u32;
        let (round, place) = ((iteration - 1) / num, (iteration - 1) % num);
        let key = RandomKey::new(self.seed, Purpose::ViewOrder, round);
        let mut order: Vec<(u32, usize)> = self
            .indices
            .iter()
            .map(|&index| {
                (
                    key.stream(index as u32, stage as u32).next_words()[0],
                    index,
                )
            })
            .collect();
        order.sort_unstable();
        self.get(order[place as usize].1)
    }

    /// At most `num` views, spread over the dataset.
    pub(super) fn spread(&self, num: usize) -> impl Iterator<Item = Result<TrainingView>> + '_ {
        let num = num.min(self.indices.len());
        (0..num).map(move |i| self.get(self.indices[i * self.indices.len() / num]))
    }

    /// Fixed views for previews.
    pub(super) fn previews(&self, num: usize) -> Result<Vec<TrainingView>> {
        self.spread(num).collect()
    }
}
