//! Light from where no view looks joins the lamps, once the light that all else brings is known.

use super::run::Run;
use crate::backend::Backend;
use crate::error::Result;
use crate::progress::TrainProgress;
use crate::unseen;
use crate::views::Views;
use eagpt_scene::SceneEdit;
use eagpt_scene::lamps::{read_lamps, write_lamps};
use eagpt_scene::rng::{Purpose, RandomKey};

impl Run<'_> {
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
        let edit = SceneEdit {
            fixed: panels.discs,
            ..SceneEdit::nothing(scene.len())
        };
        backend.edit(&edit, &[])?;
        let mut lamps = read_lamps(&list)?;
        for (mut lamp, number) in panels.lamps.into_iter().zip(1..) {
            lamp.name = format!("unseen-{number}");
            lamps.lamps.push(lamp);
        }
        write_lamps(&list, &lamps)?;
        (self.progress)(TrainProgress::Unseen { share });
        Ok(true)
    }
}
