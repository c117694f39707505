//! A run under way.

use super::folder::Folder;
use super::gloss::RunGloss;
use super::request::TrainRequest;
use crate::options::Stage;
use crate::progress::TrainProgress;
use eagpt_mirrors::Mirror;
use std::time::Instant;

/// State shared by the parts of a run.
pub(super) struct Run<'a> {
    pub(super) request: &'a TrainRequest,
    pub(super) folder: Folder,
    pub(super) progress: &'a mut dyn FnMut(TrainProgress),
    pub(super) warnings: Vec<String>,
    pub(super) started: Instant,
    pub(super) stage_seconds: Vec<(Stage, f64)>,
    /// Number of Gaussians in the end.
    pub(super) budget: usize,
    /// When the next scene is due for those who watch.
    pub(super) next_scene: Option<Instant>,
    /// Gloss of the scene of stage 0.
    pub(super) gloss: RunGloss,
    /// Mirrors that were put into the scene.
    pub(super) mirrors: Vec<Mirror>,
}

impl Run<'_> {
    pub(super) fn warn(&mut self, text: String) {
        self.warnings.push(text.clone());
        (self.progress)(TrainProgress::Warning { text });
    }
}
