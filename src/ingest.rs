//! `eagpt ingest`: RAW brackets to linear HDR images.

use crate::args::{self, GlobalArgs};
use crate::command_line;
use crate::decode;
use crate::interrupt;
use crate::output::Target;
use crate::progress::Reporter;
use crate::record::{Input, RecordBuilder};
use crate::terminal;
use anyhow::Result;
use clap::Args;
use eagpt_ingest::{
    Demosaic, ExposureRatios, IngestError, IngestOptions, IngestProgress, IngestRequest,
    LensOption, Vignetting, WhiteBalance, ingest,
};
use eagpt_scene::Shard;
use eagpt_scene::exr::Precision;
use serde::Serialize;
use std::path::PathBuf;
use std::process::ExitCode;

/// Merge RAW brackets into linear HDR images
///
/// CAPTURE is a folder of photographs, or of one folder for each lighting condition: brackets of
/// exposures at positions of the camera. Names `<position>_<index>`, the cycle of exposures,
/// folders (--stacks-in-folders) or a file capture.toml say which shots belong together. Whatever
/// is missing, double or does not fit is named, everything at once, before any work is done.
///
/// Shots are merged where the sensor measured them, with the weights of its noise; then white
/// balance, colours and one scale for the whole capture are applied. Writes, below a folder for
/// each condition if there are several: Radiance-exr/<position>.exr (linear Rec.709),
/// Preview/<position>.png (sRGB, for COLMAP), Unreliable/<position>.png (1: clipped in all shots,
/// 2: dark in all shots); and capture.json (what was decided), report.html and report.json (what to
/// take again).
///
/// Where there is no RAW, brackets of JPEG, or of PNG or TIFF of 8 bits, are merged as well: the
/// camera's response, one curve for each channel of a capture, is recovered from pixels that
/// several shots show, and is in the report. Primaries are those of the ICC profile or of EXIF,
/// else sRGB's; the white balance is the camera's. RAW files have less noise and need no such
/// curve.
///
/// The same command resumes where it was stopped, and adds stacks that are new; what is done is
/// known by its content.
#[derive(Debug, Clone, Args, Serialize)]
#[command(after_long_help = EXAMPLES)]
pub(crate) struct IngestArgs {
    /// Folder with the photographs: RAW of the camera; or linear EXR, TIFF (16 bits, float) or PNG
    /// (16 bits); or JPEG, or PNG and TIFF of 8 bits
    #[arg(value_name = "CAPTURE")]
    pub(crate) capture: PathBuf,
    /// Folder for the results
    #[arg(long, value_name = "DIR")]
    pub(crate) out: PathBuf,
    /// Each folder with photographs is one stack
    #[arg(long)]
    stacks_in_folders: bool,
    /// Exposure times of the shots of a stack in the order of their names, for files that do not
    /// state them or state 0, seconds above 0
    #[arg(long, value_name = "S,S,…", value_delimiter = ',')]
    exposures: Option<Vec<f64>>,
    /// Longest pause within a capture, minutes above 0; a longer one means two rooms in one folder
    #[arg(long, value_name = "MIN", default_value_t = 30.0)]
    max_pause: f64,
    /// Where exposure ratios come from; the photographs are compared with the metadata in any case
    #[arg(long, value_enum, default_value = "metadata")]
    exposure_ratios: ExposureRatios,
    /// Share of the range below white that counts as clipped, 0 to 0.5
    #[arg(long, value_name = "SHARE", default_value_t = 0.03)]
    clip_margin: f32,
    /// Factors for the whole capture: `as-shot` (of the first shot), R,G,B, or a grey card in a
    /// stack, `STACK@LEFT,TOP,WIDTH,HEIGHT` in pixels of the sensor
    #[arg(long, value_name = "WHITE", default_value = "as-shot", value_parser = white_balance)]
    #[serde(serialize_with = "command_line::text")]
    white_balance: WhiteBalance,
    /// Radiance of a sample at saturation in 1 s at ISO 100 and f/1, above 0 [default: the
    /// geometric mean of the capture's luminance becomes 0.18]
    #[arg(long, value_name = "RADIANCE")]
    scale: Option<f64>,
    /// Interpolation of colours between the samples of the sensor; X-Trans has bilinear and
    /// Markesteijn's method
    #[arg(long, value_enum, default_value = "ppg")]
    demosaic: Demosaic,
    /// Falloff of the lens to divide by: a,b,c of 1 + a r² + b r⁴ + c r⁶, r = 1 in the corner
    #[arg(long, value_name = "A,B,C", value_parser = polynomial, allow_hyphen_values = true)]
    vignetting: Option<[f32; 3]>,
    /// Folder with a stack of an evenly lit surface; its smoothed picture is the falloff
    #[arg(long, value_name = "DIR", conflicts_with = "vignetting")]
    flat_field: Option<PathBuf>,
    /// Folder with a stack of an evenly lit surface; a, b and c are fitted to it
    #[arg(long, value_name = "DIR", conflicts_with_all = ["vignetting", "flat_field"])]
    fit_vignetting: Option<PathBuf>,
    /// Distortion to take out: a model of COLMAP and its parameters in pixels of the sensor,
    /// `OPENCV fx,fy,cx,cy,k1,k2,p1,p2`
    #[arg(long, value_name = "MODEL PARAMS", value_parser = lens)]
    #[serde(serialize_with = "command_line::optional_text")]
    lens: Option<LensOption>,
    /// Longest side of the images, pixels, at least 16; larger ones are averaged [default: as the
    /// sensor has it]
    #[arg(long, value_name = "N")]
    long_side: Option<u32>,
    /// Write EXR files in 32 bits instead of half precision
    #[arg(long)]
    float: bool,
    /// Leave bad files out and continue; the report lists them
    #[arg(long)]
    skip_bad: bool,
    /// Merge only part I of N of the stacks, 1 to N. Parts share DIR and may run at once, on
    /// machines that share it; the same command without --shard then finishes: what is missing,
    /// reports, record
    #[arg(long, value_name = "I/N", conflicts_with = "force")]
    #[serde(serialize_with = "command_line::optional_text")]
    pub(crate) shard: Option<Shard>,
    /// Start over, replacing an earlier result of this command
    #[arg(long)]
    pub(crate) force: bool,
}

