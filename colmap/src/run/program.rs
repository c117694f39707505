//! The program `colmap`: its options, and running it.

use super::log::{self, ColmapStep};
use super::{Done, RunProgress};
use crate::error::{ColmapError, Result};
use eagpt_scene::SceneError;
use std::collections::HashSet;
use std::fs::{File, OpenOptions};
use std::io::{self, BufRead, BufReader, Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::mpsc;

/// An installed COLMAP.
pub(super) struct Program {
    path: PathBuf,
    pub(super) version: String,
}

/// A call under construction.
pub(super) struct Call {
    /// Names of the options that the command takes.
    known: HashSet<String>,
    pub(super) arguments: Vec<String>,
}

impl Program {
    /// # Errors
    /// If the program cannot be started, with how to install it, or does not say its version.
    pub(super) fn find(path: &Path) -> Result<Self> {
        let mut program = Self {
            path: path.to_owned(),
            version: String::new(),
        };
        let text = program.output(&["help"])?;
        let line = text
            .lines()
            .find(|line| line.trim_start().starts_with("COLMAP"));
        program.version = line
            .map(|line| line.split(" -- ").next().unwrap_or(line).trim().to_owned())
            .ok_or_else(|| {
                ColmapError::Program(format!("`{} help` names no COLMAP", path.display()))
            })?;
        Ok(program)
    }

    fn command(&self) -> Command {
        let mut command = Command::new(&self.path);
        command.stdin(Stdio::null());
        // COLMAP's widgets ask for a display even where nothing is shown.
        command.env("QT_QPA_PLATFORM", "offscreen");
        command
    }

    fn cannot_start(&self, error: &io::Error) -> ColmapError {
        let path = self.path.display();
        ColmapError::Program(match error.kind() {
            io::ErrorKind::NotFound => format!(
                "there is no program `{path}`: `apt-get install colmap` (Debian, Ubuntu) or `brew install colmap` installs it, \
                 --colmap names one that is elsewhere"
            ),
            _ => format!("`{path}` cannot be started: {error}"),
        })
    }

    /// Output of a short call.
    fn output(&self, arguments: &[&str]) -> Result<String> {
        let output = self
            .command()
            .args(arguments)
            .output()
            .map_err(|error| self.cannot_start(&error))?;
        let both = [output.stdout, output.stderr].concat();
        Ok(String::from_utf8_lossy(&both).into_owned())
    }

    /// Begins a call of a command.
    ///
    /// # Errors
    /// If the command's help cannot be had.
    pub(super) fn call(&self, command: &str) -> Result<Call> {
        let help = self.output(&[command, "--help"])?;
        let options = help
            .split_whitespace()
            .filter_map(|word| word.strip_prefix("--"));
        Ok(Call {
            known: options.map(str::to_owned).collect(),
            arguments: vec![command.to_owned()],
        })
    }

    /// Runs a call to its end. Its lines go to the log and to `progress`.
    ///
    /// # Errors
    /// If it fails, with the end of its output.
    pub(super) fn run(
        &self,
        step: ColmapStep,
        arguments: &[String],
        log_path: &Path,
        progress: &mut dyn FnMut(RunProgress),
    ) -> Result<()> {
        let io = |error| SceneError::io(log_path, "write", error);
        let mut options = OpenOptions::new();
        let mut log: File = options
            .create(true)
            .append(true)
            .open(log_path)
            .map_err(io)?;
        writeln!(log, "$ {} {}", self.path.display(), arguments.join(" ")).map_err(io)?;
        let mut child = self
            .command()
            .args(arguments)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .map_err(|error| self.cannot_start(&error))?;
        let (sender, lines) = mpsc::channel();
        let pipes: [Option<Box<dyn Read + Send>>; 2] = [
            child
                .stdout
                .take()
                .map(|pipe| Box::new(pipe) as Box<dyn Read + Send>),
            child
                .stderr
                .take()
                .map(|pipe| Box::new(pipe) as Box<dyn Read + Send>),
        ];
        let mut last = Vec::new();
        let written = std::thread::scope(|scope| {
            for pipe in pipes.into_iter().flatten() {
                let sender = sender.clone();
                scope.spawn(move || send_lines(pipe, &sender));
            }
            drop(sender);
            let mut written = Ok(());
            // Lines are read to the end even after an error: a full pipe would block the program.
            for text in lines {
                if written.is_ok() {
                    written = writeln!(log, "{text}");
                }
                if !text.trim().is_empty() {
                    last.push(text.trim().to_owned());
                    last.drain(..last.len().saturating_sub(3));
                }
                let done = step
                    .done(&text)
                    .or_else(|| log::num_registered(&text).map(|done| Done { done, total: 0 }));
                progress(RunProgress::Line {
                    step: step.name(),
                    text,
                    done,
                });
            }
            written
        });
        let status = child
            .wait()
            .map_err(|error| ColmapError::Program(format!("{}: {error}", self.path.display())))?;
        written.map_err(io)?;
        if status.success() {
            return Ok(());
        }
        Err(ColmapError::Program(format!(
            "{} ended with {status}: {}; all it said is in {}",
            arguments.first().map_or("", String::as_str),
            last.join(" / "),
            log_path.display()
        )))
    }
}

fn send_lines(pipe: impl Read, sender: &mpsc::Sender<String>) {
    let mut reader = BufReader::new(pipe);
    let mut line = Vec::new();
    loop {
        line.clear();
        match reader.read_until(b'\n', &mut line) {
            // A broken pipe counts as ended.
            Ok(0) | Err(_) => return,
            Ok(_) => {}
        }
        let text = String::from_utf8_lossy(&line).trim_end().to_owned();
        if sender.send(text).is_err() {
            return;
        }
    }
}

impl Call {
    /// Adds an option under the first of its names that the command accepts.
    ///
    /// # Errors
    /// If it accepts none of them.
    pub(super) fn required(&mut self, names: &[&str], value: &str) -> Result<()> {
        if self.optional(names, value) {
            return Ok(());
        }
        Err(ColmapError::Program(format!(
            "its command {} has no option {}: this version is not supported",
            self.arguments[0],
            names.join(" or ")
        )))
    }

    /// As [`Self::required`] for optional settings; returns whether it was added.
    pub(super) fn optional(&mut self, names: &[&str], value: &str) -> bool {
        let Some(name) = names.iter().find(|name| self.known.contains(**name)) else {
            return false;
        };
        self.arguments
            .extend([format!("--{name}"), value.to_owned()]);
        true
    }

    pub(super) fn flag(&mut self, names: &[&str], value: bool) {
        self.optional(names, if value { "1" } else { "0" });
    }

    /// # Errors
    /// As [`Self::required`], or for a path that is not UTF-8.
    pub(super) fn path(&mut self, names: &[&str], path: &Path) -> Result<()> {
        let text = path
            .to_str()
            .ok_or_else(|| ColmapError::invalid(path, "a path that COLMAP cannot be told"))?;
        self.required(names, text)
    }
}
