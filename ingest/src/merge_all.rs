//! The second half of the job: stacks that are good, and decisions, become files.

use crate::capture::{Capture, Quality, ShotReport, StackFiles, StackReport};
use crate::develop::{Developed, Recipe, develop};
use crate::error::{IngestError, Result};
use crate::gather::Gathered;
use crate::options::ExposureRatios;
use crate::output::{self, MergedStack};
use crate::prepare::{self, needed_memory};
use crate::problem::Problem;
use crate::report;
use crate::request::{IngestProgress, IngestRequest, IngestSummary, Tell};
use crate::resample::fitted;
use crate::stack::{Photograph, Stack};
use crate::survey::{self, Reader, Survey, estimated, read_shots};
use crate::warnings;
use eagpt_scene::files::Key;
use eagpt_scene::files::ledger::{self, Ledger};
use eagpt_scene::lens::{Pinhole, Undistortion};
use eagpt_scene::machine::available_memory;
use eagpt_scene::{Shard, files};
use glam::DAffine3;
use std::path::{Path, PathBuf};

/// A stack with all that decides its files.
struct Planned {
    stack: Stack,
    survey: Survey,
    exposures: Vec<f64>,
    files: StackFiles,
    key: Key,
    kept: Option<MergedStack>,
}

impl Planned {
    /// Its files below the output.
    fn paths(&self) -> [PathBuf; 3] {
        image_paths(&self.files)
    }
}

fn image_paths(files: &StackFiles) -> [PathBuf; 3] {
    [&files.radiance, &files.preview, &files.unreliable].map(PathBuf::from)
}

/// Stacks that are good, with what was found out about all of them.
pub(crate) struct Prepared<'a> {
    pub(crate) gathered: Gathered,
    pub(crate) surveys: Vec<Option<Survey>>,
    pub(crate) decisions: &'a prepare::Decisions,
    pub(crate) left_out: Vec<Problem>,
}

/// Merges and writes all stacks of the part, and what is told of them.
pub(crate) fn merge_all(
    request: &IngestRequest,
    prepared: Prepared<'_>,
    mut ledger: Ledger,
    tell: Tell<'_>,
) -> Result<Option<IngestSummary>> {
    let options = &request.options;
    let Prepared {
        gathered,
        surveys,
        decisions,
        left_out,
    } = prepared;
    let surveys: Vec<Survey> = surveys.into_iter().flatten().collect();
    let (scale, preview_exposure) = prepare::scales(options.scale, &surveys);
    let recipe = Recipe {
        response: decisions.response.clone(),
        color: decisions.color,
        falloff: decisions.falloff.clone(),
        scale,
        clip: options.clip(),
        demosaic: options.demosaic,
        undistortion: decisions.undistortion,
        long_side: options.long_side,
    };
    let planned = plan(request, gathered.stacks, surveys, &recipe, &ledger)?;
    check_memory(&request.capture, &planned)?;
    let total = planned.len();
    let mut done: Vec<MergedStack> = Vec::with_capacity(total);
    let mut num_kept = 0;
    for planned in &planned {
        if let Some(kept) = &planned.kept {
            done.push(kept.clone());
            num_kept += 1;
        } else {
            request.check_stop(done.len(), total)?;
            let merged = merge_one(request, planned, &recipe, preview_exposure, &mut ledger)?;
            done.push(merged);
        }
        tell(IngestProgress::Merging {
            done: done.len(),
            total,
            stack: planned.stack.name(),
        });
    }
    if request.shard != Shard::WHOLE {
        ledger.complete()?;
        return Ok(None);
    }
    warnings::compare(done.iter_mut().map(|done| &mut done.report));
    for report in done.iter().map(|done| &done.report) {
        for text in &report.warnings {
            tell(IngestProgress::Warning { text: text.clone() });
        }
    }
    let first = &planned[0].stack.shots[0].header.metadata;
    let mut conditions: Vec<String> = planned.iter().map(|p| p.stack.condition.clone()).collect();
    conditions.sort();
    conditions.dedup();
    let capture = Capture {
        camera: first.camera(),
        focal_mm: first.focal_mm,
        options: options.clone(),
        response: recipe.response,
        color: recipe.color,
        falloff: recipe.falloff,
        pinhole: recipe
            .undistortion
            .map(|undistortion| pinhole(&undistortion, options.long_side)),
        scale,
        preview_exposure,
        conditions,
        stacks: done.iter().map(|done| done.report.clone()).collect(),
        left_out,
        notes: gathered.notes,
    };
    let mut outputs = vec![
        "capture.json".into(),
        "report.json".into(),
        "report.html".into(),
    ];
    files::write_json(&request.out.join("capture.json"), &capture)?;
    let thumbnails: Vec<&str> = done.iter().map(|done| done.thumbnail.as_str()).collect();
    report::write(&request.out, &request.capture, &capture, &thumbnails)?;
    for planned in &planned {
        outputs.extend(planned.paths());
    }
    ledger.absorb_others()?;
    outputs.push(ledger::file_name(Shard::WHOLE).into());
    let shots = planned.iter().flat_map(|planned| &planned.stack.shots);
    Ok(Some(IngestSummary {
        capture,
        outputs,
        inputs: shots
            .map(|shot| (shot.path.clone(), shot.blake3.clone()))
            .collect(),
        num_kept,
    }))
}

