//! Last steps, with the finished scene.

use super::lamps::{all_emitting, keep_emitting};
use super::run::Run;
use crate::error::Result;
use crate::options::StageChoice;
use crate::own_light::{self, Balance, OwnLight};
use crate::progress::TrainProgress;
use crate::views::Views;
use eagpt_light::energy;
use eagpt_scene::{Gaussians, ply};
use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::Ordering;

impl Run<'_> {
    /// Finishes the scene in each of its lights, of which `num_moving` Gaussians are not of clean
    /// lamps, and writes it; returns how the first one, solved, compares with its photographs. It
    /// is written before that, too, as it would be if it could not be solved.
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
        self.write_all(&scenes)?;
        let balance = self.balance((&scenes[0], num_moving), views);
        if let Some(Balance { albedos, .. }) = &balance {
            scenes[0].albedos.clone_from(albedos);
            share_albedos(&mut scenes);
            self.write_all(&scenes)?;
        }
        if self.request.is_watched {
            let scene = Arc::new(scenes.swap_remove(0));
            (self.progress)(TrainProgress::Scene { scene });
        }
        Ok(balance.map(|balance| balance.own_light))
    }

    /// Writes the scene in each of its lights, and where there are several with the lamps of all of
    /// them on.
    fn write_all(&self, scenes: &[Gaussians]) -> Result<()> {
        for (light, scene) in scenes.iter().enumerate() {
            let path = self.folder.scene(light);
            ply::write_gaussians(&path, scene)?;
            keep_emitting(&self.folder.lamps(light), scene)?;
        }
        if scenes.len() > 1 {
            let ([path, lamps], scene) = (self.folder.all_lamps(), all_emitting(scenes));
            ply::write_gaussians(&path, &scene)?;
            keep_emitting(&lamps, &scene)?;
        }
        Ok(())
    }

    /// Lets no surface reflect more than it receives, where albedos are trained: `scenes` are one
    /// in all its lights.
    fn limit_albedos(
        &mut self,
        (scenes, num_moving): (&mut [Gaussians], usize),
        views: &Views,
    ) -> Result<()> {
        let request = self.request;
        if request.options.stage != StageChoice::Radiance {
            let threshold = request.options.albedo.emission_threshold;
            let (device, cameras) = (&request.device, views.cameras());
            let first = (&mut scenes[0], num_moving);
            let num = energy::limit_albedos(device, first, &cameras, threshold)?;
            share_albedos(scenes);
            (self.progress)(TrainProgress::AlbedosLimited { num });
        }
        Ok(())
    }

    /// Compares the first light of a scene, solved, with the photographs, where albedos are
    /// trained, and makes it as bright as these. That it cannot be done is a warning.
    fn balance(&mut self, scene: (&Gaussians, usize), views: &Views) -> Option<Balance> {
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
        let compared = || views.spread(0, own_light::MOST_VIEWS);
        match own_light::balance(device, scene, &cameras, compared, &mut told) {
            Ok(Some(balance)) => {
                (self.progress)(TrainProgress::AlbedosBalanced {
                    scale: balance.scale,
                    num_limited: balance.num_limited,
                });
                Some(balance)
            }
            Ok(None) => None,
            Err(error) => {
                self.warn(format!("own light: {error}"));
                None
            }
        }
    }
}

/// Gives a scene in all its lights the albedos that it has in the first.
fn share_albedos(scenes: &mut [Gaussians]) {
    if let [first, others @ ..] = scenes {
        for other in others {
            other.albedos.clone_from(&first.albedos);
        }
    }
}
