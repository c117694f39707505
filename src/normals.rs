//! `eagpt normals`: normal maps of any estimator for a dataset.

use crate::args::{self, Auto, GlobalArgs};
use crate::output::Target;
use crate::progress::Reporter;
use crate::record::{Input, RecordBuilder};
use anyhow::Result;
use clap::Args;
use eagpt_convert::normals::{
    Axes, Encoding, NormalOptions, NormalProgress, NormalRequest, NormalSummary, Reading, Space,
    make_normals, planned_files,
};
use eagpt_scene::Dataset;
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Put normal maps of any estimator into a dataset
///
/// Maps are EXR or PNG of any size, called like the views. Their space (the camera's or the
/// world's) and axes are detected by comparison with the surfaces that the dataset's depths span,
/// or the planes of its points; or they are given, and checked the same way. Where no reading
/// stands out, nothing is written.
///
/// Writes Normal-exr/<view>.exr (world space, unit length, turned to the camera, 0 where unknown)
/// and into normals/ previews and report.json. The maps may also be made here, by a network in ONNX
/// that you have (--onnx). Views without a map have no normals, which training makes up for by
/// itself.
#[derive(Debug, Clone, Args, Serialize)]
#[command(after_long_help = EXAMPLES)]
pub(crate) struct NormalsArgs {
    /// Dataset: a folder with a transforms.json, or that file
    #[arg(value_name = "DATASET")]
    pub(crate) dataset: PathBuf,
    /// Folder of maps, <view>.exr or <view>.png, made of the dataset's own images; views may be
    /// missing
    #[arg(
        long,
        value_name = "DIR",
        required_unless_present = "onnx",
        conflicts_with = "onnx"
    )]
    maps: Option<PathBuf>,
    #[command(flatten)]
    #[serde(flatten)]
    network: NetworkArgs,
    /// Suffix of the view's name in the names of maps, as _normal in 0001_normal.png
    #[arg(
        long,
        value_name = "TEXT",
        default_value = "",
        hide_default_value = true
    )]
    suffix: String,
    /// Folder to write to [default: that of the dataset, where training looks for normals]
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// Space of the maps' vectors
    #[arg(long, default_value = "auto", value_parser = args::auto::<Space>("Detected"))]
    space: Auto<Space>,
    /// Axes of the maps: `opencv` (x right, y down, z forward), `opengl` (y up, z to
    /// the viewer), `directx` (y down, z to the viewer), or which component with which sign is x, y
    /// and z, as x,-y,-z; `auto` detects them
    #[arg(long, value_name = "AXES", default_value = "auto", value_parser = axes, allow_hyphen_values = true)]
    axes: Auto<Axes>,
    /// Encoding of the maps' components
    #[arg(
        long,
        default_value = "auto",
        value_parser = args::auto::<Encoding>("Detected: PNG from 0 to 1, EXR by its values")
    )]
    encoding: Auto<Encoding>,
    /// Replace an earlier result of this command, and normals that are there
    #[arg(long)]
    pub(crate) force: bool,
}

/// A network that makes the maps.
#[derive(Debug, Clone, Args, Serialize)]
#[command(next_help_heading = "Network")]
struct NetworkArgs {
    /// Network to make maps with: an ONNX model of one picture (1x3xHxW or 1xHxWx3) whose output
    /// has three channels, or four with a confidence. Its maps go to normals/network/ as they come
    /// out
    #[arg(long, value_name = "MODEL.onnx")]
    onnx: Option<PathBuf>,
    /// Library of ONNX Runtime [default: as EAGPT_ONNXRUNTIME says, else where the dynamic loader
    /// looks]
    #[arg(long, value_name = "FILE", requires = "onnx")]
    onnxruntime: Option<PathBuf>,
    /// Width and height of the network's picture, pixels, 1 to 8192 each [default: what the model
    /// says, else the view's, rounded]
    #[arg(long, value_name = "WxH", requires = "onnx", value_parser = args::size(1..=8192))]
    size: Option<[u32; 2]>,
    /// Number of which the sides of the picture become multiples, where the model leaves them
    /// open, 1 to 1024
    #[arg(long, value_name = "PIXELS", requires = "onnx", default_value_t = 32)]
    multiple: u32,
    /// Mean that is subtracted from the picture's sRGB values, by channel
    #[arg(long, value_name = "R,G,B", requires = "onnx", default_value = "0.485,0.456,0.406", value_parser = three)]
    mean: [f32; 3],
    /// Standard deviation that the difference is divided by, by channel, each above 0
    #[arg(long, value_name = "R,G,B", requires = "onnx", default_value = "0.229,0.224,0.225", value_parser = three)]
    deviation: [f32; 3],
}

