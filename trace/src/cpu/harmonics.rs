//! Gaussians as seen from the eye of a camera.

use super::bins::{CHUNK, TileBins};
use crate::attributes::Attributes;
use crate::surfel::{SeenSet, SurfelSet};
use glam::Vec3;
use rayon::prelude::*;

/// The Gaussians of `set` as seen from `eye`, those that `bins` has at least, in `memory` where
/// that differs from one point to another.
pub(super) fn evaluate_harmonics<'a>(
    set: &'a SurfelSet,
    eye: Vec3,
    bins: &TileBins,
    memory: &'a mut Vec<Attributes>,
) -> SeenSet<'a> {
    if !set.harmonics.is_empty() {
        memory.resize(set.len(), Attributes::default());
        (memory.par_chunks_mut(CHUNK), bins.visible())
            .into_par_iter()
            .for_each(|(memory, visible)| {
                for &i in visible {
                    memory[i as usize % CHUNK] = set.attributes_from(i, eye);
                }
            });
    }
    as_seen(set, memory)
}

/// The set that [`evaluate_harmonics`] has left in `memory`.
pub(super) fn as_seen<'a>(set: &'a SurfelSet, memory: &'a [Attributes]) -> SeenSet<'a> {
    SeenSet {
        surfels: &set.surfels,
        attributes: if set.harmonics.is_empty() {
            &set.attributes
        } else {
            memory
        },
    }
}
