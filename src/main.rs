//! The program `eagpt`: parses arguments, shows progress, sets exit codes. The work itself is done
//! by the libraries.
//!
//! - [`cli`]: the program and its commands; each command's options are in its module.
//! - [`command`]: the commands that do one job each: [`synth`], [`ingest`], [`mod@colmap`],
//!   [`dataset`], [`mod@masks`], [`normals`], [`train`], [`mod@lamps`], [`edit`],
//!   [`render`], [`bake`], [`mod@eval`], [`export`], [`view`], [`mod@import`], [`mod@report`].
//! - [`mod@run`]: a chain of them, described by a project file. [`mod@demo`] runs it on a simulated
//!   capture, [`paper`] on the scenes of the paper.
//! - [`mod@bench`]: measures the speed of each stage.
//! - [`decode`]: a process that decodes photographs for another, as damaged files may end it.
//! - [`doctor`]: devices and libraries that the program finds.
//! - [`args`]: arguments that commands share.
//! - [`command_line`]: typed options printed as a command.
//! - [`device`]: the compute device, CPU or GPU.
//! - [`page`]: a scene as a page for a browser.
//! - [`progress`]: bars, lines or JSON.
//! - [`record`]: the record.json beside every result.
//! - [`output`]: folders and files for results.
//! - [`interrupt`]: stops a command at Ctrl-C.

#![allow(
    rustdoc::invalid_html_tags,
    reason = "comments of options are their help, which names files as <view>.exr"
)]

mod args;
mod bake;
mod bench;
mod cli;
mod colmap;
mod command;
mod command_line;
mod dataset;
mod decode;
mod demo;
mod device;
mod doctor;
mod edit;
mod eval;
mod export;
mod failpoint;
mod import;
mod ingest;
mod interrupt;
mod lamps;
mod masks;
mod normals;
mod output;
mod page;
mod paper;
mod progress;
mod record;
mod render;
mod report;
mod run;
mod shell;
mod source;
mod synth;
mod terminal;
mod train;
mod view;

use clap::Parser;
use eagpt_ingest::LimitedAllocator;
use std::process::ExitCode;

/// Limits the processes of [`decode`]; others pay for the reading of a number.
#[global_allocator]
static ALLOCATOR: LimitedAllocator = LimitedAllocator;

fn main() -> ExitCode {
    let mut cli = cli::Cli::parse();
    let arguments = std::env::args_os().skip(1);
    cli.global.command_line = arguments
        .map(|of| of.to_string_lossy().into_owned())
        .collect();
    terminal::init(&cli.global);
    match cli.run() {
        Ok(code) => code,
        Err(error) => {
            terminal::line(&format!("error: {}", terminal::one_line(&error)));
            ExitCode::FAILURE
        }
    }
}
