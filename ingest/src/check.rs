//! Whether stacks fit together: one camera, one lens, one size, one room.

use crate::demosaic;
use crate::gather::Gathered;
use crate::problem::{Problem, Remedy};
use crate::stack::{Photograph, Stack};
use eagpt_scene::words::{counted, listed};
use std::collections::{BTreeMap, HashMap};

/// Adds problems of readable stacks that do not fit together.
pub(crate) fn check(gathered: &mut Gathered, max_pause_s: f64) {
    let mut problems = Vec::new();
    double_files(gathered, &mut problems);
    double_names(&gathered.stacks, &mut problems);
    deviating(&gathered.stacks, &mut problems);
    apertures(&gathered.stacks, &mut problems);
    pauses(&gathered.stacks, max_pause_s, &mut problems);
    gathered.problems.extend(problems);
}

/// The same photograph twice.
fn double_files(gathered: &Gathered, problems: &mut Vec<Problem>) {
    let mut seen: HashMap<&str, &str> = HashMap::new();
    for shot in gathered.stacks.iter().flat_map(|stack| &stack.shots) {
        if let Some(first) = seen.get(shot.blake3.as_str()) {
            // If both are in one stack, the duplicate exposure is reported already.
            if !gathered.problems.iter().any(|p| p.subject == shot.name) {
                problems.push(Problem::new(
                    &shot.name,
                    Remedy::LeaveOutFile,
                    format!("the same photograph as {first}"),
                ));
            }
        } else {
            seen.insert(&shot.blake3, &shot.name);
        }
    }
}

/// Two stacks that would be written to the same files.
fn double_names(stacks: &[Stack], problems: &mut Vec<Problem>) {
    let mut seen: HashMap<String, usize> = HashMap::new();
    for stack in stacks {
        let count = seen.entry(stack.name()).or_default();
        *count += 1;
        if *count == 2 {
            problems.push(Problem::new(
                stack.name(),
                Remedy::None,
                "two stacks of this name: a capture.toml can tell them apart",
            ));
        }
    }
}

/// A property of a photograph, as people read it.
type Property = fn(&Photograph) -> String;

/// Stacks that deviate from the majority in camera, focal length, size or layout.
fn deviating(stacks: &[Stack], problems: &mut Vec<Problem>) {
    let shots = || {
        stacks
            .iter()
            .flat_map(|stack| stack.shots.iter().map(move |shot| (stack, shot)))
    };
    let properties: [(&str, Property); 3] = [
        ("camera", |shot| shot.header.metadata.camera()),
        ("focal length", |shot| {
            shot.header
                .metadata
                .focal_mm
                .map_or_else(|| "unknown".to_owned(), |mm| format!("{mm} mm"))
        }),
        ("image", |shot| {
            let header = &shot.header;
            format!(
                "{}x{} pixels of {}",
                header.width,
                header.height,
                layout(shot)
            )
        }),
    ];
    let mut told: Vec<String> = Vec::new();
    for (property, of) in properties {
        let mut counts: BTreeMap<String, usize> = BTreeMap::new();
        for (_, shot) in shots() {
            *counts.entry(of(shot)).or_default() += 1;
        }
        let Some((usual, _)) = counts.iter().max_by_key(|(_, count)| **count) else {
            continue;
        };
        let mut others: BTreeMap<String, (String, Vec<String>)> = BTreeMap::new();
        for (stack, shot) in shots().filter(|(_, shot)| of(shot) != *usual) {
            let entry = others
                .entry(stack.name())
                .or_insert_with(|| (of(shot), Vec::new()));
            entry.1.push(shot.name.clone());
        }
        for (name, (value, files)) in others {
            // Another camera also has another size: one line is enough.
            if told.contains(&name) {
                continue;
            }
            problems.push(Problem::new(
                &name,
                Remedy::LeaveOutStack,
                format!(
                    "{property} {value} where most of the capture has {usual}: {}",
                    listed(&files, 3)
                ),
            ));
            told.push(name);
        }
    }
    for stack in stacks {
        if let Some(shot) = stack
            .shots
            .iter()
            .find(|shot| !demosaic::is_known(&shot.header.layout))
        {
            problems.push(Problem::new(
                &shot.name,
                Remedy::LeaveOutStack,
                format!(
                    "colour filter array {}: only Bayer and X-Trans are known",
                    layout(shot)
                ),
            ));
        }
    }
}

