//! Small bare lamps become clean early in stage 0, before heaps of discs have gathered about them,
//! and stay so.

use super::lamps::{all_emitting, moving, unlit};
use super::lit_pixels::lit_pixels;
use super::run::Run;
use crate::backend::Backend;
use crate::error::Result;
use crate::views::Views;
use eagpt_lamps::Kinds;
use eagpt_mirrors::Mirror;
use eagpt_scene::lamps::{Lamp, Lamps, read_lamps, write_lamps};
use eagpt_scene::{Gaussians, SceneEdit, files};
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
        backend.edit(&SceneEdit::keeping(keep), &unlit(views))
    }

    /// The bare lamps that are clean and their discs, without those that mirrors show, which go.
    pub(super) fn keep_bare(
        &self,
        backend: &mut dyn Backend,
        views: &Views,
        num_mirrors: usize,
    ) -> Result<(Lamps, Gaussians)> {
        let (scene, num_moving) = moving(backend)?;
        let own = num_moving..scene.len() - num_mirrors;
        if own.is_empty() {
            return Ok((Lamps::default(), Gaussians::default()));
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
        for i in own.clone() {
            let is_of = |lamp: &Lamp| lamp.contains(scene.positions[i]);
            edit.keep[i] = !images.iter().any(is_of);
        }
        if !images.is_empty() {
            backend.edit(&edit, &unlit(views))?;
        }
        let kept = own.filter(|&i| edit.keep[i]);
        Ok((lamps, kept.map(|i| scene.get(i)).collect()))
    }
}
