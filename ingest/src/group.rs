//! Which shots of a folder make a stack.
//!
//! Names decide where they are of the form `<stack>_<index>`. Elsewhere the cycle of exposures
//! does: shots in the order of time, cut where an exposure comes again or a long pause was made.
//! The sequence that is found most often is the bracket; cut again by it, and compared with it,
//! missing, extra and double shots come to light. Nothing that deviates is mended here.

use crate::stack::natural;
use std::collections::BTreeMap;

/// Properties of a shot used for grouping.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Key {
    /// File name without folder and extension.
    pub(crate) stem: String,
    /// Time of the shot in seconds, if known.
    pub(crate) time_s: Option<f64>,
    /// Exposure.
    pub(crate) exposure: f64,
}

/// A group of shots, by their indices, in the order of time.
pub(crate) type Group = Vec<usize>;

/// Exposures are the same if they differ by less than this many stops: cameras state 1/30 for 1/32.
const SAME_STOPS: f64 = 0.2;
/// A shot has its place in the bracket if it is this near to it, in stops.
const NEAR_STOPS: f64 = 0.75;
/// Longest bracket that a camera takes.
const MAX_SHOTS: usize = 25;

/// The exposures of a bracket in the order in which they are taken.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Bracket(pub(crate) Vec<f64>);

/// Deviation of a stack from the bracket.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Deviation {
    /// Exposures that no shot has.
    pub(crate) missing: Vec<f64>,
    /// Positions in the group of shots whose exposure another has already: the other first.
    pub(crate) double: Vec<(usize, usize)>,
    /// Positions in the group of shots whose exposure is none of the bracket.
    pub(crate) extra: Vec<usize>,
    /// Whether the shots are in another order than those of other stacks.
    pub(crate) out_of_order: bool,
    /// Shots whose exposure is near one of the bracket, but not it: position and the exposure that
    /// was expected.
    pub(crate) odd: Vec<(usize, f64)>,
}

/// Groups shots. A pause longer than `max_pause_s` always ends a stack.
pub(crate) fn group(keys: &[Key], max_pause_s: f64) -> Vec<Group> {
    if let Some(groups) = by_name(keys) {
        return groups;
    }
    let order = chronological(keys);
    let paused = |a: usize, b: usize| match (keys[a].time_s, keys[b].time_s) {
        (Some(a), Some(b)) => b - a > max_pause_s,
        _ => false,
    };
    let mut first: Vec<Group> = Vec::new();
    for &shot in &order {
        let exposure = keys[shot].exposure;
        match first.last_mut() {
            Some(group)
                if !paused(*group.last().unwrap_or(&shot), shot)
                    && !group.iter().any(|&s| same(keys[s].exposure, exposure)) =>
            {
                group.push(shot);
            }
            _ => first.push(vec![shot]),
        }
    }
    let Some(bracket) = Bracket::most_common(keys, &first) else {
        return first;
    };
    if bracket.0.len() == 1 {
        return first;
    }
    let mut groups: Vec<Group> = Vec::new();
    let mut last_place = None;
    for &shot in &order {
        let place = bracket.place(keys[shot].exposure);
        let begins = match (
            groups.last().and_then(|group| group.last()),
            last_place,
            place,
        ) {
            (None, _, _) => true,
            (Some(&before), _, _) if paused(before, shot) => true,
            (_, Some(before), Some(place)) => place <= before,
            _ => false,
        };
        if begins {
            groups.push(vec![shot]);
            last_place = place;
        } else if let Some(group) = groups.last_mut() {
            group.push(shot);
            last_place = place.or(last_place);
        }
    }
    joined(keys, &bracket, groups, &paused)
}

/// Puts neighbours together that are only together a whole bracket: a shot was repeated, or the
/// order changed.
fn joined(
    keys: &[Key],
    bracket: &Bracket,
    groups: Vec<Group>,
    paused: &dyn Fn(usize, usize) -> bool,
) -> Vec<Group> {
    let complete = |group: &Group| bracket.deviation(keys, group).missing.is_empty();
    let mut kept: Vec<Group> = Vec::new();
    for group in groups {
        let together = kept.last().and_then(|before| {
            let near = !paused(*before.last()?, *group.first()?);
            let both = [before.as_slice(), group.as_slice()].concat();
            // A single shot after a whole bracket is one too many, not a bracket that misses all
            // others.
            let stray = group.len() == 1 && complete(before) && bracket.0.len() > 2;
            let parts = !complete(before) && !complete(&group);
            (near && (stray || parts && complete(&both))).then_some(both)
        });
        match (together, kept.last_mut()) {
            (Some(both), Some(before)) => *before = both,
            _ => kept.push(group),
        }
    }
    kept
}

