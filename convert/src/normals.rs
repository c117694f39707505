//! Conversion of normal maps of any estimator to the dataset's normals: world space, unit length,
//! facing the camera.
//!
//! Maps come in the camera's space or the world's, with axes that differ between estimators, as EXR
//! or PNG of any size. Their interpretation is detected, or given and checked, by comparison with
//! reference normals of the dataset: of the surfaces spanned by its depths, or of planes through
//! neighbouring points of its cloud. Of all permutations and flips of axes, the right one has by
//! far the largest mean cosine; where none stands out nothing is written.
//!
//! A normal that faces slightly away from the camera, as happens at grazing angles, is made
//! perpendicular to the view; beyond 25° it counts as unknown.

mod axes;
mod maps;
#[cfg(feature = "onnx")]
mod network;
mod options;
mod reference;
mod report;
mod turn;

pub use axes::Axes;
#[cfg(feature = "onnx")]
pub use network::{NetworkOptions, find_runtime, run_network};
pub use options::{Encoding, NormalOptions, NormalRequest, Space};
pub use reference::Reference;
pub use report::{NormalProgress, NormalReport, NormalSummary, NormalView, Reading};

use crate::error::{ConvertError, Problem, Result};
use axes::Agreement;
use eagpt_scene::dataset::NORMAL_DIR;
use eagpt_scene::exr::{self, Precision};
use eagpt_scene::{Dataset, Image, SceneError, files, png};
use glam::{DVec3, Vec3};
use reference::{Oriented, Place};
use std::path::{Path, PathBuf};
use turn::{compare, world_normals};

/// Folder of overlays and the report, inside of the folder of results.
const REPORT_DIR: &str = "normals";
/// Views that are compared to find the axes.
const NUM_PROBED: usize = 16;
/// Fewest places to compare.
const MIN_PLACES: u64 = 100;
/// Least mean cosine of the right reading: networks reach 0.9, a wrong axis loses a third.
const MIN_COSINE: f64 = 0.5;
/// Least lead of the right reading over any other.
const MIN_LEAD: f64 = 0.1;
/// Mean angle to the reference, degrees, above which a view gets a warning.
const MAX_ANGLE_DEG: f64 = 40.0;

/// The files that a job may write, relative to its folder; views without a map have none.
pub fn planned_files(dataset: &Dataset) -> Vec<PathBuf> {
    let names = dataset.frames().iter().map(|frame| frame.name.as_str());
    let of_views = names.flat_map(|name| [normal_file(name), picture_file(name)]);
    of_views.chain([report_file()]).collect()
}

fn normal_file(name: &str) -> PathBuf {
    Path::new(NORMAL_DIR).join(format!("{name}.exr"))
}

fn picture_file(name: &str) -> PathBuf {
    Path::new(REPORT_DIR)
        .join("preview")
        .join(format!("{name}.png"))
}

fn report_file() -> PathBuf {
    Path::new(REPORT_DIR).join("report.json")
}

/// Reads, checks, turns and writes normal maps; one view is in memory at a time.
///
/// # Errors
/// [`ConvertError::UnclearAxes`] before anything is written; [`ConvertError::BadFrames`] with all
/// maps that cannot be read; a folder without a map of any view; a file that cannot be written.
pub fn make_normals(
    request: &NormalRequest<'_>,
    progress: &mut dyn FnMut(NormalProgress),
) -> Result<NormalSummary> {
    let maps = maps::find(&request.maps, request.dataset, &request.options.suffix)?;
    let cloud = if request
        .dataset
        .frames()
        .iter()
        .all(|f| f.files.depth.is_some())
    {
        None
    } else {
        request.dataset.points()?
    };
    let mut job = NormalsJob {
        request,
        progress,
        points: cloud.as_ref().map(Oriented::new),
        warnings: Vec::new(),
    };
    let reading = job.find_reading(&maps)?;
    let (views, missing) = job.write(&maps, &reading)?;
    job.warn_of(&views, &missing, request.dataset.len());
    let report = NormalReport {
        reading,
        views,
        missing,
    };
    let path = request.out.join(report_file());
    files::create_parent(&path)?;
    files::write_json(&path, &report)?;
    let written = planned_files(request.dataset).into_iter();
    Ok(NormalSummary {
        report,
        outputs: written
            .filter(|file| request.out.join(file).is_file())
            .collect(),
        warnings: job.warnings,
    })
}

struct NormalsJob<'a> {
    request: &'a NormalRequest<'a>,
    progress: &'a mut dyn FnMut(NormalProgress),
    points: Option<Oriented>,
    warnings: Vec<String>,
}

