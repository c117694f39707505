//! The views that are measured: those that were rendered and that the reference has.
//!
//! A rule of division is that of the dataset whose views were rendered, as its file orders them: a
//! reference may hold the test views alone, and must not be divided once more.

use super::options::EvalOptions;
use super::renders;
use crate::error::{EvalError, Result, listed};
use crate::provenance::RenderRecord;
use eagpt_scene::dataset::{Split, SplitRule, Subset};
use eagpt_scene::{Dataset, Frame, SceneError};
use std::collections::HashSet;

/// The views of one condition to be measured.
#[derive(Debug)]
pub struct Selection {
    pub(super) dataset: Dataset,
    pub(super) indices: Vec<usize>,
    pub(super) record: RenderRecord,
    /// Number of rendered views, those without a reference included.
    pub num_rendered: usize,
    /// The division into training and test views, where it is known.
    pub split: Option<Split>,
    /// The subset that was rendered or asked for, where it is known.
    pub subset: Option<Subset>,
    /// Remarks for readers of the numbers.
    pub warnings: Vec<String>,
}

impl Selection {
    /// Chooses the views: reads the cameras of the datasets and the names of the renders.
    ///
    /// # Errors
    /// [`EvalError::MissingRenders`] if a subset is asked for and not all of it was rendered,
    /// [`EvalError::NothingInCommon`] if no view is left; whatever opening datasets and dividing
    /// them returns.
    pub fn new(options: &EvalOptions) -> Result<Self> {
        let dataset = Dataset::open(&options.dataset)?;
        let record = RenderRecord::read(&options.renders)?;
        let of_reference: HashSet<&str> = dataset.frames().iter().map(|f| &*f.name).collect();
        let rendered = renders::list(&options.renders, &of_reference)?;
        let divided = Divided::new(options, &dataset, &record);
        let (split, mut warnings) = divided.split(options)?;
        let frames = dataset.frames();
        let mut indices: Vec<usize> = (0..frames.len()).collect();
        let mut missing = Vec::new();
        match (options.subset, &split) {
            (Some(subset), Some(split)) => {
                let base = divided.dataset.frames();
                let chosen = split.indices(subset);
                let chosen: HashSet<&str> = chosen.iter().map(|&i| &*base[i].name).collect();
                indices.retain(|&i| chosen.contains(&*frames[i].name));
                let of = indices.iter().map(|&i| &frames[i].name);
                missing.extend(of.filter(|name| !rendered.contains(*name)).cloned());
            }
            _ => indices.retain(|&i| rendered.contains(&frames[i].name)),
        }
        if indices.is_empty() {
            return Err(EvalError::NothingInCommon {
                folder: options.renders.clone(),
                num_rendered: rendered.len(),
                reference: dataset.transforms().to_owned(),
                expected: frames.first().map_or(String::new(), |f| f.name.clone()),
            });
        }
        if !missing.is_empty() {
            return Err(EvalError::MissingRenders {
                folder: options.renders.clone(),
                missing,
                num_views: indices.len(),
            });
        }
        let no_reference: Vec<String> = rendered
            .iter()
            .filter(|name| !of_reference.contains(name.as_str()))
            .cloned()
            .collect();
        if !no_reference.is_empty() {
            warnings.push(format!(
                "{} of {} rendered views are not in {} and are not measured: {}",
                no_reference.len(),
                rendered.len(),
                dataset.transforms().display(),
                listed(&no_reference)
            ));
        }
        let num_aside = rendered.len() - no_reference.len() - indices.len();
        if let (Some(subset), Some(split), 1..) = (options.subset, &split, num_aside) {
            warnings.push(format!(
                "{num_aside} of {} rendered views are not measured: the subset {subset} of {} has {} views in {}",
                rendered.len(),
                split.rule,
                indices.len(),
                dataset.transforms().display()
            ));
        }
        if let Some(num) = record.num_views().filter(|num| *num > rendered.len()) {
            warnings.push(format!(
                "{}: {} of the {num} views that its record.json counts are there",
                options.renders.display(),
                rendered.len()
            ));
        }
        if let (None, Some(split), true) = (options.subset, &split, divided.by_record) {
            let measured: Vec<&Frame> = indices.iter().map(|&i| &frames[i]).collect();
            warnings.extend(trained_on(split, &divided.dataset, &measured));
        }
        Ok(Self {
            num_rendered: rendered.len(),
            subset: options.subset.or(record.subset()),
            split,
            warnings,
            indices,
            record,
            dataset,
        })
    }

    /// The views, in the order of the reference.
    pub fn frames(&self) -> impl Iterator<Item = &Frame> {
        self.indices.iter().map(|&i| &self.dataset.frames()[i])
    }

    /// The reference.
    pub fn dataset(&self) -> &Dataset {
        &self.dataset
    }

    /// The rule of the division, where it is known.
    pub(super) fn rule(&self) -> Option<SplitRule> {
        self.split.as_ref().map(|split| split.rule)
    }
}

/// The dataset that a rule divides.
struct Divided {
    dataset: Dataset,
    /// Whether it is the one that was rendered, as the record of the renders says.
    by_record: bool,
    rule: Option<SplitRule>,
    warnings: Vec<String>,
}

impl Divided {
    fn new(options: &EvalOptions, reference: &Dataset, record: &RenderRecord) -> Self {
        let rendered = record.dataset();
        let mut warnings = Vec::new();
        if let (Some(_), None, Some(path)) = (options.subset, &rendered, record.cameras()) {
            warnings.push(format!(
                "the split divides {}, since the dataset that was rendered, {}, is not there as it was",
                reference.transforms().display(),
                path.display()
            ));
        }
        // Renders of every view need no rule, but which of them are held out follows from one.
        let default = || {
            let is_known = options.subset.or(record.subset()).is_some();
            is_known.then(SplitRule::default)
        };
        Self {
            by_record: rendered.is_some(),
            dataset: rendered.unwrap_or_else(|| reference.clone()),
            rule: options.split.or_else(|| record.rule()).or_else(default),
            warnings,
        }
    }

    /// The division, and warnings about it. A rule that cannot divide the dataset is an error only
    /// if a subset is asked for.
    fn split(&self, options: &EvalOptions) -> Result<(Option<Split>, Vec<String>)> {
        let mut warnings = self.warnings.clone();
        let Some(rule) = self.rule else {
            return Ok((None, warnings));
        };
        match self.dataset.split(rule) {
            Ok(split) => {
                warnings.extend(split.warnings.iter().cloned());
                Ok((Some(split), warnings))
            }
            Err(error) if options.subset.is_some() => Err(error.into()),
            Err(error @ SceneError::Invalid { .. }) => {
                warnings.push(format!("which views are held out is not known: {error}"));
                Ok((None, warnings))
            }
            Err(error) => Err(error.into()),
        }
    }
}

/// A warning where views for training alone are measured.
fn trained_on(split: &Split, divided: &Dataset, measured: &[&Frame]) -> Option<String> {
    let names = |indices: &[usize]| -> HashSet<&str> {
        let frames = indices.iter().map(|&i| &divided.frames()[i]);
        frames.map(|frame| frame.name.as_str()).collect()
    };
    let (train, test) = (names(&split.train), names(&split.test));
    let is_training = |frame: &&&Frame| {
        let name = frame.name.as_str();
        train.contains(name) && !test.contains(name)
    };
    let num = measured.iter().filter(is_training).count();
    (num > 0).then(|| {
        format!(
            "{num} of {} measured views are training views by {}: --split test measures the others",
            measured.len(),
            split.rule
        )
    })
}
