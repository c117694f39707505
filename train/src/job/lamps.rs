//! Emitters become clean lamps, once, towards the end of stage 0; between the stages, what these
//! shine through emits with them.

use super::lit_pixels::lit_pixels;
use super::run::Run;
use crate::backend::Backend;
use crate::error::Result;
use crate::progress::TrainProgress;
use crate::views::Views;
use eagpt_lamps::{Evidence, Found, Kinds};
use eagpt_light::luminous::{luminous, reach};
use eagpt_scene::lamps::{Lamps, emits, read_lamps, write_lamps};
use eagpt_scene::rng::{Purpose, RandomKey};
use eagpt_scene::{Gaussians, LampShape};
use eagpt_trace::Tracer;
use glam::Vec3;
use std::collections::HashSet;
use std::path::Path;

impl Run<'_> {
    /// Finds the lamps that the masks of training views show, makes them clean and lists them
    /// beside the scene, with bare ones that are clean already. Later iterations leave them as they
    /// are, and fit what is around them. Of the fixed Gaussians all but the last `num_mirrors` are
    /// of bare lamps.
    pub(super) fn clean_lamps(
        &mut self,
        backend: &mut dyn Backend,
        views: &Views,
        iteration: u32,
        num_mirrors: usize,
    ) -> Result<()> {
        let (bare, discs) = self.keep_bare(backend, views, num_mirrors)?;
        // Whatever emits in any light is of a lamp.
        let scene = all_emitting(&backend.state()?.in_lights());
        let device = &self.request.device;
        let known = (!discs.is_empty()).then(|| device.scene(&discs));
        let tracer = device.scene(&scene)?;
        let mut evidence = lit_pixels(&*tracer, views, known.transpose()?.as_deref())?;
        evidence.known.clone_from(&bare.lamps);
        let found = self.find_lamps((&evidence, Kinds::All), (&scene, &*tracer), views)?;
        let lights = 0..views.num_lights();
        let mut num_lamps = found.lamps.lamps.len();
        if lights.len() > 1 {
            for light in lights {
                write_lamps(&self.folder.lamps(light), &found.in_light(light))?;
            }
            let [_, path] = self.folder.all_lamps();
            write_lamps(&path, &found.lamps)?;
        } else {
            let all = found.in_light(0).joined(bare);
            num_lamps = all.lamps.len();
            write_lamps(&self.folder.lamps(0), &all)?;
        }
        self.put_in(backend, (&found, num_lamps), views, iteration)
    }

    /// Lamps of some kinds, by their lit pixels, in a scene; tells of its progress.
    pub(super) fn find_lamps(
        &mut self,
        evidence: (&Evidence, Kinds),
        scene: (&Gaussians, &dyn Tracer),
        views: &Views,
    ) -> Result<Found> {
        let progress = &mut self.progress;
        let mut fitting = |done, total| progress(TrainProgress::FittingLamps { done, total });
        Ok(eagpt_lamps::find(
            evidence,
            scene,
            views.up(),
            &mut fitting,
        )?)
    }

    /// Puts lamps into the scene, in the light of each of the views' lights, and tells their number.
    pub(super) fn put_in(
        &mut self,
        backend: &mut dyn Backend,
        (found, num_lamps): (&Found, usize),
        views: &Views,
        iteration: u32,
    ) -> Result<()> {
        let lights = 0..views.num_lights();
        let radiances: Vec<_> = lights.map(|light| found.radiances(light)).collect();
        backend.edit(&found.edit, &radiances)?;
        (self.progress)(TrainProgress::Lamps {
            iteration,
            num_lamps,
            num_gaussians: found.edit.num_after(),
        });
        Ok(())
    }

    /// Lets what is brighter than it can reflect near lamps emit, before albedos are to explain it,
    /// and what is not reflect. What emits beside lamps is theirs.
    pub(super) fn mark_luminous(&mut self, backend: &mut dyn Backend, views: &Views) -> Result<()> {
        let request = self.request;
        let options = &request.options;
        let sampling = (
            options.albedo.num_samples,
            RandomKey::new(options.seed, Purpose::Albedo, 1),
        );
        let cameras = views.cameras();
        let mut emitting = vec![Vec::new(); views.num_lights()];
        let state = backend.state()?;
        let (num_moving, scenes) = (state.num_moving(), state.in_lights());
        for (light, (scene, emitting)) in scenes.iter().zip(&mut emitting).enumerate() {
            let listed = self.folder.lamps(light);
            if !listed.exists() {
                continue;
            }
            let lamps = only_masked(&listed)?;
            let device = &request.device;
            *emitting = luminous(device, (scene, num_moving), &lamps, &cameras, sampling)?;
            let num = emitting.iter().filter(|(_, emits)| *emits).count();
            (self.progress)(TrainProgress::Luminous {
                num,
                num_lit: emitting.len() - num,
            });
        }
        backend.mark_emitting(&emitting)?;
        self.reach_fixtures(&backend.state()?.in_lights())
    }

    /// Lets the listed lamps reach what emits beside them in each of the lights.
    fn reach_fixtures(&self, scenes: &[Gaussians]) -> Result<()> {
        let extend = |list: &Path, scene: &Gaussians| -> Result<()> {
            if list.exists() {
                let mut lamps = read_lamps(list)?;
                reach(&mut lamps, scene);
                write_lamps(list, &lamps)?;
            }
            Ok(())
        };
        for (light, scene) in scenes.iter().enumerate() {
            extend(&self.folder.lamps(light), scene)?;
        }
        if scenes.len() > 1 {
            let [_, all] = self.folder.all_lamps();
            extend(&all, &all_emitting(scenes))?;
        }
        Ok(())
    }
}

