//! The program `eagpt`: parses arguments, shows progress, sets exit codes. The work itself is done
//! by the libraries.
//!
//! - [`cli`]: the commands and the options they share; each command's own options are in its
//!   module.
//! - [`synth`], [`ingest`], [`mod@colmap`], [`dataset`], [`mod@masks`], [`normals`], [`train`],
//!   [`edit`], [`render`], [`bake`], [`mod@eval`], [`export`]: the commands.
//! - [`mod@demo`]: a simulated capture, and all that follows.
//! - [`mod@run`]: all of them, one after the other; [`mod@report`]: what came of it, on one page.
//! - [`mod@bench`]: how fast each stage is.
//! - [`command_line`]: typed options printed as a command.
//! - [`device`]: what computes, CPU or GPU.
//! - [`progress`]: bars, plain lines or JSON.
//! - [`record`]: what is written beside every result.
//! - [`output`]: folders and files that results go to.
//! - [`interrupt`]: what Ctrl-C does.

#![allow(
    rustdoc::invalid_html_tags,
    reason = "comments of options are their help, which names files as <view>.exr"
)]

mod bake;
mod bench;
mod cli;
mod colmap;
mod command_line;
mod dataset;
mod demo;
mod device;
mod doctor;
mod edit;
mod eval;
mod export;
mod ingest;
mod interrupt;
mod masks;
mod normals;
mod output;
mod paper;
mod parts;
mod progress;
mod record;
mod render;
mod report;
mod run;
mod shell;
mod synth;
mod terminal;
mod train;

use clap::Parser;
use std::process::ExitCode;

fn main() -> ExitCode {
    let cli = cli::Cli::parse();
    terminal::init(&cli.global);
    match cli::start(&cli) {
        Ok(code) => code,
        Err(error) => {
            terminal::line(&format!("error: {}", terminal::one_line(&error)));
            ExitCode::FAILURE
        }
    }
}
