//! Lamps that no view shows.

use eagpt_scene::{Gaussians, Lamp};

/// Lamps that join a scene.
#[derive(Default)]
pub(crate) struct HiddenLamps {
    /// The discs of all, and those that come with them.
    pub(crate) discs: Gaussians,
    /// The lamps, which have no names yet.
    pub(crate) lamps: Vec<Lamp>,
    /// Indices of Gaussians of the scene that make room for them.
    pub(crate) in_the_way: Vec<usize>,
}
