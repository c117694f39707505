//! Edits of the scene while stage 0 goes on, and the iterations after which they are due.

use serde::{Deserialize, Serialize};

/// Lamps as clean surfaces of known power (crate `eagpt-lamps`), in place of the heaps of discs
/// that training makes of them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LampOptions {
    /// Whether lamps become clean; in the paper they stay as they were trained.
    pub clean: bool,
    /// Share of the iterations after which small bare ones do, 0 to 1: before heaps of discs have
    /// gathered about them. Of several lights none do then.
    pub bare_after: f32,
    /// Share of the iterations after which all do, 0 to 1: geometry has to be right by then, and
    /// what is around them has to fit them afterwards.
    pub after: f32,
}

/// Share of the iterations of stage 0 between two times that clean lamps are freed.
const FREED_EVERY: f64 = 0.025;
/// The same for floaters beside them, which take longer to find.
const CLEARED_EVERY: f64 = 0.2;

impl LampOptions {
    /// Whether small bare lamps become clean after `iteration` of `total`.
    pub fn is_due_for_bare(&self, iteration: u32, total: u32) -> bool {
        let at = due(self.bare_after, total);
        self.clean && iteration == at && at < due(self.after, total)
    }

    /// Whether all lamps become clean after `iteration` of `total`.
    pub fn is_due(&self, iteration: u32, total: u32) -> bool {
        self.clean && iteration == due(self.after, total)
    }

    /// Whether all lamps are clean after `iteration` of `total`.
    pub fn is_done(&self, iteration: u32, total: u32) -> bool {
        self.clean && iteration >= due(self.after, total)
    }

    /// Whether what has come to stand before clean lamps since goes after `iteration` of `total`:
    /// now and then, so that what is around can make up for it, and at the end.
    pub fn is_freed(&self, iteration: u32, total: u32) -> bool {
        self.clean && iteration > self.first(total) && is_time(FREED_EVERY, iteration, total)
    }

    /// Whether floaters beside clean lamps go after `iteration` of `total`: when lamps become
    /// clean, now and then, and at the end.
    pub fn is_cleared(&self, iteration: u32, total: u32) -> bool {
        let becomes = iteration == self.first(total) || iteration == due(self.after, total);
        let is_time = becomes || is_time(CLEARED_EVERY, iteration, total);
        self.clean && iteration >= self.first(total) && is_time
    }

    /// The iteration of `total` after which the first lamps become clean.
    fn first(&self, total: u32) -> u32 {
        due(self.bare_after.min(self.after), total)
    }
}

/// Whether `iteration` is the last of `total` or one of those that are so far apart, in parts of
/// all.
fn is_time(every: f64, iteration: u32, total: u32) -> bool {
    let every = ((every * f64::from(total)).round() as u32).max(1);
    iteration == total || iteration.is_multiple_of(every)
}

/// The iteration of `total` after a `share` of them.
fn due(share: f32, total: u32) -> u32 {
    let due = (f64::from(share) * f64::from(total)).round() as u32;
    due.clamp(1, total)
}

/// Splitting of Gaussians during stage 0.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DensifyOptions {
    /// How often; 0 keeps the Gaussians there are, as in the paper.
    pub times: u32,
    /// Share of the iterations after which it happens for the first time, 0 to 1.
    pub from: f32,
    /// Share of the iterations after which it happens for the last time, 0 to 1.
    pub until: f32,
    /// Share of the Gaussians that the run begins with, above 0 to 1; the rest comes in equal
    /// parts.
    pub start_share: f32,
}

impl DensifyOptions {
    /// Which time it is, counted from 1, if Gaussians are split after `iteration` of `total`.
    pub fn time_at(&self, iteration: u32, total: u32) -> Option<u32> {
        (1..=self.times).find(|&time| {
            let along = if self.times > 1 {
                f64::from(time - 1) / f64::from(self.times - 1)
            } else {
                0.0
            };
            let share = f64::from(self.from) + along * f64::from(self.until - self.from);
            (share * f64::from(total)).round() as u32 == iteration
        })
    }

    /// Gaussians after `time` of these times, 0 being the start, on the way to `budget`.
    pub fn num_after(&self, time: u32, budget: usize) -> usize {
        if self.times == 0 {
            return budget;
        }
        let grown = f64::from(time) / f64::from(self.times);
        let share = f64::from(self.start_share) + grown * f64::from(1.0 - self.start_share);
        (share * budget as f64).round() as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::options::{Preset, TrainOptions};

    #[test]
    fn the_number_of_gaussians_grows_on_schedule() {
        let mut densify = TrainOptions::preset(Preset::Fast).radiance.densify;
        (densify.times, densify.from, densify.until) = (3, 0.1, 0.5);
        densify.start_share = 0.4;
        let times: Vec<(u32, u32)> = (1..=100)
            .filter_map(|i| Some((i, densify.time_at(i, 100)?)))
            .collect();
        assert_eq!(times, [(10, 1), (30, 2), (50, 3)]);
        let numbers: Vec<usize> = (0..=3).map(|t| densify.num_after(t, 1000)).collect();
        assert_eq!(numbers, [400, 600, 800, 1000]);
        densify.times = 0;
        assert_eq!(densify.num_after(0, 1000), 1000);
        assert_eq!((1..=100).find_map(|i| densify.time_at(i, 100)), None);
    }

    #[test]
    fn bare_lamps_become_clean_before_all_and_are_freed_from_there_on() {
        let mut lamps = TrainOptions::preset(Preset::Fast).radiance.lamps;
        (lamps.bare_after, lamps.after) = (0.5, 0.9);
        let at =
            |is_so: &dyn Fn(u32) -> bool| -> Vec<u32> { (1..=80).filter(|i| is_so(*i)).collect() };
        assert_eq!(at(&|i| lamps.is_due_for_bare(i, 80)), [40]);
        assert_eq!(at(&|i| lamps.is_due(i, 80)), [72]);
        let every_second: Vec<u32> = (42..=80).step_by(2).collect();
        assert_eq!(at(&|i| lamps.is_freed(i, 80)), every_second);
        assert_eq!(at(&|i| lamps.is_cleared(i, 80)), [40, 48, 64, 72, 80]);
        assert!(!lamps.is_done(71, 80) && lamps.is_done(72, 80));
        // Where all are clean first, no bare ones are looked for.
        let late = LampOptions {
            bare_after: 1.0,
            ..lamps.clone()
        };
        assert!(!(1..=80).any(|i| late.is_due_for_bare(i, 80)));
        let off = LampOptions {
            clean: false,
            ..lamps
        };
        let is_clean = |i| off.is_due(i, 80) || off.is_due_for_bare(i, 80);
        let is_any = |i| is_clean(i) || off.is_freed(i, 80) || off.is_cleared(i, 80);
        assert!(!(1..=80).any(is_any));
    }
}
