//! Division of views into those for training and those for tests.

use super::json::{Object, excerpt};
use crate::error::{Result, SceneError};
use std::collections::{HashMap, HashSet};
use std::fmt;
use std::path::Path;

/// Division of frames.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, Hash, Default, serde::Serialize, serde::Deserialize,
)]
#[serde(rename_all = "kebab-case")]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
pub enum SplitRule {
    /// Frames 0, 8, 16, … of the file test, the others train
    #[default]
    #[serde(rename = "every-8th")]
    #[cfg_attr(feature = "clap", value(name = "every-8th"))]
    Every8th,
    /// As train_filenames and test_filenames (or val_filenames) of the file say
    Listed,
    /// Every view trains and tests: nothing is held out
    All,
    /// As the released code of EAG-PT divides them, which tests on some views it has trained on
    ///
    /// For comparison with its tables; [`Split::warnings`] says how many test views were trained
    /// on.
    ///
    /// - Names with "/" (Eyeful Tower, `camera/image`): all but cameras 10, 11 and 12 train; one
    ///   camera tests and is trained on as well. The released code takes camera 23 if the path
    ///   contains "kitchen" and else 26; paths get renamed, so here it is camera 26 if there is one
    ///   and else 23.
    /// - As there, a root path with "furnishedroom" loses the frames whose names end in a number
    ///   below 108, one with "emptyroom" those below 207 (last four digits). Nothing in the data
    ///   tells these scenes, so the path has to.
    /// - A root path with "SelfCaptured": all frames train and test.
    /// - Otherwise as [`Self::Every8th`].
    Paper,
}

/// Training or test views.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
pub enum Subset {
    /// Views that are trained on
    Train,
    /// Views that are measured
    Test,
    /// Every view of either, once, in the order of the file
    All,
}

/// Frames divided by a rule; neither subset is empty.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Split {
    /// The rule.
    pub rule: SplitRule,
    /// Indices of the training views, ascending but for listed ones.
    pub train: Vec<usize>,
    /// Indices of the test views, ascending but for listed ones.
    pub test: Vec<usize>,
    /// Note for readers of results, as test views that are trained on.
    pub warnings: Vec<String>,
}

impl Split {
    /// Indices of the frames of `subset`.
    pub fn indices(&self, subset: Subset) -> Vec<usize> {
        match subset {
            Subset::Train => self.train.clone(),
            Subset::Test => self.test.clone(),
            Subset::All => {
                let mut all: Vec<usize> = self.train.iter().chain(&self.test).copied().collect();
                all.sort_unstable();
                all.dedup();
                all
            }
        }
    }
}

macro_rules! names {
    ($type:ty, $($variant:ident = $name:literal),+) => {
        impl fmt::Display for $type {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(match self { $(Self::$variant => $name),+ })
            }
        }
    };
}

names!(
    SplitRule,
    Every8th = "every-8th",
    Listed = "listed",
    All = "all",
    Paper = "paper"
);
names!(Subset, Train = "train", Test = "test", All = "all");

/// Frames that the file itself assigns to training, validation and testing, as indices.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct ListedSplit {
    pub(super) train: Option<Vec<usize>>,
    pub(super) validation: Option<Vec<usize>>,
    pub(super) test: Option<Vec<usize>>,
}

impl ListedSplit {
    /// The lists of nerfstudio, of `names` in order. Names that are `left_out` are passed over.
    pub(super) fn read(top: &Object<'_>, names: &[&str], left_out: &HashSet<&str>) -> Result<Self> {
        let index_by_name: HashMap<&str, usize> = names
            .iter()
            .enumerate()
            .map(|(index, name)| (*name, index))
            .collect();
        let read = |key: &str| -> Result<Option<Vec<usize>>> {
            let Some(names) = top.array(key)? else {
                return Ok(None);
            };
            let there = names.iter().enumerate().filter(|(_, name)| {
                let name = name.as_str();
                name.is_none_or(|name| !left_out.contains(name))
            });
            let indices = there.map(|(at, name)| {
                let index = name.as_str().and_then(|name| index_by_name.get(name));
                index.copied().ok_or_else(|| {
                    let problem = format!("{} is not the name of a frame", excerpt(name));
                    top.invalid(&format!("{key}[{at}]"), problem)
                })
            });
            indices.collect::<Result<Vec<_>>>().map(Some)
        };
        let test = read("test_filenames")?;
        // A test list that nerfstudio validates on as well is one list.
        let validation = read("val_filenames")?.filter(|list| test.as_ref() != Some(list));
        Ok(Self {
            train: read("train_filenames")?,
            validation,
            test,
        })
    }
}

