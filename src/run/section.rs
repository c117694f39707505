//! Sections of a project: tables whose keys are the options of a command, with `_` for `-`.

use super::project::{MODES, Project, mode_name};
use crate::command::JobCommand;
use crate::command_line;
use crate::render::{Mode, RenderArgs};
use anyhow::Result;
use clap::error::{ContextKind, ContextValue};
use clap::{Arg, Args, Command, ValueEnum};
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

/// Sections: name, command whose options it holds, stage, and arguments that stand for those that
/// a run fills in.
const SECTIONS: [(&str, &str, Part, &[&str]); 10] = [
    ("synth", "synth", Part::Capture, IN_AND_OUT),
    ("ingest", "ingest", Part::Capture, IN_AND_OUT),
    ("colmap", "colmap run", Part::Capture, IN_AND_OUT),
    ("poses", "colmap import", Part::Capture, IN_AND_OUT),
    ("masks", "masks", Part::Training, &["-"]),
    ("normals", "normals", Part::Training, &["-"]),
    ("train", "train", Part::Training, IN_AND_OUT),
    ("render", "render", Part::Results, RENDER),
    ("bake", "bake", Part::Results, BAKE),
    ("eval", "eval", Part::Results, EVAL),
];

/// Options that are for `eagpt run` to give.
const RESERVED: [&str; 14] = [
    "out",
    "force",
    "resume",
    "cameras",
    "reference",
    "mode",
    "name",
    "json",
    "images",
    "conditions",
    "dry_run",
    "shard",
    "view",
    "view_port",
];

fn find(section: &str) -> &'static (&'static str, &'static str, Part, &'static [&'static str]) {
    let found = SECTIONS.iter().find(|known| known.0 == section);
    found.expect("sections are named by the fields of ProjectFile")
}

/// Stage of the chain that a section belongs to.
pub(crate) fn part(section: &str) -> Part {
    find(section).2
}

/// The command of a section.
fn command(section: &str) -> Command {
    let names = find(section).1.split(' ');
    names.fold(JobCommand::program(), |command, name| {
        let found = command.find_subcommand(name).cloned();
        found.expect("sections name commands of the program")
    })
}

/// The argument of a command for a key.
fn argument<'a>(command: &'a Command, key: &str) -> Option<&'a Arg> {
    let mut arguments = command.get_arguments();
    arguments.find(|one| one.get_id() == key && one.get_long().is_some())
}

/// Resolves the paths of a section.
pub(super) fn resolve(name: &str, section: &mut Section, folder: &Path) {
    for_each_path(&command(name), section, &mut |path| {
        *path = folder.join(&*path).display().to_string();
    });
}

