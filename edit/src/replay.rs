//! Replaying a script: the same script and scene give the same result to the bit.

use crate::act::{self, Action};
use crate::lights::{self, LightFactor};
use crate::place::{Goal, Placement};
use crate::report::{Bounds, SelectionReport, StepReport};
use crate::script::{EditStep, Script, Subject};
use crate::select::{Groups, Scope, Selector};
use crate::trim::{Cuts, Side};
use eagpt_scene::{Gaussian, Gaussians, Lamps, LightBasis, Result};
use glam::Vec3;

/// The result of a script.
#[derive(Debug, Clone, PartialEq)]
pub struct Edited {
    /// The scene after the last step.
    pub gaussians: Gaussians,
    /// Matches of each named selection in the scene before the first step, by name; selections
    /// that refer to results of steps are left out.
    pub selections: Vec<SelectionReport>,
    /// Effects of each step.
    pub steps: Vec<StepReport>,
    /// The light of the scene by its lamps, if steps have set lights and it is that of the scene
    /// after the last step.
    pub basis: Option<LightBasis>,
}

/// Replays a script on a scene.
///
/// # Errors
/// [`eagpt_scene::SceneError::Script`] with file, line and key if a step selects nothing and does
/// not allow it, or leaves nothing of the scene; if it sets lights of a scene that is no longer the
/// one whose light was baked; or if the script refers to lamps, or sets lights, and nobody has set
/// them.
pub fn replay(script: &Script, gaussians: Gaussians) -> Result<Edited> {
    check_lamps(script)?;
    if script.basis.is_none()
        && let Some((step, _)) = script.light_steps().next()
    {
        let problem = "the light of the scene by its lamps is not known";
        return Err(script.file.error(step.subject_span.clone(), problem));
    }
    let none = Lamps::default();
    let mut state = State {
        script,
        lamps: script.lamps.as_ref().unwrap_or(&none),
        basis: script.basis.clone().filter(|_| script.needs_basis()),
        gaussians,
        groups: Groups::new(),
        selected: Vec::new(),
    };
    let selections = state.named_selections();
    let mut steps = Vec::with_capacity(script.steps.len());
    for (index, step) in script.steps.iter().enumerate() {
        steps.push(state.step(index, step)?);
    }
    let State {
        gaussians, basis, ..
    } = state;
    Ok(Edited {
        basis: basis.filter(|basis| basis.check(&gaussians).is_ok()),
        gaussians,
        selections,
        steps,
    })
}

/// Whether each Gaussian of a scene as it is, `[n]`, is what the first step of a script selects.
/// Nothing is done with them.
///
/// # Errors
/// [`eagpt_scene::SceneError::Script`] with file, line and key if the script refers to lamps that
/// nobody has set, or its first step selects nothing of the scene because it has another subject.
pub fn selection(script: &Script, gaussians: &Gaussians) -> Result<Vec<bool>> {
    check_lamps(script)?;
    let first = &script.steps[0];
    let Subject::Select(selector) = &first.subject else {
        let problem = "selects nothing of the scene";
        return Err(script.file.error(first.subject_span.clone(), problem));
    };
    let (no_groups, no_lamps) = (Groups::new(), Lamps::default());
    let scope = Scope {
        gaussians,
        definitions: &script.selections,
        groups: &no_groups,
        lamps: script.lamps.as_ref().unwrap_or(&no_lamps),
    };
    Ok(scope.prepare(selector).mask())
}

/// Refuses a script that refers to lamps before they are known.
fn check_lamps(script: &Script) -> Result<()> {
    match script.lamp_names.first() {
        Some(name) if script.lamps.is_none() => {
            let problem = "the lamps of the scene are not known";
            Err(script.file.error(name.span(), problem))
        }
        _ => Ok(()),
    }
}

