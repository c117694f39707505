//! What is done with the finished scene.

use super::Run;
use super::views::Views;
use crate::options::StageChoice;
use crate::own_light::{self, OwnLight};
use crate::progress::TrainProgress;
use eagpt_scene::Gaussians;
use std::ops::ControlFlow;
use std::sync::atomic::Ordering;

impl Run<'_> {
    /// Compares the light of the scene, solved, with the photographs, where albedos are trained.
    /// The scene is complete already: that it cannot be done is a warning.
    pub(super) fn own_light(&mut self, scene: Gaussians, views: &Views) -> Option<OwnLight> {
        let request = self.request;
        if request.options.stage == StageChoice::Radiance {
            return None;
        }
        let device = (&request.device, request.options.seed);
        let mut told = |step| {
            (self.progress)(TrainProgress::OwnLight { step });
            match request.stop.load(Ordering::Relaxed) {
                true => ControlFlow::Break(()),
                false => ControlFlow::Continue(()),
            }
        };
        let cameras = views.cameras();
        let compared = views.spread(own_light::MOST_VIEWS);
        match own_light::measure(device, scene, &cameras, compared, &mut told) {
            Ok(own_light) => own_light,
            Err(error) => {
                self.warn(format!("own light: {error}"));
                None
            }
        }
    }
}
