//! Lamps that no view shows.

use eagpt_scene::{Lamp, SceneEdit};

/// Lamps that join a scene.
pub(crate) struct HiddenLamps {
    /// Gaussians that make room for them, and the discs of all and what comes with them, fixed.
    pub(crate) edit: SceneEdit,
    /// The lamps, which have no names yet.
    pub(crate) lamps: Vec<Lamp>,
}
