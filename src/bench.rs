//! `eagpt bench`: how fast each stage is.

mod images;
mod inputs;
mod learning;
mod rays;
mod results;
mod scene;
mod sheet;
mod stage;
mod table;

use crate::args::{self, GlobalArgs};
use crate::device::DeviceArgs;
use crate::interrupt;
use crate::output::{self, Replace};
use crate::progress::Reporter;
use crate::record::{Input, RecordBuilder};
use crate::terminal;
use anyhow::{Context, Result, bail};
use clap::Args;
use eagpt_scene::{Gaussians, files};
use eagpt_trace::Device;
use inputs::Bench;
use results::{Change, Machine, Measured, Results};
use scene::Subject;
pub(crate) use sheet::Unit;
use sheet::{Row, Sheet};
use stage::Stage;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::Ordering;
use std::time::Duration;
pub(crate) use table::figure;

/// Measure the speed of each stage on this machine
///
/// Every figure is the median of several runs, with the smallest and the largest, and the peak
/// memory of the process during them. Four views of the dataset are rendered; without a dataset,
/// four of a room that comes with the program. Without a scene, Gaussians are those that training
/// would start from: figures of a trained scene differ, --scene gives them. On a GPU, rows named
/// after kernels are times by the device's timestamps.
///
/// --baseline compares with an earlier result: old figure, ratio (2 is twice as fast), and `faster`
/// or `SLOWER` where all runs of one lie beyond all runs of the other. Measure on a machine that
/// does nothing else. Files are written in the system's temporary folder.
#[derive(Debug, Args)]
#[command(after_long_help = EXAMPLES)]
pub(crate) struct BenchArgs {
    /// Dataset to measure on: a folder with a transforms.json, or that file [default: an embedded
    /// room]
    #[arg(value_name = "DATASET")]
    dataset: Option<PathBuf>,
    /// Scene to measure on [default: what training would start from]
    #[arg(long, value_name = "SCENE.ply")]
    scene: Option<PathBuf>,
    #[command(flatten)]
    device: DeviceArgs,
    /// Stages to measure, divided by commas [default: all]
    #[arg(long, value_name = "STAGE", value_enum, value_delimiter = ',')]
    stage: Vec<Stage>,
    /// Numbers of Gaussians, 1 to 100M, divided by commas, as 25k,250k,1M: the scene is thinned out
    /// or split [default: as it is]
    #[arg(long, value_name = "N", value_delimiter = ',', value_parser = count)]
    gaussians: Vec<usize>,
    /// Numbers of threads, divided by commas [default: one, and all; on a GPU, all]
    #[arg(long, value_name = "N", value_delimiter = ',')]
    thread_counts: Vec<NonZeroUsize>,
    /// Seconds for each figure, 0 to 3600; there are three runs and one to warm up however long
    /// they take
    #[arg(long, value_name = "S", default_value_t = 2.0, value_parser = args::within(0.0_f64..=3600.0))]
    seconds: f64,
    /// Size of the images of metrics and EXR files, pixels, 16x16 to 16384x16384
    #[arg(long, value_name = "WxH", default_value = "3000x2000", value_parser = args::size(16..=16_384))]
    image: [u32; 2],
    /// Samples for each pixel of path-traced frames, 1 to 65536
    #[arg(long, value_name = "N", default_value_t = 1,
        value_parser = clap::value_parser!(u32).range(1..=65_536))]
    spp: u32,
    /// File for the figures, JSON
    #[arg(long, value_name = "BENCH.json")]
    out: Option<PathBuf>,
    /// Earlier figures to compare with
    #[arg(long, value_name = "BENCH.json")]
    baseline: Option<PathBuf>,
    /// Compare with figures of another machine, too
    #[arg(long, requires = "baseline")]
    any_machine: bool,
    /// Replace an earlier result of this command
    #[arg(long)]
    force: bool,
}

const EXAMPLES: &str = "Examples:
  eagpt bench
  eagpt bench kitchen --scene runs/kitchen/scene.ply --out bench.json
  eagpt bench kitchen --scene runs/kitchen/scene.ply --baseline bench.json
  eagpt bench --stage bounce-rays,paths --gaussians 25k,60k,250k,1M --thread-counts 1,2,4
  eagpt bench --device gpu --gaussians 500k --spp 64";

