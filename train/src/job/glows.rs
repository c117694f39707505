//! Surfaces that shine of themselves join the lamps, once the light that they receive is known.

use super::run::Run;
use crate::backend::Backend;
use crate::error::Result;
use crate::progress::TrainProgress;
use crate::views::Views;
use eagpt_light::glows::{self, Surfaces};
use eagpt_scene::lamps::{read_lamps, write_lamps};

impl Run<'_> {
    /// Lets surfaces emit that are brighter than the light gathered there allows, and lists them
    /// with the lamps. Where no lamps are listed nothing is looked for, nor in several lights: the
    /// panes of a window that is dark in one of them would be.
    pub(super) fn mark_glows(&mut self, backend: &mut dyn Backend, views: &Views) -> Result<()> {
        let list = self.folder.lamps(0);
        if views.num_lights() > 1 || !list.exists() {
            return Ok(());
        }
        let state = backend.state()?;
        let scene = state.gaussians();
        let mut lamps = read_lamps(&list)?;
        let found = glows::glows(&Surfaces {
            gaussians: &scene,
            num_moving: state.num_moving(),
            received: &backend.gathered(0),
            gloss: self.gloss.of_gaussians(),
        });
        if found.is_empty() {
            return Ok(());
        }
        let emitting = found.iter().flatten().map(|&i| (i, true)).collect();
        backend.mark_emitting(&[emitting])?;
        let tracer = self.request.device.scene(&scene)?;
        let sights = glows::sights(&found, (&*tracer, scene.len()), views.named_cameras())?;
        let mut num = 0;
        for (members, sight) in found.iter().zip(&sights) {
            let name = format!("glow-{}", num + 1);
            let glow = glows::lamp(name, &scene, members, sight);
            let places = members.iter().map(|&i| scene.positions[i]);
            if !glows::join_as_shade(&mut lamps, &glow, places) {
                lamps.lamps.push(glow);
                num += 1;
            }
        }
        write_lamps(&list, &lamps)?;
        (self.progress)(TrainProgress::Glows {
            num,
            num_shades: found.len() - num,
        });
        Ok(())
    }
}
