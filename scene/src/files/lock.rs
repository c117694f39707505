//! A folder that one process works in at a time.

use super::create_dir;
use crate::error::{Result, SceneError};
use std::fs::{File, TryLockError};
use std::path::Path;
use std::time::{Duration, Instant};

/// File that the lock is on.
const LOCK_FILE: &str = ".lock";
/// Pause between attempts.
const PAUSE: Duration = Duration::from_millis(100);

/// A folder that others are kept out of as long as this lives.
#[derive(Debug)]
pub struct FolderLock {
    _file: File,
}

impl FolderLock {
    /// Creates `dir` where it is missing and locks it, after waiting for others up to `patience`.
    ///
    /// # Errors
    /// [`SceneError::Work`] if another process still has it; [`SceneError::Io`] if it cannot be
    /// created or locked.
    pub fn acquire(dir: &Path, patience: Duration) -> Result<Self> {
        create_dir(dir)?;
        let path = dir.join(LOCK_FILE);
        let file = File::options()
            .create(true)
            .truncate(false)
            .write(true)
            .open(&path)
            .map_err(|e| SceneError::io(&path, "open", e))?;
        let asked = Instant::now();
        loop {
            match file.try_lock() {
                Ok(()) => return Ok(Self { _file: file }),
                Err(TryLockError::WouldBlock) if asked.elapsed() < patience => {
                    std::thread::sleep(PAUSE);
                }
                Err(TryLockError::WouldBlock) => {
                    return Err(SceneError::Work {
                        path: dir.to_owned(),
                        problem: "another run is at work in this folder".to_owned(),
                    });
                }
                Err(TryLockError::Error(error)) => {
                    return Err(SceneError::io(&path, "lock", error));
                }
            }
        }
    }
}