fn count(text: &str) -> Result<usize, String> {
    let (digits, factor) = match text.strip_suffix(['k', 'M']) {
        Some(digits) if text.ends_with('k') => (digits, 1e3),
        Some(digits) => (digits, 1e6),
        None => (text, 1.0),
    };
    let number = digits.parse::<f64>().ok().map(|n| (n * factor).round());
    match number {
        Some(number) if (1.0..=1e8).contains(&number) => Ok(number as usize),
        _ => Err(format!("`{text}` is no number from 1 to 100M")),
    }
}

/// A stage on a scene with so many threads.
struct StageRun {
    stage: Stage,
    /// Index of the scene; `None` for a stage of images.
    scene: Option<usize>,
    threads: usize,
}

pub(crate) fn run(args: &BenchArgs, global: &GlobalArgs) -> Result<ExitCode> {
    let baseline = args.baseline.as_deref().map(Results::read).transpose()?;
    let mut reporter = Reporter::new(global);
    let device = args.device.open(&mut reporter)?;
    let device_name = device.name();
    if let (Some(path), Some(baseline)) = (&args.baseline, &baseline) {
        check_machine(path, baseline, &device_name, args.any_machine, &reporter)?;
    }
    let inputs: Vec<&Path> = [&args.dataset, &args.scene, &args.baseline]
        .into_iter()
        .filter_map(|path| path.as_deref())
        .collect();
    if let Some(out) = &args.out {
        output::check_file(out, "bench", &inputs, Replace::from_flag(args.force))?;
        output::create_parent(out)?;
    }
    let stop = interrupt::stop_flag()?;
    let work = tempfile::tempdir().context("temporary folder")?;
    let subject = Subject::prepare(args.dataset.as_deref(), args.scene.as_deref(), work.path())?;
    let measured = measured(args, device_name.clone(), &subject);
    let mut builder = RecordBuilder::begin("bench", &measured, global)?;
    let scenes = scenes(args, &subject.gaussians);
    let tasks = tasks(&measured.stages, &scenes, &thread_counts(args, &device));
    let mut results = Results::begin(measured);
    reporter.begin("bench", "stages", 0, tasks.len() as u64);
    for (done, task) in tasks.iter().enumerate() {
        if stop.load(Ordering::Relaxed) {
            reporter.finish();
            return Ok(interrupt::exit_code());
        }
        let gaussians = &scenes[task.scene.unwrap_or(0)];
        let first = results.rows.len();
        let name = task.stage.name();
        if task.stage.needs_emitters() && !emits(gaussians) {
            reporter.warning(&format!("{name}: left out, nothing emits"));
        } else if task.stage.needs_cpu() && !matches!(device, Device::Cpu) {
            reporter.note(&format!("{name}: left out, it needs --device cpu"));
        } else {
            let bench = Bench {
                device: &device,
                cameras_at: &subject.cameras,
                views: &subject.views,
                gaussians,
                extent: subject.extent,
                image: args.image,
                num_samples: args.spp,
                work: work.path(),
            };
            measure(task, &bench, args.seconds, &mut results.rows)?;
        }
        let done = done as u64 + 1;
        reporter.advance(done, || name.clone());
        let rows = results.rows[first..].iter();
        let rows = rows.map(|row| Change::of(row, baseline.as_ref()));
        reporter.message(&serde_json::json!({
            "message": "stage",
            "stage": name,
            "gaussians": task.scene.map(|_| gaussians.len()),
            "threads": task.threads,
            "rows": rows.collect::<Vec<_>>(),
        }))?;
    }
    reporter.finish();
    if let Some(out) = &args.out {
        let mut text = serde_json::to_string_pretty(&results)?;
        text.push('\n');
        files::write_bytes_atomic(out, text.as_bytes())?;
        let scene = args.scene.iter().map(|path| Input::of(path));
        builder.record.inputs = scene.collect::<Result<_>>()?;
        builder.record.device = Some(device_name);
        builder.wrote(out.file_name());
        builder.write_to(&output::record_path(out))?;
    }
    if !global.json {
        let heading = format!(
            "eagpt {}, {}\n{}; {}: {}x{}, {}\n\n",
            results.built(),
            results.machine.line(),
            results.options.device,
            results.options.dataset,
            results.options.view[0],
            results.options.view[1],
            results.options.scene.as_deref().unwrap_or("not trained"),
        );
        terminal::print(&(heading + &table::text(&results, baseline.as_ref())))?;
    }
    Ok(ExitCode::SUCCESS)
}

