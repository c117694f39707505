//! Sections and keys of a project, as arguments of the commands that know them.

use super::{Capture, ORIGINAL, Options, Photographs, Relight, command, option, takes_path};
use anyhow::Result;
use clap::{Arg, ArgAction, Command};
use eagpt_scene::SceneError;
use eagpt_scene::script::{Node, Table};
use std::path::{Path, PathBuf};

/// Modes that `eagpt render` has.
const MODES: [&str; 3] = ["0-bounce", "1-bounce", "path"];

/// Turns keys and values into arguments of the command that knows them.
pub(super) struct Reader<'a> {
    pub(super) command: &'a Command,
    /// Folder of the project file.
    pub(super) here: &'a Path,
    /// Seed of every command that has one.
    pub(super) seed: Option<u32>,
}

/// Options that are for `eagpt run` to give.
const RESERVED: [&str; 12] = [
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
    "dry-run",
    "shard",
];

impl Reader<'_> {
    /// The seed of the project for a command that takes one.
    pub(super) fn seeded(&self, name: &str) -> Options {
        let takes_seed = self.find(name, "seed").is_some();
        let words = match self.seed.filter(|_| takes_seed) {
            Some(seed) => vec!["--seed".to_owned(), seed.to_string()],
            None => Vec::new(),
        };
        Options {
            words,
            paths: Vec::new(),
        }
    }

    fn find(&self, name: &str, long: &str) -> Option<&Arg> {
        option(command(self.command, name)?, long)
    }

    /// The options of a section that is called like its command.
    pub(super) fn section(&self, name: &str, node: &Node<'_>) -> Result<Options> {
        self.options(name, &[&node.any_table()?], &[])
    }

    /// The options that tables give to a command, a later one before an earlier; keys of `own` in
    /// the first are not the command's.
    fn options(&self, name: &str, tables: &[&Table<'_>], own: &[&str]) -> Result<Options> {
        let mut options = Options::default();
        if tables.iter().all(|table| table.get("seed").is_none()) {
            options = self.seeded(name);
        }
        for (index, table) in tables.iter().enumerate() {
            for (key, node) in table.entries() {
                if index == 0 && own.contains(&key) {
                    continue;
                }
                let long = key.replace('_', "-");
                let known = self
                    .find(name, &long)
                    .filter(|_| !RESERVED.contains(&long.as_str()));
                let Some(argument) = known else {
                    return Err(node.error(self.unknown(name)).into());
                };
                if tables[index + 1..]
                    .iter()
                    .all(|later| later.get(key).is_none())
                {
                    self.push(&mut options, argument, &format!("--{long}"), &node)?;
                }
            }
        }
        Ok(options)
    }

    fn unknown(&self, name: &str) -> String {
        let arguments = command(self.command, name)
            .into_iter()
            .flat_map(Command::get_arguments);
        let known: Vec<String> = arguments
            .filter(|argument| !argument.is_global_set())
            .filter_map(|argument| argument.get_long())
            .filter(|long| !RESERVED.contains(long))
            .map(|long| long.replace('-', "_"))
            .collect();
        format!(
            "no such option of `eagpt {name}`; it has {}",
            known.join(", ")
        )
    }

    fn push(
        &self,
        options: &mut Options,
        argument: &Arg,
        flag: &str,
        node: &Node<'_>,
    ) -> Result<()> {
        if matches!(argument.get_action(), ArgAction::SetTrue) {
            if node.flag()? {
                options.words.push(flag.to_owned());
            }
            return Ok(());
        }
        let is_path = takes_path(argument);
        let paths = &mut options.paths;
        let mut text = |node: &Node<'_>| -> Result<String, SceneError> {
            let text = node.scalar()?;
            if is_path {
                let path = self.here.join(&text);
                let text = path.display().to_string();
                paths.push(path);
                return Ok(text);
            }
            Ok(text)
        };
        let Ok(items) = node.array() else {
            let word = text(node)?;
            options.words.extend([flag.to_owned(), word]);
            return Ok(());
        };
        let items: Vec<String> = items.iter().map(&mut text).collect::<Result<_, _>>()?;
        if argument.get_value_delimiter().is_some() {
            options.words.extend([flag.to_owned(), items.join(",")]);
        } else if matches!(argument.get_action(), ArgAction::Append) {
            let words = items.into_iter().flat_map(|item| [flag.to_owned(), item]);
            options.words.extend(words);
        } else {
            return Err(node.error("takes one value, not several").into());
        }
        Ok(())
    }

    pub(super) fn capture(&self, root: &Table<'_>, photographs: Photographs) -> Result<Capture> {
        let section = |name: &str, command: &str, own: &[&str]| match root.get(name) {
            Some(node) => self.options(command, &[&node.any_table()?], own),
            None => Ok(self.seeded(command)),
        };
        let names = root
            .get("conditions")
            .map(|node| node.array())
            .transpose()?;
        let names = names.unwrap_or_default();
        let conditions: Vec<String> = names
            .iter()
            .map(|name| name.string().map(str::to_owned))
            .collect::<Result<_, SceneError>>()?;
        let model = match root.get("poses") {
            Some(node) => node.any_table()?.get("model"),
            None => None,
        };
        let model = model.map(|node| node.string()).transpose()?;
        Ok(Capture {
            photographs,
            conditions,
            ingest: section("ingest", "ingest", &[])?,
            model: model.map(|path| self.here.join(path)),
            colmap: section("colmap", "colmap run", &[])?,
            poses: section("poses", "colmap import", &["model"])?,
        })
    }

    pub(super) fn relight(&self, node: &Node<'_>) -> Result<Relight> {
        let table = node.table(&["name", "script", "reference", "condition", "split"])?;
        let name = table.need("name")?;
        let is_name = |text: &str| {
            let plain = |c: char| c.is_ascii_alphanumeric() || "-_".contains(c);
            !text.is_empty() && text != ORIGINAL && text.chars().all(plain)
        };
        if !is_name(name.string()?) {
            return Err(name
                .error(format!(
                    "`{}` is no name of letters, digits, - and _ other than `{ORIGINAL}`",
                    name.string()?
                ))
                .into());
        }
        let path = |key: &str| -> Result<Option<PathBuf>> {
            let node = table.get(key);
            let text = node.map(|node| node.string()).transpose()?;
            Ok(text.map(|text| self.here.join(text)))
        };
        table.need("script")?;
        Ok(Relight {
            name: name.string()?.to_owned(),
            script: path("script")?.unwrap_or_default(),
            reference: path("reference")?,
            condition: table
                .get("condition")
                .map(|node| node.string().map(str::to_owned))
                .transpose()?,
            split: table
                .get("split")
                .map(|node| node.string().map(str::to_owned))
                .transpose()?,
        })
    }

    /// `[render]` holds options of all modes and `modes`, `[render.path]` those of one mode.
    /// Returns the modes, and the options of 0-bounce whether it is one of them or not.
    pub(super) fn modes(&self, root: &Table<'_>) -> Result<(Vec<(String, Options)>, Options)> {
        let Some(node) = root.get("render") else {
            let seeded = |mode: &str| (mode.to_owned(), self.seeded("render"));
            return Ok((MODES.map(seeded).into(), self.seeded("render")));
        };
        let table = node.any_table()?;
        let names: Vec<String> = match table.get("modes") {
            None => MODES.map(str::to_owned).into(),
            Some(list) => list
                .array()?
                .iter()
                .map(|mode| match mode.string()? {
                    name if MODES.contains(&name) => Ok(name.to_owned()),
                    name => Err(mode.error(format!(
                        "`{name}` is no mode; there are {}",
                        MODES.join(", ")
                    ))),
                })
                .collect::<Result<_, SceneError>>()?,
        };
        let mut own = vec!["modes"];
        own.extend(MODES);
        let options = |name: &str| {
            let mut own = own.clone();
            // What is meant for all modes does not concern the one that samples no light.
            if name == "0-bounce" {
                own.push("denoise");
            }
            match table.get(name) {
                Some(special) => self.options("render", &[&table, &special.any_table()?], &own),
                None => self.options("render", &[&table], &own),
            }
        };
        let modes = names
            .into_iter()
            .map(|name| Ok((name.clone(), options(&name)?)));
        Ok((modes.collect::<Result<_>>()?, options("0-bounce")?))
    }
}