fn layout(shot: &Photograph) -> String {
    use crate::raw::Layout;
    match &shot.header.layout {
        Layout::Rgb if shot.header.display.is_some() => "RGB of 8 bits".to_owned(),
        Layout::Rgb => "linear RGB".to_owned(),
        Layout::Mosaic {
            columns,
            rows,
            channels,
        } => {
            let letters: String = channels
                .iter()
                .map(|c| ["R", "G", "B"][usize::from((*c).min(2))])
                .collect();
            format!("a {columns}x{rows} mosaic {letters}")
        }
    }
}

/// Another aperture changes depth of field and vignetting within a stack.
fn apertures(stacks: &[Stack], problems: &mut Vec<Problem>) {
    for stack in stacks {
        let stop = |shot: &Photograph| shot.header.metadata.f_number;
        let Some(first) = stack.shots.first() else {
            continue;
        };
        let differs = |shot: &&Photograph| match (stop(shot), stop(first)) {
            (Some(a), Some(b)) => (a / b).ln().abs() > 0.03,
            _ => false,
        };
        if let Some(other) = stack.shots.iter().find(differs) {
            problems.push(Problem::new(
                stack.name(),
                Remedy::LeaveOutStack,
                format!(
                    "f/{} in {}, f/{} in {}: the aperture has to stay",
                    stop(first).unwrap_or_default(),
                    first.name,
                    stop(other).unwrap_or_default(),
                    other.name
                ),
            ));
        }
    }
}

/// A long pause within a condition: probably two rooms, or two days, in one folder.
fn pauses(stacks: &[Stack], max_pause_s: f64, problems: &mut Vec<Problem>) {
    let mut conditions: BTreeMap<&str, Vec<(f64, f64, usize)>> = BTreeMap::new();
    for (index, stack) in stacks.iter().enumerate() {
        let times: Option<Vec<f64>> = stack
            .shots
            .iter()
            .map(|shot| shot.header.metadata.time_s)
            .collect();
        if let Some(times) = times.filter(|times| !times.is_empty()) {
            let first = times.iter().copied().fold(f64::INFINITY, f64::min);
            let last = times.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            conditions
                .entry(&stack.condition)
                .or_default()
                .push((first, last, index));
        }
    }
    for stacks_by_time in conditions.values_mut() {
        stacks_by_time.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut sessions: Vec<Vec<usize>> = vec![Vec::new()];
        let mut end = f64::INFINITY;
        for (first, last, index) in stacks_by_time.iter() {
            if first - end > max_pause_s {
                sessions.push(Vec::new());
            }
            if let Some(session) = sessions.last_mut() {
                session.push(*index);
            }
            end = *last;
        }
        // The largest is taken for the capture, the first of equally large ones.
        let main = (0..sessions.len())
            .rev()
            .max_by_key(|&i| sessions[i].len())
            .unwrap_or(0);
        for (number, session) in sessions.iter().enumerate() {
            if number == main {
                continue;
            }
            let names: Vec<String> = session.iter().map(|&i| stacks[i].name()).collect();
            let what = counted(names.len(), "stack");
            let text = format!(
                "{what} taken more than {:.0} min apart from the others: two rooms in one folder? A folder for each, or --max-pause: {}",
                max_pause_s / 60.0,
                listed(&names, 3)
            );
            problems.push(Problem::new(&names[0], Remedy::LeaveOutStack, text).concerning(names));
        }
    }
}
