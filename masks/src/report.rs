//! The report, for people and for programs.

use crate::consistency::{Support, Verdict};
use crate::level::Level;
use crate::options::MaskOptions;
use eagpt_scene::{Result, SceneError, files};
use serde::Serialize;
use std::fmt::Write as _;
use std::path::Path;

/// Report of all views.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MaskReport {
    /// Effective options.
    pub options: MaskOptions,
    /// The level of linear radiance that was used, if there was one.
    pub threshold: Option<f32>,
    /// Details of the level, if it was found automatically.
    pub level: Option<Level>,
    /// Each view, in the order of the dataset.
    pub views: Vec<ViewReport>,
    /// Each region of each view, those that were dropped included.
    pub regions: Vec<RegionReport>,
}

/// One view.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ViewReport {
    /// Its name.
    pub name: String,
    /// Verdict on its mask.
    pub verdict: ViewVerdict,
    /// Pixels in its mask; null without a mask.
    pub num_pixels: Option<u64>,
    /// Their share of the image.
    pub coverage: Option<f64>,
    /// Regions in its mask, those that were dropped left out.
    pub num_regions: usize,
    /// Whether it has a label.
    pub labelled: bool,
    /// Regions that other views do not confirm.
    pub num_inconsistent: usize,
    /// Share of the places in confirmed regions that it sees and does not mask; null if below the
    /// limit.
    pub missed: Option<f64>,
}

/// Verdict on a view's mask.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum ViewVerdict {
    /// There is a mask, and other views do not object.
    Good,
    /// The mask is empty: no emitter is seen.
    Empty,
    /// There is no mask: nothing is known.
    Unknown,
    /// Other views do not confirm some of its regions.
    Inconsistent,
    /// Other views show a lamp where it has none.
    Incomplete,
}

impl ViewVerdict {
    /// The name used in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Good => "good",
            Self::Empty => "empty",
            Self::Unknown => "unknown",
            Self::Inconsistent => "inconsistent",
            Self::Incomplete => "incomplete",
        }
    }
}

impl ViewReport {
    /// The verdict that follows from the numbers.
    pub(crate) fn judge(&self) -> ViewVerdict {
        match self {
            Self {
                num_pixels: None, ..
            } => ViewVerdict::Unknown,
            Self {
                missed: Some(_), ..
            } => ViewVerdict::Incomplete,
            view if view.num_inconsistent > 0 => ViewVerdict::Inconsistent,
            Self {
                num_pixels: Some(0),
                ..
            } => ViewVerdict::Empty,
            _ => ViewVerdict::Good,
        }
    }
}

/// One region.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RegionReport {
    /// Name of its view.
    pub view: String,
    /// Mean of its pixels' centres, pixels from the image's top left corner.
    pub centre: [f64; 2],
    /// Number of its pixels.
    pub num_pixels: usize,
    /// Verdict of other views; null if views were not compared.
    pub verdict: Option<Verdict>,
    /// Visibility in other views.
    #[serde(flatten)]
    pub(crate) support: Support,
    /// Whether it left the mask.
    pub dropped: bool,
}

impl MaskReport {
    /// Writes `report.json`, `views.csv` and `table.md` into `folder`, which has to be there.
    ///
    /// # Errors
    /// [`SceneError`] naming the file that cannot be written.
    pub(crate) fn write(&self, folder: &Path) -> Result<()> {
        let path = folder.join("report.json");
        let json = serde_json::to_vec_pretty(self)
            .map_err(|error| SceneError::invalid(&path, "report", error.to_string()))?;
        files::write_bytes_atomic(&path, &json)?;
        files::write_bytes_atomic(&folder.join("views.csv"), self.csv().as_bytes())?;
        files::write_bytes_atomic(&folder.join("table.md"), self.markdown().as_bytes())
    }

    /// Number of views with a verdict.
    pub fn num_with(&self, verdict: ViewVerdict) -> usize {
        let views = self.views.iter();
        views.filter(|view| view.verdict == verdict).count()
    }

    /// Mean coverage of the views with a mask; `None` if there are none.
    pub fn mean_coverage(&self) -> Option<f64> {
        let coverages: Vec<f64> = self.views.iter().filter_map(|v| v.coverage).collect();
        (!coverages.is_empty()).then(|| coverages.iter().sum::<f64>() / coverages.len() as f64)
    }

    fn csv(&self) -> String {
        let mut writer = csv::Writer::from_writer(Vec::new());
        let heading = [
            "view",
            "verdict",
            "num_pixels",
            "coverage",
            "num_regions",
            "labelled",
            "num_inconsistent",
            "missed",
        ];
        let share = |share: Option<f64>| share.map(|s| s.to_string()).unwrap_or_default();
        let rows = self.views.iter().map(|view| {
            [
                view.name.clone(),
                view.verdict.name().to_owned(),
                view.num_pixels.map(|n| n.to_string()).unwrap_or_default(),
                share(view.coverage),
                view.num_regions.to_string(),
                view.labelled.to_string(),
                view.num_inconsistent.to_string(),
                share(view.missed),
            ]
        });
        for record in std::iter::once(heading.map(str::to_owned)).chain(rows) {
            writer
                .write_record(record)
                .expect("rows of one length, in memory");
        }
        let bytes = writer
            .into_inner()
            .expect("memory takes all that is written to it");
        String::from_utf8(bytes).expect("fields are UTF-8")
    }

    fn markdown(&self) -> String {
        let mut text = String::from(
            "| view | verdict | coverage (%) | regions | not confirmed | missed (%) |\n|---|---|---:|---:|---:|---:|\n",
        );
        let percent =
            |share: Option<f64>| share.map_or("–".to_owned(), |s| format!("{:.2}", 100.0 * s));
        for view in &self.views {
            // Writing to a string cannot fail.
            writeln!(
                text,
                "| {} | {} | {} | {} | {} | {} |",
                view.name.replace('|', "\\|"),
                view.verdict.name(),
                percent(view.coverage),
                view.num_regions,
                view.num_inconsistent,
                percent(view.missed),
            )
            .expect("strings grow");
        }
        text += &format!(
            "\nMean coverage of views with a mask: {} %.",
            percent(self.mean_coverage())
        );
        if let Some(threshold) = self.threshold {
            text += &format!(" Threshold: {threshold} linear radiance.");
        }
        let mut odd = self
            .regions
            .iter()
            .filter(|region| region.verdict == Some(Verdict::Inconsistent))
            .peekable();
        if odd.peek().is_some() {
            text += "\n\nRegions that other views do not confirm:\n\n| view | centre (px) | pixels | masked elsewhere (%) | views | dropped |\n|---|---|---:|---:|---:|---|\n";
        } else {
            text.push('\n');
        }
        for region in odd {
            writeln!(
                text,
                "| {} | {:.0}, {:.0} | {} | {} | {} | {} |",
                region.view.replace('|', "\\|"),
                region.centre[0],
                region.centre[1],
                region.num_pixels,
                percent(region.support.share()),
                region.support.num_views,
                if region.dropped { "yes" } else { "no" },
            )
            .expect("strings grow");
        }
        text
    }
}
