//! Content of the page.

use crate::lamps::LampTable;
use crate::pages::ScenePage;
use crate::picture::Picture;
use serde::Serialize;
use std::collections::BTreeMap;

/// Everything on the page.
#[derive(Debug, Default, Serialize)]
pub struct Content {
    /// Name of the run.
    pub title: String,
    /// Version of the program.
    pub version: String,
    /// A few numbers that say what it was.
    pub facts: Vec<Fact>,
    /// Pages of the run's scenes.
    pub pages: Vec<ScenePage>,
    /// Modes and conditions, if anything was measured.
    pub overview: Option<Overview>,
    /// Lights, the photographed one first.
    pub conditions: Vec<Condition>,
    /// Pictures of geometry and material.
    pub layers: Vec<Gallery>,
    /// Pictures of emission masks.
    pub masks: Vec<Gallery>,
    /// Lamps that training has found.
    pub lamps: Option<LampTable>,
    /// Loss curves.
    pub curves: Vec<Curve>,
    /// Commands that were run.
    pub steps: Vec<Step>,
    /// Time of all steps together.
    pub total_time: String,
    /// Notes for the reader.
    pub warnings: Vec<String>,
    /// The project file.
    pub project: String,
    /// Descriptions of the metrics, by key.
    pub definitions: BTreeMap<String, String>,
}

/// A number with its name.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Fact {
    /// Description.
    pub label: String,
    /// The number, rounded, with its unit.
    pub value: String,
}

/// The table of modes and conditions.
#[derive(Debug, Serialize)]
pub struct Overview {
    /// Names of the conditions.
    pub conditions: Vec<String>,
    /// Headings below each condition.
    pub headings: Vec<&'static str>,
    /// Rows: mode, a cell for each condition and heading, seconds a frame.
    pub rows: Vec<OverviewRow>,
    /// The same for a paper.
    pub latex: String,
    /// The same for a README.
    pub markdown: String,
}

/// A row of the table.
#[derive(Debug, Serialize)]
pub struct OverviewRow {
    /// The mode.
    pub name: String,
    /// Rounded values, a dash where nothing was measured.
    pub cells: Vec<String>,
    /// Seconds a frame.
    pub seconds: String,
}

/// Renderings of one light.
#[derive(Debug, Serialize)]
pub struct Condition {
    /// Its name.
    pub name: String,
    /// Whether there is something to compare with.
    pub has_reference: bool,
    /// Means of each mode.
    pub modes: Vec<Mode>,
    /// Views with their pictures.
    pub views: Vec<View>,
    /// Views that were rendered.
    pub num_views: usize,
}

/// Means of a mode.
#[derive(Debug, Serialize)]
pub struct Mode {
    /// Its name.
    pub name: String,
    /// Metrics.
    pub metrics: Vec<Fact>,
}

/// A view.
#[derive(Debug, Serialize)]
pub struct View {
    /// Its name.
    pub name: String,
    /// Reference image.
    pub reference: Option<Picture>,
    /// Rendering of each mode.
    pub shots: Vec<Shot>,
}

/// A rendering.
#[derive(Debug, Serialize)]
pub struct Shot {
    /// Its mode.
    pub mode: String,
    /// The rendering.
    pub picture: Picture,
    /// HDR-FLIP error.
    pub flip: Option<Picture>,
    /// Metrics of this view.
    pub metrics: Vec<Fact>,
}

/// Pictures with a heading.
#[derive(Debug, Serialize)]
pub struct Gallery {
    /// The heading.
    pub title: String,
    /// Notes about them.
    pub text: String,
    /// Name and picture of views.
    pub pictures: Vec<(String, Picture)>,
}

/// A loss curve.
#[derive(Debug, Serialize)]
pub struct Curve {
    /// The trained scene.
    pub stage: String,
    /// SVG.
    pub svg: String,
}

/// A step of the run.
#[derive(Debug, Serialize)]
pub struct Step {
    /// Its name.
    pub name: String,
    /// Its command.
    pub command: String,
    /// Wall time.
    pub time: String,
    /// Memory.
    pub memory: String,
    /// Products with the first digits of their digests.
    pub products: Vec<(String, String)>,
}