fn three(text: &str) -> Result<[f32; 3], String> {
    args::numbers(text).ok_or_else(|| "not three numbers, as 0.5,0.5,0.5".to_owned())
}

const EXAMPLES: &str = "Examples:
  eagpt normals kitchen --maps stable-normal/kitchen
  eagpt normals kitchen --maps dsine --suffix _normal --space camera --axes opengl
  eagpt normals kitchen --maps omnidata --out normals-omnidata
  eagpt normals kitchen --onnx dsine.onnx --onnxruntime /opt/onnxruntime/lib/libonnxruntime.so";

fn axes(text: &str) -> Result<Auto<Axes>, String> {
    match text {
        "auto" => Ok(Auto(None)),
        _ => text.parse().map(|axes| Auto(Some(axes))),
    }
}

/// The record in the dataset's own folder, which other commands may have records in.
const RECORD: &str = "normals.record.json";

#[derive(Serialize)]
struct Recorded<'a> {
    dataset: &'a Path,
    maps: &'a Path,
    network: Option<&'a NetworkRecord>,
    #[serde(flatten)]
    options: &'a NormalOptions,
    /// Space, axes and encoding of the maps.
    reading: Option<Reading>,
}

pub(crate) fn run(args: &NormalsArgs, global: &GlobalArgs) -> Result<ExitCode> {
    let options = options(args);
    let network = network(&args.network)?;
    let dataset = Dataset::open(&args.dataset)?;
    let out = args.out.clone();
    let out = out.unwrap_or_else(|| dataset.root().to_owned());
    let maps = args.maps.clone();
    let maps = maps.unwrap_or_else(|| out.join(NETWORK_DIR));
    let recorded = |reading| Recorded {
        dataset: &args.dataset,
        maps: &maps,
        network: network.as_ref(),
        options: &options,
        reading,
    };
    let mut builder = RecordBuilder::begin("normals", &recorded(None), global)?;
    let inputs = inputs(&dataset, args.maps.as_deref(), &args.suffix);
    let target = Target {
        record: RECORD,
        ..Target::new(&out, "normals", &inputs, args.force)
    };
    let mut planned = planned_files(&dataset);
    if network.is_some() {
        let frames = dataset.frames().iter();
        planned.extend(frames.map(|f| Path::new(NETWORK_DIR).join(format!("{}.exr", f.name))));
    }
    target.check(&planned)?;
    target.prepare()?;
    let request = NormalRequest {
        dataset: &dataset,
        maps: maps.clone(),
        out,
        options: options.clone(),
    };
    let mut reporter = Reporter::new(global);
    if let Some(network) = &network {
        estimate(&mut reporter, &dataset, network, &maps)?;
    }
    let summary = reporter.follow(tell, |progress| make_normals(&request, progress))?;
    builder.set_options(&recorded(Some(summary.report.reading)))?;
    let record = &mut builder.record;
    record.inputs.push(Input::of_cameras(&dataset)?);
    if let Some(model) = &args.network.onnx {
        record.inputs.push(Input::of(model)?);
    }
    record.warnings.clone_from(&summary.warnings);
    builder.wrote(&summary.outputs);
    if network.is_some() {
        builder.wrote(planned.iter().filter(|file| file.starts_with(NETWORK_DIR)));
    }
    builder.write_to(&request.out.join(RECORD))?;
    close(&reporter, &request.out, &summary)?;
    Ok(ExitCode::SUCCESS)
}

fn options(args: &NormalsArgs) -> NormalOptions {
    NormalOptions {
        space: args.space.0,
        axes: args.axes.0,
        encoding: args.encoding.0,
        suffix: args.suffix.clone(),
    }
}

