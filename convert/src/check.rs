//! The contents of a dataset, missing parts and problems.
//!
//! An error is anything training or evaluation would stop at: a frame without its image, a file
//! that cannot be read or has another size, an impossible value. All other suspicious findings are
//! warnings. Views are checked one by one; every finding names its view.

mod cameras;
mod images;
mod report;

pub use report::{CameraReport, ImageKind};
pub(crate) use report::{CheckReport, KindReport, SplitReport, ValueRange, ViewCheck};

use crate::error::{Problem, Result};
use eagpt_scene::dataset::{MIN_FACING, SplitRule};
use eagpt_scene::{Dataset, Frame};
use images::{Looked, look, median};
use rayon::prelude::*;
use serde::Serialize;
use std::collections::HashMap;
use std::collections::HashSet;
use std::path::Path;

/// Angle between up axis and the cameras' mean upward direction above which a warning is given,
/// degrees: halfway to the next axis.
const MAX_UP_ANGLE_DEG: f64 = 45.0;
/// Median angle to the surface of the depths, degrees, above which a warning is given: networks
/// stay within some 20.
const MAX_NORMAL_ANGLE_DEG: f64 = 35.0;
/// Depths and points in the same unit differ by no more than this factor, occlusion included.
const MAX_DEPTH_FACTOR: f64 = 3.0;
/// Share of pixels at one largest value of at most 1 above which a photograph counts as clipped.
const MAX_CLIPPED: f64 = 1e-4;
/// Fewer pixels than this may share a largest value by chance, in half precision above all.
const MIN_CLIPPED: usize = 10;
/// Least share of points that some view shows.
const MIN_IN_VIEW: f64 = 0.5;

/// Progress messages of the job.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[serde(tag = "message", rename_all = "kebab-case")]
pub enum CheckProgress {
    /// Views are being checked.
    Checking {
        /// Number of views done.
        done: usize,
        /// Total number of views.
        total: usize,
    },
}

/// Checks a dataset; as many views are in memory as there are threads.
///
/// # Errors
/// [`crate::ConvertError::Scene`] if the file of cameras is invalid as a whole, or none of its
/// frames can be used; everything else is in the report.
pub fn check(path: &Path, progress: &mut dyn FnMut(CheckProgress)) -> Result<CheckReport> {
    let (dataset, bad) = Dataset::survey(path)?;
    let mut problems: Vec<Problem> = bad
        .iter()
        .map(|bad| Problem::new(&bad.name, &bad.error))
        .collect();
    let cloud = match dataset.points() {
        Ok(cloud) => cloud,
        Err(error) => {
            problems.push(Problem::new("points", error));
            None
        }
    };
    let sample = cloud.as_ref().map(cameras::sample).unwrap_or_default();
    let mut all = Vec::with_capacity(dataset.len());
    let total = dataset.len();
    for batch in dataset.frames().chunks(rayon::current_num_threads().max(1)) {
        let looked: Vec<Looked> = batch.par_iter().map(|frame| look(frame, &sample)).collect();
        all.extend(looked);
        let done = all.len();
        progress(CheckProgress::Checking { done, total });
    }
    problems.extend(all.iter().flat_map(|looked| looked.problems.clone()));
    let ratios = all.iter().filter_map(|looked| looked.depth_over_points);
    let mut report = CheckReport {
        dataset: dataset.transforms().to_owned(),
        num_views: dataset.len(),
        up_axis: dataset.up_axis(),
        metres_per_unit: dataset.metres_per_unit(),
        kinds: kinds(&dataset, &all),
        cameras: cameras::poses(&dataset),
        intrinsics: cameras::intrinsics(&dataset),
        points: cloud
            .as_ref()
            .map(|cloud| cameras::points(cloud, &sample, &dataset)),
        depth_over_points: median(ratios.collect()),
        splits: splits(&dataset),
        views: all.into_iter().map(|looked| looked.view).collect(),
        problems,
        warnings: Vec::new(),
    };
    report.warnings = warnings(&report);
    Ok(report)
}