/// Works out exposures, names and digests of the stacks of the shard, and finds out what is done
/// already and what is in the way.
fn plan(
    request: &IngestRequest,
    stacks: Vec<Stack>,
    surveys: Vec<Survey>,
    recipe: &Recipe,
    ledger: &Ledger,
) -> Result<Vec<Planned>> {
    let several = stacks
        .iter()
        .any(|stack| stack.condition != stacks[0].condition);
    let mut all = Vec::with_capacity(stacks.len());
    let mine = stacks.into_iter().zip(surveys).enumerate();
    for (_, (stack, survey)) in mine.filter(|(place, _)| request.shard.has(*place)) {
        let stated: Vec<f64> = stack.shots.iter().map(Photograph::exposure).collect();
        let exposures = match request.options.exposure_ratios {
            ExposureRatios::Metadata => stated,
            ExposureRatios::Estimate => estimated(&stated, &survey.ratios),
        };
        let files = output::stack_files(&stack, several);
        let decided = (
            (prepare::shots_key(&stack), &exposures, survey.noise),
            (
                &recipe.response,
                recipe.color,
                &recipe.falloff,
                recipe.scale,
                recipe.clip,
            ),
            (
                recipe.demosaic,
                &request.options.lens,
                recipe.long_side,
                request.options.precision,
                &files,
            ),
        );
        let key = prepare::item_key(&decided)?;
        let name = output::item("stack", &stack);
        let noted = ledger.noted(&name);
        // Noted without a key: a process was killed while it wrote the files.
        let made_with = noted.and_then(|item| item.key.as_ref());
        if made_with.is_some_and(|made_with| *made_with != key) {
            return Err(IngestError::Stale {
                out: request.out.clone(),
                stack: stack.name(),
            });
        }
        if noted.is_none() && !request.start_over {
            let paths = image_paths(&files).map(|file| request.out.join(file));
            if let Some(path) = paths.into_iter().find(|path| path.exists()) {
                return Err(IngestError::Exists { path });
            }
        }
        let kept = made_with.and_then(|_| ledger.done(&name)?.value());
        all.push(Planned {
            kept,
            stack,
            survey,
            exposures,
            files,
            key,
        });
    }
    Ok(all)
}

fn check_memory(capture: &Path, planned: &[Planned]) -> Result<()> {
    let largest = planned
        .iter()
        .max_by_key(|planned| needed_memory(&planned.stack));
    let (Some(largest), Some(available)) = (largest, available_memory()) else {
        return Ok(());
    };
    let needed = needed_memory(&largest.stack);
    if needed <= available {
        return Ok(());
    }
    Err(IngestError::Memory {
        capture: capture.to_owned(),
        stack: largest.stack.name(),
        needed_mib: needed >> 20,
        available_mib: available >> 20,
    })
}

