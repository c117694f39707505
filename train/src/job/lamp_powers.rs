//! Lamps become as strong as what they light tells, once the light is known that they bring.

use super::run::Run;
use crate::backend::Backend;
use crate::error::Result;
use crate::progress::TrainProgress;
use crate::views::Views;
use eagpt_light::lamp_powers::{factors, is_cut, is_measured, shows_bulb};
use eagpt_light::makes::of_one_make;
use eagpt_scene::lamps::{Lamps, read_lamps, write_lamps};
use eagpt_scene::light_basis::NO_LIGHT;
use eagpt_scene::rng::{Purpose, RandomKey};
use eagpt_scene::{Lamp, LightGroups, SceneError};
use glam::Vec3;
use std::collections::HashSet;

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
        let measured = measured(&lamps, views);
        // Lamps without views have their power from what they light already.
        let is_free = |name: &String| {
            let lamp = lamps.named(name);
            lamp.is_some_and(|lamp| {
                let is_known = measured.contains(&lamp.name) || shows_bulb(lamp, &lamps.lamps);
                !lamp.views.is_empty() && !is_known
            })
        };
        let mut free: Vec<bool> = lights.names.iter().map(is_free).collect();
        let first = first_of_make(&lights, (&lamps, &free), views.up());
        let of = lights.of.iter();
        let together = LightGroups {
            names: lights.names.clone(),
            of: of
                .map(|of| {
                    first
                        .get(*of as usize)
                        .map_or(NO_LIGHT, |first| *first as u32)
                })
                .collect(),
        };
        for (light, first) in first.iter().enumerate() {
            free[light] &= light == *first;
        }
        let tracer = request.device.scene(&scene)?;
        let key = RandomKey::new(request.options.seed, Purpose::Albedo, 5);
        let received = backend.gathered(0);
        let found = factors((&*tracer, &scene), (&together, &free), &received, key)?;
        let factors: Vec<f32> = first.iter().map(|first| found[*first]).collect();
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

/// Names of the lamps of which views saw all that they send, and of others of their makes.
fn measured(lamps: &Lamps, views: &Views) -> HashSet<String> {
    let all: Vec<&Lamp> = lamps.lamps.iter().collect();
    let is_measured = |i: &usize| {
        let lamp = all[*i];
        is_measured(lamp, views.eyes(lamp))
            && !is_cut(lamp, &views.cameras_of(lamp).collect::<Vec<_>>())
    };
    let makes = of_one_make(&all, views.up()).into_iter();
    let known = makes.filter(|make| make.iter().any(is_measured)).flatten();
    known.map(|i| all[i].name.clone()).collect()
}

/// The first of the `free` lights that are lamps of the same make as each, `[lights]`: what hides
/// them hides as much of each, so their factors are one; `up` is the unit vector upwards.
fn first_of_make(lights: &LightGroups, (lamps, free): (&Lamps, &[bool]), up: Vec3) -> Vec<usize> {
    let mut first: Vec<usize> = (0..free.len()).collect();
    let free = (0..free.len()).filter(|light| free[*light]);
    let of: Vec<(usize, &Lamp)> = free
        .filter_map(|light| Some((light, lamps.named(&lights.names[light])?)))
        .collect();
    let makes: Vec<&Lamp> = of.iter().map(|(_, lamp)| *lamp).collect();
    for make in of_one_make(&makes, up) {
        for i in &make {
            first[of[*i].0] = of[make[0]].0;
        }
    }
    first
}
