//! Names of the positions of a capture in several conditions.

use super::gathered::Gathered;
use crate::problem::{Problem, Remedy};
use eagpt_scene::words::{counted, listed};
use std::collections::{BTreeMap, BTreeSet};

/// Gives the positions of several conditions the same names, which is what poses are shared by.
pub(super) fn name_positions(gathered: &mut Gathered) {
    let mut of_condition: BTreeMap<String, Vec<usize>> = BTreeMap::new();
    for (index, stack) in gathered.stacks.iter().enumerate() {
        of_condition
            .entry(stack.condition.clone())
            .or_default()
            .push(index);
    }
    if of_condition.len() < 2 {
        return;
    }
    let names = |indices: &Vec<usize>| -> BTreeSet<String> {
        indices
            .iter()
            .map(|&i| gathered.stacks[i].position.clone())
            .collect()
    };
    let sets: Vec<BTreeSet<String>> = of_condition.values().map(names).collect();
    let shared = sets
        .iter()
        .flatten()
        .any(|name| sets.iter().filter(|set| set.contains(name)).count() > 1);
    if shared {
        // Names tell; a position that one condition lacks is allowed, but not in silence.
        for (condition, set) in of_condition.keys().zip(&sets) {
            let all: BTreeSet<&String> = sets.iter().flatten().collect();
            let lacking: Vec<String> = all
                .iter()
                .filter(|n| !set.contains(**n))
                .map(|n| (*n).clone())
                .collect();
            if !lacking.is_empty() {
                gathered.notes.push(format!(
                    "{condition}: no {}: {}",
                    counted(lacking.len(), "position")
                        .split_once(' ')
                        .map_or("position", |(_, noun)| noun),
                    listed(&lacking, 6)
                ));
            }
        }
        return;
    }
    let counts: Vec<String> = of_condition
        .iter()
        .map(|(name, list)| format!("{name} {}", list.len()))
        .collect();
    if sets.iter().any(|set| set.len() != sets[0].len()) {
        gathered.problems.push(Problem::new(
            "positions",
            Remedy::None,
            format!(
                "the conditions have different numbers of them ({}), and file names do not tell which belong together: a capture.toml does",
                counts.join(", ")
            ),
        ));
        return;
    }
    gathered.notes.push(format!(
        "positions of the conditions ({}) are matched by their order",
        counts.join(", ")
    ));
    for list in of_condition.values() {
        for (number, &index) in list.iter().enumerate() {
            gathered.stacks[index].position = format!("p{number:03}");
        }
    }
}
