//! What a replay tells about selections and steps.

use serde::Serialize;

/// Bounds of centres, scene units: lowest and highest corner.
pub type Bounds = [[f32; 3]; 2];

/// What a named selection finds.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SelectionReport {
    /// Its name.
    pub name: String,
    /// Number of Gaussians.
    pub num_selected: usize,
    /// Where they are; `None` if there are none.
    pub bounds: Option<Bounds>,
}

/// What a step did.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StepReport {
    /// Number of the step, from 0 as in the script's keys.
    pub step: usize,
    /// Line of the script.
    pub line: usize,
    /// Its title, if it has one.
    pub title: Option<String>,
    /// "select", "insert" or "import".
    pub source: &'static str,
    /// Number of Gaussians that were selected, inserted or imported.
    pub num_selected: usize,
    /// Where they were before the actions; `None` if there were none.
    pub bounds: Option<Bounds>,
    /// Where what the step acted on was at its end; `None` if it is gone.
    pub bounds_after: Option<Bounds>,
    /// Number of Gaussians made smaller by trimming.
    pub num_shrunk: usize,
    /// Number of Gaussians removed by trimming.
    pub num_dropped: usize,
    /// Number of Gaussians of the scene after the step.
    pub num_gaussians: usize,
}
