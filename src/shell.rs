//! Completions for shells and man pages, generated from the same description as `--help`.

use crate::args::GlobalArgs;
use crate::output;
use crate::progress::Reporter;
use crate::terminal;
use anyhow::{Result, bail};
use clap::{Args, Command};
use clap_complete::Shell;
use clap_mangen::Man;
use eagpt_scene::files;
use std::path::PathBuf;
use std::process::ExitCode;

/// Print the completions of a shell
///
/// They complete commands, options and the values that options take.
#[derive(Debug, Args)]
#[command(
    after_long_help = "Examples:\n  eagpt completions bash > ~/.local/share/bash-completion/completions/eagpt\n  eagpt completions zsh > \"${fpath[1]}/_eagpt\"\n  eagpt completions fish > ~/.config/fish/completions/eagpt.fish"
)]
pub(crate) struct CompletionsArgs {
    /// Shell to write for
    #[arg(value_name = "SHELL", value_enum)]
    shell: Shell,
}

/// Write man pages, one for each command
#[derive(Debug, Args)]
#[command(after_long_help = "Example:\n  eagpt man ~/.local/share/man/man1 && man eagpt-train")]
pub(crate) struct ManArgs {
    /// Folder to write to; created
    #[arg(value_name = "DIR")]
    dir: PathBuf,
    /// Replace pages that are there
    #[arg(long)]
    force: bool,
}

pub(crate) fn completions(args: &CompletionsArgs, mut program: Command) -> Result<ExitCode> {
    let mut text = Vec::new();
    clap_complete::generate(args.shell, &mut program, "eagpt", &mut text);
    terminal::print(&String::from_utf8_lossy(&text))?;
    Ok(ExitCode::SUCCESS)
}

pub(crate) fn man(args: &ManArgs, mut program: Command, global: &GlobalArgs) -> Result<ExitCode> {
    program.build();
    let mut pages = Vec::new();
    collect(&program, &mut pages)?;
    let paths: Vec<PathBuf> = pages
        .iter()
        .map(|(name, _)| args.dir.join(format!("{name}.1")))
        .collect();
    if let Some(there) = paths.iter().find(|path| path.exists() && !args.force) {
        bail!("{}: is there already: --force replaces it", there.display());
    }
    output::create_parent(&args.dir.join("page"))?;
    for (path, (_, page)) in paths.iter().zip(&pages) {
        files::write_bytes_atomic(path, page)?;
    }
    let (reporter, num) = (Reporter::new(global), pages.len());
    reporter.note(&format!("{}: {num} pages", args.dir.display()));
    reporter
        .message(&serde_json::json!({ "message": "done", "path": args.dir, "num_pages": num }))?;
    Ok(ExitCode::SUCCESS)
}

/// The pages of a command and of those below it, by their names, as `eagpt-train`.
fn collect(command: &Command, pages: &mut Vec<(String, Vec<u8>)>) -> Result<()> {
    for below in command.get_subcommands() {
        if below.get_name() != "help" && !below.is_hide_set() {
            collect(below, pages)?;
        }
    }
    let name = command.get_display_name().unwrap_or(command.get_name());
    let mut page = Vec::new();
    Man::new(command.clone()).render(&mut page)?;
    pages.push((name.to_owned(), page));
    Ok(())
}
