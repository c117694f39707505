//! Edits of a scene: Gaussians go, move, and come to stay where they are.

use crate::gaussians::{Gaussian, Gaussians};

/// Changes of the Gaussians of a scene, `[n]` before it.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SceneEdit {
    /// Which Gaussians stay, `[n]`.
    pub keep: Vec<bool>,
    /// Some that stay, by their index before the edit, with new position, scale, rotation and
    /// opacity. Their light and material stay.
    pub moved: Vec<(u32, Gaussian)>,
    /// Gaussians that are put at the end, where stage 0 of training leaves them as they are. Their
    /// light is the same in all directions.
    pub fixed: Gaussians,
}

impl SceneEdit {
    /// An edit of `num_gaussians` that changes nothing.
    pub fn nothing(num_gaussians: usize) -> Self {
        Self::keeping(vec![true; num_gaussians])
    }

    /// An edit that leaves the Gaussians to `keep`, `[n]`, as they are.
    pub fn keeping(keep: Vec<bool>) -> Self {
        Self {
            keep,
            ..Self::default()
        }
    }

    /// Takes out the Gaussians that are not to `keep`, `[n]`.
    pub fn take_out(&mut self, keep: &[bool]) {
        for (stays, keep) in self.keep.iter_mut().zip(keep) {
            *stays &= keep;
        }
        self.moved.retain(|(i, _)| self.keep[*i as usize]);
    }

    /// Leaves of `values`, `[n]`, those of Gaussians that stay.
    pub fn retain<T>(&self, values: &mut Vec<T>) {
        let mut keep = self.keep.iter();
        values.retain(|_| *keep.next().unwrap_or(&false));
    }

    /// Number of Gaussians after it.
    pub fn num_after(&self) -> usize {
        self.keep.iter().filter(|stays| **stays).count() + self.fixed.len()
    }

    /// The scene after it.
    pub fn applied(&self, gaussians: &Gaussians) -> Gaussians {
        let mut all: Vec<Gaussian> = gaussians.iter().collect();
        for (i, moved) in &self.moved {
            all[*i as usize] = *moved;
        }
        let kept = all.into_iter().zip(&self.keep).filter(|(_, keep)| **keep);
        let kept = kept.map(|(gaussian, _)| gaussian);
        kept.chain(self.fixed.iter()).collect()
    }
}