/// Files that normals must not replace: those of the dataset but its normals, and the maps.
fn inputs(dataset: &Dataset, maps: Option<&Path>, suffix: &str) -> Vec<PathBuf> {
    let frames = dataset.frames().iter();
    let normals: Vec<&PathBuf> = frames.filter_map(|f| f.files.normal.as_ref()).collect();
    let mut files = dataset.files();
    files.retain(|file| !normals.contains(&file));
    let Some(maps) = maps else { return files };
    for frame in dataset.frames() {
        let map = |extension| maps.join(format!("{}{suffix}.{extension}", frame.name));
        files.extend(["exr", "png"].map(map));
    }
    files
}

/// Folder of a network's own maps, inside of the folder of results.
const NETWORK_DIR: &str = "normals/network";

/// A network and what it wants to see, as the record has it.
#[cfg(feature = "onnx")]
type NetworkRecord = eagpt_convert::normals::NetworkOptions;
#[cfg(not(feature = "onnx"))]
type NetworkRecord = ();

#[cfg(feature = "onnx")]
fn network(args: &NetworkArgs) -> Result<Option<NetworkRecord>> {
    let Some(model) = &args.onnx else {
        return Ok(None);
    };
    let options = NetworkRecord {
        model: model.clone(),
        library: args.onnxruntime.clone(),
        size: args.size,
        multiple: args.multiple,
        mean: args.mean,
        deviation: args.deviation,
    };
    options.validate()?;
    Ok(Some(options))
}

#[cfg(not(feature = "onnx"))]
fn network(args: &NetworkArgs) -> Result<Option<NetworkRecord>> {
    if args.onnx.is_some() {
        anyhow::bail!("--onnx: this program was built without it: cargo build --features onnx");
    }
    Ok(None)
}

/// Makes maps by a network.
#[cfg(feature = "onnx")]
fn estimate(
    reporter: &mut Reporter,
    dataset: &Dataset,
    network: &NetworkRecord,
    maps: &Path,
) -> Result<()> {
    reporter.follow(tell, |progress| {
        eagpt_convert::normals::run_network(dataset, network, maps, progress)
    })
}

#[cfg(not(feature = "onnx"))]
fn estimate(_: &mut Reporter, _: &Dataset, (): &NetworkRecord, _: &Path) -> Result<()> {
    Ok(())
}

/// Shows a message of the job.
fn tell(reporter: &mut Reporter, message: &NormalProgress) -> Result<()> {
    let (name, done, total) = match message {
        NormalProgress::Estimating { done, total } => ("estimating", *done, *total),
        NormalProgress::Comparing { done, total } => ("comparing", *done, *total),
        NormalProgress::Writing { done, total } => ("writing", *done, *total),
        NormalProgress::Reading(reading) => {
            let space = match reading.space {
                Space::Camera => "camera",
                Space::World => "world",
            };
            let cosine = reading.mean_cosine.map_or(String::new(), |cosine| {
                let next = reading.next_best.unwrap_or(-1.0);
                format!(
                    ", mean cosine {cosine:.3} to the dataset's own surfaces, next best {next:.3}"
                )
            });
            reporter.note(&format!(
                "maps are read in {space} space as {}{cosine}",
                reading.axes
            ));
            return reporter.message(message);
        }
        NormalProgress::Warning { text } => {
            reporter.warning(text);
            return reporter.message(message);
        }
    };
    reporter.count((name, "views"), (done, total), message)
}

/// Reports the outcome.
fn close(reporter: &Reporter, out: &Path, summary: &NormalSummary) -> Result<()> {
    let views = &summary.report.views;
    let mean = |of: &dyn Fn(&eagpt_convert::normals::NormalView) -> f64| {
        views.iter().map(of).sum::<f64>() / views.len().max(1) as f64
    };
    reporter.note(&format!(
        "{}: {} views with normals in {:.1} % of their pixels, {} without",
        out.display(),
        views.len(),
        100.0 * mean(&|view| view.known),
        summary.report.missing.len()
    ));
    reporter.message(&serde_json::json!({
        "message": "done",
        "path": out,
        "reading": summary.report.reading,
        "num_views": views.len(),
        "num_missing": summary.report.missing.len(),
    }))
}