struct State<'a> {
    script: &'a Script,
    lamps: &'a Lamps,
    basis: Option<LightBasis>,
    gaussians: Gaussians,
    groups: Groups,
    /// Gaussians that the step acts on, one flag for each.
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
            lamps: self.lamps,
        }
    }

    fn step(&mut self, index: usize, step: &EditStep) -> Result<StepReport> {
        let (source, found) = match &step.subject {
            Subject::SetLight(set) => ("set_light", self.set_light(step, set)?),
            Subject::Select(selector) => ("select", self.select(step, selector)),
            Subject::Insert(surface) => {
                self.append(&surface.discs());
                ("insert", Found::in_scene(&self.selected))
            }
            Subject::Import {
                asset,
                selector,
                placement,
            } => {
                let asset = &self.script.assets[*asset].gaussians;
                ("import", self.import(step, asset, selector, placement))
            }
        };
        let file = &self.script.file;
        let error = |problem: &str| file.error(step.subject_span.clone(), problem);
        if found.num == 0 && !step.allow_empty {
            let problem = "selects nothing; allow_empty = true in the step would allow it";
            return Err(error(problem));
        }
        let bounds = bounds_of(&self.gaussians, &self.selected);
        for (place, action) in step.actions.iter().enumerate() {
            match action {
                // The original stays as it is: only the copy is trimmed.
                Action::Duplicate(placement) if place == 0 => {
                    self.append(&found.cuts.pick(&self.gaussians, &self.selected));
                    self.place(placement);
                }
                _ => self.act(action).map_err(|problem| error(&problem))?,
            }
        }
        let report = StepReport {
            step: index,
            line: self.script.file.line(&step.span),
            title: step.title.clone(),
            source,
            num_selected: found.num,
            bounds,
            bounds_after: bounds_of(&self.gaussians, &self.selected),
            num_shrunk: found.cuts.shrunk.len(),
            num_dropped: found.cuts.dropped.len(),
            num_gaussians: self.gaussians.len(),
        };
        if self.gaussians.is_empty() {
            return Err(error("leaves no Gaussian of the scene"));
        }
        if let Some(name) = &step.group {
            let members = std::mem::take(&mut self.selected);
            self.groups.insert(name.clone(), members);
        }
        Ok(report)
    }

    /// Selects, and trims what crosses the boundary: of a selection that goes away, what stays and
    /// reaches into it; of any other, what is selected and reaches out of it.
    fn select(&mut self, step: &EditStep, selector: &Selector) -> Found {
        let prepared = self.scope(&self.gaussians).prepare(selector);
        let selected = prepared.mask();
        let num = count(&selected);
        let cuts = step.trim.map_or_else(Cuts::default, |how| {
            if step.actions.contains(&Action::Remove) {
                let others = inverse(&selected);
                Cuts::find(&prepared, &self.gaussians, &others, Side::Outside, how)
            } else {
                Cuts::find(&prepared, &self.gaussians, &selected, Side::Inside, how)
            }
        });
        self.selected = selected;
        if !matches!(step.actions.first(), Some(Action::Duplicate(_))) {
            for (&index, smaller) in &cuts.shrunk {
                self.gaussians.set(index, smaller);
            }
            if !cuts.dropped.is_empty() {
                let kept = (0..self.gaussians.len()).map(|i| !cuts.dropped.contains(&i));
                self.keep(&kept.collect::<Vec<_>>());
            }
        }
        Found { num, cuts }
    }

    /// Sets lights, and selects what emits of them.
    fn set_light(&mut self, step: &EditStep, set: &[LightFactor]) -> Result<Found> {
        let file = &self.script.file;
        let basis = self.basis.as_mut().expect("replay begins with it");
        basis.check(&self.gaussians).map_err(|problem| {
            let problem = format!("the light by lamps is {problem}");
            file.error(step.subject_span.clone(), problem)
        })?;
        let factors = lights::factors(basis, set);
        let factors = factors.map_err(|(span, problem)| file.error(span, problem))?;
        let mut is_set = vec![false; basis.lights().len()];
        for (index, factor) in factors {
            basis.set_factor(index, factor);
            is_set[index] = true;
        }
        basis.light(&mut self.gaussians);
        self.selected = vec![false; self.gaussians.len()];
        for (gaussian, light) in basis.emitters() {
            self.selected[gaussian] = is_set[light];
        }
        Ok(Found::in_scene(&self.selected))
    }

    fn import(
        &mut self,
        step: &EditStep,
        asset: &Gaussians,
        selector: &Selector,
        placement: &Placement,
    ) -> Found {
        // Groups are of this scene; the script's reader keeps them out of an import.
        let prepared = self.scope(asset).prepare(selector);
        let mask = prepared.mask();
        let cuts = step.trim.map_or_else(Cuts::default, |how| {
            Cuts::find(&prepared, asset, &mask, Side::Inside, how)
        });
        self.append(&cuts.pick(asset, &mask));
        self.place(placement);
        Found {
            num: count(&mask),
            cuts,
        }
    }

    /// Acts on the selection.
    ///
    /// # Errors
    /// A description of the problem if it is none that a lamp can be made of.
    fn act(&mut self, action: &Action) -> Result<(), String> {
        match action {
            Action::Remove => {
                let kept = inverse(&self.selected);
                self.keep(&kept);
            }
            Action::KeepOnly => self.keep(&self.selected.clone()),
            Action::Paint(paint) => self.change(|g| paint.apply(*g)),
            Action::MakeLamp(lamp) => {
                let old: Vec<Gaussian> = pick(&self.gaussians, &self.selected).collect();
                let surface = lamp.surface(&old, self.script.up.vector())?;
                self.keep(&inverse(&self.selected));
                self.append(&surface.discs());
            }
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
        Ok(())
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
            self.gaussians.set(index, &changed);
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
}

/// Matches of a step.
struct Found {
    num: usize,
    cuts: Cuts,
}

impl Found {
    fn in_scene(selected: &[bool]) -> Self {
        Self {
            num: count(selected),
            cuts: Cuts::default(),
        }
    }
}

fn inverse(mask: &[bool]) -> Vec<bool> {
    mask.iter().map(|flag| !flag).collect()
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
