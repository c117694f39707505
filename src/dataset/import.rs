//! `eagpt dataset import`: a dataset of another program becomes ours.

use crate::args::{self, Auto, GlobalArgs};
use crate::output::Target;
use crate::progress::Reporter;
use crate::record::{Input, RecordBuilder};
use anyhow::Result;
use clap::Args;
use eagpt_convert::World;
use eagpt_convert::import::{BadFrames, Ldr, planned_files};
use eagpt_convert::{
    ImportOptions, ImportProgress, ImportSummary, SourceDataset, SourceFormat, import,
};
use eagpt_scene::dataset::UpAxis;
use eagpt_scene::exr::Precision;
use eagpt_scene::lens::{Field, UndistortOptions};
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Make a dataset from one of another program or from a public one
///
/// Cameras become pinholes and images linear Rec.709 EXR; images of lenses that distort are
/// resampled, others keep their pixels. Writes transforms.json, Radiance-exr/ and what else the
/// source has (Emissive-exr, Normal-exr, Alpha-exr, Depth-exr, DiffCol, points3d.ply), Valid-exr/
/// where pixels are not known, import.json with everything that was detected and decided, and
/// record.json.
///
/// FIPT: cam.txt and K_list.txt with Image/, y up; or train/ and val/ of synthetic scenes. Eyeful
/// Tower: cameras.json with images-2k/ or images-1k/, y up, metres; white balance by the scene,
/// DCI-P3 to Rec.709. nerfstudio and instant-NGP: transforms.json with what it names. Blender:
/// transforms_train.json, transforms_val.json and transforms_test.json; the split is kept
/// (`listed`).
/// eagpt: our own layout, to be turned, shrunk or written anew.
#[derive(Debug, Clone, Args)]
#[command(after_long_help = EXAMPLES)]
pub(crate) struct ImportArgs {
    /// Folder of the source, or its transforms.json
    #[arg(value_name = "SOURCE")]
    source: PathBuf,
    /// Layout of the source; `auto` detects it from the files and the keys in them
    #[arg(
        long,
        default_value = "auto",
        value_parser = args::auto::<SourceFormat>("One of those below")
    )]
    format: Auto<SourceFormat>,
    /// Folder of the dataset to write
    #[arg(long, value_name = "DATASET")]
    out: PathBuf,
    /// World of the dataset
    #[arg(long, value_enum, default_value = "keep")]
    world: World,
    /// Axis that points up in the source's world, one of x, -x, y, -y, z, -z [default: that of the
    /// format]
    #[arg(long, value_name = "AXIS", value_parser = str::parse::<UpAxis>, allow_hyphen_values = true)]
    up_axis: Option<UpAxis>,
    /// Length of a unit of the source's world in metres, above 0 [default: that of the format, if
    /// it has one]
    #[arg(long, value_name = "METRES")]
    metres_per_unit: Option<f64>,
    /// Part of a distorted image that the pinhole image shows
    #[arg(long, value_enum, default_value = "inside")]
    field: Field,
    /// Largest angle of view of a pinhole image, degrees in either direction, above 0 and at most
    /// 170
    #[arg(long, value_name = "DEGREES", default_value_t = UndistortOptions::default().max_fov_deg)]
    max_fov: f64,
    /// Longest edge of the images, pixels, 1 to 65535: larger ones are shrunk, with means of light
    /// [default: the source's size]
    #[arg(long, value_name = "PIXELS")]
    max_edge: Option<u32>,
    /// Sample type of the images
    #[arg(long, value_enum, default_value = "float")]
    precision: Precision,
    /// Factor of all radiances, above 0; FIPT's own loader takes 2 for its real scenes
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0)]
    radiance_scale: f64,
    /// Factors of R, G and B in the source's colour space, each above 0 [default: for Eyeful Tower
    /// those of the scene, else 1,1,1]
    #[arg(long, value_name = "R,G,B", value_delimiter = ',', num_args = 1, value_parser = clap::value_parser!(f64))]
    white_balance: Option<Vec<f64>>,
    /// Scene of Eyeful Tower whose white balance to take [default: as NAME-final.pdf is called,
    /// else the folder]
    #[arg(long, value_name = "NAME")]
    scene: Option<String>,
    /// Folder of images where a source has several, as images-1k of Eyeful Tower [default: the
    /// first of images-2k, images-1k]
    #[arg(long, value_name = "FOLDER")]
    images: Option<String>,
    /// Scene units that a value of 1 in nerfstudio's depth images stands for, above 0; 0.001 is
    /// millimetres in a world in metres
    #[arg(long, value_name = "UNITS", default_value_t = 1e-3)]
    depth_unit: f64,
    /// Treatment of photographs that are PNG or JPEG
    #[arg(long, value_enum, default_value = "refuse")]
    ldr: Ldr,
    /// Import the other frames where some cannot be used
    #[arg(long)]
    skip_bad: bool,
    /// Replace an earlier result of this command
    #[arg(long)]
    force: bool,
}

