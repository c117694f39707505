//! Receivers of an earlier bake, and of this one.

use super::change::Change;
use super::kept::Kept;
use crate::surfaces::Seen;
use eagpt_trace::transport::matrix::known::UNKNOWN;
use std::collections::{HashMap, HashSet};

/// From here on are numbers that are no index, for receivers whose index names the random numbers
/// of another.
const OTHER_ELEMENTS: u32 = 1 << 30;

/// Where light arrives.
pub(super) struct Places {
    /// Rows of the earlier bake that still hold, by the index of the Gaussian now.
    pub(super) known: HashMap<u32, usize>,
    /// All else that reflects, by index.
    pub(super) fresh: Vec<(u32, Seen)>,
}

/// A Gaussian that light is gathered for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct KeptReceiver {
    /// Index of the Gaussian.
    pub(super) index: u32,
    /// What keeps its random numbers apart from those of others.
    pub(super) element: u32,
    /// Where light arrives, and among [`super::kept::Setup::frames`] who saw that.
    pub(super) seen: Seen,
}

/// Receivers with what their directions meet.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Rows {
    /// What light is gathered for, `[r]`.
    pub(super) receivers: Vec<KeptReceiver>,
    /// What directions meet, `[r, directions]`.
    pub(super) targets: Vec<u32>,
    /// What the light of emitters counts that they find, 0 where that was not asked for. `[r,
    /// directions]`
    pub(super) weights: Vec<f32>,
}

impl Rows {
    /// Puts receivers from all `places` in the order of their indices. What known ones met is
    /// called what it is called after the `change`; without `keeps_lights`, targets towards
    /// emitters are unknown.
    pub(super) fn merge(
        earlier: &Kept,
        places: &Places,
        change: &Change,
        keeps_lights: bool,
    ) -> Self {
        let [plain, to_lights] = earlier.setup.directions.map(|num| num as usize);
        let num = plain + to_lights;
        let earlier = &earlier.rows;
        let Places { known, fresh } = places;
        let taken = known.values().map(|&row| earlier.receivers[row].element);
        let mut taken: HashSet<u32> = taken.collect();
        let mut others = OTHER_ELEMENTS..;
        let mut element = |index: u32| {
            let mut candidates = std::iter::once(index).chain(&mut others);
            candidates
                .find(|&element| taken.insert(element))
                .expect("more than Gaussians")
        };
        let mut order: Vec<(u32, Option<Seen>)> = known.keys().map(|&i| (i, None)).collect();
        order.extend(fresh.iter().map(|&(i, seen)| (i, Some(seen))));
        order.sort_unstable_by_key(|(i, _)| *i);
        let mut rows = Self::default();
        for (index, fresh) in order {
            if let Some(seen) = fresh {
                let element = element(index);
                rows.receivers.push(KeptReceiver {
                    index,
                    element,
                    seen,
                });
                rows.targets.resize(rows.targets.len() + num, UNKNOWN);
                rows.weights.resize(rows.targets.len(), 0.0);
                continue;
            }
            let row = known[&index];
            let one = earlier.receivers[row];
            rows.receivers.push(KeptReceiver { index, ..one });
            let range = row * num..(row + 1) * num;
            let targets = earlier.targets[range.clone()]
                .iter()
                .map(|&t| change.target(t));
            if keeps_lights {
                rows.targets.extend(targets);
                rows.weights.extend_from_slice(&earlier.weights[range]);
            } else {
                rows.targets.extend(targets.take(plain));
                rows.targets.resize(rows.receivers.len() * num, UNKNOWN);
                rows.weights.resize(rows.targets.len(), 0.0);
            }
        }
        rows
    }
}