fn merge_one(
    request: &IngestRequest,
    planned: &Planned,
    recipe: &Recipe,
    preview_exposure: f64,
    ledger: &mut Ledger,
) -> Result<MergedStack> {
    let stack = &planned.stack;
    let reader = Reader {
        decoding: &request.decoding,
        response: recipe.response.as_ref(),
    };
    let frames = read_shots(stack, &reader).map_err(|unreadable| unreadable.error)?;
    // By the exposures that are used: an estimate may turn an order around.
    let mut order: Vec<usize> = (0..frames.len()).collect();
    order.sort_by(|&a, &b| planned.exposures[a].total_cmp(&planned.exposures[b]));
    let exposures: Vec<f64> = order
        .iter()
        .map(|&index| planned.exposures[index])
        .collect();
    let mut slots: Vec<_> = frames.into_iter().map(Some).collect();
    let frames = order
        .iter()
        .filter_map(|&index| slots[index].take())
        .collect();
    let developed = develop(frames, &exposures, &planned.survey.noise, recipe);
    let name = output::item("stack", stack);
    ledger.add(&name, 0.0, &[])?;
    output::write_stack(
        &request.out,
        &planned.files,
        &developed,
        preview_exposure,
        request.options.precision,
    )?;
    let merged = MergedStack {
        thumbnail: output::thumbnail(&developed.image, preview_exposure),
        report: stack_report(planned, &developed, recipe),
    };
    let key = Some(planned.key.clone());
    ledger.add_with(&name, 0.0, key, &merged, &planned.paths())?;
    Ok(merged)
}

fn stack_report(planned: &Planned, developed: &Developed, recipe: &Recipe) -> StackReport {
    let Planned {
        stack,
        survey,
        exposures,
        ..
    } = planned;
    let stated: Vec<f64> = stack.shots.iter().map(Photograph::exposure).collect();
    let measured = survey::estimated(&stated, &survey.ratios);
    let shots: Vec<ShotReport> = stack
        .shots
        .iter()
        .enumerate()
        .map(|(index, shot)| ShotReport {
            file: shot.name.clone(),
            blake3: shot.blake3.clone(),
            exposure_s: shot.header.metadata.exposure_s.unwrap_or_default(),
            iso: shot.header.metadata.iso,
            f_number: shot.header.metadata.f_number,
            exposure_stated: stated[index],
            exposure_used: exposures[index],
            exposure_error: measured[index] / stated[index] - 1.0,
            clipped_share: survey.clipped[index],
            moved_share: survey.moved[index],
        })
        .collect();
    let extreme = |values: &mut dyn Iterator<Item = f64>| values.fold(0.0, f64::max);
    let read = f64::from(survey.noise.read).sqrt();
    let (shortest, longest) = exposures
        .iter()
        .fold((f64::INFINITY, 0.0_f64), |(low, high), &exposure| {
            (low.min(exposure), high.max(exposure))
        });
    let num = developed.num_samples as f64;
    let quality = Quality {
        clipped_share: developed.counts.clipped as f64 / num,
        dark_share: developed.counts.dark as f64 / num,
        noise_floor: read / longest * recipe.scale,
        range_stops: (longest / shortest / read).log2(),
        exposure_error: extreme(&mut shots.iter().map(|shot| shot.exposure_error.abs())),
        moved_share: extreme(&mut shots.iter().filter_map(|shot| shot.moved_share)),
        sharpness: developed.sharpness,
        negative_share: developed.negative_share,
        mean_luminance: survey.log_luminance.exp() * recipe.scale,
        largest: extreme(&mut developed.image.values().iter().map(|v| f64::from(*v))),
    };
    let estimated = exposures != &stated;
    StackReport {
        condition: stack.condition.clone(),
        position: stack.position.clone(),
        files: planned.files.clone(),
        width: developed.image.width(),
        height: developed.image.height(),
        warnings: warnings::of_stack(&stack.name(), &shots, &quality, estimated),
        shots,
        noise: survey.noise,
        quality,
    }
}

/// The camera of the written images.
fn pinhole(undistortion: &Undistortion, long_side: Option<u32>) -> Pinhole {
    let camera = undistortion.camera(DAffine3::IDENTITY);
    let size = (camera.width, camera.height);
    let (width, height) = long_side.map_or(size, |side| fitted(size, side));
    Pinhole::of(&camera.resized(width, height))
}