/// Calls `visit` with every path of a section, also in lists and in the tables of modes.
fn for_each_path(command: &Command, section: &mut Section, visit: &mut dyn FnMut(&mut String)) {
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

/// Options that a project gives to a command.
#[derive(Debug)]
pub(super) struct Options<A> {
    pub(super) args: A,
    /// Files and folders among them.
    pub(super) paths: Vec<PathBuf>,
}

impl Project {
    /// The options of a section; defaults if it is not there.
    ///
    /// # Errors
    /// Naming line, key and value of what the command does not take.
    pub(super) fn options<A: Args>(&self, name: &str) -> Result<Options<A>> {
        let mut file = self.file.clone();
        let section = file.sections_mut().into_iter().find(|(of, _)| *of == name);
        let section = section.and_then(|(_, section)| section.take());
        let entries = section.iter().flatten();
        let entries = entries.filter(|(key, _)| (name, key.as_str()) != ("poses", MODEL));
        self.parse_options(name, entries.map(|(key, value)| (vec![name, key], value)))
    }

    /// The options of `[render]` for a mode: those for all, and those of `[render.MODE]` in their
    /// place. Denoising for all modes does not concern the one without noise.
    ///
    /// # Errors
    /// As [`Self::options`].
    pub(super) fn render_options(&self, mode: Mode) -> Result<Options<RenderArgs>> {
        let name = mode_name(&mode);
        let modes: Vec<String> = Mode::value_variants().iter().map(mode_name).collect();
        let all = self.file.render.iter().flatten();
        let special = self.file.render.as_ref().and_then(|of| of.get(&name));
        let special = match special {
            Some(Value::Table(table)) => Some(table),
            Some(other) => {
                let problem = format!("{other} is no table");
                return Err(self.error(&["render", &name], problem).into());
            }
            None => None,
        };
        let for_all = all.filter(|(key, _)| {
            *key != MODES
                && !modes.contains(key)
                && (mode != Mode::ZeroBounce || *key != "denoise")
                && special.is_none_or(|table| !table.contains_key(*key))
        });
        let for_all = for_all.map(|(key, value)| (vec!["render", key], value));
        let own = special.into_iter().flatten();
        let own = own.map(|(key, value)| (vec!["render", &name, key], value));
        self.parse_options("render", for_all.chain(own))
    }

    /// Parses entries with clap, which knows types, ranges and conflicts of options.
    fn parse_options<'a, A: Args>(
        &self,
        section: &str,
        entries: impl Iterator<Item = (Vec<&'a str>, &'a Value)>,
    ) -> Result<Options<A>> {
        let command = command(section);
        let (_, name, _, given) = find(section);
        let mut words: Vec<String> = given.iter().map(|word| (*word).to_owned()).collect();
        let mut places: Vec<Vec<&str>> = Vec::new();
        let mut values = Section::new();
        let entries: Vec<_> = entries.collect();
        let seed = self.file.seed.map(|seed| Value::from(i64::from(seed)));
        let has_seed = argument(&command, "seed").is_some()
            && !entries
                .iter()
                .any(|(place, _)| place.last() == Some(&"seed"));
        let seed = seed.iter().filter(|_| has_seed);
        for (place, value) in seed.map(|seed| (vec!["seed"], seed)).chain(entries) {
            let key = *place.last().expect("a key was put there");
            let known = argument(&command, key).filter(|_| !RESERVED.contains(&key));
            let known = known.ok_or_else(|| self.error(&place, unknown(name, &command)))?;
            let json = serde_json::to_value(value)?;
            command_line::push_option(&mut words, known, &json)
                .map_err(|problem| self.error(&place, problem))?;
            values.insert(key.to_owned(), value.clone());
            places.push(place);
        }
        let mut paths = Vec::new();
        for_each_path(&command, &mut values, &mut |path| {
            paths.push(PathBuf::from(&*path));
        });
        let parsed = command.no_binary_name(true).try_get_matches_from(words);
        let args = parsed.and_then(|matches| A::from_arg_matches(&matches));
        let args = args.map_err(|error| {
            let key = key_of(&error);
            let place = places
                .iter()
                .find(|place| place.last() == key.as_deref().as_ref());
            let place = place.cloned().unwrap_or_else(|| vec![section]);
            self.error(&place, message(&error))
        })?;
        Ok(Options { args, paths })
    }
}

fn unknown(name: &str, command: &Command) -> String {
    let keys = command.get_arguments().filter(|of| of.get_long().is_some());
    let keys = keys.map(|argument| argument.get_id().as_str());
    let keys: Vec<&str> = keys.filter(|key| !RESERVED.contains(key)).collect();
    let keys = keys.join(", ");
    format!("no such option of `eagpt {name}`; it has {keys}")
}

/// The key of the option that clap complains of.
fn key_of(error: &clap::Error) -> Option<String> {
    let shown = match error.get(ContextKind::InvalidArg)? {
        ContextValue::String(shown) => shown,
        ContextValue::Strings(all) => all.first()?,
        _ => return None,
    };
    let long = shown.strip_prefix("--")?.split([' ', '=']).next()?;
    Some(long.replace('-', "_"))
}

/// The first paragraph of an error of clap, in one line.
fn message(error: &clap::Error) -> String {
    let text = error.to_string();
    let text = text.trim_start_matches("error: ");
    let lines = text.lines().take_while(|line| !line.is_empty());
    lines.map(str::trim).collect::<Vec<_>>().join(" ")
}

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