impl Bracket {
    /// The sequence of exposures that most groups have; of equally many, the longest, then the
    /// first.
    pub(crate) fn most_common(keys: &[Key], groups: &[Group]) -> Option<Self> {
        let sequence = |group: &Group| group.iter().map(|&s| keys[s].exposure).collect::<Vec<_>>();
        let sequences: Vec<Vec<f64>> = groups.iter().map(sequence).collect();
        let alike =
            |a: &[f64], b: &[f64]| a.len() == b.len() && a.iter().zip(b).all(|(a, b)| same(*a, *b));
        let mut best: Option<(usize, &Vec<f64>)> = None;
        for candidate in &sequences {
            let count = sequences
                .iter()
                .filter(|other| alike(candidate, other))
                .count();
            let better =
                best.is_none_or(|(num, kept)| (count, candidate.len()) > (num, kept.len()));
            if better {
                best = Some((count, candidate));
            }
        }
        best.map(|(_, sequence)| Self(sequence.clone()))
    }

    /// The place of an exposure.
    fn place(&self, exposure: f64) -> Option<usize> {
        let stops = |other: f64| (exposure / other).log2().abs();
        let nearest =
            (0..self.0.len()).min_by(|&a, &b| stops(self.0[a]).total_cmp(&stops(self.0[b])))?;
        (stops(self.0[nearest]) < NEAR_STOPS).then_some(nearest)
    }

    /// Deviation of a group from the bracket.
    pub(crate) fn deviation(&self, keys: &[Key], group: &[usize]) -> Deviation {
        let mut owner: Vec<Option<usize>> = vec![None; self.0.len()];
        let mut deviation = Deviation::default();
        let mut last = None;
        for (position, &shot) in group.iter().enumerate() {
            let exposure = keys[shot].exposure;
            let Some(place) = self.place(exposure) else {
                deviation.extra.push(position);
                continue;
            };
            if let Some(other) = owner[place] {
                deviation.double.push((other, position));
                continue;
            }
            owner[place] = Some(position);
            deviation.out_of_order |= last.is_some_and(|last| place < last);
            last = Some(place);
            if !same(exposure, self.0[place]) {
                deviation.odd.push((position, self.0[place]));
            }
        }
        let unowned = owner
            .iter()
            .zip(&self.0)
            .filter(|(owner, _)| owner.is_none());
        deviation.missing = unowned.map(|(_, exposure)| *exposure).collect();
        deviation
    }
}

fn same(a: f64, b: f64) -> bool {
    (a / b).log2().abs() < SAME_STOPS
}

/// By time, where all shots have one; equal times by name.
pub(crate) fn chronological(keys: &[Key]) -> Vec<usize> {
    let timed = keys.iter().all(|key| key.time_s.is_some());
    let mut order: Vec<usize> = (0..keys.len()).collect();
    order.sort_by(|&a, &b| {
        let by_name = natural(&keys[a].stem, &keys[b].stem);
        match (keys[a].time_s, keys[b].time_s) {
            (Some(a), Some(b)) if timed => a.total_cmp(&b).then(by_name),
            _ => by_name,
        }
    });
    order
}

/// Groups by names `<stack>_<index>`; `None` if the names are not like that.
fn by_name(keys: &[Key]) -> Option<Vec<Group>> {
    let mut groups: BTreeMap<&str, Vec<(u32, usize)>> = BTreeMap::new();
    for (shot, key) in keys.iter().enumerate() {
        let (stack, index) = split_name(&key.stem)?;
        groups.entry(stack).or_default().push((index, shot));
    }
    let mut sizes: Vec<usize> = groups.values().map(Vec::len).collect();
    sizes.sort_unstable();
    let usual = *sizes.get(sizes.len() / 2)?;
    // A counter of the camera also has an underscore before it: its numbers do not begin anew for
    // each stack.
    let anew = groups
        .values()
        .all(|group| group.iter().all(|(index, _)| *index as usize <= usual + 1));
    if !(2..=MAX_SHOTS).contains(&usual) || !anew {
        return None;
    }
    let mut named: Vec<(&str, Group)> = groups
        .into_iter()
        .map(|(name, mut group)| {
            group.sort_unstable();
            (name, group.into_iter().map(|(_, shot)| shot).collect())
        })
        .collect();
    named.sort_by(|a, b| natural(a.0, b.0));
    Some(named.into_iter().map(|(_, group)| group).collect())
}

/// `p000_3` as `p000` and 3.
pub(crate) fn split_name(stem: &str) -> Option<(&str, u32)> {
    let (stack, index) = stem.rsplit_once(['_', '-'])?;
    let is_index =
        !index.is_empty() && index.len() <= 3 && index.bytes().all(|c| c.is_ascii_digit());
    (is_index && !stack.is_empty()).then(|| Some((stack, index.parse().ok()?)))?
}

/// A name for a group: what its files' names have in common before the last separator, or the name
/// of its first file.
pub(crate) fn name_of_group(stems: &[&str]) -> String {
    let mut parts = stems
        .iter()
        .map(|stem| split_name(stem).map(|(stack, _)| stack));
    let first = stems.first().copied().unwrap_or_default();
    match parts.next().flatten() {
        Some(stack) if stems.len() > 1 && parts.all(|other| other == Some(stack)) => {
            stack.to_owned()
        }
        _ => first.to_owned(),
    }
}

#[cfg(test)]
mod tests;
