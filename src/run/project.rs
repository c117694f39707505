//! The project file: a section for each step, whose keys are the options of a command.

mod reader;

use crate::command::JobCommand;
use anyhow::Result;
use clap::{Arg, Command};
use eagpt_scene::files;
use eagpt_scene::script::{Node, Text};
use reader::Reader;
use std::any::TypeId;
use std::path::{Path, PathBuf};

/// A project, its file checked as far as that goes without looking at what it names.
#[derive(Debug)]
pub(super) struct Project {
    /// The file.
    pub(super) path: PathBuf,
    /// Its content.
    pub(super) text: String,
    /// Folder for all results.
    pub(super) out: PathBuf,
    /// Where the photographs come from.
    pub(super) source: Source,
    /// A trained scene to take instead of training one.
    pub(super) scene: Option<PathBuf>,
    /// Options of `eagpt masks`; `None` if masks are to be those of the dataset.
    pub(super) masks: Option<Options>,
    /// Options of `eagpt normals`; `None` if normals are to be those of the dataset.
    pub(super) normals: Option<Options>,
    /// Options of `eagpt train`.
    pub(super) train: Options,
    /// Dataset whose cameras are rendered and whose images measure the result, if not those that
    /// are trained on.
    pub(super) measure: Option<PathBuf>,
    /// Changes of the light, to be rendered and, where there are references, measured.
    pub(super) relight: Vec<Relight>,
    /// Modes of rendering, in the order of the file, with their options of `eagpt render`.
    pub(super) modes: Vec<(String, Options)>,
    /// Options of `eagpt render` for scenes whose light is baked.
    pub(super) zero_bounce: Options,
    /// Options of `eagpt bake`; `None` if nothing is baked.
    pub(super) bake: Option<Options>,
    /// Options of `eagpt eval`.
    pub(super) eval: Options,
}

/// Where the photographs come from.
#[derive(Debug)]
pub(super) enum Source {
    /// A dataset that is there.
    Dataset(PathBuf),
    /// Photographs, of which a dataset is to be made.
    Capture(Box<Capture>),
}

/// RAW brackets.
#[derive(Debug)]
pub(super) enum Photographs {
    /// In a folder that is there.
    Taken(PathBuf),
    /// To be taken of a virtual room: the scene and options of `eagpt synth`.
    Simulated(String, Options),
}

/// Photographs of a room.
#[derive(Debug)]
pub(super) struct Capture {
    /// Where the RAW brackets are.
    pub(super) photographs: Photographs,
    /// Lightings, each a folder of the photographs; the first is the one to train on. Empty if
    /// there is but one.
    pub(super) conditions: Vec<String>,
    /// Options of `eagpt ingest`.
    pub(super) ingest: Options,
    /// Poses that are there already, a COLMAP model of the previews.
    pub(super) model: Option<PathBuf>,
    /// Options of `eagpt colmap run`, where there is no model.
    pub(super) colmap: Options,
    /// Options of `eagpt colmap import`.
    pub(super) poses: Options,
}

/// A change of the light.
#[derive(Debug)]
pub(super) struct Relight {
    /// Its name.
    pub(super) name: String,
    /// The edit script.
    pub(super) script: PathBuf,
    /// Dataset with what it should look like.
    pub(super) reference: Option<PathBuf>,
    /// Lighting of the capture that shows it.
    pub(super) condition: Option<String>,
    /// Views of the reference to measure; else the test views.
    pub(super) split: Option<String>,
}

/// Arguments of a command that a section of the project gives.
#[derive(Debug, Clone, Default)]
pub(super) struct Options {
    /// As typed.
    pub(super) words: Vec<String>,
    /// Files and folders among them.
    pub(super) paths: Vec<PathBuf>,
}

/// What a section of a project is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Part {
    /// Making a dataset of photographs.
    Capture,
    /// Making a scene of a dataset.
    Training,
    /// What is made of a scene.
    Results,
}

/// Sections of a project: name, command whose options it holds, what it is for.
pub(super) const SECTIONS: [(&str, &str, Part); 10] = [
    ("synth", "synth", Part::Capture),
    ("ingest", "ingest", Part::Capture),
    ("colmap", "colmap run", Part::Capture),
    ("poses", "colmap import", Part::Capture),
    ("masks", "masks", Part::Training),
    ("normals", "normals", Part::Training),
    ("train", "train", Part::Training),
    ("render", "render", Part::Results),
    ("bake", "bake", Part::Results),
    ("eval", "eval", Part::Results),
];

/// Keys of a project that are no sections.
const KEYS: [&str; 9] = [
    "out",
    "seed",
    "dataset",
    "capture",
    "simulate",
    "conditions",
    "measure",
    "scene",
    "relight",
];