fn check_machine(
    path: &Path,
    baseline: &Results,
    device: &str,
    any_machine: bool,
    reporter: &Reporter,
) -> Result<()> {
    let mut differs = baseline.machine.differences(&Machine::here());
    if baseline.options.device != device {
        differs.push("device");
    }
    if differs.is_empty() {
        return Ok(());
    }
    let problem = format!(
        "{}: machine: measured on another ({}; differs in {})",
        path.display(),
        baseline.machine.line(),
        differs.join(", ")
    );
    if !any_machine {
        bail!("{problem}: --any-machine compares all the same");
    }
    reporter.warning(&problem);
    Ok(())
}

fn measured(args: &BenchArgs, device: String, subject: &Subject) -> Measured {
    let camera = &subject.views[0].camera;
    Measured {
        device,
        dataset: subject.dataset.clone(),
        scene: args.scene.as_ref().map(|path| path.display().to_string()),
        view: [camera.width, camera.height],
        image: args.image,
        num_samples: args.spp,
        stages: if args.stage.is_empty() {
            Stage::all().to_vec()
        } else {
            args.stage.clone()
        },
        seconds: args.seconds,
    }
}

/// The scene in all numbers of Gaussians.
fn scenes(args: &BenchArgs, gaussians: &Gaussians) -> Vec<Gaussians> {
    if args.gaussians.is_empty() {
        return vec![gaussians.clone()];
    }
    let counts = args.gaussians.iter();
    counts
        .map(|&num| scene::resampled(gaussians, num))
        .collect()
}

fn thread_counts(args: &BenchArgs, device: &Device) -> Vec<usize> {
    let mut counts: Vec<usize> = args.thread_counts.iter().map(|num| num.get()).collect();
    if counts.is_empty() {
        counts = vec![rayon::current_num_threads()];
        if matches!(device, Device::Cpu) {
            counts.push(1);
        }
    }
    counts.sort_unstable();
    counts.dedup();
    counts
}

/// Stage by stage, scene by scene, so that figures to compare are neighbours.
fn tasks(stages: &[Stage], scenes: &[Gaussians], threads: &[usize]) -> Vec<StageRun> {
    let mut tasks = Vec::new();
    for &stage in stages {
        let scenes = if stage.is_of_images() {
            vec![None]
        } else {
            (0..scenes.len()).map(Some).collect()
        };
        for scene in scenes {
            tasks.extend(threads.iter().map(|&threads| StageRun {
                stage,
                scene,
                threads,
            }));
        }
    }
    tasks
}

fn emits(gaussians: &Gaussians) -> bool {
    let threshold = eagpt_trace::transport::EMISSION_THRESHOLD;
    gaussians.emissions.iter().any(|&e| e > threshold)
}

/// Measures one task in a pool of its threads.
fn measure(task: &StageRun, bench: &Bench<'_>, seconds: f64, rows: &mut Vec<Row>) -> Result<()> {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(task.threads)
        .build()
        .context("threads")?;
    let mut sheet = Sheet {
        rows,
        device: bench.device,
        stage: task.stage.name(),
        gaussians: task.scene.map(|_| bench.gaussians.len()),
        threads: task.threads,
        budget: Duration::from_secs_f64(seconds),
    };
    pool.install(|| task.stage.run(bench, &mut sheet))
        .with_context(|| task.stage.name())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_have_thousands_and_millions() {
        assert_eq!(count("25k"), Ok(25_000));
        assert_eq!(count("1M"), Ok(1_000_000));
        assert_eq!(count("0.5M"), Ok(500_000));
        assert_eq!(count("58800"), Ok(58_800));
        for bad in ["0", "", "k", "1G", "-3", "200M", "nan"] {
            assert!(count(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn stages_of_images_are_measured_once_for_each_number_of_threads() {
        let scenes = [Gaussians::default(), Gaussians::default()];
        let tasks = tasks(&[Stage::Exr, Stage::Ply], &scenes, &[1, 2]);
        assert_eq!(tasks.len(), 2 + 4);
        assert!(tasks[..2].iter().all(|task| task.scene.is_none()));
    }
}
