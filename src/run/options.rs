//! Options of commands from the sections of a project.

use super::project::{MODES, Project, mode_name};
use super::section::{MODEL, Section, SectionKind, argument, for_each_path};
use crate::command_line;
use crate::render::{Mode, RenderArgs};
use anyhow::Result;
use clap::error::{ContextKind, ContextValue};
use clap::{Args, Command, ValueEnum};
use std::path::PathBuf;
use toml::Value;

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
        let kind = SectionKind::of(section);
        let command = kind.clap_command();
        let mut words: Vec<String> = kind.given.iter().map(|word| (*word).to_owned()).collect();
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
            let known = known.ok_or_else(|| self.error(&place, unknown(kind.command, &command)))?;
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
