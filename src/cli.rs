//! The commands, and the options that all of them share.

use crate::{
    bake, bench, colmap, dataset, demo, doctor, edit, eval, export, ingest, masks, normals, paper,
    render, report, run, shell, synth, train,
};
use anyhow::{Context, Result};
use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{ArgAction, Args, Parser, Subcommand};
use eagpt_scene::Dataset;
use eagpt_scene::dataset::{SplitRule, Subset};
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// From HDR photographs of a room to a relightable scene of 2D Gaussians
///
/// Every command reads files and writes files: a scene, images, tables, and beside them a
/// record.json with the version, the effective options, the seed, hashes of the inputs, times and
/// peak memory. A seed gives the same bits for any number of threads.
///
/// Bad input ends in one line `error: …` that names the file, the field and the value, and in exit
/// code 1; wrong arguments in exit code 2; a run stopped by Ctrl-C in exit code 130.
#[derive(Debug, Parser)]
#[command(
    name = "eagpt",
    version,
    max_term_width = 110,
    subcommand_required = true
)]
pub(crate) struct Cli {
    #[command(flatten)]
    pub(crate) global: GlobalArgs,
    #[command(subcommand)]
    pub(crate) command: Command,
}

/// Options of every command.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Global options")]
pub(crate) struct GlobalArgs {
    /// Threads to compute with [default: one for each core]
    #[arg(long, global = true, value_name = "N")]
    pub(crate) threads: Option<NonZeroUsize>,
    /// Write progress and results as JSON, one object a line, on standard output
    #[arg(long, global = true)]
    pub(crate) json: bool,
    /// Say more: once for what is done, twice for details
    #[arg(short, long, global = true, action = ArgAction::Count)]
    pub(crate) verbose: u8,
    /// Say nothing but errors
    #[arg(short, long, global = true, conflicts_with = "verbose")]
    pub(crate) quiet: bool,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    Demo(demo::DemoArgs),
    Init(run::InitArgs),
    Run(run::RunArgs),
    Report(report::ReportArgs),
    Paper(paper::PaperArgs),
    Masks(masks::MasksArgs),
    Colmap(colmap::ColmapArgs),
    Ingest(ingest::IngestArgs),
    Dataset(dataset::DatasetArgs),
    Normals(normals::NormalsArgs),
    Train(train::TrainArgs),
    Edit(edit::EditArgs),
    Render(render::RenderArgs),
    Bake(bake::BakeArgs),
    Eval(eval::EvalArgs),
    Export(export::ExportArgs),
    Synth(synth::SynthArgs),
    Bench(bench::BenchArgs),
    Doctor(doctor::DoctorArgs),
    Completions(shell::CompletionsArgs),
    Man(shell::ManArgs),
}

pub(crate) fn start(cli: &Cli) -> Result<ExitCode> {
    if let Some(threads) = cli.global.threads {
        rayon::ThreadPoolBuilder::new()
            .num_threads(threads.get())
            .build_global()
            .with_context(|| format!("--threads {threads}"))?;
    }
    dispatch(&cli.command, &cli.global)
}

/// Runs a command.
pub(crate) fn dispatch(command: &Command, global: &GlobalArgs) -> Result<ExitCode> {
    match command {
        Command::Demo(args) => demo::run(args, global),
        Command::Init(args) => run::init(args, global),
        Command::Run(args) => run::run(args, global),
        Command::Report(args) => report::run(args, global),
        Command::Paper(args) => paper::run(args, global),
        Command::Masks(args) => masks::run(args, global),
        Command::Train(args) => train::run(args, global),
        Command::Edit(args) => edit::run(args, global),
        Command::Render(args) => render::run(args, global),
        Command::Bake(args) => bake::run(args, global),
        Command::Eval(args) => eval::run(args, global),
        Command::Export(args) => export::run(args, global),
        Command::Colmap(args) => colmap::run(args, global),
        Command::Synth(args) => synth::run(args, global),
        Command::Ingest(args) => ingest::run(args, global),
        Command::Dataset(args) => dataset::run(args, global),
        Command::Normals(args) => normals::run(args, global),
        Command::Bench(args) => bench::run(args, global),
        Command::Doctor(args) => doctor::run(args, global),
        Command::Completions(args) => shell::completions(args),
        Command::Man(args) => shell::man(args, global),
    }
}

/// Parses the name of a [`SplitRule`].
pub(crate) fn split_rule() -> impl TypedValueParser<Value = SplitRule> {
    PossibleValuesParser::new(["every-8th", "listed", "all", "paper"])
        .try_map(|name| name.parse::<SplitRule>())
}

/// Parses the name of a [`Subset`].
pub(crate) fn subset() -> impl TypedValueParser<Value = Subset> {
    PossibleValuesParser::new(["train", "test", "all"]).try_map(|name| name.parse::<Subset>())
}

/// Parses a seed: what TOML and JSON numbers can hold.
pub(crate) fn seed() -> impl TypedValueParser<Value = u64> {
    clap::value_parser!(u64).range(..=i64::MAX as u64)
}

/// Shows a file with the program that the system has for its kind.
///
/// # Errors
/// If there is no such program.
pub(crate) fn open_file(path: &Path) -> Result<()> {
    let program = match std::env::consts::OS {
        "macos" => "open",
        "windows" => "explorer",
        _ => "xdg-open",
    };
    std::process::Command::new(program)
        .arg(path)
        .spawn()
        .map(|_| ())
        .with_context(|| format!("{program} {}", path.display()))
}

/// All files of a dataset: what no command that reads it may replace.
pub(crate) fn dataset_files(dataset: &Dataset) -> Vec<PathBuf> {
    let mut all = vec![dataset.transforms().to_owned()];
    for frame in dataset.frames() {
        let files = &frame.files;
        all.push(files.radiance.clone());
        let others = [
            &files.emission,
            &files.normal,
            &files.alpha,
            &files.depth,
            &files.albedo,
        ];
        all.extend(others.into_iter().flatten().cloned());
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn arguments_are_consistent_and_every_option_has_help() {
        let mut command = Cli::command();
        command.build();
        command.clone().debug_assert();
        let commands = command.get_subcommands();
        for sub in commands.flat_map(|sub| std::iter::once(sub).chain(sub.get_subcommands())) {
            for argument in sub.get_arguments() {
                assert!(
                    argument.get_help().is_some(),
                    "{} {}",
                    sub.get_name(),
                    argument.get_id()
                );
            }
        }
    }
}
