//! The error of this crate.

use eagpt_render::RenderError;
use eagpt_report::ReportError;
use eagpt_scene::SceneError;
use eagpt_trace::TraceError;
use eagpt_train::TrainError;
use std::io;
use std::net::SocketAddr;

/// Result with [`ViewerError`].
pub type Result<T, E = ViewerError> = std::result::Result<T, E>;

/// Why there is no page. Every variant prints as one line.
#[derive(Debug, thiserror::Error)]
pub enum ViewerError {
    /// A file could not be read or written.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// A photograph could not be embedded.
    #[error(transparent)]
    Photograph(#[from] ReportError),
    /// The scene cannot be packed.
    #[error("scene: {0}")]
    Unfit(String),
    /// Packed bytes are not those of a scene.
    #[error("packed scene: {0}")]
    Packed(String),
    /// An act that cannot be a step of an edit script.
    #[error("edit: {0}")]
    Script(String),
    /// The server could not be started.
    #[error("{address}: {error}")]
    Address {
        /// Where it was to listen.
        address: SocketAddr,
        /// Why it does not.
        error: io::Error,
    },
    /// The system has no random numbers for a token.
    #[error("token: {0}")]
    Token(String),
    /// A picture that cannot be made.
    #[error("still: {0}")]
    Still(String),
    /// The light could not be baked.
    #[error(transparent)]
    Bake(#[from] TrainError),
    /// A picture could not be rendered.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// The device failed.
    #[error(transparent)]
    Trace(#[from] TraceError),
    /// There is no folder for temporary files.
    #[error("temporary files: {0}")]
    Temporary(#[from] io::Error),
    /// Content that is no JSON.
    #[error("page: {0}")]
    Json(#[from] serde_json::Error),
}
