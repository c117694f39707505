//! Last steps, with the finished scene.

use super::lamps::{all_emitting, keep_emitting};
use super::run::Run;
use crate::energy;
use crate::error::Result;
use crate::options::StageChoice;
use crate::own_light::{self, OwnLight};
use crate::progress::TrainProgress;
use crate::views::Views;
use eagpt_scene::{Gaussians, ply};
use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::Ordering;

impl Run<'_> {
    /// Writes the finished scene in each of its lights, and where there are several with the lamps
    /// of all of them on; returns how the first one, solved, compares with its photographs. Of each
    /// scene `num_moving` Gaussians are not of clean lamps.
    pub(super) fn write_scenes(
        &mut self,
        mut scenes: Vec<Gaussians>,
        num_moving: usize,
        views: &Views,
    ) -> Result<Option<OwnLight>> {
        for scene in &mut scenes {
            self.gloss.apply(scene);
            eagpt_mirrors::polish(&self.mirrors, scene, num_moving);
        }
        self.limit_albedos((&mut scenes, num_moving), views)?;
        for (light, scene) in scenes.iter().enumerate() {
            let path = self.folder.scene(light);
            ply::write_gaussians(&path, scene)?;
            keep_emitting(&self.folder.lamps(light), scene)?;
        }
        if scenes.len() > 1 {
            let ([path, lamps], scene) = (self.folder.all_lamps(), all_emitting(&scenes));
            ply::write_gaussians(&path, &scene)?;
            keep_emitting(&lamps, &scene)?;
        }
        let scene = scenes.swap_remove(0);
        if self.request.is_watched {
            (self.progress)(TrainProgress::Scene {
                scene: Arc::new(scene.clone()),
            });
        }
        Ok(self.own_light(scene, views))
    }

    /// Lets no surface reflect more than it receives, where albedos are trained: `scenes` are one
    /// in all its lights.
    fn limit_albedos(
        &mut self,
        (scenes, num_moving): (&mut [Gaussians], usize),
        views: &Views,
    ) -> Result<()> {
        let request = self.request;
        let [first, others @ ..] = scenes else {
            return Ok(());
        };
        if request.options.stage != StageChoice::Radiance {
            let threshold = request.options.albedo.emission_threshold;
            let (device, cameras) = (&request.device, views.cameras());
            let num = energy::limit_albedos(device, (first, num_moving), &cameras, threshold)?;
            for other in others {
                other.albedos.clone_from(&first.albedos);
            }
            (self.progress)(TrainProgress::AlbedosLimited { num });
        }
        Ok(())
    }

    /// Compares the first light of the scene, solved, with the photographs, where albedos are
    /// trained. The scene is complete already: that it cannot be done is a warning.
    fn own_light(&mut self, scene: Gaussians, views: &Views) -> Option<OwnLight> {
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
        let compared = views.spread(0, own_light::MOST_VIEWS);
        match own_light::measure(device, scene, &cameras, compared, &mut told) {
            Ok(own_light) => own_light,
            Err(error) => {
                self.warn(format!("own light: {error}"));
                None
            }
        }
    }
}
