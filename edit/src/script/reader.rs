//! The reader of scripts.

use super::actions::PlacementKeys;
use super::selectors::{self, SelectorKeys, SelectorReader, is_reserved};
use super::surfaces::ReadSurface;
use super::{Asset, EditStep, Script, Subject};
use crate::act::Action;
use crate::lights::LightFactor;
use crate::place::Pivot;
use crate::select::{Definitions, Selector};
use crate::trim::Trim;
use eagpt_scene::dataset::UpAxis;
use eagpt_scene::script::value::{Array, Color, NonEmpty, Number, Parsed, Positive, Rotation};
use eagpt_scene::script::{ScriptFile, Spanned};
use eagpt_scene::{Result, ply};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::Path;

/// A script as its file has it.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ScriptKeys {
    #[serde(default)]
    up: Parsed<UpAxis>,
    #[serde(default)]
    selections: BTreeMap<String, Spanned<SelectorKeys>>,
    step: NonEmpty<Spanned<StepKeys>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct StepKeys {
    title: Option<String>,
    select: Option<Spanned<SelectorKeys>>,
    insert: Option<Spanned<ReadSurface>>,
    import: Option<Spanned<ImportKeys>>,
    set_light: Option<Spanned<LightKeys>>,
    #[serde(default)]
    allow_empty: bool,
    trim: Option<Spanned<Trim>>,
    #[serde(default)]
    then: Vec<Spanned<Action>>,
    #[serde(rename = "as")]
    group: Option<Spanned<String>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ImportKeys {
    file: Spanned<String>,
    select: Option<Spanned<SelectorKeys>>,
    scale: Option<Positive>,
    rotate: Option<Rotation>,
    #[serde(default)]
    about: Pivot,
    #[serde(rename = "move")]
    offset: Option<Array<Number, 3>>,
    to: Option<Array<Number, 3>>,
}

/// Names and patterns of lights, and their factors.
type LightKeys = BTreeMap<Spanned<String>, Color>;

/// Checks a script and reads the scenes it names.
pub(super) fn read(file: ScriptFile) -> Result<Script> {
    let keys: ScriptKeys = file.parse()?;
    let defined = keys.selections.keys().cloned().collect();
    let mut reader = Reader {
        file: &file,
        selectors: SelectorReader::new(&file, defined),
        assets: Vec::new(),
    };
    let selections = reader.selections(&keys)?;
    let mut steps = Vec::with_capacity(keys.step.0.len());
    for step in keys.step.0 {
        steps.push(reader.step(step, &selections)?);
    }
    let (assets, lamp_names) = (reader.assets, reader.selectors.lamps);
    Ok(Script {
        blake3: blake3::hash(file.text().as_bytes()).to_hex().to_string(),
        file,
        up: keys.up.0,
        selections,
        steps,
        assets,
        lamp_names,
        lamps: None,
        basis: None,
    })
}

/// Names and scenes that have been read so far.
struct Reader<'a> {
    file: &'a ScriptFile,
    selectors: SelectorReader<'a>,
    assets: Vec<Asset>,
}

