//! Training views, taken in shuffled rounds.

use crate::backend::TrainingView;
use crate::error::Result;
use crate::options::Stage;
use crate::points::{Discs, SeenPoints};
use eagpt_scene::dataset::ViewCache;
use eagpt_scene::rng::{Purpose, RandomKey};
use eagpt_scene::spread::evenly;
use eagpt_scene::{Camera, Dataset, Lamp};
use glam::Vec3;
use std::collections::HashMap;
use std::sync::{Arc, OnceLock};

/// The views a run trains on, of one dataset or of several in different lights.
pub(crate) struct Views {
    lights: Vec<ViewCache>,
    /// Number of frames of the datasets before each of them.
    first: Vec<usize>,
    /// Frames, counted over all datasets.
    indices: Vec<usize>,
    seed: u64,
    /// The cloud of each light that has one.
    clouds: Vec<Option<Arc<Discs>>>,
    /// Their points that each frame sees, when they are first asked for.
    points: Vec<OnceLock<Arc<SeenPoints>>>,
    /// Pixels of frames that nothing is learned from, row by row.
    hidden: OnceLock<HashMap<usize, Vec<bool>>>,
}

impl Views {
    /// Views of datasets, at least one, by the indices of their frames; they may take `budget`
    /// bytes together.
    pub(crate) fn new(datasets: Vec<(Arc<Dataset>, Vec<usize>)>, budget: usize, seed: u64) -> Self {
        let num = datasets.len();
        let (mut first, mut indices) = (Vec::with_capacity(num), Vec::new());
        let (mut lights, mut before) = (Vec::with_capacity(num), 0);
        for (dataset, frames) in datasets {
            first.push(before);
            indices.extend(frames.into_iter().map(|frame| before + frame));
            before += dataset.frames().len();
            lights.push(ViewCache::new(dataset, budget / 2 / num));
        }
        Self {
            lights,
            first,
            indices,
            seed,
            clouds: Vec::new(),
            points: Vec::new(),
            hidden: OnceLock::new(),
        }
    }

    /// From here on views tell which points of the cloud of their light they see.
    pub(crate) fn look_for(&mut self, clouds: Vec<Option<Arc<Discs>>>) {
        self.points = (0..self.num_frames()).map(|_| OnceLock::new()).collect();
        self.clouds = clouds;
    }

    /// The cloud of a light, if views tell which of its points they see.
    pub(crate) fn cloud(&self, light: usize) -> Option<&Discs> {
        self.clouds.get(light)?.as_deref()
    }

    /// From here on these pixels are unknown, by the indices of views. This happens once.
    pub(crate) fn hide(&self, hidden: HashMap<usize, Vec<bool>>) {
        self.hidden.get_or_init(|| hidden);
    }

    /// Number of frames of all datasets.
    pub(crate) fn num_frames(&self) -> usize {
        (0..self.num_lights())
            .map(|light| self.dataset(light).frames().len())
            .sum()
    }

    fn points(&self, index: usize, light: usize) -> Option<Arc<SeenPoints>> {
        let cloud = self.clouds.get(light)?.as_ref()?;
        let seen = || Arc::new(cloud.seen_by(&self.camera(index)));
        Some(Arc::clone(self.points[index].get_or_init(seen)))
    }

    /// Light and frame of an index.
    fn place(&self, index: usize) -> (usize, usize) {
        let light = self.first.partition_point(|first| *first <= index) - 1;
        (light, index - self.first[light])
    }

    /// Number of lights.
    pub(crate) fn num_lights(&self) -> usize {
        self.lights.len()
    }

    /// The dataset of a light.
    pub(crate) fn dataset(&self, light: usize) -> &Dataset {
        self.lights[light].dataset()
    }

    pub(crate) fn len(&self) -> usize {
        self.indices.len()
    }

    /// Upwards, a unit vector.
    pub(crate) fn up(&self) -> Vec3 {
        self.dataset(0).up().vector()
    }

    fn camera(&self, index: usize) -> Camera {
        let (light, frame) = self.place(index);
        self.dataset(light).frames()[frame].camera
    }

    /// The camera of the first training view of a name.
    pub(crate) fn named(&self, name: &str) -> Option<Camera> {
        let is_named = |index: &&usize| {
            let (light, frame) = self.place(**index);
            self.dataset(light).frames()[frame].name == name
        };
        let index = self.indices.iter().find(is_named)?;
        Some(self.camera(*index))
    }

