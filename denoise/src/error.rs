//! The error of this crate.

use std::path::PathBuf;

/// Result with [`DenoiseError`].
pub type Result<T, E = DenoiseError> = std::result::Result<T, E>;

/// Why an image could not be denoised. Every variant prints as one line.
#[derive(Debug, thiserror::Error)]
pub enum DenoiseError {
    /// Open Image Denoise was requested and not found.
    #[error("Open Image Denoise 2 was not found in: {}", looked.join(", "))]
    NotFound {
        /// Every place searched, with the problem there.
        looked: Vec<String>,
    },
    /// A library was found but cannot be used.
    #[error("{}: {problem}", path.display())]
    Unusable {
        /// The library, or the folder searched.
        path: PathBuf,
        /// The problem.
        problem: String,
    },
    /// Open Image Denoise failed.
    #[error("Open Image Denoise: {problem}")]
    Failed {
        /// The library's message.
        problem: String,
    },
    /// Images of a frame differ in size.
    #[error("{image}: {}x{} pixels instead of {}x{}", found.0, found.1, expected.0, expected.1)]
    Size {
        /// Which image.
        image: &'static str,
        /// Its width and height.
        found: (u32, u32),
        /// Width and height of the others.
        expected: (u32, u32),
    },
}
