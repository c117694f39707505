//! The program: its commands, and how one is run.

use crate::args::GlobalArgs;
use crate::command::JobCommand;
use crate::{bench, decode, demo, doctor, paper, run, shell};
use anyhow::{Context, Result};
use clap::{CommandFactory, Parser, Subcommand};
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
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Demo(demo::DemoArgs),
    Init(run::InitArgs),
    Run(run::RunArgs),
    Paper(paper::PaperArgs),
    #[command(flatten)]
    Job(JobCommand),
    Bench(bench::BenchArgs),
    Doctor(doctor::DoctorArgs),
    Completions(shell::CompletionsArgs),
    Man(shell::ManArgs),
    #[command(name = decode::NAME, hide = true)]
    Decode,
}

impl Cli {
    /// Runs the command.
    ///
    /// # Errors
    /// The command's.
    pub(crate) fn run(&self) -> Result<ExitCode> {
        let global = &self.global;
        if let Some(threads) = global.threads {
            rayon::ThreadPoolBuilder::new()
                .num_threads(threads.get())
                .build_global()
                .with_context(|| format!("--threads {threads}"))?;
        }
        match &self.command {
            Command::Demo(args) => demo::run(args, global),
            Command::Init(args) => run::init(args, global),
            Command::Run(args) => run::run(args, global),
            Command::Paper(args) => paper::run(args, global),
            Command::Job(job) => job.run(global),
            Command::Bench(args) => bench::run(args, global),
            Command::Doctor(args) => doctor::run(args, global),
            Command::Completions(args) => shell::completions(args, Self::command()),
            Command::Man(args) => shell::man(args, Self::command(), global),
            Command::Decode => decode::run(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
