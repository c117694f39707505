//! Light from where no view looks joins the lamps, once the light that all else brings is known.

use super::lamps::without;
use super::run::Run;
use crate::backend::Backend;
use crate::bake::emits;
use crate::error::Result;
use crate::progress::TrainProgress;
use crate::unseen::{self, NAME, Panels};
use crate::views::Views;
use eagpt_scene::SceneEdit;
use eagpt_scene::lamps::write_lamps;
use eagpt_scene::rng::{Purpose, RandomKey};
use glam::Vec3;
use std::path::Path;

impl Run<'_> {
    /// Puts parts of the hull into the scene whose light differences of albedo tell of, and lists
    /// them with the lamps; whether there are any. Light has to be gathered again then. Where no
    /// lamps are listed there are none.
    pub(super) fn light_unseen(
        &mut self,
        backend: &mut dyn Backend,
        views: &Views,
    ) -> Result<bool> {
        let options = &self.request.options;
        let lights = 0..views.num_lights();
        let lists: Vec<_> = lights
            .clone()
            .map(|light| self.folder.lamps(light))
            .collect();
        if !options.albedo.unseen_light || !lists.iter().all(|list| list.exists()) {
            return Ok(false);
        }
        let key = RandomKey::new(options.seed, Purpose::Albedo, 4);
        let scenes = backend.state()?.in_lights();
        let mut found: Vec<Option<Panels>> = Vec::new();
        let mut num_lamps = 0;
        for light in lights {
            let (scene, received) = (&scenes[light], backend.gathered(light));
            let tracer = self.request.device.scene(scene)?;
            let panels = unseen::find(
                &*tracer,
                scene,
                &received,
                (&views.cameras(), views.up()),
                key,
            )?;
            found.push(panels.map(|(mut panels, share)| {
                for lamp in &mut panels.lamps {
                    num_lamps += 1;
                    lamp.name = format!("{NAME}{num_lamps}");
                }
                (self.progress)(TrainProgress::Unseen { share });
                panels
            }));
        }
        if found.iter().all(Option::is_none) {
            return Ok(false);
        }
        // Each light has panels of its own, which do not shine in the others.
        let num = |panels: &Option<Panels>| panels.as_ref().map_or(0, |panels| panels.discs.len());
        let before = |light: usize| found[..light].iter().map(num).sum::<usize>();
        let total = before(found.len());
        let radiances = found.iter().enumerate().map(|(light, panels)| {
            let mut radiances = vec![None; total];
            if let Some(panels) = panels {
                let own = panels.discs.iter();
                let own = own.map(|disc| emits(disc.emission).then_some(disc.radiance));
                radiances.splice(before(light)..before(light) + num(&found[light]), own);
            }
            radiances
        });
        let radiances: Vec<Vec<Option<Vec3>>> = radiances.collect();
        let discs = found
            .iter()
            .flatten()
            .flat_map(|panels| panels.discs.iter());
        let edit = SceneEdit {
            fixed: discs.collect(),
            ..SceneEdit::nothing(scenes[0].len())
        };
        backend.edit(&edit, &radiances)?;
        for (list, panels) in lists.iter().zip(&found) {
            list_also(list, panels.iter())?;
        }
        if lists.len() > 1 {
            let [_, path] = self.folder.all_lamps();
            list_also(&path, found.iter().flatten())?;
        }
        Ok(true)
    }
}

/// Lists lamps of `panels` with those of a list.
fn list_also<'a>(list: &Path, panels: impl Iterator<Item = &'a Panels>) -> Result<()> {
    let mut lamps = without(list, NAME)?;
    lamps
        .lamps
        .extend(panels.flat_map(|panels| panels.lamps.clone()));
    Ok(write_lamps(list, &lamps)?)
}
