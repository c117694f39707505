//! Small bare lamps become clean early in stage 0, before heaps of discs have gathered about them,
//! and stay so.

use super::lamps::{all_emitting, lit_pixels, moving, unlit};
use super::run::Run;
use crate::backend::Backend;
use crate::error::Result;
use crate::views::Views;
use eagpt_lamps::Kinds;
use eagpt_mirrors::Mirror;
use eagpt_scene::lamps::{Lamp, Lamps, read_lamps, write_lamps};
use eagpt_scene::{Camera, SceneEdit, files};
use eagpt_trace::GBuffer;
use glam::Vec3;

impl Run<'_> {
    /// Makes the bare lamps clean that the masks of training views show, and takes out what lies
    /// about them at no point of the cloud, if there is one.
    pub(super) fn clean_bare_lamps(
        &mut self,
        backend: &mut dyn Backend,
        views: &Views,
        iteration: u32,
    ) -> Result<()> {
        let scene = all_emitting(&backend.state()?.in_lights());
        let tracer = self.request.device.scene(&scene)?;
        let evidence = lit_pixels(&*tracer, views, None)?;
        let found = self.find_lamps((&evidence, Kinds::Bare), (&scene, &*tracer), views)?;
        files::create_dir(&self.folder.checkpoints())?;
        write_lamps(&self.folder.bare_lamps(), &found.lamps)?;
        let num_lamps = found.lamps.lamps.len();
        if num_lamps == 0 {
            return Ok(());
        }
        self.put_in(backend, (&found, num_lamps), views, iteration)?;
        let Some(cloud) = views.cloud(0) else {
            return Ok(());
        };
        let (scene, num_moving) = moving(backend)?;
        let is_at_surface = cloud.near_points();
        let keep = eagpt_lamps::without_heaps((&scene, num_moving), &found.lamps, is_at_surface);
        let mut edit = SceneEdit::nothing(scene.len());
        edit.take_out(&keep);
        backend.edit(&edit, &unlit(views))
    }

    /// The bare lamps that are clean, without those that mirrors show, which go.
    pub(super) fn keep_bare(
        &self,
        backend: &mut dyn Backend,
        views: &Views,
        num_mirrors: usize,
    ) -> Result<Lamps> {
        let (scene, num_moving) = moving(backend)?;
        let own = num_moving..scene.len() - num_mirrors;
        if own.is_empty() {
            return Ok(Lamps::default());
        }
        let mut lamps = read_lamps(&self.folder.bare_lamps())?;
        let is_image = |lamp: &Lamp| {
            let num = views.eyes(lamp).count();
            let crosses = |eye: &Vec3| {
                let towards = lamp.centre() - eye;
                let met = |mirror: &Mirror| mirror.meet(*eye, towards.normalize_or_zero());
                let mut met = self.mirrors.iter().filter_map(met);
                met.any(|distance| distance < towards.length())
            };
            2 * views.eyes(lamp).filter(crosses).count() > num
        };
        let images: Vec<Lamp> = (lamps.lamps)
            .extract_if(.., |lamp| is_image(lamp))
            .collect();
        let mut edit = SceneEdit::nothing(scene.len());
        for i in own {
            let is_of = |lamp: &Lamp| lamp.contains(scene.positions[i]);
            edit.keep[i] = !images.iter().any(is_of);
        }
        backend.edit(&edit, &unlit(views))?;
        Ok(lamps)
    }
}

/// The pixels of `camera` in which something is, and those beside them, row by row.
pub(super) fn shown(seen: &GBuffer, camera: &Camera) -> Vec<bool> {
    let (width, height) = (camera.width as usize, camera.height as usize);
    let mut shown = vec![false; width * height];
    for (i, _) in (0..)
        .zip(&seen.pixels)
        .filter(|(_, pixel)| pixel.alpha() > 0.0)
    {
        let (x, y) = (i % width, i / width);
        for row in y.saturating_sub(1)..(y + 2).min(height) {
            shown[row * width..][x.saturating_sub(1)..(x + 2).min(width)].fill(true);
        }
    }
    shown
}

#[cfg(test)]
mod tests {
    use super::*;
    use eagpt_scene::Gaussians;
    use eagpt_scene::Gloss;
    use eagpt_scene::discs::{Material, Solid, Surface};
    use eagpt_testkit::gaussians::look_at;
    use eagpt_trace::Device;
    use glam::DVec3;

    #[test]
    fn pixels_of_a_lamp_and_beside_it_are_left_out() {
        let ball = Surface {
            solid: Solid::Ball {
                centre: Vec3::ZERO,
                radius: 0.06,
            },
            material: Material {
                albedo: Vec3::ZERO,
                radiance: Some(Vec3::ONE),
                gloss: Gloss::NONE,
            },
            spacing: None,
        };
        let scene: Gaussians = ball.discs();
        let camera = look_at(DVec3::new(2.0, 0.0, 0.0), DVec3::ZERO, 40, 30);
        let seen = Device::Cpu.scene(&scene).unwrap().gbuffer(&camera).unwrap();
        let shown = shown(&seen, &camera);
        let is_there = |x: i32, y: i32| {
            let is_inside = (0..40).contains(&x) && (0..30).contains(&y);
            is_inside && seen.pixels[(y * 40 + x) as usize].alpha() > 0.0
        };
        let beside = [-1, 0, 1];
        for (i, shown) in (0..).zip(&shown) {
            let (x, y) = (i % 40, i / 40);
            let mut around = beside
                .iter()
                .flat_map(|dx| beside.map(|dy| (x + dx, y + dy)));
            assert_eq!(*shown, around.any(|(x, y)| is_there(x, y)), "{x} {y}");
        }
        let num = shown.iter().filter(|shown| **shown).count();
        assert!((6..200).contains(&num), "{num}");
    }
}
