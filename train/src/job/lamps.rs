//! Emitters become clean lamps, once, towards the end of stage 0.

use super::Run;
use super::views::Views;
use crate::backend::Backend;
use crate::error::Result;
use crate::progress::TrainProgress;
use eagpt_lamps::Evidence;
use eagpt_scene::lamps::{LAMPS_FILE, write_lamps};

impl Run<'_> {
    /// Finds the lamps that the masks of training views show, makes them clean and lists them
    /// beside the scene. Later iterations leave them as they are, and fit what is around them.
    pub(super) fn clean_lamps(
        &mut self,
        backend: &mut dyn Backend,
        views: &Views,
        iteration: u32,
    ) -> Result<()> {
        let gaussians = backend.state()?.gaussians();
        let tracer = self.request.device.scene(&gaussians)?;
        let mut evidence = Evidence::default();
        for training in views.iter() {
            let view = training?.view;
            if view.emission.is_some() {
                evidence.add(&view, &tracer.gbuffer(&view.camera)?);
            }
        }
        let up = views.up();
        let found = eagpt_lamps::find(&evidence, &gaussians, up, &*tracer)?;
        write_lamps(&self.request.out.join(LAMPS_FILE), &found.lamps)?;
        let num_lamps = found.lamps.lamps.len();
        backend.edit(&found.edit)?;
        (self.progress)(TrainProgress::Lamps {
            iteration,
            num_lamps,
            num_gaussians: found.edit.num_after(),
        });
        Ok(())
    }
}
