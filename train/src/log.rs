//! The loss curve: one JSON object a line.

use crate::error::Result;
use crate::loss::LossTerms;
use crate::options::Stage;
use eagpt_scene::{SceneError, files};
use serde::{Deserialize, Serialize};
use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};

/// A line of the log.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct LogLine {
    /// Stage.
    pub stage: Stage,
    /// Iteration, counted from 1.
    pub iteration: u32,
    /// Name of the training view.
    pub view: String,
    /// Smoothed total loss.
    pub smoothed: f64,
    /// The view's loss.
    #[serde(flatten)]
    pub terms: LossTerms,
    /// Seconds since the run (or its resumption) began.
    pub seconds: f64,
}

/// An open log.
pub(crate) struct Log {
    path: PathBuf,
    file: File,
}

impl Log {
    /// Opens `path` for a run that has done `iteration` iterations of `stage`: lines of later
    /// iterations, left by a run that was killed, go; `None` starts an empty log.
    ///
    /// # Errors
    /// If the file cannot be read or written.
    pub(crate) fn open(path: &Path, done: Option<(Stage, u32)>) -> Result<Self> {
        let mut kept = String::new();
        if let (Some((stage, iteration)), true) = (done, path.exists()) {
            let text = String::from_utf8_lossy(&files::read(path)?).into_owned();
            for line in text.lines() {
                // A line that does not parse was being written when the run was killed.
                let Ok(entry) = serde_json::from_str::<LogLine>(line) else {
                    continue;
                };
                let earlier = (entry.stage == Stage::Radiance && stage == Stage::Albedo)
                    || (entry.stage == stage && entry.iteration <= iteration);
                if earlier {
                    kept.push_str(line);
                    kept.push('\n');
                }
            }
        }
        files::write_bytes_atomic(path, kept.as_bytes())?;
        let file = OpenOptions::new()
            .append(true)
            .open(path)
            .map_err(|e| SceneError::io(path, "write", e))?;
        Ok(Self {
            path: path.to_owned(),
            file,
        })
    }

    /// Appends a line.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub(crate) fn push(&mut self, line: &LogLine) -> Result<()> {
        let mut text = serde_json::to_string(line)
            .map_err(|e| SceneError::invalid(&self.path, "line", e.to_string()))?;
        text.push('\n');
        self.file
            .write_all(text.as_bytes())
            .map_err(|e| SceneError::io(&self.path, "write", e))?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(stage: Stage, iteration: u32) -> LogLine {
        LogLine {
            stage,
            iteration,
            view: "v".into(),
            smoothed: 0.5,
            terms: LossTerms::default(),
            seconds: 1.0,
        }
    }

    #[test]
    fn resuming_drops_what_came_after_the_checkpoint() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("log.jsonl");
        let mut log = Log::open(&path, None).unwrap();
        for iteration in 1..=4 {
            log.push(&line(Stage::Radiance, iteration)).unwrap();
        }
        std::fs::OpenOptions::new()
            .append(true)
            .open(&path)
            .unwrap()
            .write_all(b"{\"half")
            .unwrap();
        Log::open(&path, Some((Stage::Radiance, 2)))
            .unwrap()
            .push(&line(Stage::Radiance, 3))
            .unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        let iterations: Vec<u32> = text
            .lines()
            .map(|l| serde_json::from_str::<LogLine>(l).unwrap().iteration)
            .collect();
        assert_eq!(iterations, [1, 2, 3]);
    }
}
