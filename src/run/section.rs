//! Sections of a project: tables whose keys are the options of a command, with `_` for `-`.

use crate::bake::BakeArgs;
use crate::colmap::{ImportArgs, RunArgs};
use crate::eval::EvalArgs;
use crate::ingest::IngestArgs;
use crate::masks::MasksArgs;
use crate::normals::NormalsArgs;
use crate::render::RenderArgs;
use crate::synth::SynthArgs;
use crate::train::TrainArgs;
use clap::{Arg, Args, Command};
use eagpt_scene::SceneError;
use eagpt_scene::script::{ScriptFile, Spanned};
use std::any::TypeId;
use std::path::{Path, PathBuf};
use toml::Value;
use toml::de::{DeTable, DeValue};

/// A section as it stands in the file.
pub(crate) type Section = toml::Table;

/// Stage of the chain that a section belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Part {
    /// Making a dataset of photographs.
    Capture,
    /// Making a scene of a dataset.
    Training,
    /// Products of a scene.
    Results,
}

/// Arguments that stand for an input and a folder for results.
const IN_AND_OUT: &[&str] = &["-", "--out", "-"];
const RENDER: &[&str] = &["-", "--cameras", "-", "--mode", "path", "--out", "-"];
const BAKE: &[&str] = &["-", "--cameras", "-", "--out", "-"];
const EVAL: &[&str] = &["-", "--reference", "-", "--out", "-"];

/// A kind of section.
pub(super) struct SectionKind {
    name: &'static str,
    /// The command whose options it holds.
    pub(super) command: &'static str,
    part: Part,
    /// Arguments that stand for those that a run fills in.
    pub(super) given: &'static [&'static str],
    /// The options.
    options: fn(Command) -> Command,
}

const fn kind<A: Args>(
    name: &'static str,
    command: &'static str,
    part: Part,
    given: &'static [&'static str],
) -> SectionKind {
    SectionKind {
        name,
        command,
        part,
        given,
        options: A::augment_args,
    }
}

const KINDS: [SectionKind; 10] = [
    kind::<SynthArgs>("synth", "synth", Part::Capture, IN_AND_OUT),
    kind::<IngestArgs>("ingest", "ingest", Part::Capture, IN_AND_OUT),
    kind::<RunArgs>("colmap", "colmap run", Part::Capture, IN_AND_OUT),
    kind::<ImportArgs>("poses", "colmap import", Part::Capture, IN_AND_OUT),
    kind::<MasksArgs>("masks", "masks", Part::Training, &["-"]),
    kind::<NormalsArgs>("normals", "normals", Part::Training, &["-"]),
    kind::<TrainArgs>("train", "train", Part::Training, IN_AND_OUT),
    kind::<RenderArgs>("render", "render", Part::Results, RENDER),
    kind::<BakeArgs>("bake", "bake", Part::Results, BAKE),
    kind::<EvalArgs>("eval", "eval", Part::Results, EVAL),
];

impl SectionKind {
    /// The kind of a section of this name.
    pub(super) fn of(name: &str) -> &'static Self {
        let found = KINDS.iter().find(|kind| kind.name == name);
        found.expect("sections are named by the fields of ProjectFile")
    }

    /// The options as a command of clap.
    pub(super) fn clap_command(&self) -> Command {
        (self.options)(Command::new(self.command))
    }
}

/// Stage of the chain that a section belongs to.
pub(crate) fn part(section: &str) -> Part {
    SectionKind::of(section).part
}

/// The argument of a command for a key.
pub(super) fn argument<'a>(command: &'a Command, key: &str) -> Option<&'a Arg> {
    let mut arguments = command.get_arguments();
    arguments.find(|one| one.get_id() == key && one.get_long().is_some())
}

/// Resolves the paths of a section.
pub(super) fn resolve(name: &str, section: &mut Section, folder: &Path) {
    for_each_path(
        &SectionKind::of(name).clap_command(),
        section,
        &mut |path| {
            *path = folder.join(&*path).display().to_string();
        },
    );
}

/// Calls `visit` with every path of a section, also in lists and in the tables of modes.
pub(super) fn for_each_path(
    command: &Command,
    section: &mut Section,
    visit: &mut dyn FnMut(&mut String),
) {
    let is_path = |key: &str| {
        let type_id = argument(command, key).map(|of| of.get_value_parser().type_id());
        type_id.is_some_and(|id| id == TypeId::of::<PathBuf>()) || key == MODEL
    };
    for (key, value) in section {
        match value {
            Value::Table(inner) => for_each_path(command, inner, visit),
            Value::String(text) if is_path(key) => visit(text),
            Value::Array(items) if is_path(key) => {
                for item in items {
                    if let Value::String(text) = item {
                        visit(text);
                    }
                }
            }
            _ => {}
        }
    }
}

/// Key of `[poses]` for a COLMAP model that is there already.
pub(super) const MODEL: &str = "model";

/// An error about the value at `keys`, or about the file if there is none.
pub(super) fn error(script: &ScriptFile, keys: &[&str], problem: impl Into<String>) -> SceneError {
    let mut span = 0..0;
    if let Ok(root) = DeTable::parse(script.text()) {
        let root = Spanned::new(root.span(), DeValue::Table(root.into_inner()));
        let mut value = Some(&root);
        for key in keys {
            value = value.and_then(|value| match value.get_ref() {
                DeValue::Table(table) => table.get(*key),
                DeValue::Array(items) => items.get(key.parse::<usize>().ok()?),
                _ => None,
            });
        }
        span = value
            .filter(|_| !keys.is_empty())
            .map_or(span, Spanned::span);
    }
    script.error(span, problem)
}