/// The scene of a backend, and the number of its Gaussians that are not fixed, the first ones.
pub(super) fn moving(backend: &mut dyn Backend) -> Result<(Gaussians, usize)> {
    let state = backend.state()?;
    Ok((state.gaussians(), state.num_moving()))
}

/// Radiances of no new Gaussians in the lights of the views.
pub(super) fn unlit(views: &Views) -> Vec<Vec<Option<Vec3>>> {
    vec![Vec::new(); views.num_lights()]
}

/// The scene in which all emits that emits in one of its lights, at least one, as it does in the
/// first of these. All else has the light of the first.
pub(super) fn all_emitting(lights: &[Gaussians]) -> Gaussians {
    let mut scene = lights[0].clone();
    for i in 0..scene.len() {
        let emitting = lights.iter().find(|light| emits(light.emissions[i]));
        if let Some(light) = emitting {
            scene.emissions[i] = light.emissions[i];
            scene.radiances[i] = light.radiances[i];
            if let Some(own) = scene.harmonics.get_mut(i) {
                *own = light.harmonics[i];
            }
        }
    }
    scene
}

/// The lamps of a list that masks show, as views measured them, which is then a list of these: a
/// run that is taken up may have listed others and made them stronger, which it does again.
fn only_masked(list: &Path) -> Result<Lamps> {
    let all = read_lamps(list)?;
    let mut lamps = all.clone();
    lamps.lamps.retain(|lamp| lamp.num_pixels > 0);
    for lamp in &mut lamps.lamps {
        lamp.strengthen(Vec3::from(lamp.factor).recip());
        lamp.factor = [1.0; 3];
        lamp.reach = 0.0;
    }
    if lamps != all {
        write_lamps(list, &lamps)?;
    }
    Ok(lamps)
}

/// Takes out of the list of lamps at `path`, if there is one, those without a clean shape of which
/// no Gaussian of the finished `scene` emits.
pub(super) fn keep_emitting(path: &Path, scene: &Gaussians) -> Result<()> {
    if !path.exists() {
        return Ok(());
    }
    let mut lamps = read_lamps(path)?;
    let num = lamps.lamps.len();
    let emitting = (scene.positions.iter().zip(&scene.emissions))
        .filter(|(_, emission)| emits(**emission))
        .filter_map(|(position, _)| lamps.of(*position));
    let emitting: HashSet<usize> = emitting.collect();
    let mut index = 0..;
    lamps.lamps.retain(|lamp| {
        let emits = index.next().is_some_and(|index| emitting.contains(&index));
        emits || lamp.shape != LampShape::Other
    });
    if lamps.lamps.len() < num {
        write_lamps(path, &lamps)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use eagpt_scene::lamps::Lamp;
    use eagpt_testkit::gaussians::{material, sphere};
    use eagpt_testkit::lamps::boxed;

    #[test]
    fn lamps_without_a_shape_of_which_nothing_emits_are_not_listed() {
        let scene = sphere(500, 1.0, |towards| {
            let emission = f32::from(u8::from(towards.x > 0.9));
            material(Vec3::ONE, emission, Vec3::splat(0.5))
        });
        let lamp = |name: &str, centre: Vec3, shape: LampShape| Lamp {
            shape,
            ..boxed(name, centre.to_array(), [0.3; 3])
        };
        let lamps = vec![
            lamp("lit", Vec3::X, LampShape::Other),
            lamp("dark", Vec3::NEG_X, LampShape::Other),
            lamp("ball", Vec3::Y, LampShape::Ball),
        ];
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("lamps.json");
        keep_emitting(&path, &scene).unwrap();
        assert!(!path.exists());
        write_lamps(&path, &Lamps { lamps }).unwrap();
        keep_emitting(&path, &scene).unwrap();
        let kept = read_lamps(&path).unwrap();
        assert_eq!(kept.names().collect::<Vec<_>>(), ["lit", "ball"]);
    }

    #[test]
    fn lamps_that_no_mask_shows_are_forgotten() {
        let of = |name: &str, num_pixels| Lamp {
            num_pixels,
            ..boxed(name, [0.0; 3], [0.3; 3])
        };
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("lamps.json");
        let lamps = vec![of("ball-1", 7), of("unseen-1", 0), of("glow-1", 0)];
        write_lamps(&path, &Lamps { lamps }).unwrap();
        let kept = only_masked(&path).unwrap();
        assert_eq!(kept.names().collect::<Vec<_>>(), ["ball-1"]);
        assert_eq!(read_lamps(&path).unwrap(), kept);
    }

    #[test]
    fn lamps_are_as_views_measured_them_when_a_run_is_taken_up() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("lamps.json");
        let measured = boxed("ball-1", [0.0; 3], [0.3; 3]);
        let mut stronger = measured.clone();
        stronger.strengthen(Vec3::splat(1.5));
        assert_ne!(stronger.power, measured.power);
        let lamps = vec![stronger];
        write_lamps(&path, &Lamps { lamps }).unwrap();
        let [kept] = &only_masked(&path).unwrap().lamps[..] else {
            panic!("not one lamp");
        };
        assert_eq!(kept.factor, [1.0; 3]);
        for (kept, measured) in [
            (kept.radiance, measured.radiance),
            (kept.power, measured.power),
        ] {
            // Two roundings.
            assert!(Vec3::from(kept).abs_diff_eq(measured.into(), 2.0 * f32::EPSILON));
        }
    }
}
