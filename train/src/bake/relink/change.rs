//! What an edit has changed of the geometry and of the emitters.

use super::boxes::Boxes;
use super::kept::{Shape, shape, shaped};
use eagpt_scene::{Gaussian, Gaussians};
use eagpt_trace::transport::lights;
use eagpt_trace::transport::matrix::NOTHING;
use eagpt_trace::transport::matrix::known::UNKNOWN;
use std::collections::HashMap;

/// Directions look for the emitters of the earlier bake as long as none has more than this times
/// the share of the light that it had then. The noise that it adds is at most that of as many times
/// fewer directions.
const MOST_UNDERRATED: f64 = 4.0;

/// What became of the Gaussians of an earlier bake.
pub(super) struct Change {
    /// Their indices now, `None` for what is gone. `[earlier]`
    pub(super) now: Vec<Option<u32>>,
    /// Around what is new.
    pub(super) added: Boxes,
    /// What is gone, without its light.
    pub(super) gone: Vec<Gaussian>,
    /// Around what is new or gone.
    pub(super) all: Boxes,
}

impl Change {
    pub(super) fn new(earlier: &[Shape], scene: &Gaussians) -> Self {
        let mut places: HashMap<Shape, Vec<u32>> = HashMap::new();
        // The first of several alike comes last, to be taken first.
        for i in (0..scene.len()).rev() {
            (places.entry(shape(&scene.get(i))).or_default()).push(i as u32);
        }
        let now: Vec<Option<u32>> = (earlier.iter())
            .map(|shape| places.get_mut(shape)?.pop())
            .collect();
        let mut added: Vec<u32> = places.into_values().flatten().collect();
        added.sort_unstable();
        let gone = earlier.iter().zip(&now).filter(|(_, now)| now.is_none());
        let gone: Vec<Gaussian> = gone.map(|(shape, _)| shaped(shape)).collect();
        let added: Vec<Gaussian> = added.iter().map(|&i| scene.get(i as usize)).collect();
        Self {
            added: Boxes::around(added.iter().copied()),
            all: Boxes::around(added.iter().chain(&gone).copied()),
            gone,
            now,
        }
    }

    /// What a direction met, as it is called now.
    pub(super) fn target(&self, target: u32) -> u32 {
        match target {
            NOTHING => NOTHING,
            _ => self.now[target as usize].unwrap_or(UNKNOWN),
        }
    }
}

/// Whether directions that look for emitters `then` find those of `now` well enough.
pub(super) fn are_fair(then: &Gaussians, now: &Gaussians) -> bool {
    let total = |of: &Gaussians| of.iter().map(|g| lights::power(&g)).sum::<f64>();
    let totals = [total(then), total(now)];
    let mut shares: HashMap<Shape, f64> = HashMap::new();
    for g in then.iter() {
        *shares.entry(shape(&g)).or_default() += lights::power(&g) / totals[0];
    }
    now.iter().all(|g| {
        let share = lights::power(&g) / totals[1];
        let before = shares.get(&shape(&g)).copied().unwrap_or(0.0);
        share <= MOST_UNDERRATED * before
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use eagpt_scene::random_cloud;
    use glam::Vec3;

    #[test]
    fn what_stays_is_known_by_its_geometry_and_what_is_alike_comes_in_order() {
        let before: Vec<Gaussian> = random_cloud(6, 1).iter().collect();
        let shapes: Vec<Shape> = before.iter().map(shape).collect();
        let mut after = before.clone();
        after[1].radiance *= 2.0;
        after[2].position.x += 0.1;
        after.remove(4);
        after.push(before[0]);
        let change = Change::new(&shapes, &after.iter().copied().collect());
        let now = [Some(0), Some(1), None, Some(3), None, Some(4)];
        assert_eq!(change.now, now);
        assert_eq!(change.gone.len(), 2);
        assert_eq!(change.target(5), 4);
        assert_eq!(change.target(2), UNKNOWN);
        assert_eq!(change.target(NOTHING), NOTHING);
        assert!(change.added.contain(after[2].position));
        assert!(change.added.contain(before[0].position));
        assert!(change.all.contain(before[4].position));
        let same = Change::new(&shapes, &before.into_iter().collect());
        assert!(same.gone.is_empty() && same.added.is_empty() && same.all.is_empty());
    }

    #[test]
    fn directions_are_fair_to_lamps_that_are_not_much_brighter_than_they_were() {
        let then = random_cloud(20, 2);
        assert!(are_fair(&then, &then));
        // All brighter: their shares are what they were.
        let mut now = then.clone();
        now.radiances.iter_mut().for_each(|r| *r *= 10.0);
        assert!(are_fair(&then, &now));
        now.radiances[3] *= 100.0;
        assert!(!are_fair(&then, &now));
        now.radiances[3] = Vec3::ZERO;
        assert!(are_fair(&then, &now));
        now.positions[4].x += 0.1;
        assert!(!are_fair(&then, &now));
    }
}
