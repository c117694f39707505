//! What keeps the light of clean lamps from the room, though no picture shows it, goes while stage
//! 0 goes on.

use super::lamps::{moving, unlit};
use super::run::Run;
use crate::backend::Backend;
use crate::error::Result;
use crate::views::Views;
use eagpt_scene::SceneEdit;
use eagpt_scene::lamps::{Lamp, Lamps, read_lamps};

impl Run<'_> {
    /// Takes away what iterations have put before clean lamps since: before all of them, if these
    /// are clean, or the bare ones.
    pub(super) fn free_lamps(
        &self,
        backend: &mut dyn Backend,
        views: &Views,
        all: bool,
    ) -> Result<()> {
        let lamps = self.clean_ones(views, all)?;
        if lamps.lamps.is_empty() {
            return Ok(());
        }
        let (scene, num_moving) = moving(backend)?;
        let eyes = |lamp: &Lamp| views.eyes(lamp).collect();
        let mut edit = eagpt_lamps::freed(&scene, num_moving, &lamps, eyes);
        let device = &self.request.device;
        edit.take_out(&eagpt_lamps::without_strays(
            device,
            (&scene, num_moving),
            &lamps,
        )?);
        backend.edit(&edit, &unlit(views))
    }

    /// Takes away the discs beside clean lamps, all or the bare ones, that no picture tells of.
    pub(super) fn clear_floaters(
        &self,
        backend: &mut dyn Backend,
        views: &Views,
        all: bool,
    ) -> Result<()> {
        let lamps = self.clean_ones(views, all)?;
        if lamps.lamps.is_empty() {
            return Ok(());
        }
        let (scene, num_moving) = moving(backend)?;
        let cameras = views.cameras();
        let device = &self.request.device;
        let keep = eagpt_lamps::without_floaters(device, (&scene, num_moving), &lamps, &cameras)?;
        let edit = SceneEdit {
            keep,
            ..SceneEdit::default()
        };
        backend.edit(&edit, &unlit(views))
    }

    /// The lamps that are clean: all, or the bare ones alone.
    fn clean_ones(&self, views: &Views, all: bool) -> Result<Lamps> {
        let path = match (all, views.num_lights()) {
            (false, _) => self.folder.bare_lamps(),
            (true, 1) => self.folder.lamps(0),
            (true, _) => self.folder.all_lamps()[1].clone(),
        };
        Ok(read_lamps(&path)?)
    }
}