fn kinds(dataset: &Dataset, all: &[Looked]) -> Vec<KindReport> {
    let kind = |kind: ImageKind,
                has: &dyn Fn(&Frame) -> bool,
                coverage: &dyn Fn(&ViewCheck) -> Option<f64>| {
        let frames = dataset.frames();
        let missing: Vec<String> = frames
            .iter()
            .filter(|frame| !has(frame))
            .map(|frame| frame.name.clone())
            .collect();
        let num_present = frames.len() - missing.len();
        let ranges = all.iter().flat_map(|looked| &looked.ranges);
        let ranges = ranges
            .filter(|(of, _)| *of == kind)
            .map(|(_, range)| *range);
        let shares: Vec<f64> = all
            .iter()
            .filter_map(|looked| coverage(&looked.view))
            .collect();
        KindReport {
            kind,
            num_present,
            // A kind that no view has is not missing.
            missing: if num_present > 0 { missing } else { Vec::new() },
            values: ranges.reduce(ValueRange::and),
            coverage: (!shares.is_empty())
                .then(|| shares.iter().sum::<f64>() / shares.len() as f64),
        }
    };
    vec![
        kind(ImageKind::Radiance, &|_| true, &|_| None),
        kind(ImageKind::Emission, &|f| f.files.emission.is_some(), &|v| {
            v.emission
        }),
        kind(ImageKind::Normal, &|f| f.files.normal.is_some(), &|v| {
            v.normal
        }),
        kind(ImageKind::Alpha, &|f| f.files.alpha.is_some(), &|_| None),
        kind(ImageKind::Depth, &|f| f.files.depth.is_some(), &|v| v.depth),
        kind(ImageKind::Albedo, &|f| f.files.albedo.is_some(), &|_| None),
        kind(
            ImageKind::Specular,
            &|f| f.files.specular.is_some(),
            &|_| None,
        ),
        kind(
            ImageKind::Roughness,
            &|f| f.files.roughness.is_some(),
            &|_| None,
        ),
        kind(ImageKind::Valid, &|f| f.files.valid.is_some(), &|v| v.valid),
    ]
}

fn splits(dataset: &Dataset) -> Vec<SplitReport> {
    let rules = [
        SplitRule::Every8th,
        SplitRule::Listed,
        SplitRule::All,
        SplitRule::Paper,
    ];
    let split = |rule| match dataset.split(rule) {
        Ok(split) => {
            let train: HashSet<usize> = split.train.iter().copied().collect();
            SplitReport {
                rule,
                num_train: split.train.len(),
                num_test: split.test.len(),
                num_shared: split.test.iter().filter(|i| train.contains(i)).count(),
                problem: None,
                warnings: split.warnings,
            }
        }
        Err(error) => SplitReport {
            rule,
            num_train: 0,
            num_test: 0,
            num_shared: 0,
            problem: Some(error.to_string()),
            warnings: Vec::new(),
        },
    };
    rules.into_iter().map(split).collect()
}

fn warnings(report: &CheckReport) -> Vec<String> {
    let mut texts = Vec::new();
    warn_of_cameras(report, &mut texts);
    warn_of_images(report, &mut texts);
    warn_of_normals(report, &mut texts);
    for split in &report.splits {
        // `all` obviously holds nothing out.
        if split.num_shared > 0 && split.rule != SplitRule::All {
            texts.push(format!(
                "split {}: {} of {} test views are trained on: results by it do not show what new views look like",
                split.rule, split.num_shared, split.num_test
            ));
        }
    }
    texts
}

