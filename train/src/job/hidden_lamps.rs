//! Light that no view shows joins the lamps, once the light that all else brings is known.

use super::run::Run;
use crate::backend::Backend;
use crate::error::Result;
use crate::progress::TrainProgress;
use crate::views::Views;
use eagpt_light::hidden_lamps::HiddenLamps;
use eagpt_light::luminaires;
use eagpt_light::unseen;
use eagpt_scene::lamps::{Lamps, read_lamps, write_lamps};
use eagpt_scene::rng::{Purpose, RandomKey};
use std::path::{Path, PathBuf};

impl Run<'_> {
    /// The list of the lamps, if light that views do not show is looked for: nothing is where no
    /// lamps are listed, and in several lights, of which each would want its own.
    pub(super) fn list_for_hidden_light(&self, views: &Views) -> Option<PathBuf> {
        let is_asked_for = self.request.options.albedo.unseen_light && views.num_lights() == 1;
        Some(self.folder.lamps(0)).filter(|list| is_asked_for && list.exists())
    }

    /// Closes the room where no view looks if light comes from there, and lists what shines with
    /// the lamps; whether it does. Light has to be gathered again then.
    pub(super) fn light_unseen(
        &mut self,
        backend: &mut dyn Backend,
        views: &Views,
    ) -> Result<bool> {
        let request = self.request;
        let Some(list) = self.list_for_hidden_light(views) else {
            return Ok(false);
        };
        let scene = backend.state()?.gaussians();
        let tracer = request.device.scene(&scene)?;
        let cameras = views.cameras();
        let key = RandomKey::new(request.options.seed, Purpose::Albedo, 4);
        let looking = (cameras.as_slice(), views.up());
        let found = unseen::find(&*tracer, &scene, &backend.gathered(0), looking, key)?;
        let Some((panels, share)) = found else {
            return Ok(false);
        };
        let lamps = read_lamps(&list)?;
        self.add(backend, (&list, lamps), ("unseen", panels))?;
        (self.progress)(TrainProgress::Unseen { share });
        Ok(true)
    }

    /// Puts bulbs into luminaires that no view looks into, in the scene and in the list; whether
    /// there are any. Light has to be gathered again then.
    pub(super) fn place_bulbs(&mut self, backend: &mut dyn Backend, views: &Views) -> Result<bool> {
        let request = self.request;
        let Some(list) = self.list_for_hidden_light(views) else {
            return Ok(false);
        };
        let scene = backend.state()?.gaussians();
        let cameras = views.cameras();
        let looking = (cameras.as_slice(), views.up());
        let key = RandomKey::new(request.options.seed, Purpose::Albedo, 6);
        let received = backend.gathered(0);
        let lamps = read_lamps(&list)?;
        let known = (lamps.lamps.as_slice(), received.as_slice());
        let found = luminaires::find((&request.device, &scene), known, looking, key)?;
        let num = found.lamps.len();
        if num == 0 {
            return Ok(false);
        }
        self.add(backend, (&list, lamps), ("hidden", found))?;
        (self.progress)(TrainProgress::Bulbs { num });
        Ok(true)
    }

    /// Adds lamps to the scene and, as `name-1` and so on, to those listed.
    fn add(
        &mut self,
        backend: &mut dyn Backend,
        (list, mut lamps): (&Path, Lamps),
        (name, found): (&str, HiddenLamps),
    ) -> Result<()> {
        backend.edit(&found.edit, &[])?;
        self.gloss.edit(&found.edit);
        for (mut lamp, number) in found.lamps.into_iter().zip(1..) {
            lamp.name = format!("{name}-{number}");
            lamps.lamps.push(lamp);
        }
        Ok(write_lamps(list, &lamps)?)
    }
}
