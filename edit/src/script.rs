//! Edit scripts: what they hold, and their reader, which checks all of a script before anything is
//! touched.

mod actions;
mod selectors;
mod sources;

use crate::act::Action;
use crate::insert::Surface;
use crate::place::Placement;
use crate::select::{Definitions, Selector};
use crate::trim::Trim;
use eagpt_scene::dataset::UpAxis;
use eagpt_scene::script::{Node, Origin, Text};
use eagpt_scene::{Gaussians, Result, files};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// A script, checked, with the scenes it imports from.
#[derive(Debug, Clone, PartialEq)]
pub struct Script {
    /// The file it was read from.
    pub path: PathBuf,
    /// BLAKE3 digest of the file, hexadecimal.
    pub blake3: String,
    /// The world's up axis: what "base" and "floor" go by.
    pub up: UpAxis,
    /// Named selections.
    pub selections: Definitions,
    /// Steps in order.
    pub steps: Vec<Step>,
    /// Scenes that steps import from, each once.
    pub assets: Vec<Asset>,
}

/// Another scene.
#[derive(Debug, Clone, PartialEq)]
pub struct Asset {
    /// The file.
    pub path: PathBuf,
    /// BLAKE3 digest of the file, hexadecimal.
    pub blake3: String,
    /// Its content.
    pub gaussians: Gaussians,
}

/// A step: what, and then.
#[derive(Debug, Clone, PartialEq)]
pub struct Step {
    /// Where the step stands.
    pub origin: Origin,
    /// What a person reads about it.
    pub title: Option<String>,
    /// What it acts on.
    pub source: Source,
    /// Whether to go on if that is nothing.
    pub allow_empty: bool,
    /// What happens to Gaussians that cross the boundary of the selection; `None`: nothing.
    pub trim: Option<Trim>,
    /// What it does, in order.
    pub actions: Vec<Action>,
    /// The name by which later steps may select what this one acted on.
    pub group: Option<String>,
}

/// What a step acts on.
#[derive(Debug, Clone, PartialEq)]
pub enum Source {
    /// Gaussians of the scene.
    Select {
        /// Which.
        selector: Selector,
        /// Where the selection stands.
        origin: Origin,
    },
    /// A new surface.
    Insert {
        /// Its shape and material.
        surface: Surface,
        /// Where it stands.
        origin: Origin,
    },
    /// A copy of Gaussians of another scene.
    Import {
        /// Index into [`Script::assets`].
        asset: usize,
        /// Which of its Gaussians.
        selector: Selector,
        /// Where they go.
        placement: Placement,
        /// Where the import stands.
        origin: Origin,
    },
}

impl Script {
    /// Reads and checks a script, and reads the scenes it names; their paths are relative to the
    /// script's folder.
    ///
    /// # Errors
    /// [`eagpt_scene::SceneError`] naming file, line, key and value: no TOML, an unknown or missing
    /// key, a value of the wrong type or out of its range, a name that nothing has or two things
    /// have, selections that refer to each other in a circle, an asset that cannot be read.
    pub fn read(path: &Path) -> Result<Self> {
        let bytes = files::read(path)?;
        let text = Text::new(path, &bytes)?;
        let value = text.parse()?;
        Reader::default().script(text, &Node::root(text, &value), &bytes)
    }
}

/// What the reader has come across so far.
#[derive(Default)]
struct Reader {
    /// Names in `[selections]`.
    defined: BTreeSet<String>,
    /// Names given by steps that have been read.
    groups: BTreeSet<String>,
    assets: Vec<Asset>,
    num_clusters: usize,
}

impl Reader {
    fn script(mut self, text: Text<'_>, root: &Node<'_>, bytes: &[u8]) -> Result<Script> {
        let table = root.table(&["up", "selections", "step"])?;
        let up = match table.get("up") {
            Some(node) => node.string()?.parse().map_err(|e: String| node.error(e))?,
            None => UpAxis::default(),
        };
        let step_nodes = table.need("step")?.array()?;
        if step_nodes.is_empty() {
            return Err(table.need("step")?.error("there are no steps"));
        }
        let all_groups = group_names(&step_nodes)?;
        let selections = match table.get("selections") {
            Some(node) => self.selections(&node.any_table()?, all_groups)?,
            None => Definitions::new(),
        };
        let mut steps = Vec::with_capacity(step_nodes.len());
        for node in &step_nodes {
            steps.push(self.step(node, &selections, text.path())?);
        }
        Ok(Script {
            path: text.path().to_owned(),
            blake3: blake3::hash(bytes).to_hex().to_string(),
            up,
            selections,
            steps,
            assets: self.assets,
        })
    }

    fn step(&mut self, node: &Node<'_>, selections: &Definitions, path: &Path) -> Result<Step> {
        let table = node.table(&[
            "title",
            "select",
            "insert",
            "import",
            "allow_empty",
            "trim",
            "then",
            "as",
        ])?;
        let source = self.source(&table, selections, path)?;
        let trim = match table.get("trim") {
            Some(node) => Some(trim(&node, &source, selections)?),
            None => None,
        };
        let actions = match table.get("then") {
            Some(node) => actions::actions(&node)?,
            None => Vec::new(),
        };
        if actions.is_empty() && matches!(source, Source::Select { .. }) && trim.is_none() {
            return Err(node.error("`then` is missing: nothing is done with the selection"));
        }
        let group = match table.get("as") {
            Some(name) if actions.contains(&Action::Remove) => {
                return Err(name.error("what was removed cannot be referred to"));
            }
            Some(name) => Some(self.group(&name)?),
            None => None,
        };
        Ok(Step {
            origin: node.origin(),
            title: match table.get("title") {
                Some(title) => Some(title.string()?.to_owned()),
                None => None,
            },
            source,
            allow_empty: match table.get("allow_empty") {
                Some(flag) => flag.flag()?,
                None => false,
            },
            trim,
            actions,
            group,
        })
    }

    fn group(&mut self, node: &Node<'_>) -> Result<String> {
        let name = node.string()?.to_owned();
        if self.defined.contains(&name) || !self.groups.insert(name.clone()) {
            return Err(node.error(format!("`{name}` is taken: names are given once")));
        }
        Ok(name)
    }
}

/// All names that steps give: a selection may be defined by what a step will have made when it is
/// used.
fn group_names(steps: &[Node<'_>]) -> Result<BTreeSet<String>> {
    let mut names = BTreeSet::new();
    for step in steps {
        if let Some(name) = step.any_table()?.get("as") {
            let text = selectors::name(&name)?;
            names.insert(text.to_owned());
        }
    }
    Ok(names)
}

fn trim(node: &Node<'_>, source: &Source, selections: &Definitions) -> Result<Trim> {
    let trim = match node.string()? {
        "shrink" => Trim::Shrink,
        "drop" => Trim::Drop,
        other => return Err(node.error(format!("`{other}` is none of shrink, drop"))),
    };
    let is_shape = |part: &Selector| matches!(part, Selector::Shape(_));
    match source {
        Source::Select { selector, .. } | Source::Import { selector, .. }
            if selector.mentions(selections, &is_shape) =>
        {
            Ok(trim)
        }
        _ => Err(node.error(
            "there is no boundary to trim at: the selection has no box, sphere, half_space or cylinder",
        )),
    }
}
