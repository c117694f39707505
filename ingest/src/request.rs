//! Request, progress and result of the job.

use crate::capture::Capture;
use crate::error::{IngestError, Result};
use crate::options::IngestOptions;
use crate::problem::Problem;
use crate::raw::Decoding;
use eagpt_scene::Shard;
use serde::Serialize;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// A capture to ingest, and the folder for its results.
#[derive(Debug, Clone)]
pub struct IngestRequest {
    /// Folder with the photographs.
    pub capture: PathBuf,
    /// Folder for the results.
    pub out: PathBuf,
    /// Options that decide the result.
    pub options: IngestOptions,
    /// Makes the results of an earlier run anew; otherwise those that fit are kept, and others are
    /// an error.
    pub start_over: bool,
    /// The stacks to merge. Every part surveys all stacks, its own first, and takes what others
    /// have surveyed by then.
    pub shard: Shard,
    /// Processes in which photographs are decoded.
    pub decoding: Decoding,
    /// Set to end after the stack under way.
    pub stop: Arc<AtomicBool>,
}

impl IngestRequest {
    /// An error if the job was asked to end.
    pub(crate) fn check_stop(&self, done: usize, total: usize) -> Result<()> {
        if self.stop.load(Ordering::Relaxed) {
            return Err(IngestError::Stopped { done, total });
        }
        Ok(())
    }
}

/// Progress of the job.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "message", rename_all = "kebab-case")]
pub enum IngestProgress {
    /// Headers are read and files digested.
    Reading {
        /// Files done.
        done: usize,
        /// All files.
        total: usize,
    },
    /// Stacks are decoded and surveyed.
    Surveying {
        /// Stacks done.
        done: usize,
        /// All stacks.
        total: usize,
    },
    /// Stacks are merged and written.
    Merging {
        /// Stacks done.
        done: usize,
        /// All stacks.
        total: usize,
        /// The stack that was done last.
        stack: String,
    },
    /// Something is wrong with the capture.
    Problem(Problem),
    /// Something to know.
    Note {
        /// One line.
        text: String,
    },
    /// Something to check.
    Warning {
        /// One line.
        text: String,
    },
}

/// Result of the job.
#[derive(Debug, Clone, PartialEq)]
pub struct IngestSummary {
    /// Everything that was decided and measured.
    pub capture: Capture,
    /// All files of the result, relative to the output.
    pub outputs: Vec<PathBuf>,
    /// Files that the result depends on, with their BLAKE3 digests.
    pub inputs: Vec<(PathBuf, String)>,
    /// Stacks that an earlier run had made already.
    pub num_kept: usize,
}

pub(crate) type Tell<'a> = &'a mut dyn FnMut(IngestProgress);