impl NormalsJob<'_> {
    fn warn(&mut self, text: String) {
        self.warnings.push(text.clone());
        (self.progress)(NormalProgress::Warning { text });
    }

    fn read(&self, index: usize, map: &Path) -> Result<Image<3>> {
        let camera = &self.request.dataset.frames()[index].camera;
        let encoding = self.request.options.encoding;
        maps::read(map, encoding, (camera.width, camera.height))
    }

    fn places(&self, index: usize) -> Result<Vec<Place>, SceneError> {
        let frame = &self.request.dataset.frames()[index];
        reference::places(frame, self.points.as_ref())
    }

    /// Compares some views with the dataset and decides the interpretation of the maps.
    fn find_reading(&mut self, maps: &[Option<PathBuf>]) -> Result<Reading> {
        let with_map: Vec<(usize, &PathBuf)> = maps
            .iter()
            .enumerate()
            .filter_map(|(index, map)| Some((index, map.as_ref()?)))
            .collect();
        let step = with_map.len().div_ceil(NUM_PROBED).max(1);
        let probed: Vec<_> = with_map.into_iter().step_by(step).collect();
        let mut agreement = Agreement::NONE;
        let mut visibility = Agreement::NONE;
        let mut has_depth = false;
        for (done, (index, map)) in probed.iter().enumerate() {
            let frame = &self.request.dataset.frames()[*index];
            has_depth |= frame.files.depth.is_some();
            let stored = self.read(*index, map)?;
            let (of_places, of_rays) = compare(&stored, &frame.camera, &self.places(*index)?);
            agreement = agreement.and(&of_places);
            visibility = visibility.and(&of_rays);
            let total = probed.len();
            (self.progress)(NormalProgress::Comparing {
                done: done + 1,
                total,
            });
        }
        let reference = match (agreement.num() >= MIN_PLACES, has_depth) {
            (true, true) => Reference::Depth,
            (true, false) => Reference::Points,
            (false, _) => Reference::None,
        };
        let reading = self.decide(&agreement, &visibility, reference)?;
        (self.progress)(NormalProgress::Reading(reading));
        Ok(reading)
    }

    fn decide(
        &mut self,
        agreement: &Agreement,
        visibility: &Agreement,
        reference: Reference,
    ) -> Result<Reading> {
        let options = &self.request.options;
        let unclear = |problem: String| ConvertError::UnclearAxes {
            path: self.request.maps.clone(),
            problem,
        };
        if reference == Reference::None {
            let (Some(space), Some(axes)) = (options.space, options.axes) else {
                return Err(unclear(
                    "the dataset has neither depths nor enough points to find them out by: give --space and --axes".to_owned(),
                ));
            };
            // The cosine with the direction to the camera is above 0 for any reading.
            let facing = visibility.mean_cosine(space, axes);
            if facing <= 0.0 {
                return Err(unclear(format!(
                    "read as {}, {axes}, normals are turned away from the camera (mean cosine {facing:.3})",
                    space_name(space)
                )));
            }
            return Ok(Reading {
                space,
                axes,
                reference,
                mean_cosine: None,
                next_best: None,
            });
        }
        let mut all: Vec<(Space, Axes, f64)> = [Space::Camera, Space::World]
            .into_iter()
            .flat_map(|space| {
                Axes::candidates(space)
                    .into_iter()
                    .map(move |axes| (space, axes))
            })
            .map(|(space, axes)| (space, axes, agreement.mean_cosine(space, axes)))
            .collect();
        // A stable sort: of equal readings, camera space and identity axes come first.
        all.sort_by(|a, b| b.2.total_cmp(&a.2));
        let is_allowed = |(space, axes, _): &&(Space, Axes, f64)| {
            options.space.is_none_or(|given| given == *space)
                && options.axes.is_none_or(|given| given == *axes)
        };
        let given = options.space.zip(options.axes);
        let best = match given {
            Some((space, axes)) => (space, axes, agreement.mean_cosine(space, axes)),
            None => *all
                .iter()
                .find(is_allowed)
                .ok_or_else(|| unclear("no reading has the axes that were given".to_owned()))?,
        };
        let next = all
            .iter()
            .find(|other| (other.0, other.1) != (best.0, best.1));
        let next = next.copied().unwrap_or(best);
        let (space, axes, cosine) = best;
        let told = |(space, axes, cosine): (Space, Axes, f64)| {
            format!("{} {axes} (mean cosine {cosine:.3})", space_name(space))
        };
        if given.is_none() && (cosine < MIN_COSINE || cosine - next.2 < MIN_LEAD) {
            return Err(unclear(format!(
                "the maps fit the dataset best as {}, next as {}: not clear enough; give --space and --axes",
                told(best),
                told(next)
            )));
        }
        if given.is_some() && cosine <= 0.0 {
            return Err(unclear(format!(
                "read as {} the maps contradict the dataset; they fit best as {}",
                told(best),
                told(next)
            )));
        }
        if given.is_some() && next.2 - cosine > MIN_LEAD {
            let text = format!(
                "the maps fit the dataset better as {} than as {}",
                told(next),
                told(best)
            );
            self.warn(text);
        }
        Ok(Reading {
            space,
            axes,
            reference,
            mean_cosine: Some(cosine),
            next_best: Some(next.2),
        })
    }

    /// Writes the normals of all views with a map; the names of the others.
    fn write(
        &mut self,
        maps: &[Option<PathBuf>],
        reading: &Reading,
    ) -> Result<(Vec<NormalView>, Vec<String>)> {
        let frames = self.request.dataset.frames();
        let (mut views, mut missing, mut problems) = (Vec::new(), Vec::new(), Vec::new());
        for (index, map) in maps.iter().enumerate() {
            let name = &frames[index].name;
            match map {
                None => missing.push(name.clone()),
                Some(map) => match self.write_view(index, map, reading) {
                    Ok(view) => views.push(view),
                    Err(error) => problems.push(Problem::new(name, error)),
                },
            }
            (self.progress)(NormalProgress::Writing {
                done: index + 1,
                total: maps.len(),
            });
        }
        if problems.is_empty() {
            return Ok((views, missing));
        }
        Err(ConvertError::BadFrames {
            path: self.request.maps.clone(),
            num_frames: maps.len(),
            problems,
        })
    }

    fn write_view(&self, index: usize, map: &Path, reading: &Reading) -> Result<NormalView> {
        let frame = &self.request.dataset.frames()[index];
        let stored = self.read(index, map)?;
        let (normals, facing) = world_normals(&stored, &frame.camera, reading);
        let path = self.request.out.join(normal_file(&frame.name));
        files::create_parent(&path)?;
        exr::write_rgb(&path, &normals, Precision::Half)?;
        let picture = self.request.out.join(picture_file(&frame.name));
        files::create_parent(&picture)?;
        write_picture(&picture, &normals)?;
        let places = self.places(index)?;
        let angles = places.iter().filter_map(|place| {
            let normal = Vec3::from(normals.pixels()[place.pixel]).as_dvec3();
            let cosine = place.normal.dot(normal).clamp(-1.0, 1.0);
            (normal != DVec3::ZERO).then(|| cosine.acos().to_degrees())
        });
        let angles: Vec<f64> = angles.collect();
        let num_known = normals.pixels().iter().filter(|n| **n != [0.0; 3]).count();
        Ok(NormalView {
            name: frame.name.clone(),
            map: map.to_owned(),
            known: num_known as f64 / normals.pixels().len() as f64,
            facing,
            angle_deg: (!angles.is_empty())
                .then(|| angles.iter().sum::<f64>() / angles.len() as f64),
        })
    }

    fn warn_of(&mut self, views: &[NormalView], missing: &[String], num_views: usize) {
        if let Some(first) = missing.first() {
            let num = missing.len();
            self.warn(format!(
                "{num} of {num_views} views have no map, {first} for one"
            ));
        }
        let is_bad = |view: &&NormalView| {
            view.facing < 0.9 || view.angle_deg.is_some_and(|angle| angle > MAX_ANGLE_DEG)
        };
        let bad: Vec<&NormalView> = views.iter().filter(is_bad).collect();
        if bad.is_empty() {
            return;
        }
        let names: Vec<&str> = bad.iter().take(8).map(|view| view.name.as_str()).collect();
        let more = if bad.len() > names.len() { ", …" } else { "" };
        self.warn(format!(
            "{} views do not fit the dataset (more than {MAX_ANGLE_DEG}° from it in the mean, or turned away in a tenth of their pixels): {}{more}",
            bad.len(),
            names.join(", ")
        ));
    }
}

fn space_name(space: Space) -> &'static str {
    match space {
        Space::Camera => "camera",
        Space::World => "world",
    }
}

fn write_picture(path: &Path, normals: &Image<3>) -> Result<()> {
    let byte = |value: &f32| ((0.5 * value + 0.5) * 255.0).round() as u8;
    let bytes: Vec<u8> = normals.values().iter().map(byte).collect();
    Ok(png::write_rgb8(
        path,
        normals.width(),
        normals.height(),
        &bytes,
    )?)
}
