//! Last steps, with the finished scene.

use super::Run;
use super::views::Views;
use crate::error::Result;
use crate::luminous::luminous;
use crate::options::StageChoice;
use crate::own_light::{self, OwnLight};
use crate::progress::TrainProgress;
use eagpt_scene::Gaussians;
use eagpt_scene::lamps::{LAMPS_FILE, read_lamps};
use eagpt_scene::rng::{Purpose, RandomKey};
use std::ops::ControlFlow;
use std::sync::atomic::Ordering;

impl Run<'_> {
    /// Lets what is brighter than it can reflect near lamps emit, where albedos are trained.
    pub(super) fn mark_luminous(&mut self, scene: &mut Gaussians, views: &Views) -> Result<()> {
        let options = &self.request.options;
        let listed = self.request.out.join(LAMPS_FILE);
        if options.stage == StageChoice::Radiance || !listed.exists() {
            return Ok(());
        }
        let lamps = read_lamps(&listed)?;
        let key = RandomKey::new(options.seed, Purpose::Albedo, 1);
        let sampling = (options.albedo.num_samples, key);
        let found = luminous(
            &self.request.device,
            scene,
            &lamps,
            &views.cameras(),
            sampling,
        )?;
        for &i in &found {
            scene.emissions[i] = 1.0;
        }
        (self.progress)(TrainProgress::Luminous { num: found.len() });
        Ok(())
    }

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
