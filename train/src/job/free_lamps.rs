//! Discs that keep the light of clean lamps from the room, though no picture tells of them, go
//! while stage 0 goes on.

use super::lamps::{moving, unlit};
use super::run::Run;
use crate::backend::Backend;
use crate::error::Result;
use crate::views::Views;
use eagpt_scene::lamps::{Lamp, Lamps, read_lamps};
use eagpt_scene::{Gaussians, SceneEdit};
use eagpt_trace::TraceError;

impl Run<'_> {
    /// Takes away what iterations have put before clean lamps since: before all of them, if these
    /// are clean, or the bare ones.
    pub(super) fn free_lamps(
        &self,
        backend: &mut dyn Backend,
        views: &Views,
        all: bool,
    ) -> Result<()> {
        let device = &self.request.device;
        let eyes = |lamp: &Lamp| views.eyes(lamp).collect();
        self.edit_beside(backend, (views, all), |scene, lamps| {
            let mut edit = eagpt_lamps::freed(scene.0, scene.1, lamps, eyes);
            edit.take_out(&eagpt_lamps::without_strays(device, scene, lamps)?);
            Ok(edit)
        })
    }

    /// Takes away the discs beside clean lamps, all or the bare ones, that no picture tells of.
    pub(super) fn clear_floaters(
        &self,
        backend: &mut dyn Backend,
        views: &Views,
        all: bool,
    ) -> Result<()> {
        let device = &self.request.device;
        self.edit_beside(backend, (views, all), |scene, lamps| {
            let cameras = views.cameras();
            eagpt_lamps::without_floaters(device, scene, lamps, &cameras).map(SceneEdit::keeping)
        })
    }

    /// Edits the scene, given with the number of its Gaussians that are not fixed, around the lamps
    /// that are clean, if there are any: all, or the bare ones.
    fn edit_beside(
        &self,
        backend: &mut dyn Backend,
        (views, all): (&Views, bool),
        edit: impl Fn((&Gaussians, usize), &Lamps) -> Result<SceneEdit, TraceError>,
    ) -> Result<()> {
        let path = match (all, views.num_lights()) {
            (false, _) => self.folder.bare_lamps(),
            (true, 1) => self.folder.lamps(0),
            (true, _) => self.folder.all_lamps()[1].clone(),
        };
        let lamps = read_lamps(&path)?;
        if lamps.lamps.is_empty() {
            return Ok(());
        }
        let (scene, num_moving) = moving(backend)?;
        backend.edit(&edit((&scene, num_moving), &lamps)?, &unlit(views))
    }
}
