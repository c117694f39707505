//! Processes that decode photographs: started as they are needed, kept, and replaced if one ends.

mod message;
mod serve;

pub use serve::serve_decoding;

use super::{RawFrame, Want};
use crate::error::{IngestError, Result};
use message::{MAGIC, Request};
use std::ffi::OsString;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStderr, ChildStdin, ChildStdout, Command, ExitStatus, Stdio};
use std::sync::{Arc, Mutex, PoisonError};

/// Memory of a process that decodes: several times what the largest image of
/// [`super::MAX_PIXELS`] takes as integers, with all copies.
const MEMORY_BYTES: usize = 4 << 30;
/// Exit code of a process that took too long, that of `timeout`.
const EXIT_TIME: i32 = 124;
/// Most of what a process says on standard error that is kept.
const MAX_SAID: usize = 4096;

/// Seconds that decoding a file may take: ten times what the slowest formats need on one core that
/// others use, too.
fn time_limit_s(num_bytes: u64) -> u64 {
    20 + num_bytes / 500_000
}

/// Processes of a program that calls [`serve_decoding`].
#[derive(Debug)]
pub struct Workers {
    program: PathBuf,
    arguments: Vec<OsString>,
    /// Those that wait for a file.
    idle: Mutex<Vec<Worker>>,
}

#[derive(Debug)]
struct Worker {
    process: Child,
    input: ChildStdin,
    output: ChildStdout,
    said: Arc<Mutex<Vec<u8>>>,
    listener: Option<std::thread::JoinHandle<()>>,
}

impl Drop for Worker {
    fn drop(&mut self) {
        // Either may fail for one that has ended already.
        self.process.kill().ok();
        self.process.wait().ok();
    }
}

impl Workers {
    pub(super) fn new(program: PathBuf, arguments: Vec<OsString>) -> Self {
        Self {
            program,
            arguments,
            idle: Mutex::new(Vec::new()),
        }
    }

    /// Starts the first process.
    ///
    /// # Errors
    /// [`IngestError::Decoder`] if there is no such program, or it does not decode.
    pub(super) fn check(&self) -> Result<()> {
        let worker = self.worker()?;
        self.keep(worker);
        Ok(())
    }

    /// Decodes a file in another process.
    ///
    /// # Errors
    /// As [`super::decode`], and if the process ends, with the reason.
    pub(super) fn decode(&self, path: &Path, bytes: &[u8], want: Want) -> Result<RawFrame> {
        let extension = path.extension().unwrap_or_default().to_string_lossy();
        let request = Request {
            extension: extension.into_owned(),
            want,
            num_bytes: bytes.len() as u64,
        };
        let mut worker = self.worker()?;
        let answer = message::ask(&mut worker.input, &request, bytes)
            .and_then(|()| message::answered(&mut worker.output, want));
        match answer {
            Ok(answer) => {
                self.keep(worker);
                answer.map_err(|(field, problem)| IngestError::photograph(path, field, problem))
            }
            Err(error) => {
                let problem = worker.reason(&error, bytes.len() as u64);
                let problem = format!("damaged, or too large: {problem}");
                Err(IngestError::photograph(path, "decoding", problem))
            }
        }
    }

    /// One that waits, or a new one.
    fn worker(&self) -> Result<Worker> {
        let waiting = || {
            self.idle
                .lock()
                .unwrap_or_else(PoisonError::into_inner)
                .pop()
        };
        if let Some(worker) = waiting() {
            return Ok(worker);
        }
        let failed = |problem: String| IngestError::Decoder {
            program: self.program.clone(),
            problem,
        };
        let worker = self.start().map_err(|error| failed(error.to_string()))?;
        worker.ready().map_err(failed)
    }

    fn keep(&self, worker: Worker) {
        let mut idle = self.idle.lock().unwrap_or_else(PoisonError::into_inner);
        idle.push(worker);
    }

