//! Reports of selections and steps.

use serde::Serialize;

/// Bounds of centres, scene units: lowest and highest corner.
pub type Bounds = [[f32; 3]; 2];

/// Matches of a named selection.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SelectionReport {
    /// Its name.
    pub name: String,
    /// Number of Gaussians.
    pub num_selected: usize,
    /// Their bounds; `None` if there are none.
    pub bounds: Option<Bounds>,
}

/// Effects of a step.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StepReport {
    /// Number of the step, from 0 as in the script's keys.
    pub step: usize,
    /// Line of the script.
    pub line: usize,
    /// Its title, if it has one.
    pub title: Option<String>,
    /// "select", "insert", "import" or "set_light".
    pub source: &'static str,
    /// Number of Gaussians that were selected, inserted or imported, or whose light was set.
    pub num_selected: usize,
    /// Their bounds before the actions; `None` if there were none.
    pub bounds: Option<Bounds>,
    /// Bounds of the same Gaussians after the step; `None` if they were removed.
    pub bounds_after: Option<Bounds>,
    /// Number of Gaussians made smaller by trimming.
    pub num_shrunk: usize,
    /// Number of Gaussians removed by trimming.
    pub num_dropped: usize,
    /// Number of Gaussians of the scene after the step.
    pub num_gaussians: usize,
}