/// Divides the frames of a dataset in the folder `root`, by their `names` or as `lists` have them.
pub(super) fn split(
    (root, transforms): (&Path, &Path),
    names: &[&str],
    lists: &ListedSplit,
    rule: SplitRule,
) -> Result<Split> {
    let mut warnings = Vec::new();
    let (train, test) = match rule {
        SplitRule::Every8th => every_8th(names.len()),
        SplitRule::Listed => listed(transforms, lists)?,
        SplitRule::All => ((0..names.len()).collect(), (0..names.len()).collect()),
        SplitRule::Paper => paper(root, names, &mut warnings),
    };
    if train.is_empty() || test.is_empty() {
        return Err(SceneError::invalid(
            transforms,
            format!("split {rule}"),
            format!(
                "{} training and {} test views of {} frames: neither may be empty",
                train.len(),
                test.len(),
                names.len()
            ),
        ));
    }
    let trained: HashSet<usize> = train.iter().copied().collect();
    let num_shared = test.iter().filter(|index| trained.contains(index)).count();
    if num_shared > 0 {
        warnings.push(format!(
            "split {rule}: {num_shared} of {} test views are also trained on",
            test.len()
        ));
    }
    Ok(Split {
        rule,
        train,
        test,
        warnings,
    })
}

fn every_8th(num_frames: usize) -> (Vec<usize>, Vec<usize>) {
    (0..num_frames).partition(|index| index % 8 != 0)
}

fn listed(transforms: &Path, lists: &ListedSplit) -> Result<(Vec<usize>, Vec<usize>)> {
    let list = |indices: Option<&Vec<usize>>, key: &str| {
        indices.cloned().ok_or_else(|| {
            let problem = "missing; the split `listed` needs it";
            SceneError::invalid(transforms, key, problem)
        })
    };
    Ok((
        list(lists.train.as_ref(), "train_filenames")?,
        list(
            lists.test.as_ref().or(lists.validation.as_ref()),
            "test_filenames",
        )?,
    ))
}

/// The rules documented at [`SplitRule::Paper`].
fn paper(root: &Path, names: &[&str], warnings: &mut Vec<String>) -> (Vec<usize>, Vec<usize>) {
    // The real path, so that opening `.` gives the split that opening it by name gives.
    let root = std::fs::canonicalize(root).unwrap_or_else(|_| root.to_owned());
    let root = root.to_string_lossy();
    let all = 0..names.len();
    if !names.iter().any(|name| name.contains('/')) {
        return if root.contains("SelfCaptured") {
            (all.clone().collect(), all.collect())
        } else {
            every_8th(names.len())
        };
    }
    let first_number = match &root {
        root if root.contains("furnishedroom") => 108,
        root if root.contains("emptyroom") => 207,
        _ => 0,
    };
    let kept: Vec<usize> = all
        .filter(|&index| number(names[index]).is_none_or(|number| number >= first_number))
        .collect();
    if kept.len() < names.len() {
        warnings.push(format!(
            "split paper: {} of {} frames are left out, numbered below {first_number}",
            names.len() - kept.len(),
            names.len()
        ));
    }
    let camera = |index: usize| names[index].split('/').next().unwrap_or_default();
    let test_camera = ["26", "23"]
        .into_iter()
        .find(|wanted| kept.iter().any(|&index| camera(index) == *wanted))
        .unwrap_or("26");
    let select = |wanted: &dyn Fn(&str) -> bool| {
        kept.iter()
            .copied()
            .filter(|&index| wanted(camera(index)))
            .collect()
    };
    (
        select(&|camera| !["10", "11", "12"].contains(&camera)),
        select(&|camera| camera == test_camera),
    )
}

/// The last four digits of a name as a number.
fn number(name: &str) -> Option<u32> {
    let start = name.char_indices().rev().nth(3)?.0;
    name[start..].parse().ok()
}