    fn start(&self) -> std::io::Result<Worker> {
        let mut command = Command::new(&self.program);
        command
            .args(&self.arguments)
            .env(
                "RAYON_NUM_THREADS",
                rayon::current_num_threads().to_string(),
            )
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        // Ctrl-C is for the one that asks, which ends after the stack under way.
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        #[cfg(windows)]
        std::os::windows::process::CommandExt::creation_flags(&mut command, NEW_PROCESS_GROUP);
        let mut process = command.spawn()?;
        let missing = || std::io::Error::other("no pipe to the process");
        let input = process.stdin.take().ok_or_else(missing)?;
        let output = process.stdout.take().ok_or_else(missing)?;
        let errors = process.stderr.take().ok_or_else(missing)?;
        let said = Arc::new(Mutex::new(Vec::new()));
        let heard = Arc::clone(&said);
        let listener = std::thread::Builder::new().spawn(move || listen(errors, &heard))?;
        Ok(Worker {
            process,
            input,
            output,
            said,
            listener: Some(listener),
        })
    }
}

/// `CREATE_NEW_PROCESS_GROUP` of the Windows API.
#[cfg(windows)]
const NEW_PROCESS_GROUP: u32 = 0x0000_0200;

/// Keeps the end of what a process says, so that it never waits to be heard.
fn listen(mut errors: ChildStderr, said: &Mutex<Vec<u8>>) {
    let mut part = [0; 1024];
    while let Ok(length @ 1..) = errors.read(&mut part) {
        let mut said = said.lock().unwrap_or_else(PoisonError::into_inner);
        said.extend_from_slice(&part[..length]);
        let excess = said.len().saturating_sub(MAX_SAID);
        said.drain(..excess);
    }
}

impl Worker {
    /// Waits until it has started.
    fn ready(mut self) -> std::result::Result<Self, String> {
        let mut magic = [0; MAGIC.len()];
        match self.output.read_exact(&mut magic) {
            Ok(()) if magic == *MAGIC => Ok(self),
            Ok(()) => Err("is no decoder of photographs".to_owned()),
            Err(error) => Err(self.reason(&error, 0)),
        }
    }

    /// The reason why it has not answered for a file of `num_bytes`; ends it.
    fn reason(&mut self, error: &std::io::Error, num_bytes: u64) -> String {
        if error.kind() == std::io::ErrorKind::InvalidData {
            return format!("the decoder's answer makes no sense, {error}");
        }
        // A process that ended closed its pipes: there is nothing to wait for.
        let status = match self.process.wait() {
            Ok(status) => status,
            Err(error) => return error.to_string(),
        };
        if let Some(listener) = self.listener.take() {
            // A listener that panicked has heard nothing.
            listener.join().ok();
        }
        let said = self.said.lock().unwrap_or_else(PoisonError::into_inner);
        describe(status, &String::from_utf8_lossy(&said), num_bytes)
    }
}

/// The way in which a process ended, for people.
fn describe(status: ExitStatus, said: &str, num_bytes: u64) -> String {
    if status.code() == Some(EXIT_TIME) {
        let limit = time_limit_s(num_bytes);
        return format!("decoding it did not end within {limit} s");
    }
    // The standard library's words for an allocation that failed.
    let wanted = said
        .lines()
        .find_map(|line| {
            line.strip_prefix("memory allocation of ")?
                .split(' ')
                .next()
        })
        .and_then(|bytes| bytes.parse::<u128>().ok());
    let gib = |bytes: u128| format!("{:.1} GiB", bytes as f64 / f64::from(1 << 30));
    let limit = MEMORY_BYTES as u128;
    match wanted {
        Some(wanted) if wanted > limit => {
            let (wanted, limit) = (gib(wanted), gib(limit));
            format!("decoding it takes {wanted} of memory at once, {limit} are the limit")
        }
        Some(_) => format!("decoding it takes more than {} of memory", gib(limit)),
        None if said.contains("overflowed its stack") => {
            "decoding it takes more than the stack".to_owned()
        }
        None => format!("the decoder ended with {status}"),
    }
}