fn warn_of_cameras(report: &CheckReport, texts: &mut Vec<String>) {
    let cameras = &report.cameras;
    if let (Some(angle), Some(axis)) = (cameras.up_angle_deg, cameras.most_upright)
        && angle > MAX_UP_ANGLE_DEG
    {
        let up = report.up_axis.unwrap_or_default();
        texts.push(format!(
            "up axis {up}: the cameras' mean up direction is {angle:.0}° away; up may be {axis}"
        ));
    }
    if let Some([a, b]) = cameras.same_pose.first() {
        let num = cameras.same_pose.len();
        texts.push(format!(
            "{num} pairs of views have one pose, {a} and {b} for one"
        ));
    }
    match &report.points {
        None => texts.push("no point cloud: training has nothing to start from".to_owned()),
        Some(points) if points.share_in_view < MIN_IN_VIEW => texts.push(format!(
            "{:.0} % of the points are in no picture: they may be of another world than the cameras",
            100.0 * (1.0 - points.share_in_view)
        )),
        Some(_) => {}
    }
    if let Some(ratio) = report.depth_over_points
        && !(1.0 / MAX_DEPTH_FACTOR..=MAX_DEPTH_FACTOR).contains(&ratio)
    {
        texts.push(format!(
            "depths are {ratio:.4} times those of the points: they may be of another unit"
        ));
    }
}

fn warn_of_images(report: &CheckReport, texts: &mut Vec<String>) {
    for kind in report.kinds.iter().filter(|kind| !kind.missing.is_empty()) {
        let name = format!("{:?}", kind.kind).to_lowercase();
        let (num, all) = (kind.missing.len(), report.num_views);
        texts.push(format!("{num} of {all} views have no {name}"));
    }
    let is_clipped = |view: &&ViewCheck| {
        let num_pixels = f64::from(view.size[0]) * f64::from(view.size[1]);
        view.max_radiance <= 1.0
            && view.num_at_maximum >= MIN_CLIPPED
            && view.num_at_maximum as f64 > MAX_CLIPPED * num_pixels
    };
    let clipped: Vec<&ViewCheck> = report.views.iter().filter(is_clipped).collect();
    if let Some(worst) = clipped.iter().max_by_key(|view| view.num_at_maximum) {
        texts.push(format!(
            "{} views look clipped: {} has {} pixels at its largest value {}",
            clipped.len(),
            worst.name,
            worst.num_at_maximum,
            worst.max_radiance
        ));
    }
    let black = report
        .views
        .iter()
        .filter(|view| view.mean_luminance <= 0.0);
    let black: Vec<&str> = black.map(|view| view.name.as_str()).collect();
    if let Some(first) = black.first() {
        texts.push(format!("{} views are black, {first} for one", black.len()));
    }
    let sizes: HashMap<[u32; 2], usize> =
        report.views.iter().fold(HashMap::new(), |mut all, view| {
            *all.entry(view.size).or_default() += 1;
            all
        });
    if sizes.len() > 1 {
        texts.push(format!("images have {} sizes", sizes.len()));
    }
}

fn warn_of_normals(report: &CheckReport, texts: &mut Vec<String>) {
    let mut warn = |is: &dyn Fn(&ViewCheck) -> bool, what: &str| {
        let views: Vec<&str> = report
            .views
            .iter()
            .filter(|view| is(view))
            .map(|view| view.name.as_str())
            .collect();
        if let Some(first) = views.first() {
            texts.push(format!(
                "normals of {} views {what}, {first} for one",
                views.len()
            ));
        }
    };
    warn(
        &|view| view.normals_facing.is_some_and(|share| share < MIN_FACING),
        "are turned away from the camera in more than a tenth of their pixels",
    );
    warn(
        &|view| view.normals_not_unit.is_some_and(|share| share > 0.01),
        "are not of unit length in more than a hundredth of their pixels",
    );
    warn(
        &|view| {
            view.normal_from_depth_deg
                .is_some_and(|angle| angle > MAX_NORMAL_ANGLE_DEG)
        },
        "do not fit the depths: they may have other axes",
    );
}
