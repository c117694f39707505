//! Replaying a script: the same script and scene give the same result to the bit.

use crate::act::{self, Action};
use crate::error::Result;
use crate::place::{Goal, Placement};
use crate::script::{Script, Source, Step};
use crate::select::{Groups, Scope, Selector};
use crate::trim::{self, Side, Trimmed};
use eagpt_scene::{Gaussian, Gaussians};
use glam::Vec3;
use serde::Serialize;

/// The result of a script.
#[derive(Debug, Clone, PartialEq)]
pub struct Edited {
    /// The scene after the last step.
    pub gaussians: Gaussians,
    /// What each named selection finds in the scene before the first step, by name; those that refer to what steps make are left
    /// out.
    pub selections: Vec<SelectionReport>,
    /// What each step did.
    pub steps: Vec<StepReport>,
}

/// Bounds of centres, scene units: lowest and highest corner.
pub type Bounds = [[f32; 3]; 2];

/// What a named selection finds.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SelectionReport {
    /// Its name.
    pub name: String,
    /// Number of Gaussians.
    pub num_selected: usize,
    /// Where they are; `None` if there are none.
    pub bounds: Option<Bounds>,
}

/// What a step did.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StepReport {
    /// Number of the step, from 0 as in the script's keys.
    pub step: usize,
    /// Line of the script.
    pub line: usize,
    /// Its title, if it has one.
    pub title: Option<String>,
    /// "select", "insert" or "import".
    pub source: &'static str,
    /// Number of Gaussians that were selected, inserted or imported.
    pub num_selected: usize,
    /// Where they were before the actions; `None` if there were none.
    pub bounds: Option<Bounds>,
    /// Where what the step acted on was at its end; `None` if it is gone.
    pub bounds_after: Option<Bounds>,
    /// Number of Gaussians made smaller by trimming.
    pub num_shrunk: usize,
    /// Number of Gaussians removed by trimming.
    pub num_dropped: usize,
    /// Number of Gaussians of the scene after the step.
    pub num_gaussians: usize,
}

/// Replays a script on a scene.
///
/// # Errors
/// [`crate::EditError::Script`] with file, line and key if a step selects nothing and does not allow it.
pub fn replay(script: &Script, gaussians: Gaussians) -> Result<Edited> {
    let mut state = State {
        script,
        gaussians,
        groups: Groups::new(),
        selected: Vec::new(),
    };
    let selections = state.named_selections();
    let mut steps = Vec::with_capacity(script.steps.len());
    for (index, step) in script.steps.iter().enumerate() {
        steps.push(state.step(index, step)?);
    }
    Ok(Edited {
        gaussians: state.gaussians,
        selections,
        steps,
    })
}

struct State<'a> {
    script: &'a Script,
    gaussians: Gaussians,
    groups: Groups,
    /// What the step acts on, one flag for each Gaussian.
    selected: Vec<bool>,
}