const EXAMPLES: &str = "Examples:
  eagpt ingest card/kitchen --out kitchen-hdr --vignetting=-0.22,0.05,-0.01
  eagpt ingest card/kitchen --out kitchen-hdr --long-side 1200 --skip-bad
  eagpt ingest card/kitchen --out kitchen-hdr --white-balance p000@1810,1204,160,120 --exposure-ratios estimate
  eagpt ingest merged-elsewhere --out hdr --exposures 0.01,0.04,0.16
  eagpt ingest card/kitchen --out kitchen-hdr --shard 1/4      (and 2/4 … on other machines, then without --shard)

capture.toml, in the folder of the capture:
  [[stack]]
  position = \"p000\"
  condition = \"front\"
  files = [\"front/DSC0001.ARW\", \"front/DSC0002.ARW\", \"front/DSC0003.ARW\"]";

fn polynomial(text: &str) -> Result<[f32; 3], String> {
    args::numbers(text).ok_or_else(|| format!("`{text}` is not A,B,C: three numbers"))
}

fn lens(text: &str) -> Result<LensOption, String> {
    let parts = text.trim().split_once(' ').and_then(|(model, params)| {
        let params: Option<Vec<f64>> = params
            .split(',')
            .map(|part| part.trim().parse().ok())
            .collect();
        Some(LensOption {
            model: model.to_owned(),
            params: params?,
        })
    });
    parts.ok_or_else(|| {
        format!("`{text}` is not a model, a space, and numbers with commas between them")
    })
}

fn white_balance(text: &str) -> Result<WhiteBalance, String> {
    if text == "as-shot" {
        return Ok(WhiteBalance::AsShot);
    }
    if let Some((stack, rectangle)) = text.rsplit_once('@') {
        if let Some(rectangle) = args::numbers(rectangle) {
            return Ok(WhiteBalance::GreyCard {
                stack: stack.to_owned(),
                rectangle,
            });
        }
    } else if let Some(factors) = args::numbers(text) {
        return Ok(WhiteBalance::Factors(factors));
    }
    Err(format!(
        "`{text}` is not as-shot, R,G,B or STACK@LEFT,TOP,WIDTH,HEIGHT"
    ))
}

fn options(args: &IngestArgs) -> IngestOptions {
    let vignetting = match (args.vignetting, &args.flat_field, &args.fit_vignetting) {
        (Some(abc), _, _) => Vignetting::Polynomial(abc),
        (_, Some(folder), _) => Vignetting::FlatField(folder.clone()),
        (_, _, Some(folder)) => Vignetting::Fit(folder.clone()),
        _ => Vignetting::None,
    };
    IngestOptions {
        stacks_in_folders: args.stacks_in_folders,
        exposures_s: args.exposures.clone(),
        max_pause_s: 60.0 * args.max_pause,
        exposure_ratios: args.exposure_ratios,
        clip_margin: args.clip_margin,
        white_balance: args.white_balance.clone(),
        scale: args.scale,
        demosaic: args.demosaic,
        vignetting,
        lens: args.lens.clone(),
        long_side: args.long_side,
        precision: if args.float {
            Precision::Float
        } else {
            Precision::Half
        },
        skip_bad: args.skip_bad,
    }
}

pub(crate) fn run(args: &IngestArgs, global: &GlobalArgs) -> Result<ExitCode> {
    let options = options(args);
    options.validate()?;
    let target = |force| Target::new(&args.out, "ingest", &[], force);
    // Another command's result is never touched; one of this command is added to, unless it is to
    // be replaced.
    target(true).check(&[])?;
    let request = IngestRequest {
        capture: args.capture.clone(),
        out: args.out.clone(),
        options: options.clone(),
        start_over: args.force,
        shard: args.shard.unwrap_or(Shard::WHOLE),
        decoding: decode::in_processes()?,
        stop: interrupt::stop_flag()?,
    };
    eagpt_ingest::check_places(&args.capture, &args.out)?;
    target(args.force).prepare()?;
    let mut builder = RecordBuilder::begin("ingest", &options, global)?;
    let mut reporter = Reporter::new(global);
    let mut warnings = Vec::new();
    let skip_bad = args.skip_bad;
    let listen = |reporter: &mut Reporter, message: &IngestProgress| {
        match message {
            IngestProgress::Warning { text } => warnings.push(text.clone()),
            IngestProgress::Problem(problem) if skip_bad => {
                warnings.push(format!("left out: {problem}"));
            }
            _ => {}
        }
        tell(reporter, message, skip_bad)
    };
    let outcome = reporter.follow(listen, |progress| ingest(&request, progress));
    let summary = match outcome {
        Err(error) if matches!(error.downcast_ref(), Some(IngestError::Stopped { .. })) => {
            reporter.note(&format!("{error}: the same command resumes"));
            return Ok(interrupt::exit_code());
        }
        other => other?,
    };
    let Some(summary) = summary else {
        let of = request.shard;
        reporter.note(&format!("{}: part {of}", args.out.display()));
        reporter.message(&serde_json::json!({
            "message": "done",
            "complete": false,
            "path": args.out,
        }))?;
        return Ok(ExitCode::SUCCESS);
    };
    let record = &mut builder.record;
    record.device = Some("cpu".to_owned());
    record.warnings = warnings;
    record.inputs = summary
        .inputs
        .into_iter()
        .map(|(path, blake3)| Input { path, blake3 })
        .collect();
    builder.wrote(&summary.outputs);
    let record_path = builder.write(&args.out)?;
    let num_stacks = summary.capture.stacks.len();
    reporter.note(&format!(
        "{}: {num_stacks} images, {} made before; {}",
        args.out.display(),
        summary.num_kept,
        args.out.join("report.html").display()
    ));
    reporter.message(&serde_json::json!({
        "message": "done",
        "path": args.out,
        "record": record_path,
        "num_stacks": num_stacks,
        "num_kept": summary.num_kept,
        "num_left_out": summary.capture.left_out.len(),
    }))?;
    Ok(ExitCode::SUCCESS)
}

/// Shows a message of the job.
fn tell(reporter: &mut Reporter, message: &IngestProgress, skip_bad: bool) -> Result<()> {
    let (task, steps) = match message {
        IngestProgress::Reading { done, total } => (("reading", "files"), (*done, *total)),
        IngestProgress::Surveying { done, total } => (("looking", "stacks"), (*done, *total)),
        IngestProgress::Merging { done, total, .. } => (("merging", "stacks"), (*done, *total)),
        IngestProgress::Problem(problem) => {
            if skip_bad {
                reporter.warning(&format!("left out: {problem}"));
            } else if !reporter.is_json() {
                // Errors, and so not for `--quiet` to keep back.
                terminal::line(&format!("error: {problem}"));
            }
            return reporter.message(message);
        }
        IngestProgress::Note { text } => {
            reporter.note(text);
            return reporter.message(message);
        }
        IngestProgress::Warning { text } => {
            reporter.warning(text);
            return reporter.message(message);
        }
    };
    let note = || match message {
        IngestProgress::Merging { stack, .. } => stack.clone(),
        _ => String::new(),
    };
    reporter.count_with(task, steps, note, message)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn white_balances_are_parsed() {
        assert_eq!(white_balance("as-shot"), Ok(WhiteBalance::AsShot));
        assert_eq!(
            white_balance("2,1,1.5"),
            Ok(WhiteBalance::Factors([2.0, 1.0, 1.5]))
        );
        let card = WhiteBalance::GreyCard {
            stack: "front/p0".to_owned(),
            rectangle: [1, 2, 30, 40],
        };
        assert_eq!(white_balance("front/p0@1,2,30,40"), Ok(card));
        for bad in ["2,1", "p0@1,2,3", "warm", "p0@1,2,3,-4"] {
            assert!(white_balance(bad).unwrap_err().contains(bad));
        }
    }
}