impl Reader<'_> {
    /// The named selections, which may refer to names that steps give: those are there by the time
    /// a step uses them.
    fn selections(&mut self, keys: &ScriptKeys) -> Result<Definitions> {
        for (name, selector) in &keys.selections {
            if is_reserved(name) {
                let problem = "this name cannot be given";
                return Err(self.file.error(selector.span(), problem));
            }
        }
        for name in keys
            .step
            .0
            .iter()
            .filter_map(|step| step.get_ref().group.as_ref())
        {
            if is_reserved(name.get_ref()) {
                let problem = format!("`{}` is not a name that can be given", name.get_ref());
                return Err(self.file.error(name.span(), problem));
            }
            self.selectors.groups.insert(name.get_ref().clone());
        }
        let mut definitions = Definitions::new();
        for (name, selector) in &keys.selections {
            definitions.insert(name.clone(), self.selectors.selector(selector)?);
        }
        self.selectors.groups.clear();
        for (name, selector) in &keys.selections {
            let problem = selectors::circle(&definitions[name], &definitions, &mut vec![name]);
            if let Some(problem) = problem {
                return Err(self.file.error(selector.span(), problem));
            }
        }
        Ok(definitions)
    }

    fn step(&mut self, step: Spanned<StepKeys>, selections: &Definitions) -> Result<EditStep> {
        let (file, span) = (self.file, step.span());
        let StepKeys {
            title,
            select,
            insert,
            import,
            set_light,
            allow_empty,
            trim,
            then,
            group,
        } = step.into_inner();
        let (subject, subject_span) = match (select, insert, import, set_light) {
            (Some(keys), None, None, None) => (
                Subject::Select(self.selectors.selector(&keys)?),
                keys.span(),
            ),
            (None, Some(keys), None, None) => {
                let span = keys.span();
                (Subject::Insert(keys.into_inner().0), span)
            }
            (None, None, Some(keys), None) => {
                let span = keys.span();
                (self.import(keys.get_ref(), selections)?, span)
            }
            (None, None, None, Some(keys)) => {
                let span = keys.span();
                let set = keys.into_inner().into_iter();
                let set = set.map(|(pattern, Color(factor))| LightFactor { pattern, factor });
                (Subject::SetLight(set.collect()), span)
            }
            (None, None, None, None) => {
                let problem = "one of select, insert, import, set_light is missing";
                return Err(file.error(span, problem));
            }
            (_, insert, import, set_light) => {
                let spans = [
                    insert.map(|keys| keys.span()),
                    import.map(|keys| keys.span()),
                    set_light.map(|keys| keys.span()),
                ];
                let second = spans.into_iter().flatten().next().unwrap_or(span);
                let problem = "is one too many: only one of select, insert, import, set_light";
                return Err(file.error(second, problem));
            }
        };
        let trim = match trim {
            Some(trim) if subject.has_boundary(selections) => Some(trim.into_inner()),
            Some(trim) => {
                return Err(file.error(
                    trim.span(),
                    "there is no boundary to trim at: the selection has no box, sphere, half_space or cylinder",
                ));
            }
            None => None,
        };
        if then.is_empty() && matches!(subject, Subject::Select(_)) && trim.is_none() {
            let problem = "`then` is missing: nothing is done with the selection";
            return Err(file.error(span, problem));
        }
        let is_remove = |action: &&Spanned<Action>| *action.get_ref() == Action::Remove;
        if let Some(next) = then.iter().skip_while(|action| !is_remove(action)).nth(1) {
            let problem = "after `remove` there is nothing left to act on";
            return Err(file.error(next.span(), problem));
        }
        if let Some(name) = &group {
            if then.iter().any(|action| is_remove(&action)) {
                let problem = "what was removed cannot be referred to";
                return Err(file.error(name.span(), problem));
            }
            let text = name.get_ref();
            let SelectorReader {
                defined, groups, ..
            } = &mut self.selectors;
            if defined.contains(text) || !groups.insert(text.clone()) {
                let problem = format!("`{text}` is taken: names are given once");
                return Err(file.error(name.span(), problem));
            }
        }
        Ok(EditStep {
            span,
            title,
            subject,
            subject_span,
            allow_empty,
            trim,
            actions: then.into_iter().map(Spanned::into_inner).collect(),
            group: group.map(Spanned::into_inner),
        })
    }

    fn import(&mut self, keys: &ImportKeys, selections: &Definitions) -> Result<Subject> {
        let selector = match &keys.select {
            Some(select) => {
                let selector = self.selectors.selector(select)?;
                let is_group = |part: &Selector| matches!(part, Selector::Group(_));
                if selector.mentions(selections, &is_group) {
                    return Err(self.file.error(
                        select.span(),
                        "refers to Gaussians that a step of this script made, which the other scene does not have",
                    ));
                }
                let is_lamp = |part: &Selector| matches!(part, Selector::Lamp(_));
                if selector.mentions(selections, &is_lamp) {
                    return Err(self.file.error(
                        select.span(),
                        "refers to lamps of the scene that is edited, which the other scene does not have",
                    ));
                }
                selector
            }
            None => Selector::Everything,
        };
        let span = keys.file.span();
        let placement = PlacementKeys {
            scale: keys.scale,
            rotate: keys.rotate,
            about: keys.about,
            offset: keys.offset,
            to: keys.to,
        };
        Ok(Subject::Import {
            selector,
            placement: placement
                .try_into()
                .map_err(|problem: String| self.file.error(span, problem))?,
            asset: self.asset(&keys.file)?,
        })
    }

    /// The index of a scene, read if it has not been.
    fn asset(&mut self, name: &Spanned<String>) -> Result<usize> {
        let error = |problem: String| self.file.error(name.span(), problem);
        if name.get_ref().is_empty() {
            return Err(error("a file name may not be empty".to_owned()));
        }
        let folder = self.file.path().parent().unwrap_or(Path::new(""));
        let path = folder.join(name.get_ref());
        if let Some(index) = self.assets.iter().position(|asset| asset.path == path) {
            return Ok(index);
        }
        let bytes = std::fs::read(&path)
            .map_err(|problem| error(format!("{}: read: {problem}", path.display())))?;
        let gaussians = ply::read_gaussians(&path).map_err(|problem| error(problem.to_string()))?;
        self.assets.push(Asset {
            path,
            blake3: blake3::hash(&bytes).to_hex().to_string(),
            gaussians,
        });
        Ok(self.assets.len() - 1)
    }
}