impl State<'_> {
    fn named_selections(&self) -> Vec<SelectionReport> {
        let definitions = &self.script.selections;
        let is_group = |part: &Selector| matches!(part, Selector::Group(_));
        let plain = definitions
            .iter()
            .filter(|(_, selector)| !selector.mentions(definitions, &is_group));
        plain
            .map(|(name, selector)| {
                let mask = self.scope(&self.gaussians).prepare(selector).mask();
                SelectionReport {
                    name: name.clone(),
                    num_selected: count(&mask),
                    bounds: bounds_of(&self.gaussians, &mask),
                }
            })
            .collect()
    }

    fn scope<'a>(&'a self, gaussians: &'a Gaussians) -> Scope<'a> {
        Scope {
            gaussians,
            definitions: &self.script.selections,
            groups: &self.groups,
        }
    }

    fn step(&mut self, index: usize, step: &Step) -> Result<StepReport> {
        let (source, origin) = match &step.source {
            Source::Select { selector, origin } => {
                self.selected = self.scope(&self.gaussians).prepare(selector).mask();
                ("select", origin)
            }
            Source::Insert { surface, origin } => {
                self.append(&surface.discs());
                ("insert", origin)
            }
            Source::Import {
                asset,
                selector,
                placement,
                origin,
            } => {
                let asset = &self.script.assets[*asset].gaussians;
                // Groups are of this scene; the script's reader keeps them out of an import.
                let mask = self.scope(asset).prepare(selector).mask();
                let chosen: Gaussians = pick(asset, &mask).collect();
                self.append(&chosen);
                self.place(placement);
                ("import", origin)
            }
        };
        let num_selected = count(&self.selected);
        if num_selected == 0 && !step.allow_empty {
            return Err(origin.error(
                &self.script.path,
                "selects nothing; allow_empty = true in the step would allow it",
            ));
        }
        let mut report = StepReport {
            step: index,
            line: step.origin.line,
            title: step.title.clone(),
            source,
            num_selected,
            bounds: bounds_of(&self.gaussians, &self.selected),
            bounds_after: None,
            num_shrunk: 0,
            num_dropped: 0,
            num_gaussians: 0,
        };
        self.trim(step, &mut report);
        for action in &step.actions {
            self.act(action);
        }
        report.bounds_after = bounds_of(&self.gaussians, &self.selected);
        report.num_gaussians = self.gaussians.len();
        if let Some(name) = &step.group {
            let members = std::mem::take(&mut self.selected);
            self.groups.insert(name.clone(), members);
        }
        Ok(report)
    }

    fn act(&mut self, action: &Action) {
        match action {
            Action::Remove => {
                let kept: Vec<bool> = self.selected.iter().map(|selected| !selected).collect();
                self.keep(&kept);
            }
            Action::KeepOnly => self.keep(&self.selected.clone()),
            Action::Paint(paint) => self.change(|g| paint.apply(*g)),
            Action::Place(placement) => self.place(placement),
            Action::Duplicate(placement) => {
                let copies: Gaussians = pick(&self.gaussians, &self.selected).collect();
                self.append(&copies);
                self.place(placement);
            }
            Action::SnapToFloor(height) => {
                let up = self.script.up.vector();
                let heights = pick(&self.gaussians, &self.selected).map(|g| g.position.dot(up));
                if let Some(lowest) = heights.reduce(f32::min) {
                    self.place(&Placement {
                        goal: Goal::By(up * (height - lowest)),
                        ..Placement::by(Vec3::ZERO)
                    });
                }
            }
        }
    }

    fn place(&mut self, placement: &Placement) {
        if let Some(bounds) = act::bounds(&self.gaussians, &self.selected) {
            let similarity = placement.resolve(bounds, self.script.up.vector());
            self.change(|g| similarity.gaussian(g));
        }
    }

    fn change(&mut self, change: impl Fn(&Gaussian) -> Gaussian) {
        for index in (0..self.gaussians.len()).filter(|i| self.selected[*i]) {
            let changed = change(&self.gaussians.get(index));
            act::set(&mut self.gaussians, index, &changed);
        }
    }

    /// Adds Gaussians at the end and selects them alone.
    fn append(&mut self, added: &Gaussians) {
        self.selected = vec![false; self.gaussians.len()];
        for g in added.iter() {
            self.gaussians.push(g);
        }
        let num = self.gaussians.len();
        self.selected.resize(num, true);
        for members in self.groups.values_mut() {
            members.resize(num, false);
        }
    }

    /// Removes all but the Gaussians flagged, from the selection and the groups as well.
    fn keep(&mut self, kept: &[bool]) {
        self.gaussians = pick(&self.gaussians, kept).collect();
        let masks = self.groups.values_mut().chain([&mut self.selected]);
        for mask in masks {
            let flags = mask
                .iter()
                .zip(kept)
                .filter(|(_, kept)| **kept)
                .map(|(flag, _)| *flag);
            *mask = flags.collect();
        }
    }

    /// Trims what crosses the boundary of the selection: of a selection that goes away, what stays and reaches into it; of any other,
    /// what is selected and reaches out of it.
    fn trim(&mut self, step: &Step, report: &mut StepReport) {
        let (Some(how), Source::Select { selector, .. }) = (step.trim, &step.source) else {
            return;
        };
        let (side, touched) = if step.actions.contains(&Action::Remove) {
            (Side::Outside, false)
        } else {
            (Side::Inside, true)
        };
        let mut kept = vec![true; self.gaussians.len()];
        let mut shrunk = Vec::new();
        let prepared = self.scope(&self.gaussians).prepare(selector);
        for index in (0..self.gaussians.len()).filter(|i| self.selected[*i] == touched) {
            let g = self.gaussians.get(index);
            match trim::trim(&prepared, index, &g, side, how) {
                Trimmed::Kept => {}
                Trimmed::Shrunk(smaller) => shrunk.push((index, smaller)),
                Trimmed::Dropped => kept[index] = false,
            }
        }
        report.num_shrunk = shrunk.len();
        report.num_dropped = kept.len() - count(&kept);
        for (index, smaller) in &shrunk {
            act::set(&mut self.gaussians, *index, smaller);
        }
        if report.num_dropped > 0 {
            self.keep(&kept);
        }
    }
}

fn pick<'a>(gaussians: &'a Gaussians, mask: &'a [bool]) -> impl Iterator<Item = Gaussian> + 'a {
    let chosen = mask.iter().enumerate().filter(|(_, chosen)| **chosen);
    chosen.map(|(index, _)| gaussians.get(index))
}

fn count(mask: &[bool]) -> usize {
    mask.iter().filter(|flag| **flag).count()
}

fn bounds_of(gaussians: &Gaussians, mask: &[bool]) -> Option<Bounds> {
    act::bounds(gaussians, mask).map(|(low, high)| [low.to_array(), high.to_array()])
}