    /// The cameras of all training views; those of several lights once.
    pub(crate) fn cameras(&self) -> Vec<Camera> {
        self.of_poses().map(|index| self.camera(index)).collect()
    }

    /// The cameras of the views that show a lamp, …
    pub(crate) fn cameras_of<'a>(&'a self, lamp: &'a Lamp) -> impl Iterator<Item = Camera> + 'a {
        lamp.views.iter().filter_map(|name| self.named(name))
    }

    /// … and where they are.
    pub(crate) fn eyes<'a>(&'a self, lamp: &'a Lamp) -> impl Iterator<Item = Vec3> + 'a {
        self.cameras_of(lamp).map(|camera| camera.origin())
    }

    /// As [`Self::cameras`], with the names of their views.
    pub(crate) fn named_cameras(&self) -> impl Iterator<Item = (Camera, &str)> {
        self.of_poses().map(|index| {
            let (light, frame) = self.place(index);
            let frame = &self.dataset(light).frames()[frame];
            (frame.camera, frame.name.as_str())
        })
    }

    /// One view of each camera that has views in several lights, whose lights take turns; all
    /// others.
    fn of_poses(&self) -> impl Iterator<Item = usize> + '_ {
        let mut poses: Vec<(Camera, Vec<usize>)> = Vec::new();
        for &index in &self.indices {
            let (light, camera) = (self.place(index).0, self.camera(index));
            let known = poses
                .iter_mut()
                .find(|(known, views)| *known == camera && self.place(views[0]).0 < light);
            match known {
                Some((_, views)) => views.push(index),
                None => poses.push((camera, vec![index])),
            }
        }
        let turn = |(turn, (_, views)): (usize, (Camera, Vec<usize>))| views[turn % views.len()];
        poses.into_iter().enumerate().map(turn)
    }

    /// A view of every pose, each in one of its lights, sorted by light.
    pub(crate) fn poses(&self) -> impl Iterator<Item = Result<TrainingView>> + '_ {
        let mut indices: Vec<usize> = self.of_poses().collect();
        indices.sort_unstable();
        indices.into_iter().map(|index| self.get(index))
    }

    /// All views, in the dataset's order.
    pub(crate) fn iter(&self) -> impl Iterator<Item = Result<TrainingView>> + '_ {
        self.indices.iter().map(|&index| self.get(index))
    }

    /// Those of one light.
    pub(crate) fn of_light(&self, light: usize) -> impl Iterator<Item = Result<TrainingView>> + '_ {
        let own = self
            .indices
            .iter()
            .filter(move |index| self.place(**index).0 == light);
        own.map(|&index| self.get(index))
    }

    fn get(&self, index: usize) -> Result<TrainingView> {
        let (light, frame) = self.place(index);
        let view = self.lights[light].get(frame)?;
        let points = self.points(index, light);
        // Another index: prepared copies of the whole photograph differ.
        let (index, view) = match self.hidden.get().and_then(|hidden| hidden.get(&index)) {
            Some(hidden) => (index + self.num_frames(), Arc::new(view.without(hidden))),
            None => (index, view),
        };
        Ok(TrainingView {
            index,
            light,
            view,
            points,
        })
    }

    /// Reads every view once, in order; those for which `is_good` says so stay.
    pub(crate) fn retain(&mut self, mut is_good: impl FnMut(Result<TrainingView>) -> bool) {
        let mut good = self.indices.clone();
        good.retain(|&index| is_good(self.get(index)));
        self.indices = good;
    }

    /// Whether there are views of a light.
    pub(crate) fn has(&self, light: usize) -> bool {
        self.indices
            .iter()
            .any(|&index| self.place(index).0 == light)
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

    /// At most `num` views, spread over those of a light.
    pub(crate) fn spread(
        &self,
        light: usize,
        num: usize,
    ) -> impl Iterator<Item = Result<TrainingView>> + '_ {
        let own = self.indices.iter().copied();
        let own: Vec<usize> = own.filter(|index| self.place(*index).0 == light).collect();
        let chosen: Vec<usize> = evenly(&own, num).copied().collect();
        chosen.into_iter().map(|index| self.get(index))
    }

    /// Fixed views for previews.
    pub(crate) fn previews(&self, num: usize) -> Result<Vec<TrainingView>> {
        let lights = 0..self.num_lights();
        lights.flat_map(|light| self.spread(light, num)).collect()
    }
}
