//! Edit scripts and their reader, which checks all of a script before the scene is touched.

mod actions;
mod reader;
mod selectors;
mod shapes;
mod surfaces;

use crate::act::Action;
use crate::lights::{self, LightFactor};
use crate::place::Placement;
use crate::select::{Definitions, Selector};
use crate::trim::Trim;
use eagpt_scene::dataset::UpAxis;
use eagpt_scene::discs::Surface;
use eagpt_scene::script::{ScriptFile, Spanned};
use eagpt_scene::{Gaussians, Lamps, LightBasis, Result};
use std::ops::Range;
use std::path::{Path, PathBuf};

/// A script, checked, with the scenes it imports from.
#[derive(Debug, Clone, PartialEq)]
pub struct Script {
    /// The file it was read from.
    pub file: ScriptFile,
    /// BLAKE3 digest of the file, hexadecimal.
    pub blake3: String,
    /// The world's up axis, which "base" and "floor" refer to.
    pub(crate) up: UpAxis,
    /// Named selections.
    pub(crate) selections: Definitions,
    /// Steps in order.
    pub steps: Vec<EditStep>,
    /// Scenes that steps import from, each once.
    pub assets: Vec<Asset>,
    /// Names and patterns of lamps that selectors refer to, with their places in the file.
    pub(crate) lamp_names: Vec<Spanned<String>>,
    /// Lamps of the scene to be edited, once they are known.
    pub(crate) lamps: Option<Lamps>,
    /// Light of the scene to be edited by its lamps, once it is known.
    pub(crate) basis: Option<LightBasis>,
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

/// A step of a script.
#[derive(Debug, Clone, PartialEq)]
pub struct EditStep {
    /// Place of the step in the file.
    pub(crate) span: Range<usize>,
    /// Description for people.
    pub title: Option<String>,
    /// Gaussians that it acts on.
    pub(crate) subject: Subject,
    /// Place of their selector, surface or import in the file.
    pub(crate) subject_span: Range<usize>,
    /// Whether to continue if there are none.
    pub(crate) allow_empty: bool,
    /// Treatment of Gaussians that cross the boundary of the selection; `None`: none.
    pub(crate) trim: Option<Trim>,
    /// Actions in order.
    pub(crate) actions: Vec<Action>,
    /// The name by which later steps may select the Gaussians of this one.
    pub(crate) group: Option<String>,
}

/// Gaussians that a step acts on.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Subject {
    /// Gaussians of the scene.
    Select(Selector),
    /// A new surface.
    Insert(Surface),
    /// A copy of Gaussians of another scene.
    Import {
        /// Index into [`Script::assets`].
        asset: usize,
        /// Selection among its Gaussians.
        selector: Selector,
        /// Placement of the copy.
        placement: Placement,
    },
    /// Emitters of some lights, whose light changes, and with it that of the scene.
    SetLight(Vec<LightFactor>),
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
        Self::of_file(ScriptFile::read(path)?)
    }

    /// As [`Self::read`], of a script in memory.
    ///
    /// # Errors
    /// As [`Self::read`], but that the file is there.
    pub fn of_file(file: ScriptFile) -> Result<Self> {
        reader::read(file)
    }

    /// Whether a selector refers to lamps: such a script is replayed after [`Self::set_lamps`].
    pub fn needs_lamps(&self) -> bool {
        !self.lamp_names.is_empty()
    }

    /// Sets the lamps of the scene that will be edited.
    ///
    /// # Errors
    /// [`eagpt_scene::SceneError::Script`] with file, line and key of a name or pattern that no
    /// lamp has; it lists the names there are.
    pub fn set_lamps(&mut self, lamps: Lamps) -> Result<()> {
        for name in &self.lamp_names {
            let pattern = name.get_ref();
            if lamps.matching(pattern).is_empty() {
                let there: Vec<&str> = lamps.names().collect();
                let there = match there.len() {
                    0 => "the scene has none".to_owned(),
                    _ => format!("there are {}", there.join(", ")),
                };
                let problem = format!("`{pattern}` is no lamp: {there}");
                return Err(self.file.error(name.span(), problem));
            }
        }
        self.lamps = Some(lamps);
        Ok(())
    }

    /// Whether a step sets lights: such a script is replayed after [`Self::set_basis`].
    pub fn needs_basis(&self) -> bool {
        self.light_steps().next().is_some()
    }

    /// Sets the light of the scene that will be edited, by its lamps.
    ///
    /// # Errors
    /// [`eagpt_scene::SceneError::Script`] with file, line and key of a name or pattern that no
    /// light has, or of two patterns for one light.
    pub fn set_basis(&mut self, basis: LightBasis) -> Result<()> {
        for (_, set) in self.light_steps() {
            lights::factors(&basis, set)
                .map_err(|(span, problem)| self.file.error(span, problem))?;
        }
        self.basis = Some(basis);
        Ok(())
    }

    /// Steps that set lights.
    pub(crate) fn light_steps(&self) -> impl Iterator<Item = (&EditStep, &[LightFactor])> {
        self.steps.iter().filter_map(|step| match &step.subject {
            Subject::SetLight(set) => Some((step, set.as_slice())),
            _ => None,
        })
    }
}

impl Subject {
    /// Whether regions limit the selection.
    fn has_boundary(&self, selections: &Definitions) -> bool {
        let is_shape = |part: &Selector| matches!(part, Selector::Shape(_));
        match self {
            Self::Select(selector) | Self::Import { selector, .. } => {
                selector.mentions(selections, &is_shape)
            }
            Self::Insert(_) | Self::SetLight(_) => false,
        }
    }
}
