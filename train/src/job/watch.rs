//! The scene while it trains, for those who watch.

use super::run::Run;
use crate::backend::Backend;
use crate::error::Result;
use crate::progress::TrainProgress;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Least time from one scene to the next.
const INTERVAL: Duration = Duration::from_secs(3);
/// Least time to the next scene over that which one takes: watching costs a twentieth at most.
const LEAST_RATIO: u32 = 20;

impl Run<'_> {
    /// Whether somebody watches and waits for a scene.
    pub(super) fn is_watched_now(&self) -> bool {
        self.request.is_watched && self.next_scene.is_none_or(|due| due <= Instant::now())
    }

    /// Tells the scene of the backend, of several lights in the first, if it is due. No step may
    /// be under way; none is done differently for it.
    pub(super) fn tell_scene(&mut self, backend: &mut dyn Backend) -> Result<()> {
        if !self.is_watched_now() {
            return Ok(());
        }
        let started = Instant::now();
        let scene = backend.state()?.in_lights().swap_remove(0);
        (self.progress)(TrainProgress::Scene {
            scene: Arc::new(scene),
        });
        let rest = INTERVAL.max(started.elapsed() * LEAST_RATIO);
        self.next_scene = Some(Instant::now() + rest);
        Ok(())
    }
}