const EXAMPLES: &str = "Examples:
  eagpt dataset import fipt/conference --radiance-scale 2 --out conference
  eagpt dataset import eyeful/apartment --max-edge 1024 --precision half --out apartment
  eagpt dataset import eyeful/workshop --max-fov 100 --world z-up --out workshop
  eagpt dataset import room/transforms.json --ldr srgb --skip-bad --out room-ldr";

#[derive(Serialize)]
struct Recorded<'a> {
    source: &'a Path,
    format: SourceFormat,
    #[serde(flatten)]
    options: &'a ImportOptions,
}

pub(super) fn run(args: &ImportArgs, global: &GlobalArgs) -> Result<ExitCode> {
    let options = options(args)?;
    let mut builder = RecordBuilder::begin("dataset import", &options, global)?;
    let source = SourceDataset::open(&args.source, args.format.0, &options)?;
    builder.set_options(&Recorded {
        source: &args.source,
        format: source.format,
        options: &options,
    })?;
    let inputs = source.files();
    let target = Target::new(&args.out, "dataset import", &inputs, args.force);
    let planned = planned_files(&source);
    target.check(&planned)?;
    super::refuse_foreign(&args.out, &planned)?;
    let mut reporter = Reporter::new(global);
    reporter.note(&format!(
        "{}: format {}, {} frames",
        source.root.display(),
        source.format,
        source.num_frames()
    ));
    // Problems are reported before the earlier result is removed.
    if !source.problems.is_empty() && options.bad_frames == BadFrames::Refuse {
        return Err(refuse(&mut reporter, &source));
    }
    target.prepare()?;
    let summary = reporter.follow(tell, |progress| {
        import(&source, &args.out, &options, progress)
    })?;
    let record = &mut builder.record;
    for file in source.camera_files() {
        record.inputs.push(Input::of(file)?);
    }
    record.warnings.clone_from(&summary.report.warnings);
    builder.wrote(&summary.outputs);
    builder.write(&args.out)?;
    close(&reporter, &args.out, &summary)?;
    Ok(ExitCode::SUCCESS)
}

fn refuse(reporter: &mut Reporter, source: &SourceDataset) -> anyhow::Error {
    // People are told by causes; programs want each.
    for problem in &source.problems {
        if let Err(error) = reporter.message(&ImportProgress::Bad(problem.clone())) {
            return error;
        }
    }
    source.bad_frames().into()
}

fn options(args: &ImportArgs) -> Result<ImportOptions> {
    let white_balance = args.white_balance.as_deref().map(|gains| {
        <[f64; 3]>::try_from(gains).map_err(|_| {
            anyhow::anyhow!("--white-balance: {} factors, not 3 as R,G,B", gains.len())
        })
    });
    let options = ImportOptions {
        ldr: args.ldr,
        bad_frames: if args.skip_bad {
            BadFrames::Skip
        } else {
            BadFrames::Refuse
        },
        world: args.world,
        up_axis: args.up_axis,
        metres_per_unit: args.metres_per_unit,
        undistort: UndistortOptions {
            pinhole: None,
            field: args.field,
            max_fov_deg: args.max_fov,
        },
        max_edge: args.max_edge,
        precision: args.precision,
        radiance_scale: args.radiance_scale,
        white_balance: white_balance.transpose()?,
        scene: args.scene.clone(),
        images: args.images.clone(),
        depth_unit: args.depth_unit,
    };
    options.validate()?;
    Ok(options)
}

/// Shows a message of the job.
fn tell(reporter: &mut Reporter, message: &ImportProgress) -> Result<()> {
    match message {
        ImportProgress::Importing { done, total } => {
            return reporter.count(("importing", "views"), (*done, *total), message);
        }
        ImportProgress::Bad(problem) => {
            reporter.note(&format!("bad: {}: {}", problem.view, problem.problem));
        }
        ImportProgress::Note { text } => reporter.note(text),
        ImportProgress::Warning { text } => reporter.warning(text),
    }
    reporter.message(message)
}

/// Reports the outcome.
fn close(reporter: &Reporter, out: &Path, summary: &ImportSummary) -> Result<()> {
    let report = &summary.report;
    let num_resampled = report.lenses.iter().filter(|lens| !lens.kept).count();
    let num_points = report.num_points.unwrap_or(0);
    reporter.note(&format!(
        "{}: {} views, {} lenses of which {num_resampled} resampled, {num_points} points, {} frames left out",
        out.display(),
        report.views.len(),
        report.lenses.len(),
        report.left_out.len(),
    ));
    reporter.message(&serde_json::json!({
        "message": "done",
        "path": out,
        "format": report.format,
        "num_views": report.views.len(),
        "num_lenses": report.lenses.len(),
        "num_points": report.num_points,
        "num_left_out": report.left_out.len(),
    }))
}
