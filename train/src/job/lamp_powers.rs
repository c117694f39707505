//! Lamps become as strong as what they light tells, once the light is known that they bring.

use super::run::Run;
use crate::backend::Backend;
use crate::error::Result;
use crate::lamp_powers::{factors, is_measured, shows_bulb};
use crate::progress::TrainProgress;
use crate::views::Views;
use eagpt_scene::lamps::{read_lamps, write_lamps};
use eagpt_scene::light_basis::NO_LIGHT;
use eagpt_scene::rng::{Purpose, RandomKey};
use eagpt_scene::{LightGroups, SceneError};
use glam::Vec3;

impl Run<'_> {
    /// Multiplies the light of lamps that send more than views see, in the scene and in the list;
    /// whether there are any. Light has to be gathered again then.
    pub(super) fn correct_lamps(
        &mut self,
        backend: &mut dyn Backend,
        views: &Views,
    ) -> Result<bool> {
        let request = self.request;
        let Some(path) = self.list_for_hidden_light(views) else {
            return Ok(false);
        };
        let mut lamps = read_lamps(&path)?;
        let scene = backend.state()?.gaussians();
        let lights = LightGroups::new(&scene, &lamps)
            .map_err(|problem| SceneError::invalid(&path, "name", problem))?;
        // Lamps without views have their power from what they light already.
        let is_free = |name: &String| {
            let lamp = lamps.named(name);
            lamp.is_some_and(|lamp| {
                let is_known =
                    is_measured(lamp, views.eyes(lamp)) || shows_bulb(lamp, &lamps.lamps);
                !lamp.views.is_empty() && !is_known
            })
        };
        let free: Vec<bool> = lights.names.iter().map(is_free).collect();
        let tracer = request.device.scene(&scene)?;
        let key = RandomKey::new(request.options.seed, Purpose::Albedo, 5);
        let received = backend.gathered(0);
        let factors = factors((&*tracer, &scene), (&lights, &free), &received, key)?;
        let most = factors.iter().copied().fold(1.0, f32::max);
        if most == 1.0 {
            return Ok(false);
        }
        let emitting = (0..).zip(&lights.of).filter(|(_, of)| **of != NO_LIGHT);
        let stronger: Vec<(usize, f32)> = emitting
            .map(|(i, of)| (i, factors[*of as usize]))
            .filter(|(_, factor)| *factor != 1.0)
            .collect();
        backend.brighten(&stronger)?;
        for (name, factor) in lights.names.iter().zip(&factors) {
            let own = lamps.lamps.iter_mut().filter(|lamp| lamp.name == *name);
            own.for_each(|lamp| lamp.strengthen(Vec3::splat(*factor)));
        }
        write_lamps(&path, &lamps)?;
        let num = factors.iter().filter(|factor| **factor != 1.0).count();
        (self.progress)(TrainProgress::LampPowers { num, most });
        Ok(true)
    }
}
