//! Surfaces that shine of themselves, and what else emits, join the lamps, once the light that
//! surfaces receive is known.

use super::run::Run;
use crate::backend::Backend;
use crate::error::Result;
use crate::progress::TrainProgress;
use crate::views::Views;
use eagpt_light::glows::{self, Surfaces};
use eagpt_scene::lamps::{Lamp, read_lamps, write_lamps};

impl Run<'_> {
    /// Lets surfaces emit that are brighter than the light gathered there allows, and lists them
    /// with the lamps, as what emits already and is of none. Where no lamps are listed nothing is
    /// looked for, nor in several lights: the panes of a window that is dark in one of them would
    /// be.
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
        let as_lamps = |all: &[Vec<usize>]| -> Result<Vec<Lamp>> {
            if all.is_empty() {
                return Ok(Vec::new());
            }
            let tracer = self.request.device.scene(&scene)?;
            let sights = glows::sights(all, (&*tracer, scene.len()), views.named_cameras())?;
            let lamps = all.iter().zip(&sights);
            Ok(lamps
                .map(|(of, sight)| glows::lamp(&scene, of, sight))
                .collect())
        };
        let named = |kind: &str, number: usize, lamp: Lamp| Lamp {
            name: format!("{kind}-{number}"),
            ..lamp
        };
        let mut num = 0;
        for (members, glow) in found.iter().zip(as_lamps(&found)?) {
            let places = members.iter().map(|&i| scene.positions[i]);
            if !glows::join_as_shade(&mut lamps, &glow, places) {
                num += 1;
                lamps.lamps.push(named("glow", num, glow));
            }
        }
        let others = (1..).zip(as_lamps(&glows::unlisted(&scene, &lamps))?);
        (lamps.lamps).extend(others.map(|(number, lamp)| named("other", number, lamp)));
        write_lamps(&list, &lamps)?;
        if !found.is_empty() {
            let emitting = found.iter().flatten().map(|&i| (i, true)).collect();
            backend.mark_emitting(&[emitting])?;
            (self.progress)(TrainProgress::Glows {
                num,
                num_shades: found.len() - num,
            });
        }
        Ok(())
    }
}
