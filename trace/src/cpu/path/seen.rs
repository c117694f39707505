//! The scene as the rays of a bounce see it.

use crate::blend::features_of_one;
use crate::cpu::CpuScene;
use crate::cpu::realizations::NUM_REALIZATIONS;
use crate::features::Features;
use crate::ray::Ray;
use crate::transport::light_list::{Importances, LightList};
use crate::transport::start::Surface;
use eagpt_scene::Gloss;
use glam::Vec3;

/// The blend of all hits, or the opaque discs of one realization. Emitters are chosen among what
/// rays can meet there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Seen {
    Blend,
    Realization(u32),
}

impl Seen {
    /// A realization by `choice`, uniform in [0, 1): those of a pixel's samples take turns.
    pub(super) fn realization(choice: f32) -> Self {
        Self::Realization((choice * NUM_REALIZATIONS as f32) as u32)
    }

    /// The surface that a ray meets: its features, and the specular part of its material.
    pub(super) fn trace(self, scene: &CpuScene, ray: &Ray) -> (Features, Gloss) {
        match self {
            Self::Blend => scene.trace_glossy(ray),
            Self::Realization(number) => {
                let hit = scene.realization_hit(ray, number);
                hit.map_or((Features::default(), Gloss::NONE), |hit| {
                    let attributes = scene.attributes(hit.index);
                    let features = features_of_one(hit.t, attributes, ray.direction);
                    (features, scene.gloss(hit.index))
                })
            }
        }
    }

    /// A direction from `surface` to a random emitter.
    pub(super) fn sample(
        self,
        (lights, importances): (&LightList, &Importances),
        surface: &Surface,
        numbers: [f32; 3],
    ) -> Option<Vec3> {
        let origin = surface.position;
        match self {
            Self::Blend => lights.sample_footprint(importances, origin, numbers),
            Self::Realization(number) => lights.sample(importances, number, origin, numbers),
        }
    }

    /// Density over solid angle of [`Self::sample`].
    pub(super) fn density(
        self,
        (lights, importances): (&LightList, &Importances),
        surface: &Surface,
        direction: Vec3,
    ) -> f32 {
        let origin = surface.position;
        match self {
            Self::Blend => lights.footprint_density(importances, origin, direction),
            Self::Realization(number) => lights.density(importances, number, origin, direction),
        }
    }
}
