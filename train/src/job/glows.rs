//! Surfaces that shine of themselves join the lamps, once the light that they receive is known.

use super::lamps::{all_emitting, without};
use super::run::Run;
use crate::backend::Backend;
use crate::bake::emits;
use crate::error::Result;
use crate::glows::{self, Surfaces};
use crate::progress::TrainProgress;
use crate::views::Views;
use eagpt_scene::lamps::write_lamps;

/// What names of such lamps begin with.
const NAME: &str = "glow-";

impl Run<'_> {
    /// Lets surfaces emit that are brighter than the light gathered there allows, and lists them
    /// with the lamps. Where no lamps are listed there are none.
    pub(super) fn mark_glows(&mut self, backend: &mut dyn Backend, views: &Views) -> Result<()> {
        let lights = 0..views.num_lights();
        let mut lists: Vec<_> = lights
            .clone()
            .map(|light| self.folder.lamps(light))
            .collect();
        if !lists.iter().all(|list| list.exists()) {
            return Ok(());
        }
        let state = backend.state()?;
        let (num_moving, scenes) = (state.num_moving(), state.in_lights());
        let mut found = Vec::new();
        for light in lights {
            let mut lamps = without(&lists[light], NAME)?;
            lamps.lamps.retain(|lamp| !lamp.views.is_empty());
            found.push(glows::glows(&Surfaces {
                gaussians: &scenes[light],
                num_moving,
                received: &backend.gathered(light),
                lamps: &lamps,
                gloss: self.gloss.of_gaussians(),
            }));
        }
        let all = glows::in_any_light(&found);
        if all.is_empty() {
            return Ok(());
        }
        let emitting = |surfaces: &Vec<Vec<usize>>| {
            let members = surfaces.iter().flatten();
            members.map(|&i| (i, true)).collect()
        };
        backend.mark_emitting(&found.iter().map(emitting).collect::<Vec<_>>())?;
        let mut scenes = backend.state()?.in_lights();
        if scenes.len() > 1 {
            let [_, path] = self.folder.all_lamps();
            lists.push(path);
            scenes.push(all_emitting(&scenes));
        }
        let tracer = self.request.device.scene(&scenes[0])?;
        let sights = glows::sights(&all, (&*tracer, scenes[0].len()), views.named_cameras())?;
        for (list, scene) in lists.iter().zip(&scenes) {
            let mut lamps = without(list, NAME)?;
            for ((members, sight), number) in all.iter().zip(&sights).zip(1..) {
                let members = members.iter().copied();
                let members: Vec<usize> = members.filter(|&i| emits(scene.emissions[i])).collect();
                if !members.is_empty() {
                    let name = format!("{NAME}{number}");
                    lamps.lamps.push(glows::lamp(name, scene, &members, sight));
                }
            }
            write_lamps(list, &lamps)?;
        }
        (self.progress)(TrainProgress::Glows { num: all.len() });
        Ok(())
    }
}
