//! Neighbouring surfaces of one gloss made one: what is divided by a texture or a shadow is
//! explained by the same lobe, and better by the views of all.

use super::evidence::Evidence;
use super::planes::Planes;
use eagpt_light::irradiance::smooth::Smoothing;
use eagpt_light::segments::Segments;
use std::collections::{BTreeMap, BTreeSet};

/// Share of the differences between views that each of two surfaces may lose in what is explained.
const MOST_LOST: f64 = 0.1;

/// Surfaces that are not joined yet.
struct Open<'a> {
    planes: &'a Planes,
    evidence: Vec<Evidence>,
    neighbours: BTreeMap<usize, BTreeSet<usize>>,
    /// Share lost by joining a pair, the lower number first.
    lost: BTreeMap<(usize, usize), f64>,
}

/// Joins surfaces of `segments`, those that lose least first; their evidence adds up.
pub(super) fn joined(
    segments: &Segments,
    evidence: Vec<Evidence>,
    (smoothing, planes): (&Smoothing, &Planes),
) -> (Segments, Vec<Evidence>) {
    let mut open = Open {
        planes,
        evidence,
        neighbours: BTreeMap::new(),
        lost: BTreeMap::new(),
    };
    for (a, b) in segments.borders(smoothing).into_keys() {
        open.neighbours.entry(a).or_default().insert(b);
        if a < b {
            open.compare(a, b);
        }
    }
    let mut names: Vec<u32> = (0..segments.num as u32).collect();
    let least = |lost: &BTreeMap<(usize, usize), f64>| {
        let pairs = lost.iter().map(|(pair, lost)| (*pair, *lost));
        pairs.min_by(|a, b| a.1.total_cmp(&b.1))
    };
    while let Some(((a, b), _)) = least(&open.lost) {
        open.join(a, b);
        let names = names.iter_mut();
        names.for_each(|name| *name = if *name == b as u32 { a as u32 } else { *name });
    }
    let joined = segments.joined(&names);
    let mut evidence = vec![Evidence::default(); joined.num];
    let mut is_moved = vec![false; segments.num];
    for (&before, &after) in segments.of.iter().zip(&joined.of) {
        let of = names[before as usize] as usize;
        if !std::mem::replace(&mut is_moved[of], true) {
            evidence[after as usize] = std::mem::take(&mut open.evidence[of]);
        }
    }
    (joined, evidence)
}

impl Open<'_> {
    /// Notes the loss of joining two neighbours, if it is little.
    fn compare(&mut self, a: usize, b: usize) {
        let pair = (a.min(b), a.max(b));
        self.lost.remove(&pair);
        // A surface that is not flat would take its plane from one that is.
        let is_one_way = match [a, b].map(|surface| self.planes.of[surface]) {
            [Some(first), Some(second)] => first.has(second.normal()),
            planes => planes == [None; 2],
        };
        if !is_one_way {
            return;
        }
        let [first, second] = [a, b].map(|surface| &self.evidence[surface]);
        let (Some((_, of_first)), Some((_, of_second))) = (first.lobe(), second.lobe()) else {
            return;
        };
        let mut both = first.clone();
        both.add(second);
        let Some((lobe, _)) = both.lobe() else {
            return;
        };
        let lost =
            (of_first - first.all.explained(lobe)).max(of_second - second.all.explained(lobe));
        if lost <= MOST_LOST {
            self.lost.insert(pair, lost);
        }
    }

    /// Makes `b` a part of `a`.
    fn join(&mut self, a: usize, b: usize) {
        let part = std::mem::take(&mut self.evidence[b]);
        self.evidence[a].add(&part);
        self.lost.retain(|&(i, j), _| i != b && j != b);
        for other in self.neighbours.remove(&b).unwrap_or_default() {
            let of_other = self.neighbours.entry(other).or_default();
            of_other.remove(&b);
            if other != a {
                of_other.insert(a);
                self.neighbours.entry(a).or_default().insert(other);
            }
        }
        for other in self.neighbours[&a].clone() {
            self.compare(a, other);
        }
    }
}