/// Names of the sections that are for a part of the chain.
pub(crate) fn sections(of: Part) -> impl Iterator<Item = &'static str> {
    let mine = SECTIONS.iter().filter(move |(.., part)| *part == of);
    mine.map(|(name, ..)| *name)
}

/// A command by its name, as `colmap import`.
pub(super) fn command<'a>(program: &'a Command, name: &str) -> Option<&'a Command> {
    let mut words = name.split(' ');
    words.try_fold(program, |command, word| command.find_subcommand(word))
}

/// An option of a command by its long name.
pub(super) fn option<'a>(command: &'a Command, long: &str) -> Option<&'a Arg> {
    let mut arguments = command.get_arguments();
    arguments.find(|argument| argument.get_long() == Some(long))
}

/// Whether an option takes paths.
pub(super) fn takes_path(option: &Arg) -> bool {
    option.get_value_parser().type_id() == TypeId::of::<PathBuf>()
}

/// Name of the condition that was photographed.
pub(crate) const ORIGINAL: &str = "original";

impl Project {
    /// Reads a project file; `out` goes before what it says itself. Paths in it are relative to its
    /// folder.
    pub(super) fn read(path: &Path, out: Option<&Path>) -> Result<Self> {
        Self::parse(path, &files::read(path)?, out)
    }

    /// As [`Self::read`] for a file's content.
    pub(super) fn parse(path: &Path, bytes: &[u8], out: Option<&Path>) -> Result<Self> {
        let text = Text::new(path, bytes)?;
        let value = text.parse()?;
        let keys: Vec<&str> = KEYS
            .into_iter()
            .chain(SECTIONS.iter().map(|(name, ..)| *name))
            .collect();
        let root = Node::root(text, &value).table(&keys)?;
        let here = path.parent().unwrap_or(Path::new(""));
        let at = |node: Node<'_>| -> Result<PathBuf> { Ok(here.join(node.string()?)) };
        let command = JobCommand::program();
        let reader = Reader {
            command: &command,
            here,
            seed: root
                .get("seed")
                .map(|node| node.whole(0..=u32::MAX))
                .transpose()?,
        };
        let out = match (out, root.get("out")) {
            (Some(out), _) => out.to_owned(),
            (None, Some(node)) => at(node)?,
            (None, None) => path.with_extension(""),
        };
        let section = |name: &str| match root.get(name) {
            Some(node) => reader.section(name, &node).map(Some),
            None => Ok(None),
        };
        let source = match root.one_of(&["dataset", "capture", "simulate"])? {
            ("dataset", node) => {
                let mut only_of_captures = sections(Part::Capture).chain(["conditions"]);
                if let Some(stray) = only_of_captures.find_map(|key| root.get(key)) {
                    return Err(stray.error("is for a capture, not for a dataset").into());
                }
                Source::Dataset(at(node)?)
            }
            ("capture", node) => Source::Capture(Box::new(
                reader.capture(&root, Photographs::Taken(at(node)?))?,
            )),
            (_, node) => {
                let options = section("synth")?.unwrap_or_else(|| reader.seeded("synth"));
                let scene = match node.string()? {
                    // A name is that of a scene that comes with the program.
                    name if !name.contains(['/', '.']) => name.to_owned(),
                    path => here.join(path).display().to_string(),
                };
                let photographs = Photographs::Simulated(scene, options);
                Source::Capture(Box::new(reader.capture(&root, photographs)?))
            }
        };
        let scene = root.get("scene").map(at).transpose()?;
        let of_training = sections(Part::Training).find_map(|key| root.get(key));
        if let (Some(_), Some(stray)) = (&scene, of_training) {
            let problem = "is for a scene to be trained, but `scene` names one that is";
            return Err(stray.error(problem).into());
        }
        let (modes, zero_bounce) = reader.modes(&root)?;
        let relight = root.get("relight").map(|node| node.array()).transpose()?;
        let relight = relight.unwrap_or_default();
        let relight: Vec<Relight> = relight
            .iter()
            .map(|node| reader.relight(node))
            .collect::<Result<_>>()?;
        if let Some((twice, node)) = relight.iter().enumerate().find_map(|(i, one)| {
            let twice = relight[..i].iter().any(|other| other.name == one.name);
            twice.then_some((&one.name, root.get("relight")?))
        }) {
            return Err(node
                .error(format!("two conditions are called `{twice}`"))
                .into());
        }
        Ok(Self {
            path: path.to_owned(),
            text: String::from_utf8_lossy(bytes).into_owned(),
            out,
            source,
            measure: root.get("measure").map(at).transpose()?,
            scene,
            masks: section("masks")?,
            normals: section("normals")?,
            train: section("train")?.unwrap_or_else(|| reader.seeded("train")),
            modes,
            zero_bounce,
            bake: section("bake")?,
            eval: section("eval")?.unwrap_or_default(),
            relight,
        })
    }
}
