//! The list for blended rays, which meet emitters as footprints, not as discs: luminance times the
//! integral of the opacity takes the place of luminance times area, and points are spread as the
//! opacity is.

use super::{Disc, FOOTPRINTS, Importances, LightList, SCRATCH};
use crate::cpu::bvh::Reach;
use crate::ray::Ray;
use glam::Vec3;

impl LightList {
    /// As [`Self::sample`] for blended rays: to a random point of a footprint.
    pub(crate) fn sample_footprint(
        &self,
        importances: &Importances,
        origin: Vec3,
        [pick, a, b]: [f32; 3],
    ) -> Option<Vec3> {
        let cumulative = |disc: &Disc| disc.cumulative_footprint;
        let (disc, surfel) = self.choose(importances, pick, FOOTPRINTS, cumulative)?;
        // Inverse of the footprint's radial distribution, 1 − exp(−r²/2), cut at its rim.
        let radius = (-2.0 * (1.0 - a * disc.inside).ln()).max(0.0).sqrt();
        (disc.point(surfel, radius, b) - origin).try_normalize()
    }

    /// Density over solid angle with which [`Self::sample_footprint`] chooses unit `direction`:
    /// every emitter along the ray could have been the one.
    pub(crate) fn footprint_density(
        &self,
        importances: &Importances,
        origin: Vec3,
        direction: Vec3,
    ) -> f32 {
        let ray = Ray::free(origin.to_array(), direction.to_array());
        let sum: f32 = SCRATCH.with_borrow_mut(|scratch| {
            self.footprints.find_hits(&ray, Reach::Everything, scratch);
            scratch.sort();
            let hits = scratch.hits().iter().map(|hit| {
                let i = hit.index() as usize;
                let cosine = direction.dot(Vec3::from(self.set.surfels[i].normal));
                self.discs[i].weight(importances, hit.t(), cosine) * hit.alpha
            });
            hits.sum()
        });
        if sum > 0.0 {
            sum / self.total(importances, FOOTPRINTS)
        } else {
            0.0
        }
    }
}
