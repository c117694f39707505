//! Output to the terminal that does not break a progress bar.

use crate::args::GlobalArgs;
use anyhow::{Context, Result};
use indicatif::MultiProgress;
use std::io::{self, ErrorKind, Write};
use std::sync::LazyLock;
use tracing_subscriber::EnvFilter;

/// All bars of the program. Whatever else goes to standard error goes through
/// [`MultiProgress::suspend`].
pub(crate) static BARS: LazyLock<MultiProgress> = LazyLock::new(MultiProgress::new);

/// Sets up what the libraries log.
pub(crate) fn init(global: &GlobalArgs) {
    let level = match (global.quiet, global.verbose) {
        (true, _) => "error",
        (false, 0) => "warn",
        (false, 1) => "info",
        (false, _) => "debug",
    };
    let filter = EnvFilter::try_from_env("EAGPT_LOG").unwrap_or_else(|_| EnvFilter::new(level));
    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(|| BesideBars)
        .with_ansi(console_colors())
        .with_target(false)
        .without_time()
        .init();
}

/// Returns whether standard error shows colours: it is a terminal, and NO_COLOR is not set.
fn console_colors() -> bool {
    let wanted = std::env::var_os("NO_COLOR").is_none_or(|value| value.is_empty());
    wanted && io::IsTerminal::is_terminal(&io::stderr())
}

/// Writes a line to standard error.
pub(crate) fn line(text: &str) {
    let written = BARS.suspend(|| writeln!(io::stderr(), "{text}"));
    if written.is_err() {
        // Standard error is closed: there is nowhere left to say so, and the job continues.
    }
}

/// Writes text to standard output, where results asked for go. A reader that has seen enough is no
/// error.
///
/// # Errors
/// If standard output cannot be written, as when the disk is full.
pub(crate) fn print(text: &str) -> Result<()> {
    let written = BARS.suspend(|| {
        let mut out = io::stdout().lock();
        out.write_all(text.as_bytes())?;
        out.flush()
    });
    match written {
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(()),
        other => other.context("standard output"),
    }
}

/// An error with its causes on one line, without repeating a cause that the message already tells.
pub(crate) fn one_line(error: &anyhow::Error) -> String {
    let mut text = String::new();
    for cause in error.chain() {
        let cause = cause.to_string();
        if text.is_empty() {
            text = cause;
        } else if !text.contains(&cause) {
            text = format!("{text}: {cause}");
        }
    }
    let words: Vec<&str> = text.split(['\n', '\r']).map(str::trim).collect();
    let joined = words
        .into_iter()
        .filter(|part| !part.is_empty())
        .collect::<Vec<_>>()
        .join(" ");
    joined
        .chars()
        .map(|c| if c.is_control() { '?' } else { c })
        .collect()
}

/// Lines of cells in columns, as many in each: the first `num_left` aligned to the left, others to
/// the right.
pub(crate) fn columns(lines: &[Vec<String>], num_left: usize) -> String {
    let num_columns = lines.first().map_or(0, Vec::len);
    let width = |column: usize| lines.iter().map(move |line| line[column].chars().count());
    let widths: Vec<usize> = (0..num_columns)
        .map(|column| width(column).max().unwrap_or(0))
        .collect();
    let mut text = String::new();
    for line in lines {
        let cells = line.iter().zip(&widths).enumerate();
        let cells = cells.map(|(column, (cell, &width))| match column < num_left {
            true => format!("{cell:<width$}"),
            false => format!("{cell:>width$}"),
        });
        text.push_str(cells.collect::<Vec<_>>().join("  ").trim_end());
        text.push('\n');
    }
    text
}

struct BesideBars;

impl Write for BesideBars {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        BARS.suspend(|| io::stderr().write(bytes))
    }

    fn flush(&mut self) -> io::Result<()> {
        io::stderr().flush()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use eagpt_scene::SceneError;
    use std::path::Path;

    #[test]
    fn columns_line_up() {
        let line = |cells: [&str; 3]| cells.map(str::to_owned).to_vec();
        let text = columns(&[line(["a", "what", "n"]), line(["abc", "w", "10"])], 2);
        assert_eq!(text, "a    what   n\nabc  w     10\n");
    }

    #[test]
    fn errors_are_one_line_and_repeat_nothing() {
        let source = io::Error::other("disk\nfull");
        let error = SceneError::io(Path::new("a\tb.exr"), "write", source);
        assert_eq!(one_line(&error.into()), "a?b.exr: write: disk full");
        let chained = anyhow::anyhow!("inner").context("outer");
        assert_eq!(one_line(&chained), "outer: inner");
    }
}
