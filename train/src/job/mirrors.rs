//! Mirrors become surfaces that reflect the room, once, before lamps become clean: what a mirror
//! shows of a lamp is no lamp.

use super::run::Run;
use crate::backend::{Backend, TrainingView};
use crate::checkpoint::Checkpoint;
use crate::error::Result;
use crate::options::Stage;
use crate::progress::TrainProgress;
use crate::views::Views;
use eagpt_light::irradiance;
use eagpt_mirrors::{Evidence, Mirror, Room};
use eagpt_scene::rng::{Purpose, RandomKey};
use eagpt_scene::{Camera, Gaussians, files, pictures, png};
use eagpt_trace::Tracer;
use eagpt_trace::transport::matrix::Receiver;
use eagpt_trace::transport::start::Surface;
use glam::Vec3;
use serde::{Deserialize, Serialize};
use std::collections::HashMap;

/// Value of a mask from which on a pixel shows a mirror.
const SHOWN: f32 = 0.5;

/// Directions from which the light that a disc of a mirror gets is gathered.
const NUM_SAMPLES: u32 = 32;

/// The mirrors of a run, as their file has them.
#[derive(Serialize, Deserialize)]
struct Placed {
    /// Iteration of stage 0 after which they came into the scene.
    iteration: u32,
    mirrors: Vec<Mirror>,
}

impl Run<'_> {
    /// Finds the mirrors that training views show, puts them into the scene and lists them beside
    /// it; returns the number of their discs, the last ones. From here on nothing is learned from
    /// the pixels that show them.
    pub(super) fn place_mirrors(
        &mut self,
        backend: &mut dyn Backend,
        views: &Views,
        iteration: u32,
    ) -> Result<usize> {
        let request = self.request;
        let scene = backend.state()?.in_lights().swap_remove(0);
        let tracer = request.device.scene(&scene)?;
        let cameras = views.cameras();
        let mut evidence = Evidence::new(cameras.iter().map(Camera::num_pixels).sum());
        for training in views.of_light(0) {
            let view = training?.view;
            evidence.add(&view, &tracer.gbuffer(&view.camera)?);
        }
        let mirrors = eagpt_mirrors::find(&evidence, views.up(), &*tracer, request.options.seed)?;
        if mirrors.is_empty() {
            return Ok(0);
        }
        let mut room = Room::new(&mirrors, &evidence, &scene, &*tracer);
        for training in views.of_light(0) {
            room.add(&training?.view)?;
        }
        let mut edit = room.edit();
        let placed = edit.applied(&scene);
        let tracer = request.device.scene(&placed)?;
        edit.fixed.radiances =
            reflected(&*tracer, &placed, edit.fixed.len(), request.options.seed)?;
        let no_lamps = vec![vec![None; edit.fixed.len()]; views.num_lights()];
        backend.edit(&edit, &no_lamps)?;
        files::create_dir(&self.folder.mirror_masks())?;
        let mut hidden = HashMap::new();
        for training in views.iter() {
            let training = training?;
            let camera = &training.view.camera;
            let shown = eagpt_mirrors::pixels(&mirrors, camera, &tracer.gbuffer(camera)?);
            if let Some(shown) = shown {
                let bytes: Vec<u8> = shown.iter().map(|shows| 255 * u8::from(*shows)).collect();
                let path = self.folder.mirror_mask(training.light, &training.view.name);
                png::write_gray8(&path, camera.width, camera.height, &bytes)?;
                hidden.insert(training.index, shown);
            }
        }
        views.hide(hidden);
        (self.progress)(TrainProgress::Mirrors {
            iteration,
            num_mirrors: mirrors.len(),
            num_gaussians: edit.num_after(),
        });
        let placed = Placed { iteration, mirrors };
        files::write_json(&self.folder.mirrors(), &placed)?;
        self.mirrors = placed.mirrors;
        Ok(edit.fixed.len())
    }

    /// Takes the mirrors of an earlier run that goes on from `start`, if it has placed them by
    /// then.
    pub(super) fn take_up_mirrors(&mut self, views: &Views, start: &Checkpoint) -> Result<()> {
        let path = self.folder.mirrors();
        if !path.exists() {
            return Ok(());
        }
        let placed: Placed = files::read_json(&path)?;
        if start.stage == Stage::Radiance && start.iteration < placed.iteration {
            files::remove_if_there(&path)?;
            return files::remove_if_there(&self.folder.mirror_masks()).map_err(Into::into);
        }
        let mut hidden = HashMap::new();
        for training in views.iter() {
            let TrainingView {
                index, light, view, ..
            } = training?;
            let path = self.folder.mirror_mask(light, &view.name);
            if path.exists() {
                let mask = pictures::read_mask(&path)?;
                let shown = mask.pixels().iter().map(|[value]| *value >= SHOWN);
                hidden.insert(index, shown.collect());
            }
        }
        views.hide(hidden);
        self.mirrors = placed.mirrors;
        Ok(())
    }
}

/// Radiance of discs of mirrors, the last `num` Gaussians of a scene that `tracer` traces: what
/// single rays see of them is that of a diffuse surface that reflects as much, as in baking.
fn reflected(tracer: &dyn Tracer, scene: &Gaussians, num: usize, seed: u64) -> Result<Vec<Vec3>> {
    let discs = scene.len() - num..scene.len();
    let receiver = |i: usize| {
        let surface = Surface {
            position: scene.positions[i],
            normal: scene.rotations[i] * Vec3::Z,
            offset: scene.scales[i].min_element(),
        };
        (i as u32, surface)
    };
    let receivers: Vec<Receiver> = discs.clone().map(receiver).collect();
    let sampling = (NUM_SAMPLES, RandomKey::new(seed, Purpose::Albedo, 3));
    let received = irradiance::received(tracer, &receivers, &scene.radiances, sampling)?;
    let reflected = discs.zip(received);
    Ok(reflected
        .map(|(i, light)| scene.gloss[i].specular * light)
        .collect())
}
