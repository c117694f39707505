//! The error of this crate.

use std::path::PathBuf;

/// Result with [`DenoiseError`].
pub type Result<T, E = DenoiseError> = std::result::Result<T, E>;

/// Why an image could not be denoised. Every variant prints as one line.
#[derive(Debug, thiserror::Error)]
pub enum DenoiseError {
    /// Open Image Denoise was asked for and is nowhere.
    #[error("Open Image Denoise 2 is not installed where it was looked for: {}", looked.join(", "))]
    NotFound {
        /// Every place, with what was wrong there.
        looked: Vec<String>,
    },
    /// A library is there but cannot be used.
    #[error("{}: {problem}", path.display())]
    Unusable {
        /// The library, or the folder it was looked for in.
        path: PathBuf,
        /// What is wrong.
        problem: String,
    },
    /// Open Image Denoise gave up.
    #[error("Open Image Denoise: {problem}")]
    Failed {
        /// What it said.
        problem: String,
    },
    /// Images of a frame that differ in size.
    #[error("{image}: {}x{} pixels instead of {}x{}", found.0, found.1, wanted.0, wanted.1)]
    Size {
        /// Which image.
        image: &'static str,
        /// Its width and height.
        found: (u32, u32),
        /// Width and height of the others.
        wanted: (u32, u32),
    },
}
