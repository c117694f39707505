//! Lamps that no view shows.

use eagpt_scene::{Lamp, SceneEdit};

/// Lamps that join a scene.
pub struct HiddenLamps {
    /// Gaussians that make room for them, and the discs of all and what comes with them, fixed.
    pub edit: SceneEdit,
    /// The lamps, which have no names yet.
    pub lamps: Vec<Lamp>,
}
